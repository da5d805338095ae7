"""Figures of sessions, fits and diagnoses."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ._calibration import Calibration
    from ._results import Diagnosis, Fit
    from ._session import Session

MEASURED, FITTED, WITH_CAUSES = "#7a8a99", "#c0392b", "#1f77b4"

_PANELS_IN_A_ROW = 4

_SHOWN_S = 0.1
"""What a figure of a session shows before and after an onset, s."""


def _panels(count: int, height: float = 2.2) -> tuple[Figure, list[Axes]]:
    """A figure with `count` panels that share their axes. It belongs to no window, so nothing keeps it alive but its owner."""
    from matplotlib.figure import Figure

    columns = max(1, min(_PANELS_IN_A_ROW, count))
    rows = max(1, -(-count // columns))
    figure = Figure(figsize=(2.7 * columns + 0.6, height * rows + 0.6), layout="constrained")
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    panels = list(grid.flat)
    for panel in panels[count:]:
        panel.set_axis_off()
    for panel in panels[:count]:
        panel.spines[["top", "right"]].set_visible(False)
        panel.tick_params(labelbottom=True)
    return figure, panels[:count]


def _label(figure: Figure, x: str, y: str) -> None:
    figure.supxlabel(x, fontsize="medium")
    figure.supylabel(y, fontsize="medium")


def _title(velocity_rad_s: float, torque_nm: float, condition: str | None = None) -> str:
    return f"{velocity_rad_s:g} rad/s, {torque_nm:g} N m" + (f", {condition}" if condition else "")


def figure_of_fit(fit: Fit, independent: bool) -> Figure:
    """Measured and fitted torque, one panel a condition."""
    trials = {own["trial"]: own for own in fit.dict["trials"]}
    rows: dict[str, list[int]] = {}
    for row, number in enumerate(fit.trials):
        own = trials[number]
        rows.setdefault(_title(own["velocity_rad_s"], own["torque_nm"], own.get("condition")), []).append(row)
    time_ms, measured, predicted = 1e3 * fit.time_s, fit.measured_nm, fit.predicted_nm(independent=independent)
    figure, panels = _panels(len(rows))
    for panel, (title, own_rows) in zip(panels, rows.items(), strict=True):
        for first, row in enumerate(own_rows):
            panel.plot(time_ms, measured[row], color=MEASURED, lw=2.4, alpha=0.6, label=None if first else "measured")
            panel.plot(time_ms, predicted[row], color=FITTED, lw=1.0, label=None if first else "fitted")
        panel.set_title(title, fontsize="small")
    if panels:
        panels[0].legend(frameon=False, fontsize="small")
    _label(figure, "time after the onset (ms)", "torque, change from the hold (N m)")
    return figure


def figure_of_diagnosis(diagnosis: Diagnosis) -> Figure:
    """What the model leaves of the torque in each condition, without and with the causes."""
    shown = diagnosis.dict["residual_map"]
    conditions: Sequence[dict[str, Any]] = shown["conditions"]
    time_ms = 1e3 * np.array(shown["time_s"], dtype=float)
    figure, panels = _panels(len(conditions))
    for panel, own in zip(panels, conditions, strict=True):
        mean, after = (np.array(own[key], dtype=float) for key in ("mean_nm", "after_nm"))
        if own.get("sd_nm") is not None:
            sd = np.array(own["sd_nm"], dtype=float)
            panel.fill_between(time_ms, mean - sd, mean + sd, color=FITTED, alpha=0.15, lw=0)
        panel.axhline(0.0, color="0.7", lw=0.8)
        panel.plot(time_ms, mean, color=FITTED, lw=1.4, label="model")
        if diagnosis.causes:
            panel.plot(time_ms, after, color=WITH_CAUSES, lw=1.4, label="with the causes")
        panel.set_title(_title(own["velocity_rad_s"], own["torque_nm"], own.get("condition")), fontsize="small")
    if panels:
        panels[0].legend(frameon=False, fontsize="small")
    causes = ", ".join(diagnosis.causes)
    figure.suptitle(f"verdict: {diagnosis.verdict}" + (f" ({causes})" if causes else ""), fontsize="medium")
    _label(figure, "time after the onset (ms)", "measured less predicted torque (N m)")
    return figure


def figure_of_session(session: Session) -> Figure:
    """Angle and torque of the trials that are analysed, one colour a velocity."""
    from matplotlib import colormaps
    from matplotlib.figure import Figure

    trials = [own for own in session.to_frame().to_dict("records") if own["status"] == "ok"]
    velocities = sorted({own["velocity_rad_s"] for own in trials})
    colours = colormaps["viridis"](np.linspace(0.0, 0.85, max(1, len(velocities))))
    figure = Figure(figsize=(7.5, 4.6), layout="constrained")
    angle, torque = figure.subplots(2, 1, sharex=True)
    is_known = all(own["onset_s"] is not None and not np.isnan(own["onset_s"]) for own in trials)
    for own in trials:
        record = session.record(own["trial"])
        time = record["t_s"].to_numpy()
        start = own["onset_s"] if is_known else 0.0
        # Without onsets, whole records.
        kept = np.abs(time - start) <= _SHOWN_S if is_known else np.ones(time.size, dtype=bool)
        colour = colours[velocities.index(own["velocity_rad_s"])]
        angle.plot(1e3 * (time[kept] - start), record["theta_m_rad"].to_numpy()[kept], color=colour, lw=0.8)
        torque.plot(1e3 * (time[kept] - start), record["torque_l_nm"].to_numpy()[kept], color=colour, lw=0.8)
    for velocity, colour in zip(velocities, colours, strict=True):
        angle.plot([], [], color=colour, label=f"{velocity:g} rad/s")
    angle.legend(frameon=False, fontsize="small")
    angle.set_ylabel("angle (rad)")
    torque.set_ylabel("torque (N m)")
    torque.set_xlabel("time after the onset (ms)" if is_known else "time in the record (ms)")
    for panel in (angle, torque):
        panel.spines[["top", "right"]].set_visible(False)
    return figure


def figure_of_calibration(calibration: Calibration) -> Figure:
    """How far the constants are from what the session states, in per cent of it, with 95 % intervals."""
    from matplotlib.figure import Figure

    frame = calibration.to_frame()
    known = frame[frame["value"].notna() & frame["stated"].notna() & (frame["stated"] != 0.0)]
    figure = Figure(figsize=(6.4, 0.42 * max(3, len(known)) + 1.0), layout="constrained")
    panel = figure.subplots()
    rows = np.arange(len(known))[::-1]
    scale = 100.0 / np.abs(known["stated"])
    panel.axvline(0.0, color="0.7", lw=0.8)
    panel.errorbar(
        (known["value"] - known["stated"]) * scale, rows, xerr=1.96 * known["se"] * scale, fmt="o", ms=4, capsize=3, color=FITTED
    )
    panel.set_yticks(rows, known["name"])
    panel.set_ylim(-0.6, len(known) - 0.4)
    panel.set_xlabel("measured less stated (% of the stated value)")
    panel.spines[["top", "right"]].set_visible(False)
    return figure


def embedded(draw: Callable[[], Figure]) -> str:
    """A figure as an element of HTML."""
    picture = io.BytesIO()
    draw().savefig(picture, format="png", dpi=90)
    return f'<img alt="figure" src="data:image/png;base64,{base64.b64encode(picture.getvalue()).decode()}">'
