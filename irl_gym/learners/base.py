"""What every learner is and gives: a frozen record of hyper-parameters, and a frozen outcome."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Generic, Protocol, TypeVar, runtime_checkable

from irl_gym.checks import checked_number
from irl_gym.facts import Fact
from irl_gym.features.linear_reward import LinearReward
from irl_gym.mdp.policies import Policy
from irl_gym.mdp.rewards import TabularReward
from irl_gym.programs.solvers import Status, check_solving


@runtime_checkable
class Proof(Protocol):
    """What every learner proves of its program; each learner's says more."""

    @property
    def objective(self) -> float:
        """The program's objective at the reward, recomputed."""
        ...

    @property
    def duality_gap(self) -> float:
        """How far the reward can be from the program's optimum."""
        ...

    def facts(self) -> tuple[Fact, ...]:
        """What it says, in sentences."""
        ...

    def to_json(self) -> dict[str, Any]:
        """As json holds it."""
        ...


AnyReward = TypeVar("AnyReward", TabularReward, LinearReward)
AnyProof = TypeVar("AnyProof", bound=Proof)


@dataclass(frozen=True, eq=False)
class IRLResult(Generic[AnyReward, AnyProof]):
    """A learned reward, and what the learner proves of it."""

    reward: AnyReward
    """(S,) paid on arrival, (S, A), or alpha . phi paid on arrival."""
    status: Status
    """What became of the program; `status.sentence` says it."""
    proof: AnyProof
    """What the learner proves of its program, such as a FiniteProof; what the reward says of the expert, `certify` tells."""
    stats: Mapping[str, Any] = field(default_factory=dict)
    """Solver, seconds, iterations, program by program."""
    policy: Policy | None = None
    """A policy planned for the reward, where learning made one."""

    def facts(self) -> tuple[Fact, ...]:
        """What became of the program, and what the proof says."""
        mood = "plain" if self.status is Status.OPTIMAL else "open" if self.status is Status.INACCURATE else "bad"
        return (Fact("status of the program", self.status.sentence, mood), *self.proof.facts())

    def record(self) -> dict[str, Any]:
        """What a run's folder keeps beside the reward and the certificate, as json holds it: NaN becomes None."""
        return without_nan({"status": self.status.value, "stats": dict(self.stats)})


@runtime_checkable
class Learner(Protocol):
    """Turns a world without reward and an expert into a reward.

    The loop gives `fit` a table and what is known of the expert's policy, unless the learner says in `takes` what else: names
    of parts of the loop (`irl_gym.loop.loop.Loop`), the first two in this order, any other by its name.
    """

    def fit(self, world: Any, expert: Any, /) -> IRLResult[Any, Any]:
        """Learn a reward under which the expert is optimal: of a table and a policy, or of a simulator and episodes."""
        ...


def takes(learner: Learner) -> tuple[str, ...]:
    """The parts of the loop that a learner's `fit` is given."""
    return getattr(learner, "takes", ("mdp", "known_expert"))


def without_nan(value: Any) -> Any:
    """None for NaN, at any depth of mappings and lists: json has no other word for a number that is not known."""
    if isinstance(value, Mapping):
        return {key: without_nan(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [without_nan(one) for one in value]
    return None if isinstance(value, float) and math.isnan(value) else value


def check_weighing(learner: Any) -> None:
    """Check the fields that learners of linear rewards share: penalty, l1, horizon, seed, solver and time_limit.

    Raises:
        InvalidParameter: one outside its range.
    """
    checked_number("penalty", learner.penalty, "a slope of at least 1, such as the paper's 2", least=1)
    checked_number("l1", learner.l1, "a number of at least 0", least=0)
    checked_number("seed", learner.seed, "a whole number of at least 0", least=0, whole=True)
    if learner.horizon is not None:
        checked_number("horizon", learner.horizon, "a number of steps of at least 1, or None", least=1, whole=True)
    check_solving(learner.solver, learner.time_limit)
