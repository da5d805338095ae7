"""The benchmark's result as one Markdown text, for the terminal and for the docs."""

from collections import defaultdict
from statistics import median

from . import score


def markdown(outcomes, rates) -> str:
    return "\n\n".join([_rates(rates), _confusion(outcomes), _bias(outcomes), _time(outcomes)]) + "\n"


def _table(head, rows):
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(str(c) for c in line) + " |" for line in lines)


def _rates(rates):
    rows = []
    for r in rates:
        sign = "at most" if r.at_most else "at least"
        value = "-" if r.value is None else f"{r.value:.1%}"
        met = {None: "not in this run", True: "yes", False: "**no**"}[r.met]
        rows.append([r.name, f"{r.hits}/{r.of}", value, f"{sign} {r.required:.0%}", met])
    return "## Required\n\n" + _table(["what", "count", "rate", "required", "met"], rows)


def _confusion(outcomes):
    by = defaultdict(list)
    for o in outcomes:
        by[o.case.effect].append(o)
    rows = []
    for effect, group in by.items():
        kind, n = group[0].case.group, len(group)
        count = lambda f: f"{sum(map(bool, map(f, group)))}/{n}"
        if kind == "mechanism":
            cells = [count(lambda o: score.found(o, effect)), count(lambda o: score.alone(o, effect))]
            cells += [_fraction(group, False), _fraction(group, True)]
        elif kind == "pair":
            cells = [count(lambda o: all(score.found(o, m) for m in effect.split("+"))), "", "", ""]
        else:
            right = "adequate" if kind == "none" else "unexplained"
            cells = [count(lambda o: score.verdict(o) == right), "", "", ""]
        said = ", ".join(f"{phrase} {k}" for phrase, k in score.answers(group).most_common(5))
        rows.append([effect, *cells, said])
    return "## Hidden and answered\n\n" + _table(
        ["hidden", "right", "named alone", "values covered", "nominal values covered", "answers"], rows)


def _fraction(group, nominal):
    hits = [hit for o in group for _, hit in score.coverage(o, nominal)]
    return f"{sum(hits)}/{len(hits)}" if hits else ""


def _bias(outcomes):
    single = [o for o in outcomes if o.case.group == "mechanism"]
    tables = [score.bias_table(single, p) for p in ("k_srs_nm_per_rad", "x_e_rad")]
    rows = [[m] + [f"{t[m][i]:.1%}" if m in t else "" for t in tables for i in (0, 1)]
            for m in dict.fromkeys([*tables[0], *tables[1]])]
    return "## Median bias before and after the extension\n\n" + _table(
        ["hidden", "k_srs before", "k_srs after", "x_e before", "x_e after"], rows)


def _time(outcomes):
    seconds = [o.seconds for o in outcomes]
    failed = [f"- {o.case.effect}, seed {o.case.seed}: {o.error}" for o in outcomes if o.error]
    text = f"{len(outcomes)} sessions; a diagnosis took {median(seconds):.1f} s (median), at most {max(seconds):.1f} s."
    return text + ("\n\nFailed:\n\n" + "\n".join(failed) if failed else "")
