"""The benchmark's result as one Markdown text, for the terminal and for the docs."""

from collections import defaultdict
from statistics import median

from . import probability, score, verdict


def markdown(outcomes, rates) -> str:
    parts = [_rates(rates), _laboratories(outcomes), _kinds(outcomes), _probabilities(outcomes), _confusion(outcomes), _bias(outcomes),
             _time(outcomes)]
    return "\n\n".join(parts) + "\n"


def table(head, rows):
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(str(c) for c in line) + " |" for line in lines)


def _rates(rates):
    rows = []
    for r in rates:
        sign = "at most" if r.at_most else "at least"
        value = "-" if r.value is None else f"{r.value:.1%}"
        met = {None: "not in this run", True: "yes", False: "**no**"}[r.met]
        rows.append([r.name, f"{r.hits}/{r.of}", value, f"{sign} {r.required:.0%}", met])
    return "## Required\n\n" + table(["what", "count", "rate", "required", "met"], rows)


def _laboratories(outcomes):
    """One row each, and one for all together."""
    by = defaultdict(list)
    for o in outcomes:
        by[o.case.laboratory].append(o)
    rows = [_shares(laboratory, group) for laboratory, group in by.items()]
    if len(rows) > 1:
        rows.append(_shares("all", outcomes))
    return "## Laboratories\n\n" + table(["laboratory", "sessions", *verdict.KINDS, "false alarms", "findable", "right of the findable",
                                            "can be told apart", "right of these", "place of aliens right"], rows)


def _kinds(outcomes):
    """The same counts for what is hidden: nothing, one mechanism, two, a function in no catalogue, another alien."""
    def kind(o):
        if o.case.kind != "alien":
            return {"none": "nothing", "mechanism": "a mechanism", "pair": "two mechanisms"}[o.case.kind]
        return "an alien that is a function at a place" if o.truth["hidden"][0].get("place") else "another alien"

    by = defaultdict(list)
    for o in outcomes:
        by[kind(o) + (f", {o.case.group}" if o.case.trap else "")].append(o)
    rows = [[hidden, len(group), *_verdicts(group)] for hidden, group in by.items()]
    return "## Right, missed, left open and wrong\n\n" + table(["hidden", "sessions", *verdict.KINDS], rows)


def _shares(name, group):
    empty = [o for o in group if o.case.kind == "none"]
    asked = [o for o in group if o.oracle]
    findable = [o for o in asked if o.oracle["findable"]]
    apart = [o for o in asked if o.oracle["told_apart"]]
    places = [p for o in group if o.case.kind == "alien" and (p := verdict.place_is_right(o)) is not None]
    right = lambda some: _of(sum(verdict.of(o) == verdict.RIGHT for o in some), len(some))
    return [name, len(group), *_verdicts(group), _of(sum(map(verdict.is_false_alarm, empty)), len(empty)), _of(len(findable), len(asked)),
            right(findable), _of(len(apart), len(asked)), right(apart), _of(sum(places), len(places))]


def _verdicts(group):
    said = [verdict.of(o) for o in group]
    return [said.count(kind) for kind in verdict.KINDS]


def _of(count, of):
    return f"{count}/{of}" if of else ""


def _probabilities(outcomes):
    title = "## Probabilities\n\n"
    cost = probability.log_score(outcomes)
    if cost is None:
        return title + "The program states none; there is no log score and no reliability."
    rows = [[f"{d.stated:.3f}", f"{d.true / d.of:.3f}", f"{d.true}/{d.of}"] for d in probability.reliability(outcomes)]
    return title + f"Mean log score {cost[0]:.3f} over {cost[1]} answers (lower is better; 0 is the best).\n\n" + table(
        ["stated probability, mean of a tenth", "share that is true", "count"], rows)


def _confusion(outcomes):
    by = defaultdict(list)
    for o in outcomes:
        by[o.case.effect + (f", {o.case.group}" if o.case.trap else "")].append(o)
    rows = []
    for effect, group in by.items():
        kind, n = group[0].case.kind, len(group)
        count = lambda f: f"{sum(map(bool, map(f, group)))}/{n}"
        if kind == "mechanism":
            cells = [count(lambda o: score.found(o, score.cause(o))), count(lambda o: score.alone(o, score.cause(o)))]
            cells += [_fraction(group, False), _fraction(group, True)]
        elif kind == "pair":
            cells = [count(lambda o: all(score.found(o, m) for m in o.case.causes)), "", "", ""]
        else:
            right = "adequate" if kind == "none" else "unexplained"
            cells = [count(lambda o: score.verdict(o) == right), "", "", ""]
        said = ", ".join(f"{phrase} {k}" for phrase, k in score.answers(group).most_common(5))
        rows.append([effect, *cells, said])
    return "## Hidden and answered\n\n" + table(
        ["hidden", "right", "named alone", "values covered", "nominal values covered", "answers"], rows)


def _fraction(group, nominal):
    hits = [hit for o in group for _, hit in score.coverage(o, nominal)]
    return f"{sum(hits)}/{len(hits)}" if hits else ""


def _bias(outcomes):
    single = [o for o in outcomes if o.case.kind == "mechanism"]
    tables = [score.bias_table(single, p) for p in ("k_srs_nm_per_rad", "x_e_rad")]
    rows = [[m] + [f"{t[m][i]:.1%}" if m in t else "" for t in tables for i in (0, 1)]
            for m in dict.fromkeys([*tables[0], *tables[1]])]
    return "## Median bias without and with the added mechanisms\n\n" + table(
        ["hidden", "k_srs before", "k_srs after", "x_e before", "x_e after"], rows)


def _time(outcomes):
    seconds = [o.seconds for o in outcomes]
    failed = [f"- {o.case.effect}, seed {o.case.seed}: {o.error}" for o in outcomes if o.error]
    text = f"{len(outcomes)} sessions; a diagnosis took {median(seconds):.1f} s (median), at most {max(seconds):.1f} s."
    return text + ("\n\nFailed:\n\n" + "\n".join(failed) if failed else "")
