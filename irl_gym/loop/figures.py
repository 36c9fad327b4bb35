"""The figures of a run: rewards, values and policies, returns, and the learning curve, each drawn where what it shows is there.

Parts are those of `irl_gym.loop.loop.Loop.sources`. Axes: S states, A actions.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from irl_gym.features.linear_reward import LinearReward
from irl_gym.judging.curves import Curve
from irl_gym.judging.metrics import optimal_actions
from irl_gym.loop.worlds import RunWorld
from irl_gym.mdp.episodes import Episode, seen_parts
from irl_gym.mdp.planning.dynamic_programming import policy_evaluation
from irl_gym.mdp.policies import as_distribution
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.reports import plotting
from irl_gym.reports.cell_maps import draw_actions, draw_planes
from irl_gym.spaces.names import Names
from irl_gym.tables.cells import Cells
from irl_gym.tables.layouts import GridLayout
from irl_gym.tables.tabulation import Tabulation

RETURNS = 100
"""Episodes of each policy in the figure of returns."""


def learning_curve(folder: Path, curve: Curve, judged: Mapping[str, Any]) -> dict[str, Any]:
    """What the agent was worth as it trained, between random actions and the expert; exact planning has no curve."""
    if not curve.steps.size:
        return {}
    levels = {name: judged["policies"][name]["value"] for name in ("expert", "random")}
    drawn = {"retrained on the recovered reward": plotting.DrawnCurve(curve.steps, curve.value)}
    return _kept(folder, {"learning_curve.png": plotting.draw_learning_curve(drawn, **levels)})


def of_table(
    folder: Path, table: Tabulation, tabular: TabularReward, expert: np.ndarray, agent: np.ndarray, layout: GridLayout | None,
    env: gym.Env, env_id: str | None,
) -> dict[str, Any]:  # fmt: skip
    """Rewards, values and policies state by state."""
    return _kept(folder, _pictures(table, tabular, expert, agent, layout, Names.of(env, table.states, env_id)))


def _kept(folder: Path, pictures: Mapping[str, plotting.Figure]) -> dict[str, Any]:
    (folder / "figures").mkdir(exist_ok=True)
    for name, figure in pictures.items():
        plotting.save_figure(figure, folder / "figures" / name)
    return {}


def _pictures(
    table: Tabulation, learned: TabularReward, expert: np.ndarray, agent: np.ndarray, layout: GridLayout | None, names: Names
) -> dict[str, plotting.Figure]:
    mdp, true = table.mdp, table.reward
    unknown = np.zeros(mdp.n_states, dtype=bool)
    if expert.ndim == 2:  # read from data: where nothing is known, random
        known = np.logical_not(np.isnan(expert).any(axis=1))
        unknown = ~known
        expert = np.where(known[:, None], expert, 1 / mdp.n_actions)
        taken = (expert > 0) & known[:, None]
    else:
        taken = as_distribution(expert, mdp.n_states, mdp.n_actions) > 0
    values = [policy_evaluation(mdp, reward.expected(mdp), expert) for reward in (true, learned)]
    values = [np.where(unknown & ~mdp.terminal, np.nan, V) for V in values]  # nothing is known of the expert there
    if isinstance(table.states, Cells) and len(table.states.shape) == 2:
        told = np.where(taken.any(axis=1), expert.argmax(axis=1) if expert.ndim == 2 else expert, np.nan)
        return _of_plane(table.states, mdp, (true, learned), values, {"Expert": told, "Retrained agent": agent})
    retrained, optimal = as_distribution(agent, mdp.n_states, mdp.n_actions), optimal_actions(mdp, true)
    return {
        "rewards.png": plotting.draw_rewards(layout, true.values, learned.values, mdp, names),
        "values.png": plotting.draw_values(layout, values[0], values[1], mdp, names),
        "policies.png": plotting.draw_policies(layout, taken, retrained, optimal, mdp, names),
    }


def _of_plane(
    cells: Cells, mdp: TabularMDP, rewards: tuple[TabularReward, TabularReward], values: list[np.ndarray],
    policies: dict[str, np.ndarray],
) -> dict[str, plotting.Figure]:  # fmt: skip
    """The same over the two coordinates of a grid of cells."""
    paid = [reward.values if reward.on_states else reward.values.max(axis=1) for reward in rewards]
    names = [
        f"{name} reward, {'on arrival' if reward.on_states else 'of a step, largest over actions'}"
        for name, reward in zip(("True", "Learned"), rewards, strict=True)
    ]
    valued = ("Expert's value, true reward", "Expert's value, learned reward")
    return {
        "rewards.png": draw_planes(cells, mdp, dict(zip(names, paid, strict=True)), label="reward", centred=True),
        "values.png": draw_planes(cells, mdp, dict(zip(valued, values, strict=True)), label="discounted value", centred=False),
        "policies.png": draw_actions(cells, mdp, policies, mdp.n_actions),
    }


def returns(
    folder: Path, weights: LinearReward, demonstrations: list[Episode], agent: Any, world: RunWorld, seed: int
) -> dict[str, Any]:
    """The recovered reward's return of episodes against the true one's, where there is no table."""
    seed += 31_337
    episodes = {
        "expert": seen_parts(demonstrations)[:RETURNS],
        "random": world.episodes(world.random, RETURNS, seed),
        "retrained": world.episodes(agent, RETURNS, seed + RETURNS),
    }
    points = {
        name: np.array([[one.total_reward, weights.of(one.observations)[1:].sum()] for one in some])
        for name, some in episodes.items()
    }
    return _kept(folder, {"returns.png": plotting.draw_returns(points)})
