"""What the loop's command line asks for of learners: which one, and its options; an option of another one is refused."""

from dataclasses import dataclass, fields, is_dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal, cast, get_type_hints

from tyro.conf import Suppress, arg

from irl_gym.commands.terminal import UNSET
from irl_gym.errors import InvalidParameter, UnknownLearner
from irl_gym.runs.choices import TAKEN, FeatureName, PlannerName

if TYPE_CHECKING:
    import gymnasium as gym

    from irl_gym.features.feature_maps import FeatureMap
    from irl_gym.learners.linear_programs.feature import FeatureLP
    from irl_gym.learners.linear_programs.finite import FiniteLP
    from irl_gym.learners.linear_programs.trajectory import TrajectoryLP
    from irl_gym.learners.needs import Needs


@dataclass(frozen=True)
class Learning:
    """How the reward is recovered."""

    learner: str = "finite-lp"
    """finite-lp, feature-lp, trajectory-lp (Ng & Russell's sections 3 to 5), one more that `irl-gym learners` lists, or
    module:Class of your own; with --help its options show."""
    options: Annotated[tuple[str, ...], UNSET] = ()
    """Of any other learner: name=value ..., or one json object."""
    l1: float | Literal["auto"] = 0.0
    """Price of ||R||_1, of ||alpha||_1 with features: a number, or auto for just below lambda_0 (finite-lp)."""
    margin_cap: float | Literal["auto", "none"] = "auto"
    """finite-lp and feature-lp. Cap on margins: a number, auto, or none for the paper's own program."""
    slack: float | Literal["auto", "none"] = "auto"
    """finite-lp. Price of a violation, where a margin is worth 1; none: not at any price. auto: 1 for an expert of episodes."""
    reward_on: Literal["state", "state-action"] = "state"
    """finite-lp. What the recovered reward is a function of."""
    horizon: Annotated[int | None, UNSET] = None
    """finite-lp. Steps of an episode: the expert is the best in undiscounted sums of so many; the default is none."""
    features: FeatureName = "auto"
    """feature-lp and trajectory-lp. auto is one-hot for discrete observations, radial for others."""
    size: Annotated[int | None, UNSET] = None
    """Of the features: centres along each coordinate, Fourier order, or degree."""
    coordinates: Annotated[tuple[int, ...], UNSET] = ()
    """Values of each coordinate that a discrete observation is made of, such as 5 5 5 4 for Taxi."""
    sample: Annotated[int | None, UNSET] = None
    """feature-lp. States in S_0, drawn at random; the default is all."""
    rounds: Annotated[int | None, UNSET] = None
    """trajectory-lp. At most; the default is 30 on tables, 8 on environments that are stepped."""
    gap_cap: Literal["auto", "none"] = "none"
    """trajectory-lp. auto lets no policy that is far worse than the expert outweigh the others."""
    inner: Annotated[PlannerName | None, UNSET] = None
    """trajectory-lp. Who solves for each reward tried; the default is value-iteration on a table, else ppo."""
    time_limit: Annotated[float | None, UNSET] = None
    """Seconds for all of the learner's work, its proof included (not of clone, which only counts); the default is no limit."""

    def check(self, needs: "Needs | None" = None) -> None:
        """Check that no option is given which the learner does not have.

        Args:
            needs: of a learner of the user's own; None where that is not known yet.

        Raises:
            InvalidParameter: one that only others have.
        """
        taken = TAKEN.get(self.learner) or taken_by_own(needs)
        for one in fields(self):
            if one.name not in ("learner", *taken) and getattr(self, one.name) != one.default:
                flag, whose = one.name.replace("_", "-"), [name for name, names in TAKEN.items() if one.name in names]
                expected = " or ".join(whose) or "module:Class of your own"
                raise InvalidParameter(
                    f"--{flag} is {getattr(self, one.name)!r:.60}, but the learner is {self.learner}, which has no such "
                    f"option: expected {expected} with it. Leave it out."
                )

    @property
    def own(self) -> dict[str, Any]:
        """The options of a learner that is not one of Ng & Russell's.

        Raises:
            InvalidParameter: one is given twice, or is no option's value.
        """
        from irl_gym.runs.choices import parse_keywords

        found = parse_keywords(self.options, "options")
        if self.time_limit is not None and "time_limit" in found:
            twice = f"time_limit is {self.time_limit:g}, and {found['time_limit']!r:.40} among options"
            raise InvalidParameter(f"{twice}: expected it once. Leave one out.")
        return found if self.time_limit is None else {**found, "time_limit": self.time_limit}

    def phi(self, env: "gym.Env") -> "FeatureMap":
        """The features that are asked for."""
        from irl_gym.runs.named_parts import features_named

        return features_named(self.features, env, size=self.size, coordinates=self.coordinates or None)

    @property
    def cap(self) -> float | Literal["auto"] | None:
        """The margin cap as learners take it."""
        return None if self.margin_cap == "none" else self.margin_cap

    def finite(self, from_episodes: bool) -> "FiniteLP":
        """The learner of section 3."""
        from irl_gym.learners.linear_programs.finite import FiniteLP

        slack = 1.0 if from_episodes and self.reward_on == "state" else None
        if self.slack != "auto":
            slack = None if self.slack == "none" else self.slack
        return FiniteLP(
            l1=self.l1, margin_cap=self.cap, reward_on=self.reward_on, report_lambda_0=True, slack=slack,
            time_limit=self.time_limit, horizon=self.horizon,
        )  # fmt: skip

    def linear(self, env: "gym.Env", control: bool, seed: int) -> "FeatureLP | TrajectoryLP":
        """The learner of section 4 or 5."""
        from irl_gym.learners.linear_programs.feature import FeatureLP
        from irl_gym.learners.linear_programs.trajectory import TrajectoryLP

        phi, l1 = self.phi(env), cast("Any", self.l1)
        if self.learner == "feature-lp":
            return FeatureLP(phi, self.sample, margin_cap=self.cap, l1=l1, seed=seed, time_limit=self.time_limit)
        rounds = self.rounds if self.rounds is not None else 8 if control else 30
        gap_cap = "auto" if self.gap_cap == "auto" else None
        return TrajectoryLP(phi, gap_cap=gap_cap, l1=l1, max_rounds=rounds, seed=seed, time_limit=self.time_limit)


OF_PART = {"features": ("features", "size", "coordinates"), "environment": ("inner",)}
"""The options that make a part of the problem."""


def taken_by_own(needs: "Needs | None") -> tuple[str, ...]:
    """The options of a learner of the user's own: its own, and those of parts that it needs."""
    parts = OF_PART if needs is None else [part for part in OF_PART if part in needs.parts]
    return ("options", "time_limit", *(option for part in parts for option in OF_PART[part]))


def for_help(learner: str) -> type[Learning]:
    """The record without the options that a learner has not: what --help shows."""
    hints, taken, own = get_type_hints(Learning, include_extras=True), TAKEN.get(learner), dict[str, Any]()
    if taken is None:
        kind = _found(learner)
        taken = [one for one in taken_by_own(None if kind is None else kind.needs)
                 if one != "time_limit" or hasattr(kind, one)]  # fmt: skip
        own = {name: Annotated[hints[name], arg(help=_told(kind))] for name in ("options",)}
    others = [one for one in fields(Learning) if one.name not in ("learner", *taken)]
    made = {one.name: one.default for one in others}
    hidden = {one.name: Annotated[hints[one.name], Suppress] for one in others}
    told = {"__doc__": Learning.__doc__, "__module__": Learning.__module__, "__annotations__": hidden | own}
    return dataclass(frozen=True)(type("Learning", (Learning,), {**told, **made}))


def _found(learner: str) -> type[Any] | None:
    """The class of a learner; None where there is none of that name, which a run says."""
    from irl_gym.learners.registry import learner_class

    try:
        return learner_class(learner)
    except UnknownLearner:
        return None


def _told(kind: type[Any] | None) -> str:
    """What --help says of the options of a learner: each of its fields."""
    from irl_gym.records import documented

    how = "name=value ..., or one json object."
    if kind is None or not is_dataclass(kind):
        return how
    each = [f"{name}: {' '.join(text.split())}" for name, text in documented(kind).items()]
    return "\n".join([how, *each]) if each else f"{how} {kind.__name__} has none."
