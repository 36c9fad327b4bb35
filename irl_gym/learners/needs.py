"""What a learner has to be given: Table 1 of the lecture notes (2.1.3) as a declaration.

    variable                     passive    active     interactive      part of a `Problem`
    demonstrations D*            yes        yes        optional         demonstrations; or the expert, whose policy is all
    environment, dynamics T      no         yes        yes              environment, dynamics
    oracle pi*                   no         no         yes              oracle
    reward R                     no         optional   optional         reward
Who needs an oracle is interactive, who needs an environment or its dynamics active, who needs neither passive. A reward that is
required moves nobody: Table 1 has no column for who reads it and needs no environment. Demonstrations are sequences of states,
or of states and actions (lecture notes 2.1.2): `actions` says whether a learner can do with the first.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

from irl_gym.errors import InvalidParameter, MissingPart
from irl_gym.learners.problem import Problem
from irl_gym.mdp.episodes import Episode
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.records import Record

Column = Literal["passive", "active", "interactive"]
Part = Literal[
    "demonstrations", "expert", "environment", "oracle", "dynamics", "reward", "features", "gamma", "horizon", "also"
]
PARTS: tuple[str, ...] = get_args(Part)
OfActions = Literal["needed", "inferred", "not read"]
OR = " or "

TO_GET = {
    "demonstrations": "the expert's episodes, such as `read_minari(id)` or `collect(env, policy, n)` gives",
    "expert": "the expert's policy, such as `value_iteration(mdp, reward).policy`",
    "environment": "a world that can be run and solved, such as `Simulator(env, SB3(), gamma)`",
    "oracle": "somebody who answers what the expert does, such as `Oracle(policy)`",
    "dynamics": "a table, such as `tabulate(env, gamma=0.99).mdp`, or a `GenerativeModel(env, gamma)`",
    "reward": "the true reward, such as `tabulate(env, gamma=0.99).reward`",
    "features": "phi of observations, such as `RadialBasis.grid(low, high, 5)`",
    "gamma": "a discount between 0 and 1",
    "horizon": "a number of steps",
    "also": "further problems that share the reward",
}
"""What each part is, and how it is had."""


@dataclass(frozen=True)
class Needs(Record):
    """The parts of a `Problem` that a learner reads; what is not named here it does not look at.

    Raises:
        InvalidParameter: a word that is no part of a problem, or a part that is named twice.
    """

    required: tuple[str, ...]
    """Parts without which nothing is learned; of "expert or demonstrations" one is enough, the first that there is is read."""
    optional: tuple[str, ...] = ()
    """Parts that are read where there are some."""
    actions: OfActions = "needed"
    """Those of the demonstrations: needed; inferred where they are missing, if the dynamics are a table; or never read."""

    def __post_init__(self) -> None:
        if self.actions not in get_args(OfActions):
            raise InvalidParameter(f"actions are {self.actions!r:.60}: expected one of {', '.join(get_args(OfActions))}.")
        for one in self.parts:
            if one not in PARTS:
                raise InvalidParameter(f"a learner needs {one!r}: expected one of {', '.join(PARTS)}, or two joined by 'or'.")
            if self.parts.count(one) > 1:
                raise InvalidParameter(f"a learner needs {one!r} twice: expected each part once.")

    @property
    def parts(self) -> tuple[str, ...]:
        """All parts that are read, where they are there."""
        return (*(one for part in self.required for one in part.split(OR)), *self.optional)

    @property
    def unused(self) -> tuple[str, ...]:
        """Parts that are never looked at."""
        return tuple(one for one in PARTS if one not in self.parts)

    @property
    def column(self) -> Column:
        """The learner's column of Table 1."""
        if "oracle" in self.required:
            return "interactive"
        asked = [{*part.split(OR)} for part in self.required]
        return "active" if any(part <= {"environment", "dynamics"} for part in asked) else "passive"

    def lacking(self, given: Collection[str]) -> str | None:
        """The first part that is required and not given, as it was declared; None where all are."""
        return next((part for part in self.required if not {*given} & {*part.split(OR)}), None)

    def worked_out(self, parts: Mapping[str, Callable[[], Any]]) -> dict[str, Any]:
        """What a learner reads, by name, where parts cost something: of two of which one is enough no more than one.

        Args:
            parts: by name, how each is had; None where it is not there.
        """
        found: dict[str, Any] = {}
        for part in (*self.required, *self.optional):
            for one in part.split(OR):
                found[one] = parts[one]()
                if not _absent(found[one]):
                    break
        return found

    def of(self, problem: Problem, learner: Any) -> Problem:
        """The problem without the parts that are unused.

        Args:
            problem: what is known.
            learner: who needs it, for the error.

        Raises:
            MissingPart: it lacks a part that is required.
            InvalidDemonstrations: episodes without actions, where these are needed.
        """
        given = {one for one in PARTS if not _absent(getattr(problem, one))} | ({"gamma"} if problem.discount else set())
        if (lacks := self.lacking(given)) is not None:
            how = "; or ".join(TO_GET[one] for one in lacks.split(OR))
            raise MissingPart(f"{type(learner).__name__} needs {lacks}, and the problem has {_listed(given)}: expected {how}.")
        later = {one for part in self.required for one in [one for one in part.split(OR) if one in given][1:]}
        kept = {} if "gamma" in self.unused else {"gamma": problem.discount}
        found = replace(problem, **{one: () if one == "also" else None for one in (*self.unused, *later)}, **kept)
        return self.with_actions(found, learner)

    def with_actions(self, problem: Problem, learner: Any) -> Problem:
        """A problem without unused parts, checked: its episodes have actions where the learner cannot do without.

        Of episodes that are read from files as they are asked for, the first is looked at.

        Raises:
            InvalidDemonstrations: one has none; it is named.
        """
        given: Any = problem.demonstrations or ()
        if self.actions == "not read" or (self.actions == "inferred" and isinstance(problem.dynamics, TabularMDP)):
            return problem
        for number, one in enumerate(given if isinstance(given, list | tuple) else given[:1]):
            if isinstance(one, Episode):
                one.taken(f"{type(learner).__name__} needs actions, and episode {number}")
        return problem


def _absent(part: Any) -> bool:
    return part is None or (isinstance(part, tuple) and not part)


def _listed(given: set[str]) -> str:
    return ", ".join(one for one in PARTS if one in given) or "nothing but spaces"
