"""What the terminal says of a recovered reward: what all learners know, then what each one's certificate knows."""

from collections.abc import Iterator, Mapping
from typing import Any

from irl_gym.optimality import told_record
from irl_gym.page.compared import DISTANCES
from irl_gym.sampling_error import estimated_table
from irl_gym.shares import MUCH

ROUNDING = 1e-12
"""A distance from the best possible up to this is none."""
HARM = 1e-6
"""Share of the expert's advantage over random below which a tie costs nothing but rounding."""


def told_of_reward(reward: Mapping[str, Any], metrics: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """What is said of the reward, line by line: what all learners know, then what each one's certificate knows."""
    if not reward["status"].startswith("Optimal"):
        yield "status", reward["status"]
    best = f"yes, against {reward['rounds'] + 1} policies" if "fell_short" in reward else "yes"
    seen = metrics["demonstrations"]["episodes_only"] and "fell_short" not in reward
    judged = "; judged are the actions most frequent in its episodes" if seen else ""
    optimal = told_record(reward) or (best if reward["expert_optimal"] else _why_not(reward))
    yield "expert optimal under it", f"{optimal}{judged}"
    table = metrics["table"] or {}
    if not table.get("exact", True):
        yield "judged on", estimated_table(table, reward)
    if reward.get("unsettled_states"):
        told = "there a margin is within its sampling error, and may be noise. Try more steps to count."
        yield "states the counts leave open", f"{reward['unsettled_states']:,}: {told}"
    if reward.get("unknown_states"):
        of_all = f"{reward['unknown_states']:,} of {metrics['table']['reachable']:,}"
        yield "states where it was not seen", f"{of_all}: nothing is asked of its actions there"
    if reward["degenerate"]:
        yield "degenerate", "R is zero, or ties the expert with every action, or every policy found"
    if "worst_tie_regret" in reward:
        yield "worst-tie regret", _worst_tie(reward)
    known = [f"{name} {reward[key]:.2f}" for name, key in DISTANCES.items() if reward.get(key) is not None]
    if known:
        yield (
            "distance from the true one",
            f"{', '.join(known)}; 0 ranks all policies alike, 0.71 is unrelated; the best can agree in spite of it",
        )
    yield from {"FiniteLP": _told_finite, "FeatureLP": _told_feature, "TrajectoryLP": _told_trajectory}[reward["learner"]](
        reward
    )


def _worst_tie(reward: Mapping[str, Any]) -> str:
    """What the worst tie loses, where there is a scale to say it on."""
    share = reward["worst_tie_regret_share"]
    if share is None:
        return "not known, as there is no score"
    regret, of_range = _zero(reward["worst_tie_regret"]), f", {abs(share):.2%} of what the expert has over random"
    beware = "; how an agent breaks ties decides what it earns" if share > MUCH else ""
    return f"{regret:.4g}{of_range}{beware}" if regret >= 0 else f"none: it gains {-regret:.4g}{of_range}"


def _zero(value: float) -> float:
    """A loss, without the sign of rounding."""
    return 0.0 if abs(value) < 1e-9 else value


def _why_not(reward: Mapping[str, Any]) -> str:
    if "regret" in reward:
        noise = reward["regret_error"]
        give = ", and one episode tells no noise" if noise is None else f" +- {noise:.2g}"
        return f"no: the policy planned for it gains {reward['regret']:.3g}{give} over the expert"
    return "NO: see certificate.json"


def _told_finite(reward: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    lambda_0 = "not computed" if reward["lambda_0"] is None else f"{reward['lambda_0']:.5g}"
    yield "lambda, lambda_0", f"{reward['l1']:.5g}, {lambda_0}"
    cap = reward["margin_cap"]
    yield "margin cap", "none (Ng & Russell's own program)" if cap is None else f"{cap:.4g}"
    gap = reward["duality_gap"]
    yield "margins short of the most by", "unknown" if gap is None else f"at most {gap:.1e}" if gap > ROUNDING else "none"
    if reward["least_l1_norm"] is not None:
        above = max(reward["l1_norm"] - reward["least_l1_norm"], 0.0)
        how = f"at most {above:.1e} above the least" if above > ROUNDING else "the least"
        yield "||R||_1", f"{reward['l1_norm']:.4g}, {how} with these margins"
    if reward.get("zero"):  # it ties everything, and the status says why
        return
    ties = reward["marginless_states"] - reward["violated_states"]
    if ties > 0:
        other = " Try --reward-on state-action." if reward.get("reward_on") == "state" else ""
        mend = " Try --margin-cap auto --l1 0." if cap is None or reward["l1"] > 0 else other
        yield "states where it leaves ties", f"{ties}: the expert has no margin there.{mend}"
    if reward.get("unbreakable_states"):
        kind = "state reward" if reward.get("reward_on") == "state" else "reward"
        told = f"there no {kind} that makes the expert optimal prefers its action to some other."
        yield "states with lasting ties", f"{reward['unbreakable_states']}: {told}"
    if reward["inseparable_states"]:
        share = reward.get("worst_tie_regret_share")
        mend = " Try --reward-on state-action." if share is not None and share > HARM else ""
        mend = " Nothing is lost by it." if share is not None and share <= HARM else mend
        yield "states it cannot settle", f"{reward['inseparable_states']}: there an action has the expert's successors.{mend}"


def _told_feature(reward: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    yield "features", f"{reward['n_features']}, the rows have rank {reward['rank']}"
    yield "sample", f"{reward['states']:,} states; {reward['trivial']:,} more have nothing to compare"
    cap, gap = reward["margin_cap"], max(reward["duality_gap"], 0.0)
    yield "margin cap", "none (Ng & Russell's own program)" if cap is None else f"{cap:.4g}"
    yield "objective", f"{reward['objective']:.5g}, at most {gap:.1e} below the optimum"
    if reward.get("unbreakable_states"):
        told = "there no reward in the span of the features that makes the expert optimal prefers its action to some other."
        yield "states with lasting ties", f"{reward['unbreakable_states']}: {told}"
    if not reward["expressible"]:
        yield "expressible", "NO: no reward in the span of the features makes the expert optimal. Try more --features"


def _told_trajectory(reward: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    yield "features", f"{reward['n_features']}"
    yield "best round", f"{reward['best_round']} of {reward['rounds']}, by its policy's distance to the expert"
    noise = (
        "one episode tells no noise"
        if reward["distance_error"] is None
        else f"noise alone makes about {reward['distance_error']:.2g}"
    )
    yield "distance", f"{reward['distance']:.4g}; {noise}"
    if reward["fell_short"]:
        yield "planner", f"fell short of the expert by {-reward['regret']:.3g} under the reward it planned for"
    yield (
        "trajectories",
        f"cut after {reward['horizon']} steps, which changes a value under R by {reward['truncation']:.2g} at most",
    )
