"""What the discount, and a world without an end, make of a reward."""

import numpy as np
import pytest
from models import ring
from patients import corridor, finding, judged, names, right

from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.shaping import ExpectedAdvantage
from irl_gym.mdp.tabular_mdp import TabularMDP

GOAL = np.eye(12)[11]
STEPS = GOAL - 1
"""Each step costs 1."""
CYCLE = ring([[1, 0], [2, 1], [0, 2]])
"""Forward or stay, for ever."""
FORWARD = np.zeros(3, dtype=int)


def test_a_gamma_so_small_that_margins_vanish_is_told_with_a_larger_one():
    mdp = corridor(12, 0.1)
    said = finding("small-gamma", judged(mdp, right(mdp), GOAL), mdp, right(mdp))
    assert set(said.states.tolist()) >= {0, 1, 2, 3} and 10 not in said.states and "at 0.5" in said.mend


@pytest.mark.parametrize("length, told", [(14, False), (15, True)])
def test_a_few_margins_that_vanish_are_no_finding(length, told):
    mdp = corridor(length, 0.3)  # margins vanish in 1 of 13 states, or in 2 of 14: from a tenth on it is told
    assert ("small-gamma" in names(judged(mdp, right(mdp), np.eye(length)[-1]), mdp, right(mdp))) == told


def test_the_larger_gamma_mends_margins_that_vanish():
    mdp = corridor(12, 0.5)
    assert names(judged(mdp, right(mdp), GOAL), mdp, right(mdp)) == ()


def test_a_true_reward_whose_values_vanish_is_told():
    mdp = corridor(12, 0.1)
    learned = FiniteLP().fit(mdp, right(mdp))
    assert "under the true reward" in finding("small-gamma", learned, mdp, right(mdp), true=GOAL).sentence


def test_ties_near_the_reward_are_not_blamed_on_gamma(toy_text):
    mdp = toy_text("FrozenLake 4x4").mdp
    expert = np.array([2, 2, 1, 0, 1, 0, 1, 0, 2, 2, 1, 0, 0, 2, 2, 0])
    assert "small-gamma" not in names(FiniteLP(margin_cap=None).fit(mdp, expert), mdp, expert)


def test_a_gamma_so_near_1_that_margins_drown_is_told_with_a_smaller_one():
    mdp = corridor(12, 1 - 1e-9)
    steps = judged(mdp, right(mdp), STEPS)
    assert "0.99999" in finding("gamma-near-one", steps, mdp, right(mdp)).mend


def test_the_smaller_gamma_mends_margins_that_drown():
    mdp = corridor(12, 0.99999)
    assert "gamma-near-one" not in names(judged(mdp, right(mdp), STEPS), mdp, right(mdp))


def test_small_differences_where_nothing_ends_are_told():
    R = [1.0, 1.0 + 1e-5, 1.0 + 3e-5]
    assert "never-ends" in names(judged(CYCLE, FORWARD, R), CYCLE, np.array([0, 0, 1]))


def test_a_world_without_an_end_is_healthy_where_margins_are_clear():
    expert = np.array([0, 0, 1])
    assert names(FiniteLP().fit(CYCLE, expert), CYCLE, expert) == ()


def test_an_end_mends_what_never_ends():
    P = CYCLE.P.toarray()
    P[4:] = 0
    mdp = TabularMDP(P, 0.9, CYCLE.d0)
    assert "never-ends" not in names(judged(mdp, FORWARD, [1.0, 1.0, 1.0 + 3e-5]), mdp, FORWARD)


def _fork():
    P = np.zeros((4, 2, 4))
    P[0, 0, 1] = P[0, 1, 2] = P[1, :, 3] = P[2, :, 3] = 1
    return TabularMDP.from_dense(P, 0.9, np.eye(4)[0]), np.zeros(4, dtype=int), np.array([0, 1e-5, 0, 1.0])


def test_margins_that_an_agent_will_not_see_are_told():
    mdp, expert, R = _fork()
    assert names(judged(mdp, expert, R), mdp, expert, true=R) == ("faint-margins",)


def test_shaping_mends_faint_margins():
    mdp, expert, R = _fork()
    shaped = ExpectedAdvantage(1e-5).apply(TabularReward(R), mdp).values
    assert "faint-margins" not in names(judged(mdp, expert, shaped), mdp, expert)


def test_faint_margins_are_no_finding_where_the_agent_is_retrained_with_shaping():
    mdp, expert, R = _fork()
    assert names(judged(mdp, expert, R), mdp, expert, true=R, shaped=True) == ()
