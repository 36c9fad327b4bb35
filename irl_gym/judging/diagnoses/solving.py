"""A solver at its limit: what it says itself, and the bound that the certificate recomputed."""

from collections.abc import Iterator

from irl_gym.judging.diagnoses.case import Case
from irl_gym.judging.diagnoses.findings import Finding
from irl_gym.programs.status import Status

FAR = 1e-3
"""A duality gap above this, in units of the objective, is far from the optimum."""
ROUNDING = 1e-6
"""A gap below this, in units of the price that the objective is less, is what two sums leave that cancel."""
OTHER = {"clarabel": "highs", "highs": "clarabel"}


def _programs(case: Case) -> Iterator[tuple[str, dict]]:
    programs = case.stats.get("programs", {})
    yield from programs.items()


def inaccurate(case: Case) -> Finding | None:
    """The solver stopped short of its tolerances."""
    short = [(name, one) for name, one in _programs(case) if Status(one["status"]) is Status.INACCURATE]
    if not short and case.status is not Status.INACCURATE:
        return None
    name, one = short[0] if short else ("reward", {})
    solver = str(one.get("solver", "the solver"))
    gap = case.claims.get("duality_gap")
    other = f'solver="{OTHER[solver]}"' if solver in OTHER else "the other solver"
    return Finding(
        "solver-inaccurate",
        f"{solver} stopped short of its tolerances on the program {name!r}"
        f"{'' if gap is None else f'; recomputed, the reward is at most {max(gap, 0.0):.1e} below the optimum'}.",
        f"{other}; or a gamma further from 1.",
        flags=("--gamma",),
    )


def far_from_optimal(case: Case) -> Finding | None:
    """Weak duality, recomputed: no reward has a larger objective than the bound, and none with these margins is smaller."""
    if case.status is not None and not case.status.usable:  # 0 is no unit; a zero reward has a finding of its own
        return None
    gap, objective = case.claims.get("duality_gap"), case.claims.get("objective")
    if gap is not None and objective is not None and gap > _far(case, objective):
        what = f"its objective is {objective:.4g} and the bound {gap:.2g} above it"
    else:
        norm, least = case.claims.get("l1_norm"), case.claims.get("least_l1_norm")
        if norm is None or least is None or norm - least <= FAR * norm:
            return None
        what = f"||R||_1 is {norm:.4g}, and the least with these margins can be {norm - least:.2g} smaller"
    return Finding(
        "far-from-optimal",
        f"The reward is not proved to be the program's optimum: {what}.",
        'The other solver (solver="highs" or "clarabel"), or no time_limit.',
    )


def _far(case: Case, objective: float) -> float:
    """The gap from which a reward is far from the optimum, in units of the objective."""
    norm = case.claims.get("l1_norm") or case.claims.get("alpha_l1_norm") or 0.0
    price = (case.claims.get("l1") or 0.0) * norm
    return max(FAR * max(abs(objective), case.claims.get("margin_cap") or 0.0), ROUNDING * price)


def retried(case: Case) -> Finding | None:
    """One solver gave no answer, and the other did."""
    again = [(name, one) for name, one in _programs(case) if one.get("attempts", 1) > 1]
    if not again:
        return None
    name, one = again[0]
    first = OTHER.get(one["solver"], "the first solver")
    return Finding(
        "solver-retried",
        f"{first} gave no answer to the program {name!r}, and {one['solver']} did, after {one['seconds']:.1f} s in all. The "
        "answer is as good as its proof.",
        f'solver="{one["solver"]}" asks it first.',
    )
