"""Noise against its closed form."""

import pickle

import gymnasium as gym
import numpy as np
import pytest

from irl_gym.agents.noise import Noisy, boltzmann, boltzmann_expert, noisy
from irl_gym.errors import InvalidParameter, InvalidPolicy
from irl_gym.judging.metrics import policy_value
from irl_gym.mdp.episodes import collect
from irl_gym.mdp.planning.dynamic_programming import backup, policy_evaluation, value_iteration
from irl_gym.mdp.policies import Policy, TabularPolicy, as_distribution
from irl_gym.spaces.states import StateIndex

N = 40_000


class Always:
    """Takes one action, and remembers whether it was asked deterministically."""

    def __init__(self, action=2):
        self.action, self.asked = action, []

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        self.asked.append(deterministic)
        return (np.full(len(observation), self.action) if np.ndim(observation) else np.int64(self.action)), "hidden"


def within(shares, expected, n):
    return np.all(np.abs(shares - expected) <= 4 * np.sqrt(np.maximum(expected * (1 - expected), 1e-12) / n) + 1e-12)


@pytest.mark.parametrize("policy", [np.array([1, 0, 2]), np.eye(3), np.array([[True, True, False]] * 3)])
def test_noisy_mixes_every_kind_of_table_with_the_uniform_one(policy):
    expected = 0.7 * as_distribution(policy, 3, 3) + 0.1
    np.testing.assert_allclose(noisy(policy, 0.3, 3), expected, atol=1e-15)


def test_noisy_reads_the_number_of_actions_from_a_table_that_has_it():
    np.testing.assert_array_equal(noisy(np.eye(2), 1.0), np.full((2, 2), 0.5))


def test_noisy_asks_for_the_number_of_actions_where_actions_do_not_tell_it():
    with pytest.raises(InvalidParameter, match="Give n_actions"):
        noisy(np.array([0, 1]), 0.1)


@pytest.mark.parametrize("epsilon", [-0.1, 1.1, np.nan, True])
def test_noisy_refuses_what_is_no_probability(epsilon):
    with pytest.raises(InvalidParameter, match="epsilon is"):
        noisy(np.eye(2), epsilon)


def test_noisy_refuses_an_action_out_of_range():
    with pytest.raises(InvalidPolicy, match=r"policy\[s=1\] is action 3"):
        noisy(np.array([0, 3]), 0.1, 3)


def test_noisy_policy_draws_the_closed_form_in_a_batch():
    actions, _ = Noisy(Always(), 0.4, 4).predict(np.zeros(N, dtype=np.int64))
    assert within(np.bincount(actions, minlength=4) / N, np.array([0.1, 0.1, 0.7, 0.1]), N)


def test_noisy_policy_gives_single_observations_the_noise_of_a_batch():
    batch, _ = Noisy(Always(), 0.5, 4, seed=3).predict(np.zeros(200, dtype=np.int64))
    alone = Noisy(Always(), 0.5, 4, seed=3)
    assert [int(alone.predict(0)[0]) for _ in range(200)] == batch.tolist()


def test_noisy_policy_stays_noisy_and_asks_deterministically_when_deterministic():
    under = Always()
    actions, _ = Noisy(under, 0.4, 4).predict(np.zeros(N, dtype=np.int64), deterministic=True)
    assert under.asked == [True] and within(np.mean(actions != 2), 0.3, N)


def test_noisy_policy_without_noise_is_the_policy():
    actions, hidden = Noisy(Always(), 0.0, 4).predict(np.zeros(50, dtype=np.int64))
    assert (actions == 2).all() and hidden == "hidden"


def test_noisy_policy_depends_on_its_seed():
    one, two = (Noisy(Always(), 0.5, 4, seed=seed).predict(np.zeros(100, dtype=np.int64))[0] for seed in (0, 1))
    assert (one != two).any()


def test_noisy_policy_survives_pickling():
    table = TabularPolicy(as_distribution(np.arange(16) % 4, 16, 4), StateIndex(gym.spaces.Discrete(16)))
    kept = pickle.loads(pickle.dumps(Noisy(table, 0.5, 4, seed=5)))
    assert kept.predict(0)[0] == Noisy(table, 0.5, 4, seed=5).predict(0)[0] and isinstance(kept, Policy)


@pytest.mark.parametrize("action", [4, -1, 1.0])
def test_noisy_policy_names_an_action_that_is_none(action):
    with pytest.raises(InvalidPolicy, match=f"the policy's action is {action}: expected an integer from 0 to 3"):
        Noisy(Always(action), 0.1, 4).predict(np.zeros(3))


def test_noisy_policy_points_to_noisy_for_a_table(unchecked):
    with pytest.raises(InvalidParameter, match="Use `noisy` for tables"):
        Noisy(np.eye(3), 0.1, 3)


@pytest.mark.parametrize(("name", "value"), [("epsilon", 2), ("n_actions", 0), ("seed", -1)])
def test_noisy_policy_names_the_number_that_is_out_of_range(name, value):
    with pytest.raises(InvalidParameter, match=f"{name} is {value}"):
        Noisy(Always(), **{"epsilon": 0.1, "n_actions": 4, "seed": 0, name: value})


def test_noisy_policy_is_worth_what_the_noisy_table_is(toy_text):
    table = toy_text("FrozenLake 4x4")
    best = value_iteration(table.mdp, table.reward).policy
    env = gym.make("FrozenLake-v1", is_slippery=False)
    actor = Noisy(TabularPolicy(as_distribution(best, 16, 4), table.states), 0.2, 4, seed=1)
    returns = [0.99 ** np.arange(len(one)) @ one.rewards for one in collect(env, actor, 1500, deterministic=True)]
    exact = policy_value(table.mdp, table.reward, noisy(best, 0.2, 4))
    assert abs(np.mean(returns) - exact) < 3 * np.std(returns) / np.sqrt(len(returns))


def test_boltzmann_is_the_softmax():
    Q = np.array([[0.0, 1.0, 3.0], [5.0, 5.0, 4.0]])
    weights = np.exp(Q / 2)
    np.testing.assert_allclose(boltzmann(Q, 2.0), weights / weights.sum(axis=1, keepdims=True), rtol=1e-14)


def test_boltzmann_is_greedy_with_uniform_ties_at_zero():
    Q = np.array([[1.0, 1.0 + 1e-15, 0.0], [0.0, -2.0, -1.0]])
    np.testing.assert_array_equal(boltzmann(Q, 0.0), [[0.5, 0.5, 0], [1, 0, 0]])


def test_boltzmann_is_uniform_at_infinity():
    np.testing.assert_array_equal(boltzmann(np.array([[1.0, -1e308]]), np.inf), [[0.5, 0.5]])


@pytest.mark.parametrize("temperature", [1e-320, 1e-12, 1.0, 1e300])
def test_boltzmann_is_safe_with_extreme_numbers(temperature):
    p = boltzmann(np.array([[1e308, -1e308, 0.0], [-1e308, -1e308, -1e308]]), temperature)
    assert np.isfinite(p).all() and np.allclose(p.sum(axis=1), 1) and p[0].argmax() == 0
    np.testing.assert_allclose(p[1], 1 / 3)


@pytest.mark.parametrize("temperature", [-1.0, np.nan, -np.inf])
def test_boltzmann_refuses_a_temperature_that_is_none(temperature):
    with pytest.raises(InvalidParameter, match="temperature is"):
        boltzmann(np.eye(2), temperature)


def test_boltzmann_names_a_preference_that_is_not_finite():
    with pytest.raises(InvalidParameter, match=r"Q\[s=1, a=0\] is nan"):
        boltzmann(np.array([[0.0, 1.0], [np.nan, 1.0]]), 1.0)


def test_boltzmann_expert_is_the_softmax_of_the_experts_own_values(toy_text):
    table = toy_text("FrozenLake 4x4 slippery")
    policy = value_iteration(table.mdp, table.reward).policy
    R = table.reward.expected(table.mdp)
    Q = backup(table.mdp, R, policy_evaluation(table.mdp, R, policy))
    np.testing.assert_allclose(boltzmann_expert(table.mdp, table.reward, policy, 0.05), boltzmann(Q, 0.05), rtol=1e-12)


def test_boltzmann_expert_gets_worse_with_the_temperature(toy_text):
    table = toy_text("FrozenLake 4x4 slippery")
    best = value_iteration(table.mdp, table.reward).policy
    values = [
        policy_value(table.mdp, table.reward, boltzmann_expert(table.mdp, table.reward, best, t))
        for t in (0, 0.01, 0.1, np.inf)
    ]
    uniform = policy_value(table.mdp, table.reward, np.full((16, 4), 0.25))
    assert values[0] == pytest.approx(policy_value(table.mdp, table.reward, best))
    assert values == sorted(values, reverse=True) and values[-1] == pytest.approx(uniform)
