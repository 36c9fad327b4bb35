"""A reward on steps is told as one on states only where that is what the environment pays."""

import gymnasium as gym
import numpy as np
import pytest

from irl_gym.environments.reveal import Reveal
from irl_gym.mdp.arrival_rewards import paid_on_arrival
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.tables.tabulate import tabulate


def steps_of(env_id, **kwargs):
    env = gym.make(env_id, **kwargs)
    table = tabulate(Reveal(env) if env_id == "Blackjack-v1" else env, gamma=0.9, check_steps=0)
    return table.reward.expected(table.mdp), table.mdp


def test_a_goal_that_is_slipped_into_pays_one_and_nothing_else_pays():
    R, mdp = steps_of("FrozenLake-v1")
    found = paid_on_arrival(R, mdp)
    assert found is not None
    np.testing.assert_allclose(found[mdp.reachable], np.eye(mdp.n_states)[15][mdp.reachable], atol=1e-8)


@pytest.mark.parametrize("rules", [{"sab": True}, {"natural": True, "sab": False}])
def test_blackjack_pays_no_number_that_its_rules_do_not_know(rules):
    R, mdp = steps_of("Blackjack-v1", **rules)
    found = paid_on_arrival(R, mdp)
    assert found is not None and not found[~mdp.terminal].any()
    assert found.min() >= -1 - 1e-9 and found.max() <= (1.5 if "natural" in rules else 1) + 1e-9


def test_what_is_found_has_the_expectations_of_every_step():
    R, mdp = steps_of("Blackjack-v1")
    found = paid_on_arrival(R, mdp)
    acting = mdp.reachable & ~mdp.terminal
    assert found is not None
    np.testing.assert_allclose((mdp.P @ found).reshape(R.shape)[acting], R[acting], atol=1e-6)


def test_payments_that_depend_on_the_step_are_none_on_states():
    assert paid_on_arrival(*steps_of("CliffWalking-v1")) is None


def test_a_solution_beyond_what_steps_pay_is_refused():
    P = np.zeros((3, 2, 3))
    P[0, 0], P[0, 1], P[1, :, 2] = [0, 0.5, 0.5], [0.0, 0.9, 0.1], 1  # the plain payments would be 2.25 and -0.25
    P[2, :, 0] = 1
    mdp = TabularMDP.from_dense(P, 0.9, np.array([1.0, 0, 0]))
    R = np.array([[1.0, 2.0], [-0.25, -0.25], [0.0, 0.0]])
    assert np.allclose(P[0] @ [0, 2.25, -0.25], R[0]) and paid_on_arrival(R, mdp) is None
