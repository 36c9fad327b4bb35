"""The default learner on Gymnasium's tables: no tie is left that leads a learner astray (references.md, section 1)."""

import numpy as np
import pytest
from certified import certified

from irl_gym.judging.metrics import policy_value, random_value, tie_aware_agreement, ties, worst_tie
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.mdp.planning.dynamic_programming import value_iteration

EXPERT_VALUES = {
    "FrozenLake 4x4 slippery": 0.542,
    "FrozenLake 4x4": 0.951,
    "FrozenLake 8x8 slippery": 0.4146,
    "FrozenLake 8x8": 0.8775,
    "CliffWalking": -12.25,
    "Taxi": 6.33,
}


def plan(table):
    """An optimal policy of the environment's own reward."""
    return value_iteration(table.mdp, table.reward.values, tolerance=1e-8, sweeps=50).policy


def lost(table, learner):
    """Worst-tie regret as a share of what the expert has over a random policy."""
    expert = plan(table)
    best, chance = policy_value(table.mdp, table.reward, expert), random_value(table.mdp, table.reward)
    return (best - worst_tie(table.mdp, learner.fit(table.mdp, expert).reward, table.reward).value) / (best - chance)


@pytest.mark.parametrize("name", EXPERT_VALUES)
def test_value_iteration_gives_the_known_value_of_the_expert(toy_text, name):
    table = toy_text(name)
    assert policy_value(table.mdp, table.reward, plan(table)) == pytest.approx(EXPERT_VALUES[name], rel=1e-3)


@pytest.mark.parametrize("name", [*EXPERT_VALUES, "GridWorld", "FourRooms"])
def test_finite_lp_worst_tie_loses_at_most_one_percent(toy_text, name):
    assert lost(toy_text(name), FiniteLP()) <= 0.01


def test_finite_lp_on_steps_loses_at_most_one_percent_on_the_slippery_cliff(toy_text):
    assert lost(toy_text("CliffWalking slippery"), FiniteLP(reward_on="state-action")) <= 0.01


def test_what_a_solver_left_open_counts_as_tied(toy_text):
    table = toy_text("Taxi")
    learned = FiniteLP(margin_cap=None).fit(table.mdp, plan(table)).reward
    assert worst_tie(table.mdp, learned, table.reward).value == pytest.approx(-912.35, abs=0.01)
    assert worst_tie(table.mdp, learned, table.reward, tolerance=1e-12).value == pytest.approx(6.327, abs=0.001)
    others = ~np.eye(6, dtype=bool)[plan(table)]
    agreed = tie_aware_agreement(table.mdp, learned, others)
    assert ties(table.mdp, learned).undecided.sum() > 100 and 0 < agreed.undecided <= agreed.share


@pytest.mark.parametrize(("reward_on", "value"), [("state", -143.4), ("state-action", -46.35)])
def test_worst_tie_on_the_slippery_cliff_shows_what_a_state_reward_cannot_say(toy_text, reward_on, value):
    table = toy_text("CliffWalking slippery")
    learned = FiniteLP(reward_on=reward_on).fit(table.mdp, plan(table)).reward
    assert worst_tie(table.mdp, learned, table.reward).value == pytest.approx(value, rel=5e-3)


def test_certificate_counts_the_one_inseparable_state_of_the_slippery_cliff(toy_text):
    table = toy_text("CliffWalking slippery")
    certificate = certified(FiniteLP(), table.mdp, plan(table))
    assert certificate.inseparable.tolist() == [36]


def test_paper_lp_leaves_disastrous_ties_on_frozen_lake(toy_text):
    assert lost(toy_text("FrozenLake 8x8"), FiniteLP(margin_cap=None)) == pytest.approx(1, abs=0.01)
