"""What every learner is and gives: a frozen record of hyper-parameters, and a frozen outcome."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, is_dataclass, replace
from typing import Any, ClassVar, Generic, Protocol, TypeVar, runtime_checkable

import numpy as np

from irl_gym.demonstrations.inferred import Inferred
from irl_gym.errors import InvalidParameter, InvalidReward, a_type
from irl_gym.facts import Fact, Mood
from irl_gym.features.linear_reward import LinearReward
from irl_gym.learners.needs import Needs
from irl_gym.learners.problem import Problem
from irl_gym.mdp.rewards import TabularReward
from irl_gym.programs.status import Status
from irl_gym.records import Record


@runtime_checkable
class Proof(Protocol):
    """What every learner says of its program, or of what it did; each says more.

    The library's own say in `known` that the entries of `to_json` are those that it reads by name. Of any other proof they are
    kept in a place of their own, whatever they are called.
    """

    def facts(self) -> tuple[Fact, ...]:
        """What it says, in sentences."""
        ...

    def to_json(self) -> dict[str, Any]:
        """As json holds it."""
        ...


AnyReward = TypeVar("AnyReward", bound=TabularReward | LinearReward | None)
AnyLearner = TypeVar("AnyLearner")
AnyProof = TypeVar("AnyProof", bound=Proof)


@dataclass(frozen=True, eq=False)
class Outcome(Record, Generic[AnyReward, AnyProof]):
    """What was learned, a reward or a policy or both, and what the learner proves of it.

    Raises:
        InvalidParameter: neither a reward nor a policy; or a status, a proof, notes or a policy that is none.
        InvalidReward: a reward that is none.
    """

    reward: AnyReward
    """(S,) paid on arrival, (S, A), or alpha . phi paid on arrival; None of a learner of policies."""
    status: Status
    """What became of the program, or that there was none; `status.sentence` says it."""
    proof: AnyProof
    """What the learner proves of its program, such as a FiniteProof; what the reward says of the expert, `certify` tells."""
    stats: Mapping[str, Any] = field(default_factory=dict)
    """Solver, seconds, iterations, program by program."""
    policy: Any = None
    """Of a table (S,) actions, (S, A) probabilities, or what has `predict`, whose deterministic actions a run keeps; without a
    table what has `predict`, of observations and of batches. There a run keeps agents of SB3 (`irl_gym.agents.planners.Agent`);
    any other policy is learned again where a run is continued. None of a learner of rewards alone."""
    labelled: Any = None
    """Of a learner that asks, the episodes in which it did, if there were some (`LabelledEpisode`); a run keeps them as a
    Minari dataset, and so does `irl_gym.learners.interactive.labelled.write_labelled`."""
    inferred: Inferred | None = None
    """How the actions of demonstrations were inferred that have states alone; None where none were."""

    def __post_init__(self) -> None:
        if not isinstance(self.reward, TabularReward | LinearReward | None):
            raise InvalidReward(f"the reward is {a_type(self.reward)}: expected a TabularReward or a LinearReward.")
        if not isinstance(self.status, Status):
            raise InvalidParameter(f"status is {self.status!r:.80}: expected a Status, such as Status.LEARNED.")
        if not isinstance(self.proof, Proof):
            raise InvalidParameter(f"proof is {a_type(self.proof)}: expected `facts()` and `to_json()`.")
        if not isinstance(self.stats, Mapping):
            raise InvalidParameter(f"stats is {self.stats!r:.80}: expected notes by name.")
        if isinstance(self.policy, type):
            raise InvalidParameter(f"policy is the class {self.policy.__name__}: expected a policy that was made of it.")
        if self.reward is None and self.policy is None:
            raise InvalidParameter("reward and policy are None: expected what was learned, at least one of the two.")

    def facts(self) -> tuple[Fact, ...]:
        """What became of the program, and what the proof says.

        Raises:
            InvalidParameter: the proof says something else than facts.
        """
        moods: dict[Status, Mood] = {Status.OPTIMAL: "plain", Status.LEARNED: "plain", Status.INACCURATE: "open"}
        label = "status" if self.status is Status.LEARNED else "status of the program"
        told = Fact(label, self.status.sentence.removesuffix("."), moods.get(self.status, "bad"))
        proved = self.proof.facts()
        if not (isinstance(proved, tuple | list) and all(isinstance(one, Fact) for one in proved)):
            raise InvalidParameter(f"{type(self.proof).__name__}.facts() gave {proved!r:.80}: expected a tuple of `Fact`.")
        return (told, *(() if self.inferred is None else self.inferred.facts()), *proved)

    def proved(self) -> dict[str, Any]:
        """What a certificate keeps of the proof: its facts, the terms that are read by name, and entries of another's own."""
        told, known = self.proof.to_json(), getattr(self.proof, "known", False)
        facts = [one.to_json() for one in Outcome.facts(self)]  # whatever a class of somebody's own makes of them
        return {"facts": facts, "terms": told if known else {}, "own": {} if known else told}

    def record(self) -> dict[str, Any]:
        """What a run's folder keeps beside the reward and the certificate, as json holds it: NaN becomes None."""
        return without_nan({"status": self.status.value, "stats": dict(self.stats)})


@runtime_checkable
class Learner(Protocol):
    """Learns from what is known of an expert and a world: a frozen record of hyper-parameters.

    It may say in `how` how its policy comes about; in `on_rows` that its policy is one of a table's rows; and in
    `resumes` that `learn` takes a `folder` besides, in which it keeps what it has, and from which it goes on; and in
    `of_feasible_set` that its reward is one of all those under which the expert is optimal, so that these are examined: then it
    has `r_max` and `reward_on`, as FiniteLP has.
    """

    needs: ClassVar[Needs]
    """The parts of a problem that it reads."""

    def learn(self, problem: Problem, rng: np.random.Generator) -> Outcome[Any, Any]:
        """Learn a reward, a policy, or both.

        Args:
            problem: what is known.
            rng: of what is drawn, but for a learner that has a seed of its own.

        Raises:
            MissingPart: the problem lacks a part that is needed.
        """
        ...


def checked_learner(learner: Any) -> Any:
    """A learner as it is.

    Raises:
        InvalidParameter: it is none, or the class of one, or no record whose fields a run can keep.
    """
    if not is_dataclass(learner) or isinstance(learner, type) or not isinstance(learner, Learner):
        what = "a frozen dataclass with `needs` and `learn`, such as FiniteLP()"
        raise InvalidParameter(f"learner is {learner!r:.80}: expected {what}.")
    return learner


def featured(learner: AnyLearner, problem: Problem) -> AnyLearner:
    """A learner with the features of a problem, where it has none of its own.

    Raises:
        MissingPart: nor has the problem.
    """
    if getattr(learner, "features", None) is not None:
        return learner
    told: Any = learner
    return replace(told, features=Needs(("features",)).of(problem, learner).features)


def without_nan(value: Any) -> Any:
    """None for NaN, at any depth of mappings and lists: json has no other word for a number that is not known."""
    if isinstance(value, Mapping):
        return {key: without_nan(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [without_nan(one) for one in value]
    return None if isinstance(value, float) and math.isnan(value) else value
