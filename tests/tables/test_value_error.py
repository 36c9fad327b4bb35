"""Errors of rewards and of planned values hold, and none is claimed where nothing says how large it is."""

import gymnasium as gym
import numpy as np
import pytest
from counted import counted, episode
from gymnasium import spaces
from tiny_env import TableEnv, lottery
from windy_env import Calm

from irl_gym.mdp.planning.dynamic_programming import policy_evaluation, policy_iteration
from irl_gym.tables.counted.counting import Interaction
from irl_gym.tables.enumeration.table import Enumeration

pytestmark = pytest.mark.usefixtures("unchecked")
GAMMA = 0.9


class Walk(gym.Env):
    """A random walk between two ends, one of which pays 1; the four actions do nothing."""

    observation_space, action_space = spaces.Discrete(9), spaces.Discrete(4)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.cell = 4
        return 4, {}

    def step(self, action):
        self.cell += 2 * int(self.np_random.integers(2)) - 1
        return self.cell, float(self.cell == 8), self.cell in (0, 8), False, {}


TRUE = Enumeration().table(Walk(), GAMMA)
TRUTH = float(TRUE.mdp.d0 @ policy_iteration(TRUE.mdp, TRUE.reward).V)


def walked(steps, seed):
    table = Interaction(steps, seed=seed).table(Walk(), GAMMA)
    return table, policy_iteration(table.mdp, table.reward)


def test_the_best_of_noisy_values_is_too_high_and_the_error_holds_it():
    for seed in range(6):
        table, best = walked(3_000, seed)
        planned = float(table.mdp.d0 @ best.V)
        assert TRUTH + 0.01 < planned <= TRUTH + table.evidence.value_error


def test_the_error_of_values_holds_for_the_policy_that_was_planned_and_for_any_other():
    for seed in range(4):
        table, best = walked(30_000, seed)
        for policy in (best.policy, np.zeros(9, dtype=int), np.full((9, 4), 0.25)):
            said = float(table.mdp.d0 @ policy_evaluation(table.mdp, table.reward, policy))
            assert abs(said - TRUTH) <= table.evidence.value_error < 1 / (1 - GAMMA)


def test_errors_shrink_with_more_steps():
    few, many = (walked(steps, 0)[0].evidence for steps in (3_000, 30_000))
    assert many.value_error < few.value_error / 2 and many.reward_error < few.reward_error / 2


def test_the_error_of_rewards_holds_for_each_pair():
    env = TableEnv(lottery(0.3), [1, 0])
    for seed in range(20):
        table = Interaction(200, seed=seed).table(env, GAMMA)
        assert abs(table.reward.values[0, 0] - 0.3) <= table.evidence.reward_error < 0.5


def test_no_error_is_claimed_where_all_steps_paid_the_same():
    evidence = counted([episode([0, 1], [0]), episode([0, 1], [1])]).table.evidence
    assert evidence.reward_error is None and evidence.value_error is None
    assert str(evidence).count("not known, as all steps paid the same") == 2


def test_a_pair_never_visited_may_pay_and_lead_anything():
    evidence = counted([episode([0, 1], [0], [1]), episode([0, 1], [0], [0])] * 500).table.evidence
    assert evidence.reward_error == 1 and evidence.value_error > 1


def test_a_prior_is_in_the_errors():
    walks = [episode([0, 1], [0], [1]), episode([0, 2], [1], [0])] * 1_000
    plain, moved = (counted(walks, prior=prior).table.evidence for prior in (0, 1_000))
    assert plain.reward_error < 0.1 and moved.reward_error > 1 / 3 and moved.value_error > plain.value_error


def test_enumerations_with_counted_rows_have_errors_too_and_exact_ones_none():
    counts = Enumeration(runs=2_000, start_runs=100).table(Calm(), GAMMA).evidence
    assert 0 < counts.reward_error < 0.1 and 0 < counts.value_error < 10
    assert (TRUE.evidence.error, TRUE.evidence.reward_error, TRUE.evidence.value_error) == (0, 0, 0)


def test_the_bound_on_probabilities_is_told_as_one_on_sampling_noise():
    told = str(walked(3_000, 0)[0].evidence)
    assert "for sampling noise, with 95 % confidence, if observations hide no state" in told
