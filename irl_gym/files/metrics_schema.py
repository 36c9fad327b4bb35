"""What metrics.json and certificate.json hold: see `run_schema`."""

from typing import Annotated, Any, Literal, NotRequired

from pydantic import AfterValidator, Field
from typing_extensions import TypedDict

from irl_gym.files.run_schema import Count, Lost, Number, Pair, StatusName, Text

TOGETHER = {
    "n_features": ("rank",), "expressible": ("n_features", "states"), "regret": ("regret_error",),
    "gaps": ("gap_errors", "regret", "truncation", "horizon", "n_features"), "loss_low": ("expert_optimal",),
    "distance": ("distance_error",), "worst_tie_regret": ("worst_tie_regret_share",),
}  # fmt: skip
"""Of what a learner says of its reward: entries that are read with another."""


def _together(told: Any) -> Any:
    """Refuse entries without those that are read with them."""
    for one, others in TOGETHER.items():
        lacking = [other for other in others if one in told and other not in told]
        if lacking:
            raise ValueError(f"{lacking[0]} beside {one}")
    return told


def _gaps(told: Any) -> Any:
    """Refuse a reward that is judged by sampled values without as many errors as gaps."""
    gaps, errors = told.get("gaps", ()), told.get("gap_errors", ())
    if len(gaps) != len(errors) or ("regret" in told) is not bool(gaps):
        raise ValueError("as many gaps as gap_errors, and one at least where there is a regret")
    return told


class RewardEntries(TypedDict, total=False):
    """What is known of a reward, whichever learner it is of."""

    zero: bool
    errs: bool
    inferred: bool
    expressible: bool
    fell_short: bool
    objective: Number | None
    duality_gap: Number | None
    l1: Number
    slack: Number | None
    lambda_0: Number | None
    margin_cap: Number | None
    l1_norm: Number
    least_l1_norm: Number | None
    alpha_l1_norm: Number
    loss_low: Number | None
    loss_bound: Number | None
    loss_share: Number | None
    worst_violation: Number
    sampling_error: Number | None
    standard_error: Number | None
    regret: Number
    regret_error: Number | None
    distance: Number
    distance_error: Number | None
    truncation: Number
    horizon: Count
    optimal_within: bool | None
    loss_within: Number | None
    n_features: Count
    rank: Count
    trivial: Count
    left_out: Count


class _Part(RewardEntries, total=False):
    expert_optimal: bool | None
    degenerate: bool
    states: Count
    margin: list[Number | None]
    gaps: list[Number]
    gap_errors: list[Number | None]
    unbreakable_rows: list[Pair]
    inseparable: list[Count]
    marginless: list[Count]
    unbreakable: list[Count]
    unconstrained: list[Count]
    undecided: list[Count]
    unknown: list[Count]
    unsettled: list[Count]
    violated: list[Count]


CertificatePart = Annotated[_Part, AfterValidator(_together), AfterValidator(_gaps)]


class Proved(TypedDict):
    """What a learner proves, of `Outcome.proved`."""

    terms: CertificatePart
    own: dict[str, Any]


class Certificate(TypedDict):
    """certificate.json, of `certificates.certificate_of`, but for its facts, which `facts.facts_of` reads."""

    optimality: CertificatePart | None
    proof: Proved


class _Rewarded(RewardEntries):
    learner: Text
    status: StatusName
    expert_optimal: NotRequired[bool | None]
    degenerate: NotRequired[bool]
    rounds: NotRequired[Count]
    best_round: NotRequired[Count]
    states: NotRequired[Count]
    inseparable_states: NotRequired[Count]
    marginless_states: NotRequired[Count]
    unbreakable_states: NotRequired[Count]
    unconstrained_states: NotRequired[Count]
    undecided_states: NotRequired[Count]
    unknown_states: NotRequired[Count]
    unsettled_states: NotRequired[Count]
    violated_states: NotRequired[Count]
    reward_on: NotRequired[Literal["state", "state-action"]]
    worst_tie_value: NotRequired[Number]
    worst_tie_regret: NotRequired[Number]
    worst_tie_regret_share: NotRequired[Number | None]
    starc: NotRequired[Number | None]
    epic: NotRequired[Number | None]


class Row(TypedDict):
    """How good a policy is."""

    value: Number
    score: Number | None
    mean_return: Number
    return_low: Number | None
    return_high: Number | None
    agreement: Number | None
    how: Text
    expected_return: NotRequired[Number | None]
    return_share: NotRequired[Number | None]
    sampled_value: NotRequired[Number]
    sampled_low: NotRequired[Number | None]
    sampled_high: NotRequired[Number | None]
    loses_at_most: NotRequired[Number | None]


def _with_references(rows: Any) -> Any:
    """Refuse rows that lack one of those that others are measured by."""
    lacking = [name for name in ("expert", "random") if name not in rows]
    if lacking:
        raise ValueError(f"a policy {lacking[0]}")
    if len({*rows} - {"clone"}) < 3:
        raise ValueError("a policy that is judged, beside expert and random")
    return rows


class Worth(TypedDict):
    """The interval of the expert's value."""

    episodes: Count | None
    low: Number | None
    high: Number | None


class CheckEntry(TypedDict):
    """How a table was checked, of `SelfCheck`."""

    steps: Count
    p_value: Number
    episodes: NotRequired[Count]


class Sized(TypedDict):
    """How big a table is, and how far it is to be trusted."""

    states: Count
    reachable: Count
    actions: Count
    transitions: Count
    exact: bool
    method: Text
    checked: Text | None
    check: CheckEntry | None
    horizon: NotRequired[Count | None]
    limit: NotRequired[Count]
    split: NotRequired[Count]
    counted: NotRequired[bool]
    error: NotRequired[Number | None]
    errors: NotRequired[list[Annotated[list[Text], Field(min_length=2, max_length=2)]]]
    hidden_state: NotRequired[Text | None]


class Demonstrated(Lost):
    """What was shown of the expert."""

    episodes: Count
    given: bool
    episodes_only: bool
    no_clone: NotRequired[Text]
    trained_return: NotRequired[Number]
    vecnormalize: NotRequired[bool]


TrainingEntry = TypedDict("TrainingEntry", {
    "environment_steps": Count, "resumed_at": NotRequired[list[Count]],
    "steps_to_0.9": Count | None, "steps_to_0.99": Count | None,
})  # fmt: skip


class Metrics(TypedDict):
    """metrics.json, of `scorecard.scorecard`."""

    policies: Annotated[dict[Annotated[str, Field(max_length=200)], Row], AfterValidator(_with_references)]
    reward: Annotated[_Rewarded, AfterValidator(_together)]
    training: TrainingEntry
    table: Sized | None
    demonstrations: Demonstrated
    score_reason: NotRequired[Text | None]
    expert_value: NotRequired[Worth]
