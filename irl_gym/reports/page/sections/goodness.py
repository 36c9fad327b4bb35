"""Why a state that is good may have less of a learned reward than one that is not: said where it is so, and is no fault."""

import numpy as np

from irl_gym.mdp.arrival_rewards import paid_on_arrival
from irl_gym.mdp.rewards import TabularReward
from irl_gym.reports.page.scene import Scene
from irl_gym.written import number, state_called

EVEN = 1e-9
"""A share of the largest reward; what differs by less is rounding."""


def not_goodness(scene: Scene, learned: TabularReward, record: str) -> str:
    """Where the state that the environment pays most has less of the learned reward than another: how that can be.

    Args:
        scene: what is known state by state.
        learned: a reward under which the expert is optimal.
        record: whose word that is, behind a comma; nothing where it is computed.
    """
    mdp, R = scene.mdp, scene.table.reward.values
    paid, L = R if R.ndim == 1 else paid_on_arrival(R, mdp), learned.values
    if paid is None or L.ndim != 1:
        return ""
    low = np.where(mdp.reachable, paid, -np.inf)
    most = low >= low.max() - EVEN * np.abs(paid[mdp.reachable]).max()
    others = mdp.reachable & ~most & (L > L[most].max() + EVEN * np.abs(L).max())
    if not others.any():
        return ""
    ends = others & mdp.terminal
    other = int(np.argmax(np.where(ends if ends.any() else others, L, -np.inf)))
    goal = int(np.argmax(np.where(most, L, -np.inf)))
    best, worse = (state_called(scene.called(state)) for state in (goal, other))
    now = f"has {number(L[goal])} under the learned reward"
    ending = "where an episode ends and " if mdp.terminal[other] else ""
    return (
        f" Here {best}, which the environment pays most, {now}, and {worse}, {ending}which the environment pays "
        f"{number(paid[other])}, has {number(L[other])}. That is no fault: a reward says which actions are best, not which "
        "states are good. It is paid on arrival, and what counts is where an action leads beside the other actions of the same "
        f"state; what the expert does is the best under this reward{record}."
    )
