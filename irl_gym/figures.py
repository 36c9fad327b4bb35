"""The figures of a run: which data of the loop go into which picture."""

from pathlib import Path
from typing import TYPE_CHECKING

import gymnasium as gym
import numpy as np

from irl_gym import plotting
from irl_gym.cell_maps import draw_actions, draw_planes
from irl_gym.cells import Cells
from irl_gym.demonstrations import seen_parts
from irl_gym.dynamic_programming import evaluate_policy
from irl_gym.evaluation import learning_curve
from irl_gym.layouts import GridLayout, grid_layout
from irl_gym.linear_reward import LinearReward
from irl_gym.listed_states import usual_observation
from irl_gym.mdp import TabularMDP
from irl_gym.metrics import optimal_actions
from irl_gym.names import Names, action_names, state_name
from irl_gym.policies import as_distribution
from irl_gym.rewards import TabularReward
from irl_gym.states import StateIndex
from irl_gym.worlds import SteppedWorld, TableWorld

if TYPE_CHECKING:
    from irl_gym.loop import Loop

RETURNS = 100
"""Episodes of each policy in the figure of returns."""


def draw(loop: "Loop", folder: Path) -> None:
    """Draw rewards, values, policies and the learning curve as PNG; where there is no table, returns and the curve."""
    levels = {name: loop.folder_metrics["policies"][name]["value"] for name in ("expert", "random")}
    curve = learning_curve(loop)
    pictures = _of_table(loop, loop.world) if isinstance(loop.world, TableWorld) else _of_steps(loop, loop.world)
    if curve.steps.size:  # exact planning has none
        pictures["learning_curve.png"] = plotting.draw_learning_curve(
            {"retrained on the recovered reward": plotting.Curve(curve.steps, curve.value)}, **levels
        )
    for name, figure in pictures.items():
        plotting.save_figure(figure, folder / name)


def layout_of(env: gym.Env, world: TableWorld) -> GridLayout | None:
    """The map, where the table is exact and its rows are the cells; not where only some cells are listed."""
    exact = world.table.evidence.exact and isinstance(world.table.states, StateIndex)
    return grid_layout(env, world.table.mdp) if exact else None


def _of_table(loop: "Loop", world: TableWorld) -> dict[str, plotting.Figure]:
    table = world.table
    mdp, true, learned = table.mdp, table.reward, world.tabular(loop.learned)
    layout = layout_of(loop.env, world)
    expert, unknown = loop.expert, np.zeros(mdp.n_states, dtype=bool)
    if expert.ndim == 2:  # read from data: where nothing is known, random
        known = ~np.isnan(expert).any(axis=1)
        unknown = ~known
        expert = np.where(known[:, None], expert, 1 / mdp.n_actions)
        taken = (expert > 0) & known[:, None]
    else:
        taken = as_distribution(expert, mdp.n_states, mdp.n_actions) > 0
    values = [evaluate_policy(mdp, reward.expected(mdp), expert) for reward in (true, learned)]
    values = [np.where(unknown & ~mdp.terminal, np.nan, V) for V in values]  # nothing is known of the expert there
    if isinstance(table.states, Cells) and len(table.states.shape) == 2:
        told = np.where(taken.any(axis=1), expert.argmax(axis=1) if expert.ndim == 2 else expert, np.nan)
        return _of_plane(table.states, mdp, (true, learned), values, {"Expert": told, "Retrained agent": loop.agent})
    agent = as_distribution(loop.agent, mdp.n_states, mdp.n_actions)
    optimal = optimal_actions(mdp, true)
    usual = usual_observation(table.states)
    names = Names(action_names(loop.env), lambda row: state_name(loop.env_id, table.states.decode(row), None, usual))
    return {
        "rewards.png": plotting.draw_rewards(layout, true.values, learned.values, mdp, names),
        "values.png": plotting.draw_values(layout, values[0], values[1], mdp, names),
        "policies.png": plotting.draw_policies(layout, taken, agent, optimal, mdp, names),
    }


def _of_plane(
    cells: Cells,
    mdp: TabularMDP,
    rewards: tuple[TabularReward, TabularReward],
    values: list[np.ndarray],
    policies: dict[str, np.ndarray],
) -> dict[str, plotting.Figure]:
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


def _of_steps(loop: "Loop", world: SteppedWorld) -> dict[str, plotting.Figure]:
    """The recovered reward's return of episodes against the true one's."""
    reward = loop.learned
    if not isinstance(reward, LinearReward):
        return {}
    seed = loop.experiment.seed + 31_337
    episodes = {
        "expert": seen_parts(loop.demonstrations)[:RETURNS],
        "random": world.episodes(world.random, RETURNS, seed),
        "retrained": world.episodes(loop.agent, RETURNS, seed + RETURNS),
    }
    points = {
        name: np.array([[one.total_reward, reward.of(one.observations)[1:].sum()] for one in some])
        for name, some in episodes.items()
    }
    return {"returns.png": plotting.draw_returns(points)}
