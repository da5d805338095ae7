"""docs/benchmarks/bench.md out of what was measured."""

import subprocess
from pathlib import Path

from .fits import SAME

NAMES = {
    "sensitivities": "one simulation with six sensitivities",
    "simulation": "one simulation",
    "weighed_repetition": "one repetition (61 parameters)",
    "weighed_session": "one session (36 trials, 3 x 61 parameters)",
    "plain_repetition": "one repetition, plain sum of squares",
    "plain_session": "one session, plain sum of squares",
    "bootstrap": "1,000 bootstrap refits of the session, two cores",
}


def duration(seconds: float) -> str:
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if seconds >= size:
            return f"{significant(seconds / size)} {unit}"
    return f"{seconds * 1e9:.0f} ns"


def significant(value: float) -> str:
    """Two digits, or the whole number."""
    return f"{value:,.0f}" if value >= 10 else f"{value:.1f}"


def markdown(r: dict) -> str:
    times = {figure: dict(own) for figure, own in r["seconds"].items()}
    slow, as_it_comes = r["slow"], r["seconds"]["as_it_comes"]
    extrapolated = set()
    for kind in ("weighed", "plain"):
        of = slow[f"{kind}_repetition"]
        times[f"{kind}_repetition"]["c"] = of["seconds"]
        if of["cut_off"]:
            extrapolated.add(f"{kind}_repetition")
        times[f"{kind}_session"]["c"] = of["seconds_a_call"] * r["calls_of_c"][f"{kind}_session"]
        extrapolated.add(f"{kind}_session")
    # The evaluations of two drawn sessions, at (c)'s price.
    times["bootstrap"]["c"] = slow["weighed_repetition"]["seconds_a_call"] * r["calls_of_c"]["bootstrap"] / 2 * 1000
    extrapolated.add("bootstrap")
    two_cores = {who: value / 2 for who, value in times["bootstrap"].items()}
    times["bootstrap"] = two_cores

    def row(figure):
        own = times[figure]
        ratio = [f"{significant(own[peer] / own['ours'])}" for peer in "abc"]
        mark = "*" if figure in extrapolated else ""
        peers = [duration(own[p]) + (mark if p == "c" else "") for p in "abc"]
        return f"| {NAMES[figure]} | {' | '.join(ratio)}{mark} | {duration(own['ours'])} | {' | '.join(peers)} |"

    megabytes = {who: value / 1e6 for who, value in r["memory"].items()}
    memory = [significant(megabytes[p] / megabytes["ours"]) for p in "abc"]
    memory_row = f"| peak memory, one session | {' | '.join(memory)} | {megabytes['ours']:.0f} MB | " + " | ".join(
        f"{megabytes[p]:.0f} MB" for p in "abc"
    )
    return TEXT.format(
        processor=processor(),
        build=build(),
        rounds=r["rounds"],
        rows="\n".join([row(figure) for figure in NAMES] + [memory_row + " |"]),
        alone=duration(r["seconds"]["simulation_alone"]["ours"]),
        alone_slopes=duration(r["seconds"]["sensitivities_alone"]["ours"]),
        as_it_comes_a=duration(as_it_comes["a"]),
        as_it_comes_b=duration(as_it_comes["b"]),
        as_it_comes_ratio_a=significant(as_it_comes["a"] / times["weighed_repetition"]["ours"]),
        as_it_comes_ratio_b=significant(as_it_comes["b"] / times["weighed_repetition"]["ours"]),
        from_nothing=duration(r["seconds"]["from_nothing"]["ours"]),
        together=duration(r["seconds"]["together"]["ours"]),
        peak=peak(r),
        costs="\n".join(cost_row(r, name) for name in (*[n for n in NAMES if n in r["ours"]], "bootstrap")),
        torque=r["agreement"]["torque"],
        slopes=r["agreement"]["slopes"],
        solve_ivp=r["agreement"]["torque_of_solve_ivp"],
        call=duration(slow["weighed_repetition"]["seconds_a_call"]),
        cut_off=cut_off(slow),
        apart=apart(r),
    )


def cost_row(r: dict, name: str) -> str:
    own = [f"{r['ours_excess'][name]:.1e}", *(f"{r['excess'][name][p]:.1e}" for p in "ab")]
    of_c = r["slow"].get(name, {}).get("costs")
    lowest = sum(r["lowest"][name])
    own.append(f"{of_c[0] / lowest - 1.0:.1e}" if of_c else "-")
    steps = max(o["steps"] for o in r["ours"][name]) if name in r["ours"] else "-"
    settings = "; ".join(f"({p}) {r['settings'][name][p]}" for p in "abc")
    return f"| {title(name)} | {lowest:.6g} | {' | '.join(own)} | {steps} | {settings} |"


def apart(r: dict) -> str:
    """Who did not come to the optimum."""
    ends = [(f"ours on {title(name)}", value) for name, value in r["ours_excess"].items()]
    ends += [(f"({p}) on {title(name)}", own[p]) for name, own in r["excess"].items() for p in "ab"]
    ends += [(f"(c) on {title(name)}", own["costs"][0] / sum(r["lowest"][name]) - 1.0) for name, own in r["slow"].items() if own["costs"]]
    far = [f"{who} ({excess:.1%})" for who, excess in ends if excess > SAME]
    return f"Not within 0.1 %: {', '.join(far)}." if far else "All are within 0.1 %."


def title(name: str) -> str:
    return "two refits" if name == "bootstrap" else NAMES[name]


def peak(r: dict) -> str:
    operations, at_most = r["operations"], r["operations"]["multiply_add_peak_per_s"]
    if at_most is None:
        return "The peak of this processor was not measured."
    done = operations["sensitivities"] / r["seconds"]["sensitivities"]["ours"]
    return (
        f"A simulation with six sensitivities asks for {operations['sensitivities']:,} additions, multiplications and divisions, "
        f"counted by running the model over numbers that count: {done / 1e9:.1f} thousand million a second, which is "
        f"{done / (2 * at_most):.0%} of the {2 * at_most / 1e9:.0f} that the same core does when it does nothing but fused "
        f"multiply-adds on registers of {operations['lanes']}. The steps of the model are fused, in the same places at every "
        f"width of vector, so that all give the same bits; the filter is not."
    )


def cut_off(slow: dict) -> str:
    names = [name.replace("_", " ") for name, own in slow.items() if own["cut_off"]]
    return f" (c) was cut off on the {' and the '.join(names)}." if names else " (c) was not cut off on either repetition."


def processor() -> str:
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    return next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), "an unnamed processor")


def build() -> str:
    described = subprocess.run(["git", "describe", "--always", "--dirty"], cwd=Path(__file__).parent, capture_output=True, text=True, check=False)
    return described.stdout.strip() or "of no known commit"


TEXT = """# The fit, side by side

How fast the fit is beside what laboratories use today, all in one run of `scripts/bench` on one core of {processor}, build {build}. Everybody
fits the same numbers: the prepared windows of the session that `ramphold run protocols/de-vlugt-2011.json --seed 1` makes, with
the same model, start and bounds, to the same optimum.

- **(a)** the model in numba, classical Runge-Kutta with its forward sensitivities, and scipy's bounded `least_squares` (trf)
- **(b)** the same model in numba with finite differences
- **(c)** `solve_ivp` and `least_squares`, as a plain script has it

scipy is asked in 24 ways (dense or sparse, scaled or not, from loose to tight tolerances); each peer gets the fastest of them that
comes within 0.1 % of the lowest cost that anybody found. Ours runs as it comes. Where scipy, too, runs as it comes (dense,
tolerances of 1e-8), one repetition takes (a) {as_it_comes_a} and (b) {as_it_comes_b}: {as_it_comes_ratio_a} and {as_it_comes_ratio_b} times ours.

| | times (a) | times (b) | times (c) | ours | (a) | (b) | (c) |
|---|---|---|---|---|---|---|---|
{rows}

Times are those on the core, the best of {rounds} rounds (ours of one for the bootstrap) in which ours and the peers take turns; other work on the machine does not
lengthen them, though it does cool the caches. * (c) goes through one repetition once; where marked, its time is that of one of its
evaluations ({call} for 12 trials) times as many as (b) needed at the least.{cut_off}

- One simulation is that of a trial among 16, which ours takes through the model several to a vector; one alone takes
  {alone}, with six sensitivities {alone_slopes}. For (b) and (c) six sensitivities are seven simulations.
- Repetition and session are weighed by the noise of the holds, as `ramphold fit` does, from the start that it finds. The whole of
  `ramphold fit` after the session is read, start and second look at other optima included, takes {from_nothing} for
  each trial on its own, and {together} with the model of the session.
- The plain sum of squares has flat valleys and many optima that the noise does not tell apart. Everybody starts within 10 % of
  the same one, which (a) found when it was let run to the end.
- The bootstrap is `ramphold::fit::bootstrap`, timed over 200 refits on two threads; the peers refit the first six of its
  sessions. The time of two cores is half the time on the core of all threads together. Ours does more: a drawn session's
  optimum need not be the one about the truth, so every refit looks for others. The peers go down from the truth and no further; they
  are given the tolerance that leads to the best that either of them finds.

## The share of the processor

{peak}

## The same optimum

Predicted torque at the start differs by {torque:.0e} N m between ours and the peers' compiled model, its derivatives by {slopes:.0e}
of the greatest, the torque of `solve_ivp` by {solve_ivp:.0e} N m. How far each ends above the lowest cost found, as a part of it,
the worst repetition for sessions:

| | lowest cost | ours | (a) | (b) | (c) | our steps | how scipy was asked |
|---|---|---|---|---|---|---|---|
{costs}

{apart}

Written by `scripts/bench`; the peers are in `scripts/bench_peers`, our side in `benches/fit`."""
