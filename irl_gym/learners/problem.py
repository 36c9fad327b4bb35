"""What is known of an expert and a world: A_IL: <D*, pi*, T, R> -> pi (lecture notes 2.1.2), each part optional.

    demonstrations   D*, the expert's episodes, with their actions or of states alone
    expert           its policy, known in advance: the complete policy of Ng & Russell's section 3, NaN where it is not known
    oracle           pi* that may be asked, and counts how often
    environment      a world that can be run; with a planner, solved for a reward
    dynamics         T: a table, or a generative model
    reward           R, where it is known
    features         phi, of which the reward is to be made
    spaces           how observations and actions are numbered: always there
Which learner needs which, and in which column of Table 1 that puts it, is declared in `irl_gym.learners.needs`.
Axes: S states, A actions.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol, runtime_checkable

import numpy as np
from gymnasium import spaces

from irl_gym._typing import Vector
from irl_gym.checks import checked_number
from irl_gym.demonstrations.inferred import Inferred
from irl_gym.demonstrations.shown import ShownPolicy, shown
from irl_gym.environments.generative import GenerativeModel
from irl_gym.errors import InvalidMDP, InvalidParameter, InvalidPolicy, MissingPart, a_type
from irl_gym.features.feature_maps import FeatureMap, as_features, check_length
from irl_gym.features.linear_reward import LinearReward
from irl_gym.mdp.episodes import EmpiricalPolicy, Episode, empirical_policy
from irl_gym.mdp.policies import Policy, as_distribution, completed
from irl_gym.mdp.rewards import TabularReward, as_reward
from irl_gym.mdp.tabular_mdp import TabularMDP, check_discount
from irl_gym.records import Record, short
from irl_gym.spaces.states import StateIndex, States
from irl_gym.tables.tabulation import Tabulation


@runtime_checkable
class World(Protocol):
    """A world that can be run and solved for a reward; `irl_gym.agents.simulator.Simulator` is one.

    It may have a `limit`, the steps after which it cuts episodes, and an `env`, of which copies can be stepped.
    """

    @property
    def gamma(self) -> float:
        """Discount."""
        ...

    def plan(self, reward: LinearReward, *, seed: int = 0) -> Policy:
        """A policy for a reward of observations."""
        ...

    def sums(self, policy: Policy | None, features: FeatureMap, n: int, *, horizon: int, seed: int) -> np.ndarray:
        """(N, K) sum_t gamma^t phi(s_t) of n episodes of a policy, random if None, cut after `horizon` steps."""
        ...


class Oracle:
    """An expert that can be asked, observation by observation; it counts its answers.

    Args:
        policy: what answers: what has `predict`, such as a TabularPolicy or an agent of SB3; or a function
            `(observation, info) -> action`. Actions count from 0.
        deterministic: passed to `predict`; False of an expert whose mistakes are drawn.
        gate: `(observation, info, action) -> bool`: does the expert take over, where a learner would do `action`? None of one
            that does not watch learners.
    """

    def __init__(
        self,
        policy: Policy | Callable[[Any, Mapping[str, Any]], Any],
        deterministic: bool = True,
        gate: Callable[[Any, Mapping[str, Any], int], Any] | None = None,
    ):
        if not isinstance(policy, Policy) and not callable(policy):
            raise InvalidParameter(
                f"the oracle's policy is {a_type(policy)}: expected one with `predict`, or a function (observation, "
                "info) -> action. A table of actions is one as `TabularPolicy(actions, states)`."
            )
        self.policy, self.deterministic, self.gate, self.queries = policy, deterministic, gate, 0

    def takes_over(self, observation: Any, info: Mapping[str, Any] | None, action: int) -> bool:
        """Does the expert act, where a learner would do `action`? Nobody is asked what is to be done: it is no query.

        Raises:
            InvalidPolicy: the gate's answer is neither True nor False; it is shown, with the observation.
        """
        assert self.gate is not None
        answer = self.gate(observation, {} if info is None else info, action)
        if not isinstance(answer, bool | np.bool_):
            raise InvalidPolicy(
                f"the gate's answer at observation {_told(observation)} is {answer!r:.80}: expected True or False."
            )
        return bool(answer)

    def ask(self, observation: Any, info: Mapping[str, Any] | None = None, *, n_actions: int | None = None) -> int:
        """What the expert does; one query more.

        Args:
            observation: as the environment shows it.
            info: what the environment tells besides; None where it is not run.
            n_actions: A, which the answer is checked against.

        Raises:
            InvalidPolicy: the answer is no action; it is shown, with the number of the query, from 1, and the observation.
        """
        self.queries += 1
        if isinstance(self.policy, Policy):
            answer = self.policy.predict(observation, deterministic=self.deterministic)[0]
        else:
            answer = self.policy(observation, {} if info is None else info)
        number = np.asarray(answer) if isinstance(answer, int | np.integer | np.ndarray) else np.zeros(0)
        if number.size == 1 and number.dtype.kind in "iu" and 0 <= (action := int(number.item())):
            if n_actions is None or action < n_actions:
                return action
        last = "" if n_actions is None else f" to {n_actions - 1}"
        raise InvalidPolicy(
            f"the oracle's answer to query {self.queries}, observation {_told(observation)}, is {answer!r:.80}: expected an "
            f"action, a whole number from 0{last}."
        )


def _told(observation: Any) -> str:
    """An observation in a few words."""
    return short(observation.item() if isinstance(observation, np.generic) else observation)


@dataclass(frozen=True)
class Spaces(Record):
    """How observations and actions are numbered."""

    observations: spaces.Space
    """What is observed."""
    actions: spaces.Space
    """What can be done."""
    states: States | None = None
    """Turns observations into rows of a table; None where there is no table, or observations are its rows."""


@dataclass(frozen=True, eq=False)
class Problem(Record):
    """What is known of an expert and a world.

    Raises:
        InvalidMDP, InvalidParameter: dynamics or environment that are none, or discounts that differ.
        InvalidDiscount: gamma outside (0, 1).
        InvalidPolicy, InvalidReward, InvalidFeatures: beside a table, an expert, a reward or features of another one. Episodes
            of another are refused by `seen`, which numbers them.
    """

    spaces: Spaces
    """How observations and actions are numbered."""
    demonstrations: Sequence[Episode] | None = None
    """The expert's episodes."""
    expert: Any = None
    """Of a table (S,) actions, (S, A) probabilities, NaN where nothing is known, or (S, A) set; else what has `predict`."""
    environment: World | None = None
    """A world that can be run and solved."""
    oracle: Oracle | None = None
    """Who can be asked what the expert does."""
    dynamics: TabularMDP | GenerativeModel | None = None
    """P, gamma and d0 as a table; or an environment that can be set to any state."""
    reward: TabularReward | None = None
    """The true reward, paid on the table."""
    features: FeatureMap | np.ndarray | None = None
    """phi of observations."""
    gamma: float | None = None
    """Discount, where neither dynamics nor environment carries one."""
    horizon: int | None = None
    """Steps of an episode, where it is finite."""
    also: tuple["Problem", ...] = ()
    """Further problems that share the reward."""

    def __post_init__(self) -> None:
        if not isinstance(self.dynamics, TabularMDP | GenerativeModel | None):
            what = "a TabularMDP or a GenerativeModel, or None; of a Tabulation its `mdp`"
            raise InvalidMDP(f"dynamics is {a_type(self.dynamics)}: expected {what}.")
        if not isinstance(self.environment, World | None):
            what = "a world that can be run and solved, such as Simulator(env, SB3(), gamma)"
            raise InvalidParameter(f"environment is {a_type(self.environment)}: expected {what}.")
        if self.gamma is not None:
            check_discount(self.gamma)
        told = {name: value.gamma for name in ("dynamics", "environment") if (value := getattr(self, name)) is not None} | (
            {} if self.gamma is None else {"gamma": self.gamma}
        )
        if len({*told.values()}) > 1:
            said = ", ".join(f"{value} ({name})" for name, value in told.items())
            raise InvalidParameter(f"the problem has several discounts, {said}: expected one. Make its parts with the same.")
        if self.horizon is not None:
            checked_number("horizon", self.horizon, "a number of steps of at least 1, or None", least=1, whole=True)
        if isinstance(self.dynamics, TabularMDP):
            self._check_parts(self.dynamics)

    def _check_parts(self, mdp: TabularMDP) -> None:
        """Check that all that is told row by row is of this table."""
        for space, n, what in (
            (self.spaces.observations, mdp.n_states, "state"),
            (self.spaces.actions, mdp.n_actions, "action"),
        ):
            if isinstance(space, spaces.Discrete) and space.n != n and (what == "action" or self.spaces.states is None):
                told = f"{what}s are numbered by {space}, and the table has {n}: expected one number for each."
                raise InvalidParameter(f"{told} `Problem.of(table, ...)` takes the table's own.")
        if self.expert is not None and not isinstance(self.expert, Policy):
            as_distribution(completed(self.expert, mdp.n_states)[0], mdp.n_states, mdp.n_actions)
        if self.reward is not None:
            as_reward(self.reward).expected(mdp)
        if isinstance(self.features, np.ndarray):
            check_length(as_features(self.features), mdp.n_states)

    @classmethod
    def of(cls, dynamics: TabularMDP | Tabulation, **parts: Any) -> "Problem":
        """A problem on a table.

        Args:
            dynamics: the table, `tabulate(...)` or its mdp. The true reward of a Tabulation is not taken from it: who knows it
                gives it as a part.
            **parts: what else is known, by the names of the fields.
        """
        mdp, states = (dynamics.mdp, dynamics.states) if isinstance(dynamics, Tabulation) else (dynamics, None)
        observations = spaces.Discrete(mdp.n_states) if states is None else states.space
        return cls(Spaces(observations, spaces.Discrete(mdp.n_actions), states), dynamics=mdp, **parts)

    @property
    def discount(self) -> float | None:
        """gamma, whichever part carries it; None where none does."""
        for part in (self.dynamics, self.environment):
            if part is not None:
                return part.gamma
        return self.gamma

    @cached_property
    def seen(self) -> EmpiricalPolicy:
        """How often the episodes take each action in each state. Ask only where there are episodes and states are numbered.

        Raises:
            InvalidDemonstrations, UnknownObservation: episodes of other spaces, or without actions.
        """
        assert self.demonstrations is not None
        return empirical_policy(self.demonstrations, *self._numbered)

    @cached_property
    def shown(self) -> ShownPolicy:
        """The same, and what they do most; of episodes of states alone as a table tells (`irl_gym.demonstrations.inferred`).

        Raises:
            InvalidDemonstrations, UnknownObservation: episodes of other spaces, or without actions where there is no table.
        """
        assert self.demonstrations is not None
        return shown(self.demonstrations, *self._numbered, self.dynamics if isinstance(self.dynamics, TabularMDP) else None)

    @property
    def _numbered(self) -> tuple[States, int]:
        """The numbering of states, and A."""
        actions: Any = self.spaces.actions
        return self.spaces.states or StateIndex(self.spaces.observations), int(actions.n)

    @property
    def policy(self) -> Any:
        """The expert's policy, or where that is not known its most frequent actions, (S, A), NaN in states never visited."""
        if self.expert is not None:
            return self.expert
        if self.demonstrations is None:
            raise MissingPart("the problem has neither expert nor demonstrations: expected one of them.")
        return self.shown.policy

    @property
    def inferred(self) -> Inferred | None:
        """How actions were inferred; None where `policy` rests on none that were."""
        return self.shown.inferred if self.expert is None and self.demonstrations is not None else None

    @property
    def visits(self) -> Vector | None:
        """(S,) how often the episodes visit each state, where they are all that is known of the expert; else None."""
        return self.shown.visits if self.expert is None and self.demonstrations is not None else None
