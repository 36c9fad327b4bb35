"""The figures of a run: which data of the loop go into which picture."""

from pathlib import Path
from typing import TYPE_CHECKING

from irl_gym import plotting
from irl_gym.dynamic_programming import evaluate_policy
from irl_gym.evaluation import learning_curve
from irl_gym.layouts import grid_layout
from irl_gym.metrics import optimal_actions, random_value
from irl_gym.policies import as_distribution, support

if TYPE_CHECKING:
    from irl_gym.loop import Loop


def draw(loop: "Loop", folder: Path) -> None:
    """Draw rewards, values, policies and the learning curve as PNG."""
    mdp, true, learned = loop.table.mdp, loop.table.reward, loop.learned
    layout = grid_layout(loop.env, mdp)
    values = [evaluate_policy(mdp, reward.expected(mdp), loop.expert_actions) for reward in (true, learned)]
    agent = as_distribution(loop.agent_actions, mdp.n_states, mdp.n_actions)
    expert = support(loop.expert_actions, mdp.n_states, mdp.n_actions)
    curve = learning_curve(loop)
    pictures = {
        "rewards.png": plotting.draw_rewards(layout, true.values, learned.values, mdp),
        "values.png": plotting.draw_values(layout, values[0], values[1], mdp),
        "policies.png": plotting.draw_policies(layout, expert, agent, optimal_actions(mdp, true), mdp),
        "learning_curve.png": plotting.draw_learning_curve(
            {"retrained on the recovered reward": plotting.Curve(curve[:, 0], curve[:, 1])},
            expert=loop.true_value(loop.expert_actions),
            random=random_value(mdp, true),
        ),
    }
    for name, figure in pictures.items():
        plotting.save_figure(figure, folder / name)
