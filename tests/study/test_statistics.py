"""The tables of a study against statsmodels, pingouin and scipy, on balanced made-up data and on published ones."""

import warnings

import numpy as np
import pandas as pd
import pingouin as pg
import pytest
from scipy import stats
from statsmodels.stats.anova import AnovaRM

warnings.filterwarnings("ignore")

# Maxwell and Delaney 1990: reaction times, ms, of ten persons; noise absent or present, stimulus tilted by 0, 4, 8 degrees.
REACTION_TIMES = """
420 420 480 480 600 780
420 480 480 360 480 600
480 480 540 660 780 780
420 540 540 480 780 900
540 660 540 480 660 720
360 420 360 360 480 540
480 480 600 540 720 840
480 600 660 540 720 900
540 600 540 480 720 780
480 420 540 540 660 780
"""
# Shrout and Fleiss 1979: six targets, four judges.
RATINGS = [[9, 2, 5, 8], [6, 1, 3, 2], [8, 4, 6, 8], [7, 1, 2, 6], [10, 5, 6, 9], [6, 2, 4, 7]]

VELOCITIES, TORQUES = [1.3, 1.95, 2.6, 3.25], [0.9, 1.5, 2.1]


def long(cells, first, second):
    """Persons by cells as (subject, session, velocity, torque, value)."""
    places = [(a, b) for a in first for b in second]
    return [(f"P{person:02}", 1, *place, value)
            for person, row in enumerate(cells) for place, value in zip(places, row)]


def published():
    cells = [[float(value) for value in line.split()] for line in REACTION_TIMES.split("\n") if line]
    return long(cells, [1.0, 2.0], [0.0, 4.0, 8.0])


def made_up(seed, persons=8):
    """As the paper's design, with persons who differ in level and in both effects, and unequal variances."""
    draw = np.random.default_rng(seed)
    velocity, torque = np.meshgrid(VELOCITIES, TORQUES, indexing="ij")
    cells = []
    for _ in range(persons):
        own = 10 + draw.normal() * 2 + (1 + draw.normal() * 0.4) * velocity + (4 + draw.normal()) * torque
        cells.append((own + draw.normal(size=own.shape) * (0.3 + 0.3 * velocity)).ravel())
    return long(cells, VELOCITIES, TORQUES)


DATA = {"published": published, "made up, 8": lambda: made_up(1), "made up, 15": lambda: made_up(2, 15)}


@pytest.fixture(params=DATA)
def rows(request):
    return DATA[request.param]()


def frame(rows):
    return pd.DataFrame(rows, columns=["subject", "session", "velocity", "torque", "value"])


def close(found, expected, relative=1e-8):
    assert float(found) == pytest.approx(expected, rel=relative, abs=1e-300)


def anderson(chi_square, d, df):
    """p-value of Mauchly's test (Anderson 2003, 10.7.4)."""
    rho = 1 - (2 * d * d + d + 2) / (6 * d * df)
    second = (d + 2) * (d - 1) * (d - 2) * (2 * d**3 + 6 * d * d + 3 * d + 2) / (288 * (df * d * rho) ** 2)
    first, more = (stats.chi2.sf(chi_square, d * (d + 1) / 2 - 1 + extra) for extra in (0, 4))
    return first + second * (more - first)


EFFECTS = [("velocity", "velocity"), ("torque", "torque"), ("velocity x torque", "velocity:torque")]


def test_analysis_of_variance_is_that_of_statsmodels(tables, rows):
    found = {row["effect"]: row for row in tables(rows)["anova"]}
    expected = AnovaRM(frame(rows), "value", "subject", within=["velocity", "torque"]).fit().anova_table
    for own, theirs in EFFECTS:
        line = expected.loc[theirs]
        close(found[own]["f"], line["F Value"])
        close(found[own]["df_effect"], line["Num DF"])
        close(found[own]["df_error"], line["Den DF"])
        close(found[own]["p"], line["Pr > F"])


def test_sphericity_and_effect_sizes_are_those_of_pingouin(tables, rows):
    found = {row["effect"]: row for row in tables(rows)["anova"]}
    data = frame(rows)
    expected = pg.rm_anova(data, dv="value", within=["velocity", "torque"], subject="subject", detailed=True, effsize="ng2")
    partial = pg.rm_anova(data, dv="value", within=["velocity", "torque"], subject="subject", effsize="np2")
    for own, theirs in [("velocity", "velocity"), ("torque", "torque"), ("velocity x torque", "velocity * torque")]:
        line = expected[expected["Source"] == theirs].iloc[0]
        close(found[own]["ss"], line["SS"])
        close(found[own]["generalised_eta_squared"], line["ng2"])
        close(found[own]["partial_eta_squared"], partial[partial["Source"] == theirs].iloc[0]["np2"])
    for own in ("velocity", "torque"):
        wide = data.groupby(["subject", own])["value"].mean().unstack()
        close(found[own]["epsilon_gg"], pg.epsilon(wide, correction="gg"))
        close(found[own]["epsilon_hf"], pg.epsilon(wide, correction="hf"))
        if wide.shape[1] > 2:
            _, w, chi_square, df, p = pg.sphericity(wide, method="mauchly")
            for name, value in [("mauchly_w", w), ("mauchly_chi_square", chi_square), ("mauchly_df", df)]:
                close(found[own][name], value)
            close(found[own]["mauchly_p"], anderson(chi_square, wide.shape[1] - 1, len(wide) - 1))
            # Pingouin has, as R, the number of conditions for d in one place of the second term; both print the same.
            close(found[own]["mauchly_p"], p, 5e-4)
        df = float(found[own]["df_effect"]), float(found[own]["df_error"])
        for epsilon, p in (("epsilon_gg", "p_gg"), ("epsilon_hf", "p_hf")):
            factor = float(found[own][epsilon])
            close(found[own][p], stats.f.sf(float(found[own]["f"]), factor * df[0], factor * df[1]))


def test_epsilon_of_the_interaction_is_that_of_its_orthonormal_contrasts(tables, rows):
    # Box 1954 from the eigenvalues; pingouin has no Huynh-Feldt epsilon of an interaction.
    data = frame(rows)
    wide = data.pivot(index="subject", columns=["velocity", "torque"], values="value")
    levels = data["velocity"].nunique(), data["torque"].nunique()
    centred = [np.linalg.svd(np.eye(k) - 1 / k)[0][:, : k - 1] for k in levels]
    contrasts = np.kron(*centred)
    roots = np.linalg.eigvalsh(np.cov((wide.to_numpy() @ contrasts).T))
    n, d = len(wide), len(roots)
    gg = roots.sum() ** 2 / (d * (roots**2).sum())
    found = {row["effect"]: row for row in tables(rows)["anova"]}["velocity x torque"]
    close(found["epsilon_gg"], gg)
    close(found["epsilon_hf"], min(1.0, (n * d * gg - 2) / (d * (n - 1 - d * gg))))
    w = np.prod(roots) / (roots.sum() / d) ** d
    close(found["mauchly_w"], w, 1e-6)


def test_contrasts_are_paired_t_tests_corrected_after_holm(tables, rows):
    found = tables(rows)["contrasts"]
    data = frame(rows)
    for own, factor in (("velocity_rad_s", "velocity"), ("torque_nm", "torque")):
        wide = data.groupby(["subject", factor])["value"].mean().unstack()
        lines = [row for row in found if row["factor"] == own]
        expected = [stats.ttest_rel(wide[float(row["level"])], wide[float(row["other_level"])]) for row in lines]
        adjusted = pg.multicomp([test.pvalue for test in expected], method="holm")[1]
        assert len(lines) == wide.shape[1] * (wide.shape[1] - 1) // 2
        for row, test, p_holm in zip(lines, expected, adjusted):
            close(row["t"], test.statistic)
            close(row["p"], test.pvalue)
            close(row["p_holm"], p_holm)
            interval = test.confidence_interval()
            close(row["low"], interval.low, 1e-6)
            close(row["high"], interval.high, 1e-6)


def test_trends_are_the_persons_own_regressions(tables, rows):
    found = {row["factor"]: row for row in tables(rows)["trends"]}
    data = frame(rows)
    for own, factor in (("velocity_rad_s", "velocity"), ("torque_nm", "torque")):
        lines = np.array([np.polyfit(person[factor], person["value"], 1) for _, person in data.groupby("subject")])
        for name, values in (("slope", lines[:, 0]), ("intercept", lines[:, 1])):
            test = stats.ttest_1samp(values, 0)
            interval = test.confidence_interval()
            close(found[own][name], values.mean())
            close(found[own][f"{name}_low"], interval.low, 1e-6)
            close(found[own][f"{name}_high"], interval.high, 1e-6)
            close(found[own]["p" if name == "slope" else "intercept_p"], test.pvalue, 1e-6)


def test_means_are_over_persons(tables, rows):
    expected = frame(rows).groupby(["velocity", "torque"])["value"].agg(["mean", "std"])
    for row in tables(rows)["means"]:
        mean, sd = expected.loc[(float(row["velocity_rad_s"]), float(row["torque_nm"]))]
        close(row["mean"], mean)
        close(row["sd"], sd)


@pytest.mark.parametrize("ratings", [RATINGS, np.random.default_rng(3).normal(20, 3, (12, 1))
                                     + np.random.default_rng(4).normal([0, 0.5, 1], 0.8, (12, 3))])
def test_reliability_is_that_of_pingouin(tables, ratings):
    ratings = np.asarray(ratings, dtype=float)
    rows = [(f"P{person:02}", session + 1, 1.3, 0.9, value)
            for person, own in enumerate(ratings) for session, value in enumerate(own)]
    (found,) = tables(rows)["reliability"]
    data = frame(rows)
    icc = pg.intraclass_corr(data, targets="subject", raters="session", ratings="value").set_index("Type")
    single = {"icc_agreement": ("ICC2", "ICC(A,1)"), "icc_consistency": ("ICC3", "ICC(C,1)")}
    for own, names in single.items():
        theirs = next(name for name in names if name in icc.index)
        close(found[own], icc.loc[theirs, "ICC"])
    errors = ratings - ratings.mean(0) - ratings.mean(1, keepdims=True) + ratings.mean()
    sem = np.sqrt((errors**2).sum() / ((len(ratings) - 1) * (ratings.shape[1] - 1)))
    close(found["sem"], sem)
    close(found["smallest_detectable_change"], 1.96 * np.sqrt(2) * sem)


def test_the_mixed_model_agrees_with_the_analysis_of_variance_where_nothing_is_missing(tables, mixed_model):
    found = {row["effect"]: row for row in tables(made_up(2, 15))["anova"]}
    mixed = mixed_model()
    for effect, row in mixed.items():
        close(row["f"], float(found[effect]["f"]), 2e-3)
        close(row["df_error"], float(found[effect]["df_error"]))


def test_the_mixed_model_uses_persons_who_lack_conditions(tables, mixed_model):
    rows = [row for index, row in enumerate(made_up(2, 15)) if index not in (3, 17, 40, 41, 90)]
    found = tables(rows, code=1)
    assert {row["persons"] for row in found["anova"]} == {"11"}
    mixed = mixed_model()
    whole = {row["effect"]: float(row["f"]) for row in found["anova"]}
    assert {row["persons"] for row in mixed.values()} == {"15"}
    assert all(row["converged"] == "True" and row["missing_cells"] == "5" for row in mixed.values())
    # Fifteen persons say more than eleven.
    assert float(mixed["torque"]["f"]) > whole["torque"]
