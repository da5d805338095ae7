"""python -m bench_peers PROGRAM SESSION WORK [ROUNDS]: measures, and prints docs/benchmarks/bench.md."""

import dataclasses
import json
import sys
from pathlib import Path

from . import fits, page
from .measure import (
    DRAWN,
    FIGURES,
    PROBLEMS,
    REFITS,
    Ours,
    agreement,
    best,
    fit_for_memory,
    memory,
    one_simulation,
    prepare,
    solve_ivp_fit,
    told,
)


def main(program: str, session: str, work: str, rounds: str = "3") -> int:
    folder = Path(work)
    ours = Ours(program, session, folder)
    windows = prepare(ours, folder)
    results = {"agreement": dataclasses.asdict(agreement(windows)), "rounds": int(rounds)}
    told("the models agree:", results["agreement"])

    chosen, excess, peers_best, ours_excess = choose(windows)
    seconds = in_turn(ours, windows, chosen, int(rounds))
    slow = {name: with_solve_ivp(windows, name, chosen[name]) for name in ("weighed_repetition", "plain_repetition")}
    file = folder / "problem.json"
    of = chosen["weighed_session"]
    results |= {
        "seconds": seconds,
        "settings": {name: {peer: str(t.settings) for peer, t in own.items()} for name, own in chosen.items()},
        "excess": excess,
        "ours_excess": ours_excess,
        "lowest": peers_best,
        "slow": slow,
        "ours": {name: windows.given[name]["ours"] for name in PROBLEMS},
        "calls_of_c": {name: own["c"].calls for name, own in chosen.items()},
        "memory": {
            "ours": ours.ask("memory", session)["peak_bytes"],
            **{p: memory(file, p, json.dumps(dataclasses.astuple(of["b" if p == "c" else p].settings))) for p in "abc"},
        },
        "operations": ours.ask("operations", session),
        "problem": {k: len(windows.given["weighed_repetition"][k]) for k in ("start", "measured_nm")},
    }
    (folder / "results.json").write_text(json.dumps(results, indent=1))
    print(page.markdown(results))
    of_c = [cost / sum(peers_best[name]) - 1.0 for name, own in slow.items() for cost in own["costs"] or []]
    of_peers = [e for name, own in excess.items() if name != "bootstrap" for e in own.values()]
    same = max(*ours_excess.values(), *of_peers, *of_c)
    if same > fits.SAME:
        told(f"not everybody came to the same optimum: {same:.2%} above the lowest")
        return 1
    return 0


def choose(windows):
    """For each problem and peer, the fastest way of asking scipy that comes to the lowest cost that anybody found."""
    chosen, excess, lowest, ours = {}, {}, {}, {}
    problems = {name: windows.parts(name) for name in PROBLEMS}
    problems["bootstrap"] = [part for session in windows.refits()[:2] for part in session]
    for name, parts in problems.items():
        parts[0].residuals(parts[0].start)
        parts[0].jacobian(parts[0].start)
        tried = {peer: fits.all_tried(fits.PEERS[peer], parts) for peer in "ab"}
        of_peers = tried["a"] + tried["b"]
        found = fits.lowest(of_peers, parts)
        # The peers do not look for other optima: on refits they are asked to come to the best of theirs.
        target = fits.lowest_of(of_peers) if name == "bootstrap" else found
        chosen[name] = {}
        for peer, own in tried.items():
            reaching = [t for t in own if fits.reaches(t, target)]
            nearest = min(own, key=lambda t: fits.excess(t.costs, target))
            chosen[name][peer] = min(reaching, key=lambda t: t.seconds, default=nearest)
        # (c) pays for evaluations alone; its derivatives are rougher, so it is told to stop later.
        few = min([t for t in tried["b"] if fits.reaches(t, target)] or [chosen[name]["b"]], key=lambda t: t.calls)
        later = dataclasses.replace(few.settings, tolerance=0.1 * few.settings.tolerance)
        chosen[name]["c"] = dataclasses.replace(few, settings=later)
        excess[name] = {peer: fits.excess(chosen[name][peer].costs, found) for peer in "ab"}
        ours[name] = fits.excess([part.ours for part in parts], found)
        lowest[name] = found
        told(name, "ours", f"{ours[name]:.1e}", {p: f"{t.settings}: {excess[name].get(p, 0):.1e}" for p, t in chosen[name].items()})
    return chosen, excess, lowest, ours


def in_turn(ours: Ours, windows, chosen, rounds: int) -> dict:
    """Best times on the core of every figure, ours and the peers' one after the other in every round."""
    seconds = {figure: {} for figure in (*FIGURES, "as_it_comes")}

    def least(figure, who, value):
        seconds[figure][who] = min(value, seconds[figure].get(who, float("inf")))

    for number in range(rounds):
        told(f"round {number + 1} of {rounds}")
        for figure in FIGURES:
            if figure != "bootstrap" or number == 0:
                least(figure, "ours", ours.seconds(figure))
            if figure in PROBLEMS:
                for peer in "ab":
                    settings = chosen[figure][peer].settings
                    parts = windows.parts(figure)
                    least(figure, peer, best(lambda: [fits.PEERS[peer](part, settings) for part in parts]))
        for peer in "ab":
            part = windows.parts("weighed_repetition")[0]
            least("as_it_comes", peer, best(lambda: fits.PEERS[peer](part, fits.AS_IT_COMES)))
        for figure, times in one_simulation(windows).items():
            for peer, value in times.items():
                least(figure, peer, value)
        for peer in "ab":
            settings = chosen["bootstrap"][peer].settings
            parts = [part for session in windows.refits() for part in session]
            all_drawn = best(lambda: [fits.PEERS[peer](part, settings) for part in parts], fewest=1)
            least("bootstrap", peer, all_drawn * REFITS / DRAWN)
    return seconds


def with_solve_ivp(windows, name: str, chosen) -> dict:
    """(c) on one repetition."""
    found = solve_ivp_fit(windows.parts(name)[0], chosen["c"].settings, chosen["c"].calls)
    told(name, found)
    return dataclasses.asdict(found)


if __name__ == "__main__":
    if sys.argv[1] == "memory":
        print(fit_for_memory(Path(sys.argv[2]), *sys.argv[3:5]))
        sys.exit()
    sys.exit(main(*sys.argv[1:]))
