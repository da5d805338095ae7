"""The peers: scipy's bounded least squares over the three ways to the model."""

import dataclasses
import time

from scipy.optimize import least_squares

from . import plain
from .problem import Part

# As near to the lowest cost that anybody found counts as the same optimum.
SAME = 1e-3


@dataclasses.dataclass(frozen=True)
class Settings:
    """How scipy is asked: dense with an exact inner solution or sparse with LSMR, scaled or not, and when it stops."""

    sparse: bool
    scaled: bool
    tolerance: float

    def __str__(self):
        inner = "sparse, LSMR" if self.sparse else "dense, exact"
        return f"{inner}, x_scale={'jac' if self.scaled else '1'}, ftol={self.tolerance:g}"

    def options(self, part: Part) -> dict:
        return {
            "method": "trf",
            "bounds": (part.low, part.high),
            "tr_solver": "lsmr" if self.sparse else "exact",
            "x_scale": "jac" if self.scaled else 1.0,
            "ftol": self.tolerance,
            "xtol": 1e-8,
            "gtol": 1e-10,
        }


def with_sensitivities(part: Part, settings: Settings, **more):
    """(a) the compiled model and its forward sensitivities."""
    jacobian = part.sparse_jacobian if settings.sparse else part.jacobian
    return least_squares(part.residuals, part.start, jac=jacobian, **settings.options(part), **more)


def with_differences(part: Part, settings: Settings, **more):
    """(b) the compiled model and finite differences; with `sparse`, scipy moves unrelated coordinates together."""
    return least_squares(part.residuals, part.start, **_differences(part, settings), **more)


def with_solve_ivp(part: Part, settings: Settings, **more):
    """(c) solve_ivp and finite differences."""
    options = {"diff_step": plain.DIFFERENCE, **_differences(part, settings), **more}
    return least_squares(part.residuals_of_solve_ivp, part.start, **options)


def _differences(part: Part, settings: Settings) -> dict:
    sparsity = part.sparsity() if settings.sparse else None
    return {"jac": "2-point", "jac_sparsity": sparsity, **settings.options(part)}


# What least_squares does when it is told nothing but the bounds.
AS_IT_COMES = Settings(sparse=False, scaled=False, tolerance=1e-8)

PEERS = {"a": with_sensitivities, "b": with_differences, "c": with_solve_ivp}
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8)


@dataclasses.dataclass
class Tried:
    """What one way of asking came to: time on the core, model evaluations, costs part by part."""

    settings: Settings
    seconds: float
    calls: int
    costs: list[float]


def tried(peer, parts: list[Part], settings: Settings) -> Tried:
    for part in parts:
        part.calls = 0
    begun = time.thread_time()
    found = [peer(part, settings).x for part in parts]
    seconds, calls = time.thread_time() - begun, sum(part.calls for part in parts)
    return Tried(settings, seconds, calls, [part.cost(x) for part, x in zip(parts, found, strict=True)])


def all_tried(peer, parts: list[Part]) -> list[Tried]:
    """Every kind of problem solver, each with tighter tolerances until the cost falls no more."""
    results = []
    for sparse in (False, True):
        for scaled in (False, True):
            for tolerance in TOLERANCES:
                results.append(tried(peer, parts, Settings(sparse, scaled, tolerance)))
                if reaches(results[-1], lowest(results, parts)) and tolerance < 1e-3:
                    break
    return results


def lowest(results: list[Tried], parts: list[Part]) -> list[float]:
    """The lowest cost of each part that anybody found."""
    return [min([part.ours] + [r.costs[i] for r in results]) for i, part in enumerate(parts)]


def lowest_of(results: list[Tried]) -> list[float]:
    """The lowest cost of each part that any of these found."""
    return [min(costs) for costs in zip(*(r.costs for r in results), strict=True)]


def reaches(result: Tried, best: list[float]) -> bool:
    return all(cost <= (1.0 + SAME) * least for cost, least in zip(result.costs, best, strict=True))


def excess(costs: list[float], best: list[float]) -> float:
    """How far above the best the worst part is, as a part of it."""
    return max(cost / least - 1.0 for cost, least in zip(costs, best, strict=True))
