"""What is wrong under the true reward."""

import numpy as np
from models import paper_grid
from patients import corridor, finding, judged, names, right

from irl_gym.dynamic_programming import policy_iteration
from irl_gym.learners.finite import FiniteLP

GRID = paper_grid()


def test_the_worst_tie_is_told_with_what_it_loses(toy_text):
    table = toy_text("FrozenLake 4x4 slippery")
    expert = policy_iteration(table.mdp, table.reward).policy
    said = finding("worst-tie", FiniteLP(margin_cap=None).fit(table.mdp, expert), table.mdp, expert, true=table.reward)
    assert "the expert 0.542" in said.sentence and said.states.size == len(said.actions) > 0


def test_an_expert_worse_than_random_is_told():
    worst = policy_iteration(GRID.mdp, -GRID.step_reward).policy
    assert "expert-worse-than-random" in names(FiniteLP().fit(GRID.mdp, worst), GRID.mdp, worst, true=GRID.R)


def test_an_expert_that_could_earn_more_is_told_with_the_states_it_loses_in():
    mdp = corridor(6, 0.9)
    lingers = np.full((6, 2), 0.5)
    lingers[[0, 1, 2, 4]] = [0, 1]
    said = finding("expert-suboptimal", None, mdp, lingers, true=np.eye(6)[5])
    assert said.states.tolist() == [3]


def test_a_better_expert_mends_both():
    assert names(FiniteLP().fit(GRID.mdp, GRID.expert), GRID.mdp, GRID.expert, true=GRID.R) == ()


def test_an_expert_that_enters_states_where_it_is_not_known_has_no_value():
    mdp = corridor(6, 0.9)
    partly = np.full((6, 2), np.nan)
    partly[0] = [1, 0]
    partly[1] = [0, 1]
    found = names(judged(mdp, partly, np.eye(6)[5]), mdp, partly, true=np.eye(6)[5])
    assert "expert-worse-than-random" in found  # it stays in 0, where it is known
    partly[0] = [0, 1]
    assert "expert-worse-than-random" not in names(judged(mdp, partly, np.eye(6)[5]), mdp, partly, true=np.eye(6)[5])


def test_the_expert_of_a_corridor_is_healthy_under_its_goal():
    mdp = corridor(6, 0.9)
    assert names(judged(mdp, right(mdp), np.eye(6)[5]), mdp, right(mdp), true=np.eye(6)[5]) == ()
