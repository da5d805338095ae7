"""`ramphold export --parquet`, read by polars."""

import csv

import numpy
import polars
from conftest import done, ramphold
from test_bids import records


def test_a_row_a_sample_holds_every_sample_of_every_session(session, measured, tmp_path):
    done("export", session, measured, "--parquet", tmp_path / "samples.parquet")
    table = polars.read_parquet(tmp_path / "samples.parquet")
    assert set(table["session"].unique()) == {"first", "second"} and set(table["subject"]) == {"S01"}
    count = 0
    for folder in (session, measured):
        for row, record in records(folder):
            own = table.filter((polars.col("session") == folder.name) & (polars.col("trial") == int(row["trial"])))
            count += len(own)
            for name in ("theta_m_rad", "torque_l_nm"):
                assert numpy.array_equal(own[name].to_numpy(), record[name])
            assert numpy.allclose(own["t_s"].to_numpy(), record["t_s"], rtol=0, atol=1e-12)
            if row["onset_s"]:
                onset = own.filter(polars.col("t_from_onset_s").abs() < 1e-9)
                assert len(onset) == 1 and abs(onset["t_s"][0] - float(row["onset_s"])) < 1e-9
            assert own["emg_fcr_mvc"].null_count() == (0 if "emg_fcr_mvc" in record else len(own))
    assert count == len(table)


def test_a_row_a_trial_holds_its_fit(session, measured, tmp_path):
    done("export", session, measured, "--parquet", tmp_path / "trials.parquet", "--trials")
    table = polars.read_parquet(tmp_path / "trials.parquet")
    fit = {row["trial"]: row for row in csv.DictReader((session / "results/fit.csv").open())}
    assert len(fit) >= 8
    for row in table.filter(polars.col("session") == "first").iter_rows(named=True):
        if row["status"] == "ok":
            assert row["k_srs_nm_per_rad"] == float(fit[str(row["trial"])]["k_srs_nm_per_rad"])
            assert row["rest_s"] is not None
    assert table.filter(polars.col("session") == "second")["k_srs_nm_per_rad"].null_count() == len(
        table.filter(polars.col("session") == "second")
    )


def test_a_file_that_is_there_is_not_overwritten(session, tmp_path):
    (tmp_path / "mine.parquet").write_text("mine")
    result = ramphold("export", session, "--parquet", tmp_path / "mine.parquet")
    assert result.returncode == 2 and "exists already" in result.stderr
    assert (tmp_path / "mine.parquet").read_text() == "mine"


def test_a_fit_that_is_no_table_is_said(session, tmp_path):
    import shutil

    shutil.copytree(session, tmp_path / "session")
    (tmp_path / "session/results/fit.csv").write_text("trial,x\none,2\n")
    result = ramphold("export", tmp_path / "session", "--parquet", tmp_path / "t.parquet", "--trials")
    assert result.returncode == 2 and "fit.csv" in result.stderr and "ramphold fit" in result.stderr
    assert not (tmp_path / "t.parquet").exists()
