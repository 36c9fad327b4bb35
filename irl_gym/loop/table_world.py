"""A run's world with a table, exact or of cells: a policy is its actions (S,) or probabilities (S, A), and values are exact.

Axes: S states, A actions, T steps.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np

from irl_gym.agents.noise import noisy
from irl_gym.agents.planners import FOR_ADVANTAGES, SB3, Agent, Planner, ValueIteration, tabular_actions
from irl_gym.demonstrations.choices import AfterEnd
from irl_gym.demonstrations.endings import in_table
from irl_gym.demonstrations.shown import ShownPolicy, shown
from irl_gym.environments.rollouts import run_episodes
from irl_gym.environments.tabular_vec_env import TabularVecEnv, shows_rows
from irl_gym.errors import UnknownObservation
from irl_gym.features.linear_reward import LinearReward
from irl_gym.files.run_folder import RunFolder
from irl_gym.judging import metrics
from irl_gym.judging.curves import EPISODES, sampled_returns, two_returns
from irl_gym.learners.base import Outcome
from irl_gym.learners.cloning.clone import Clone
from irl_gym.learners.cloning.proofs import CloneProof
from irl_gym.learners.problem import Problem
from irl_gym.mdp.episodes import Episode, collect, collect_from_table
from irl_gym.mdp.policies import Policy, TabularPolicy, as_distribution, load_actions
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.shaping import ShapedReward
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.spaces.states import States
from irl_gym.tables.layouts import GridLayout, map_of
from irl_gym.tables.table_files import keep_table
from irl_gym.tables.tabulation import Tabulation

DEFAULT_EPISODE_STEPS = 500
"""Time limit of episodes in environments that have none."""

Progress = Callable[[int, Policy], None] | None
Choose = Callable[[Any], int]
"""An observation -> an action, counted from 0."""
Glance = tuple[float, np.ndarray]
"""What a policy in training is worth, and what the episodes of its point of the curve are drawn from, or returned."""


def step_limit(env: gym.Env) -> int:
    """Steps after which an episode is truncated."""
    return (env.spec.max_episode_steps if env.spec is not None else None) or DEFAULT_EPISODE_STEPS


@dataclass(frozen=True, eq=False)
class TableWorld:
    """An environment with a table."""

    env: gym.Env
    """The environment."""
    table: Tabulation
    """Exact, or of the cells of a grid: then values are the grid's, and episodes the environment's own."""
    num_envs: int
    """Copies that SB3 trains on."""
    seed: int
    """Of agents."""
    horizon: int | None = None
    """Steps that values count; None for all. The time limit, where the expert's value is that of episodes that were cut."""
    cloner: ClassVar[type] = Clone
    """What copies demonstrations."""

    @property
    def gamma(self) -> float:
        """Discount."""
        return self.table.mdp.gamma

    @property
    def limit(self) -> int:
        """Steps after which episodes are cut."""
        return step_limit(self.env)

    @property
    def mdp(self) -> TabularMDP:
        """P, gamma and d0."""
        return self.table.mdp

    @property
    def states(self) -> States:
        """Observations and rows."""
        return self.table.states

    @property
    def true(self) -> TabularReward:
        """The true reward."""
        return self.table.reward

    @property
    def layout(self) -> GridLayout | None:
        """The map, where the table is exact and its rows are the cells; not where only some cells are listed."""
        return map_of(self.env, self.table)

    @property
    def random(self) -> np.ndarray:
        """(S, A) the random policy."""
        mdp = self.table.mdp
        return np.full((mdp.n_states, mdp.n_actions), 1 / mdp.n_actions)

    def planner(self, *, shaped: bool) -> Planner:
        """PPO, with settings that suit the reward."""
        return SB3(hyperparameters=FOR_ADVANTAGES if shaped else {})

    def expert(self) -> Planner:
        """Exact planning."""
        return ValueIteration()

    def train(self, planner: Planner, reward: Any, progress: Progress = None) -> Policy:
        """A policy for a reward, the true one if None, from steps of the table."""
        paid = self.table.reward if reward is None else self.tabular(reward)
        env = TabularVecEnv(
            self.table.mdp, paid, num_envs=self.num_envs, max_episode_steps=self.limit,
            states=self.table.states, show_rows=shows_rows(self.table.states), seed=self.seed,
        )  # fmt: skip
        return planner.plan(env, gamma=self.gamma, seed=self.seed, progress=progress)

    def tabular(self, reward: TabularReward | LinearReward) -> TabularReward:
        """A reward of either kind in the table."""
        return reward.tabular(self.table.states)

    def weights(self, reward: TabularReward | LinearReward) -> None:
        """What a reward of features is known by; here it is one of rows."""

    def paid(self, reward: TabularReward | LinearReward, *, shaped: bool, margin_cap: float | None) -> TabularReward:
        """What an agent is paid: a reward, or its expected advantage, where losses count up to the cap, or a typical loss."""
        plain = self.tabular(reward)
        if not shaped:
            return plain
        return ShapedReward.of(plain, self.mdp, margin_cap or None).paid

    def pays(
        self,
        reward: TabularReward | LinearReward | None,
        observations: Sequence[Any],
        actions: Sequence[int | None],
        *,
        terminated: bool,
    ) -> tuple[list[int | None], np.ndarray]:  # fmt: skip
        """Rows of T + 1 observations, None where the table has none, and (T,) what a reward pays for the steps, NaN there."""
        last = len(actions) if terminated else None
        rows = [self._row(one, terminated=time == last) for time, one in enumerate(observations)]
        if reward is None:
            return rows, np.full(len(actions), np.nan)
        paid, steps = self.tabular(reward), zip(rows, actions, rows[1:], strict=False)
        read = (0, 2) if paid.on_states else (0, 1, 2)
        return rows, np.array([np.nan if None in [one[i] for i in read] else float(paid.pay(*one)) for one in steps])

    def _row(self, observation: Any, *, terminated: bool) -> int | None:
        try:
            return int(self.states.encode(observation, terminated=terminated))
        except UnknownObservation:  # of a table that was sampled
            return None

    def clone(self, problem: Problem, tell: Callable[[float], None]) -> Outcome[None, CloneProof]:
        """A copy of demonstrations, by counting; random actions where there are none."""
        return Clone().learn(problem)

    def keep_table(self, folder: Path) -> None:
        """Write the table, unless it is there."""
        keep_table(self.table, folder)

    def can_keep(self, policy: Any) -> bool:
        """Is there a file for it? Its actions are kept, whatever it is."""
        return True

    def keep(self, policy: Any, folder: Path, name: str, epsilon: float = 0.0) -> None:
        """Write the actions, or with noise or of a table with several the probabilities; an agent in SB3's zip too.

        Args:
            policy: what has `predict`; or (S,) actions, (S, A) probabilities or set.
            folder: where to.
            name: of the file.
            epsilon: probability of a random action in its place.
        """
        if not isinstance(policy, Policy):
            policy = self.actor(policy, self.seed)
        if isinstance(policy, Agent):
            policy.save(folder / f"{name}.zip")
        actions: Any = tabular_actions(policy, self.table.states)
        if isinstance(policy, TabularPolicy) and not (policy.probabilities.max(axis=1) == 1).all():
            actions = policy.probabilities
        as_distribution(actions, self.mdp.n_states, self.mdp.n_actions)  # refuses what is no policy of this table
        if epsilon:
            actions = noisy(actions, epsilon, self.table.mdp.n_actions)
        np.savez(folder / ("expert.npz" if name == "expert" else f"{name}_policy.npz"), actions=actions)

    def load(self, folder: RunFolder, name: str) -> np.ndarray:
        """(S,) actions; (S, A) probabilities of an expert read from data, NaN where nothing is known of it."""
        return folder.load("expert.npz" if name == "expert" else f"{name}_policy.npz", load_actions)

    def known(self, episodes: list[Episode], after_end: AfterEnd) -> list[Episode]:
        """Recorded episodes as an exact table knows them."""
        return list(in_table(episodes, self.mdp, self.states, after_end)) if self.table.evidence.exact else episodes

    def seen(self, episodes: list[Episode]) -> ShownPolicy:
        """How often each action was taken in each state, as recorded, or as the table tells of states alone."""
        return shown(episodes, self.states, self.mdp.n_actions, self.mdp)

    def chooser(self, policy: Any, seed: int) -> Choose:
        """What acts as in the episodes that judge a policy."""
        actor = self.actor(policy, seed)
        return lambda observation: int(actor.predict(observation)[0])

    def actor(self, policy: Any, seed: int) -> TabularPolicy:
        """A policy that acts on observations."""
        return TabularPolicy(as_distribution(policy, self.mdp.n_states, self.mdp.n_actions), self.states, seed)

    def episodes(self, policy: Any, n: int, seed: int) -> list[Episode]:
        """Episodes: from the table where it is exact and holds every reward, else by stepping the environment."""
        table, limit = self.table, self.limit
        if table.evidence.exact and table.payments.entries is not None:
            drawn = collect_from_table(
                table.mdp, table.payments.entries, table.states, policy, n, seed=seed, max_episode_steps=limit
            )
            return list(drawn)
        actor = self.actor(policy, seed)
        if table.evidence.exact:
            return list(collect(self.env, actor, n, seed=seed, max_episode_steps=limit))
        return run_episodes(self.env, actor, n, seed=seed, most=limit, deterministic=False)

    def value(self, policy: Any) -> float:
        """Exact discounted value from d0 under the true reward; the grid's, where the table is of cells."""
        return metrics.policy_value(self.table.mdp, self.table.reward, policy, self.horizon)

    def glance(self, policy: Policy) -> Glance:
        """The value of a policy in training, and its actions (S,)."""
        actions = tabular_actions(policy, self.states)
        return self.value(actions), actions.astype(np.min_scalar_type(self.mdp.n_actions))

    def returns(self, glanced: Sequence[np.ndarray]) -> tuple[Sequence[np.ndarray], tuple[float, float] | None]:
        """Returns of sampled episodes of policies (S,), and the only two that are possible; drawn together, which is fast."""
        limit, seed = self.limit, self.seed + 7_919
        return sampled_returns(self.table, glanced, EPISODES, limit=limit, seed=seed), two_returns(self.table)
