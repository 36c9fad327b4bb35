"""Who demonstrates: any expert in any environment with discrete actions, an episode by its number.

Where there is an exact table that settles every reward, episodes are drawn from it, thousands at once; else the environment is
stepped. Episode i depends on the seed and on i alone: it is drawn in the chunk i // n, which has a generator of its own, or
stepped by a policy with a generator of its own, after `reset(seed=seed + i)`.
Axes: S states, A actions, T steps, n episodes of a chunk.
"""

import json
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from itertools import count, islice
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from irl_gym._typing import Matrix
from irl_gym.agents.expert_files import check_agent, fingerprint, is_file
from irl_gym.agents.experts import Acting, load_expert
from irl_gym.agents.noise import Noisy, checked_epsilon, noisy
from irl_gym.agents.planners import SB3, Agent, load_agent, tabular_actions
from irl_gym.checks import checked_number, discrete_actions
from irl_gym.demonstrations.export import Demonstrator
from irl_gym.demonstrations.minari_files import spec_json, unkept
from irl_gym.errors import InvalidParameter, NotDiscrete, NotTabular, did_you_mean
from irl_gym.loop.table_world import TableWorld, step_limit
from irl_gym.loop.worlds import SteppedWorld
from irl_gym.mdp.episodes import Episode, collect, collect_from_table
from irl_gym.mdp.planning.dynamic_programming import value_iteration
from irl_gym.mdp.policies import Policy, TabularPolicy, as_distribution, generator
from irl_gym.mdp.tabular_mdp import check_discount
from irl_gym.runs.choices import PlannerName
from irl_gym.runs.experiment import as_config
from irl_gym.runs.named_parts import planner_named
from irl_gym.spaces.states import StateIndex
from irl_gym.tables.enumeration.table import Enumeration
from irl_gym.tables.tabulate import tabulate
from irl_gym.tables.tabulation import Tabulation

TRAINED: dict[str, PlannerName] = {"ppo": "ppo", "dqn": "dqn", "a2c": "a2c"}
NAMED = ("value-iteration", *TRAINED, "random")
"""Experts that have a name; any other is a file."""
CHUNK_BYTES = 16 << 20
"""Of episodes drawn from a table at once, of the longest that they can be."""
CHUNK = 2048
"""Episodes drawn at once, at most."""

OnTraining = Callable[[float], None]
"""Told the share of an agent's training that is done."""


@dataclass(frozen=True, eq=False)
class StatesAlone:
    """Another's episodes without their actions."""

    whole: Demonstrator
    """Whose."""

    def episodes(self, first: int) -> Iterator[Episode]:
        """Episodes first, first + 1, ... without end."""
        return (replace(one, actions=None) for one in self.whole.episodes(first))


@dataclass(frozen=True, eq=False)
class Drawn:
    """Episodes drawn from a table."""

    table: Tabulation
    """Exact, with a reward for each transition."""
    policy: Matrix
    """(S, A) probabilities."""
    limit: int
    """Steps after which an episode is truncated."""
    seed: int
    """Of all episodes."""

    def episodes(self, first: int) -> Iterator[Episode]:
        """Episodes from number `first` on."""
        n = int(np.clip(CHUNK_BYTES // (24 * (self.limit + 1)), 1, CHUNK))
        table, entries = self.table, self.table.payments.entries
        assert entries is not None
        for chunk in count(first // n):
            drawn = collect_from_table(
                table.mdp, entries, table.states, self.policy, n, seed=_seed(self.seed, chunk), max_episode_steps=self.limit
            )
            yield from islice(drawn, max(0, first - chunk * n), None)


@dataclass(frozen=True, eq=False)
class Stepped:
    """Episodes of an environment that is stepped."""

    env: gym.Env
    """Reset for each episode."""
    acting: Callable[[int], Policy]
    """Makes the policy of an episode from a seed."""
    limit: int
    """Steps after which an episode is truncated."""
    seed: int
    """Of the first episode."""
    deterministic: bool
    """Given to `predict`."""

    def episodes(self, first: int) -> Iterator[Episode]:
        """Episodes from number `first` on."""
        for i in count(first):
            yield from collect(
                self.env, self.acting(_seed(self.seed, i)), 1, seed=self.seed + i, deterministic=self.deterministic,
                max_episode_steps=self.limit,
            )  # fmt: skip


def _seed(seed: int, number: int) -> int:
    """A seed of its own for each chunk or episode."""
    return int(np.random.SeedSequence([seed, number]).generate_state(1, np.uint64)[0])


@dataclass(frozen=True)
class Recording:
    """Who acts, and how.

    Raises:
        InvalidParameter: no such expert, epsilon outside 0 to 1, fewer than 1 steps or states, or a seed that is not 0 to
            2^32 - 1.
        InvalidDiscount: gamma outside (0, 1).
    """

    expert: str
    """value-iteration, ppo, dqn, a2c or random; or a file, SB3's zip of an agent or an npz of actions or probabilities."""
    gamma: float
    """Discount that the expert plans or learns with."""
    epsilon: float = 0.0
    """Probability of a uniformly random action in place of the expert's."""
    seed: int = 0
    """Of everything that is drawn."""
    max_episode_steps: int | None = None
    """Truncate longer episodes; None for the environment's own limit, or 500 where it has none."""
    total_timesteps: int | None = None
    """That an agent is trained for; None for its default."""
    max_states: int | None = None
    """That an enumeration may find; None for its default."""
    expert_normalize: str | None = None
    """Statistics of the observations of an agent in a zip, trained under VecNormalize: the file of its `save`, or an npz."""

    def __post_init__(self) -> None:
        check_discount(self.gamma)
        checked_epsilon(self.epsilon)
        checked_number("seed", self.seed, "a whole number from 0 to 2^32 - 1", least=0, below=2**32, whole=True)
        for name in ("max_episode_steps", "total_timesteps", "max_states"):
            if getattr(self, name) is not None:
                checked_number(name, getattr(self, name), "a whole number of at least 1", least=1, whole=True)
        if self.expert not in NAMED and not is_file(self.expert):
            raise InvalidParameter(
                f"expert is {self.expert!r}, which is no file: expected one of {', '.join(NAMED)}, or the path of SB3's zip "
                f"or of an npz of actions.{did_you_mean(self.expert, NAMED)}"
            )
        if self.expert_normalize is not None and self.expert in NAMED:
            raise InvalidParameter(
                f"expert_normalize is {self.expert_normalize!r}, but expert is {self.expert!r}: expected an agent's zip with "
                "it."
            )

    def plan(self, env: gym.Env) -> dict[str, Any]:
        """Everything that the episodes depend on, as json; a file by its digest, and so what json does not hold."""
        spec = env.spec
        told: Any = repr(env) if spec is None else as_config(spec) if unkept(spec) else json.loads(str(spec_json(spec)))
        found = {**asdict(self), "environment": told}
        statistics = found.pop("expert_normalize")
        if self.expert not in NAMED:
            found["expert"] = f"file with sha256 {fingerprint(self.expert, statistics)}"
        return found

    def metadata(self, env_id: str) -> dict[str, Any]:
        """What a dataset of these episodes says of itself, in Minari's words."""
        return {
            "algorithm_name": Path(self.expert).name, "author": {"irl_gym"}, "author_email": {"none given"},
            "description": f"Episodes in {env_id}, gamma {self.gamma}, epsilon {self.epsilon}, seed {self.seed}.",
        }  # fmt: skip

    def demonstrator(self, env: gym.Env, folder: Path, on_training: OnTraining | None = None) -> Demonstrator:
        """Make or load the expert, and let it act.

        Args:
            env: with discrete actions.
            folder: where an agent that is trained here is kept, and found again.
            on_training: told how far training is.

        Raises:
            NotDiscrete: continuous actions, or a table of actions for observations that cannot be numbered.
            NotTabular: value-iteration where there is no table, or one of more states than allowed.
            InvalidPolicy: a table of actions of another size.
            DatasetMismatch: an agent of another environment.
        """
        limit = min(step_limit(env), self.max_episode_steps or step_limit(env))
        n_actions = int(discrete_actions(env.action_space).n)
        table = self._table(env)
        if self.expert == "random" and table is None:
            return Stepped(env, lambda seed: _random(env, n_actions, seed), limit, self.seed, deterministic=True)
        expert = self._expert(env, table, folder, on_training)
        if isinstance(expert, Agent):
            check_agent(expert, env.observation_space, env.action_space)
            if table is None:
                return Stepped(env, lambda seed: _noisy(expert, self.epsilon, n_actions, seed), limit, self.seed, True)
            expert = tabular_actions(expert, table.states)
        states = StateIndex(env.observation_space) if table is None else table.states
        policy = noisy(as_distribution(expert, states.n_states, n_actions), self.epsilon)
        if table is not None and table.evidence.exact and table.payments.entries is not None:
            return Drawn(table, policy, limit, self.seed)
        return Stepped(env, lambda seed: TabularPolicy(policy, states, seed), limit, self.seed, deterministic=False)

    def _table(self, env: gym.Env) -> Tabulation | None:
        by = None if self.max_states is None else Enumeration(known=True, max_states=self.max_states)
        try:
            return tabulate(env, gamma=self.gamma, by=by, seed=self.seed)
        except (NotTabular, NotDiscrete) as error:
            if self.expert == "value-iteration":
                raise type(error)(f"{error} Or choose ppo, dqn or a2c, experts that need no table.") from error
            return None

    def _expert(
        self, env: gym.Env, table: Tabulation | None, folder: Path, on_training: OnTraining | None
    ) -> Agent | np.ndarray:
        """(S,) actions or (S, A) probabilities; or an agent."""
        if table is not None and self.expert == "value-iteration":
            return value_iteration(table.mdp, table.reward).policy
        if table is not None and self.expert == "random":
            return np.full((table.mdp.n_states, table.mdp.n_actions), 1 / table.mdp.n_actions)
        if self.expert not in NAMED:
            return load_expert(self.expert, normalize=self.expert_normalize)
        discrete = isinstance(env.observation_space, spaces.Discrete)
        planner = planner_named(TRAINED[self.expert], self.total_timesteps, control=table is None, discrete=discrete)
        assert isinstance(planner, SB3)
        kept = folder / "expert.zip"
        if not kept.exists():
            world = SteppedWorld(env, self.gamma, 8, 1, self.seed) if table is None else TableWorld(env, table, 64, self.seed)
            report = on_training or (lambda share: None)
            agent = world.train(planner, None, lambda steps, _: report(min(1.0, steps / planner.total_timesteps)))
            assert isinstance(agent, Agent)
            agent.save(kept)
        return load_agent(kept, planner.algorithm)


def _noisy(agent: Agent, epsilon: float, n_actions: int, seed: int) -> Policy:
    return Noisy(agent, epsilon, n_actions, seed) if epsilon else agent


def _random(env: gym.Env, n_actions: int, seed: int) -> Policy:
    rng = generator(seed)
    return Acting(lambda _: rng.integers(n_actions), n_actions, env.observation_space)
