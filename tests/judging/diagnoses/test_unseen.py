"""Where nothing is known of the expert."""

import numpy as np
from models import ring
from patients import corridor, finding, judged, names, right, sampled

from irl_gym.judging.diagnoses.case import Case
from irl_gym.judging.diagnoses.unseen import entered, strays
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP

FORK = np.zeros((4, 2, 4))
FORK[0, 0, 1] = FORK[0, 1, 2] = FORK[1, :, 3] = FORK[2, :, 3] = 1
FORK = TabularMDP.from_dense(FORK, 0.9, np.eye(4)[0])
"""From 0 to 1 or 2, then to the terminal 3; the expert goes by 1."""
BY_1 = np.array([[1.0, 0], [1, 0], [np.nan, np.nan], [np.nan, np.nan]])


def test_states_never_visited_are_named_with_their_share():
    said = finding("unvisited-states", FiniteLP().fit(FORK, BY_1), FORK, BY_1)
    assert said.states.tolist() == [2] and "33%" in said.sentence and "a low reward, by choice" in said.sentence


def test_more_of_the_expert_mends_unvisited_states():
    known = np.array([0, 0, 0, 0])
    assert "unvisited-states" not in names(FiniteLP().fit(FORK, known), FORK, known)


def test_a_reward_that_leads_where_the_expert_never_was_is_told():
    tempting = judged(FORK, BY_1, [0.0, 0.5, 0.6, 1.0])
    assert finding("strays", tempting, FORK, BY_1).states.tolist() == [2]


def test_avoiding_unknown_states_mends_strays():
    assert "strays" not in names(FiniteLP(unvisited="avoid").fit(FORK, BY_1), FORK, BY_1)


def test_a_sampled_reward_that_leads_where_the_expert_never_was_is_told():
    claims = sampled().proof.to_json()
    R = np.array([0.0, 0.0, 1.0, 0.0])
    case = Case(FORK, np.zeros(4, dtype=int), TabularReward(R), claims, weights=R)
    said = strays(case)
    assert said is not None and said.states.tolist() == [2] and "More rounds" in said.mend


def test_the_states_that_a_policy_enters_are_those_its_actions_lead_to():
    fork = TabularMDP(ring([[1, 2], [0, 0], [2, 2]]).P, 0.9, np.eye(3)[0])
    assert entered(fork, np.eye(2, dtype=bool)[[0, 0, 0]]).tolist() == [True, True, False]
    mdp = corridor(5, 0.9)
    taken = np.eye(2, dtype=bool)[right(mdp)]
    taken[2] = False
    assert entered(mdp, taken).tolist() == [True, True, True, False, False]
