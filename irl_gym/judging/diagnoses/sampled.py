"""What only the certificates of sampled learners know: features that cannot express, noise, cuts, a planner that fell short."""

import numpy as np

from irl_gym.judging.diagnoses.case import Case
from irl_gym.judging.diagnoses.findings import Finding, counted


def inexpressible(case: Case) -> Finding | None:
    """(10) with R = alpha . phi may have no solution but ties (Ng & Russell 2000, section 4)."""
    if case.claims.get("expressible", True):
        return None
    rank, K, states = case.claims["rank"], case.claims["n_features"], case.claims["states"]
    return Finding(
        "inexpressible",
        f"No reward in the span of the features makes the expert optimal in the {counted(states)} of the sample, but those "
        f"that tie it with everything: {K:,} features, of which the rows see {rank:,} directions.",
        "More or other features, one a state (OneHot) where the table is small; or FiniteLP, which needs none.",
        flags=("--features",),
    )


def noisy_rows(case: Case) -> Finding | None:
    """Rows of (10) that are means of rollouts have standard errors; a margin within two of them is noise."""
    error = case.claims.get("standard_error")
    margins = np.array([m for m in case.claims.get("margin", ()) if m is not None and m > 0], dtype=np.float64)
    if error is None or (margins.size and 2 * error <= np.median(margins)):
        return None
    typical = f"where the typical one is {np.median(margins):.2g}" if margins.size else "and no margin is above 0"
    return Finding(
        "noisy-rows",
        f"The margins are means of too few rollouts: a row's standard error is up to {error:.2g}, {typical}.",
        "More samples: four times as many halve the error.",
    )


def _noiseless(case: Case) -> bool:
    """Are there values of which no error is known, as a single episode has none?"""
    return case.claims.get("regret_error") is None or None in case.claims.get("gap_errors", ())


def fell_short(case: Case) -> Finding | None:
    """The planned policy is worse than the expert under the very reward that it was planned for: planning failed."""
    if "regret" not in case.claims or case.claims.get("zero") or _noiseless(case):
        return None
    regret, error = case.claims["regret"], case.claims["regret_error"]
    if regret >= -2 * error - 1e-9:
        return None
    return Finding(
        "planner-fell-short",
        f"The policy planned for the reward earns {-regret:.3g} less than the expert under that reward, standard error "
        f"{error:.2g}: the planner fell short, so what it says of the reward is too little.",
        "A stronger `inner` planner: more total_timesteps, or ValueIteration() where there is a table.",
        flags=_stronger(case),
    )


def _stronger(case: Case) -> tuple[str, ...]:
    """The flags of a stronger inner planner; none where it is exact already."""
    if case.stats.get("exact_planner"):
        return ()
    return ("--total-timesteps",) if case.mdp is None else ("--inner value-iteration",)


def beaten(case: Case) -> Finding | None:
    """(12) V^pi* >= V^pi_k: a policy that beats the expert under R shows that R is not yet the expert's."""
    if "regret" not in case.claims or case.claims.get("zero") or _noiseless(case):
        return None
    regret, error = case.claims["regret"], case.claims["regret_error"]
    worst = min(zip(case.claims["gaps"], case.claims["gap_errors"], strict=True), key=lambda one: one[0] + 2 * one[1])
    if regret <= 2 * error + 1e-9 and worst[0] >= -2 * worst[1] - 1e-9:
        return None
    if regret > 2 * error + 1e-9:
        told = f"the policy planned for it earns {regret:.3g} more than the expert, standard error {error:.2g}"
    else:
        told = f"a policy found before earns {-worst[0]:.3g} more than the expert, standard error {worst[1]:.2g}"
    return Finding(
        "expert-beaten",
        f"The expert is not best under the reward: {told}.",
        "More rounds (max_rounds, patience), or richer features; if the expert errs, nothing.",
        flags=("--rounds",),
    )


def drowned(case: Case) -> Finding | None:
    """Gaps within two standard errors cannot be told from none: too few trajectories."""
    gaps, errors = case.claims.get("gaps"), case.claims.get("gap_errors")
    if gaps is None or errors is None or case.claims.get("zero"):
        return None
    shown = case.stats.get("expert_episodes")
    mend = "More episodes of the expert, and more trajectories a policy: four times as many halve the error."
    if _noiseless(case):
        whose = "the expert showed one" if shown == 1 else "the expert, or each policy, has one"
        told = f"One episode tells no noise, and {whose}: the value gaps, up to {max(gaps):.3g}, may be chance."
        return Finding("too-few-trajectories", told, mend, flags=("--episodes",))
    if any(g > 2 * e for g, e in zip(gaps, errors, strict=True)):
        return None
    few = f"; the expert showed {counted(shown, 'episode')}" if shown else ""
    told = f"the largest is {max(gaps):.3g}, and standard errors are up to {max(errors):.2g}{few}"
    return Finding("too-few-trajectories", f"The value gaps drown in noise: {told}.", mend, flags=("--episodes",))


def cut_short(case: Case) -> Finding | None:
    """Cutting at H changes a value by gamma^(H+1) R_max / (1 - gamma) at most (Ng & Russell 2000, footnote 2)."""
    gaps, truncation = case.claims.get("gaps"), case.claims.get("truncation")
    if gaps is None or truncation is None or case.claims.get("zero"):
        return None
    dropped, largest = case.stats.get("episodes_dropped", 0), max(gaps)
    if truncation <= largest and not dropped:
        return None
    told = f" Dropped, since cut off before: {counted(dropped, 'episode')}." if dropped else ""
    return Finding(
        "cut-short",
        f"Trajectories were cut after {counted(case.claims['horizon'], 'step')}, which can change a value by {truncation:.3g}; "
        f"the largest gap between expert and others is {largest:.3g}.{told}",
        "A longer horizon, and episodes of the expert that last as long or end.",
    )
