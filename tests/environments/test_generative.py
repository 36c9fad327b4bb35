"""Rows of (10) by rollouts from states that the environment is set to, against the exact ones of its table."""

import gymnasium as gym
import models
import numpy as np
import pytest

from irl_gym.environments.generative import GenerativeModel, least_horizon, truncation_bound
from irl_gym.environments.tabular_env import TabularEnv
from irl_gym.errors import InvalidDiscount, InvalidParameter, InvalidPolicy, NotSettable
from irl_gym.features.feature_maps import OneHot, Table
from irl_gym.learners.linear_programs.feature_rows import rows_of_model, rows_of_table
from irl_gym.mdp.planning.discounted import Discounted
from irl_gym.mdp.planning.dynamic_programming import value_iteration
from irl_gym.mdp.policies import TabularPolicy, as_distribution
from irl_gym.spaces.states import StateIndex

DRIVE = "irl_gym_envs:irl_gym/ContinuousGridWorld-v0"


def acting(table, policy):
    """The policy of a table, on the observations of an environment that shows its rows."""
    from gymnasium import spaces

    states = StateIndex(spaces.Discrete(table.n_states))
    return TabularPolicy(as_distribution(policy, table.n_states, table.n_actions), states)


def exact_rows(mdp, expert, phi, S_0):
    return rows_of_table(mdp, expert, phi, lambda rows: rows, S_0, Discounted(mdp.P_pi(expert), mdp.gamma))


def by_rollouts(env, mdp, expert, phi, S_0, samples, **kwargs):
    settings = {"horizon": least_horizon(mdp.gamma, 1e-3), "seed": 0, **kwargs}
    states = S_0[:, None].astype(float)
    return rows_of_model(GenerativeModel(env, mdp.gamma), acting(mdp, expert), phi, states, samples=samples, **settings)


class Parallel:
    """The actions' rollouts with other random numbers for each action, to compare with."""

    def __init__(self, physics):
        self.physics, self.rngs = physics, {}

    def __getattr__(self, name):
        return getattr(self.physics, name)

    def transition(self, states, actions, rng):
        own = self.rngs.setdefault(id(rng), np.random.default_rng(len(self.rngs)))
        self.rngs[id(rng)] = own
        self.kept = getattr(self, "kept", [])
        self.kept.append(rng)  # so that no other generator gets its id
        return self.physics.transition(states, actions, own)


# --- oracle: the exact rows ---


@pytest.fixture(scope="module")
def lake(toy_text):
    table = toy_text("FrozenLake 4x4 slippery")
    return table.mdp, value_iteration(table.mdp, table.reward).policy


def in_standard_errors(found, exact):
    """How far the rows are from the exact ones, in the largest standard error of each row."""
    error = found.batches.std(axis=0, ddof=1).max(axis=1) / np.sqrt(len(found.batches))
    return np.abs(found.rows.d - exact.rows.d).max(axis=1) / error


def test_rows_of_rollouts_approach_the_exact_rows_of_a_random_table():
    model = models.random_model(0, S=5, A=2, kind="dense", gamma=0.8)
    phi, S_0 = Table(np.random.default_rng(0).normal(size=(5, 3))), np.arange(5)
    env = TabularEnv(model.mdp, model.R)
    found = by_rollouts(env, model.mdp, model.expert, phi, S_0, samples=250)
    assert in_standard_errors(found, exact_rows(model.mdp, model.expert, phi, S_0)).max() < 5


def test_rows_of_rollouts_approach_the_exact_rows_of_frozen_lake(lake):
    mdp, expert = lake
    phi, S_0 = Table(np.random.default_rng(0).normal(size=(16, 2))), np.array([0, 6, 10, 14])
    found = by_rollouts(gym.make("FrozenLake-v1"), mdp, expert, phi, S_0, samples=50, horizon=200)
    exact = exact_rows(mdp, expert, phi, S_0)
    assert in_standard_errors(found, exact).max() < 5 and len(found.rows.d) == len(exact.rows.d) == 12


@pytest.mark.parametrize("samples", [1, 3])
def test_rows_of_a_deterministic_world_are_exact_but_for_the_horizon(toy_text, samples):
    table = toy_text("FrozenLake 4x4")
    expert = value_iteration(table.mdp, table.reward).policy
    S_0 = np.flatnonzero(~table.mdp.terminal)
    found = by_rollouts(gym.make("FrozenLake-v1", is_slippery=False), table.mdp, expert, OneHot(16), S_0, samples, horizon=200)
    exact = exact_rows(table.mdp, expert, OneHot(16), S_0)
    cut = 2 * truncation_bound(0.99, 200)
    np.testing.assert_array_equal(S_0[found.states], exact.states)
    assert np.abs(found.rows.d - exact.rows.d).max() <= cut and found.trivial == exact.trivial


def test_rows_of_a_table_with_terminal_states_can_be_sampled():
    model = models.random_model(1, S=5, A=2, kind="terminal", gamma=0.8)
    S_0 = np.flatnonzero(~model.mdp.terminal)
    env = TabularEnv(models.TabularMDP(model.mdp.P, 0.8, np.eye(5)[0]), model.R)
    found = by_rollouts(env, model.mdp, model.expert, OneHot(5), S_0, samples=100)
    assert in_standard_errors(found, exact_rows(model.mdp, model.expert, OneHot(5), S_0)).max() < 5


# --- random numbers ---


def test_margins_vary_less_when_the_actions_share_their_random_numbers(monkeypatch):
    world = GenerativeModel(gym.make(DRIVE), 0.9)
    phi = Corner()
    settings = {"samples": 100, "horizon": 20, "seed": 0}
    states = world.states(20, np.random.default_rng(0))
    common = rows_of_model(world, Still(), phi, states, **settings)
    monkeypatch.setitem(world.__dict__, "physics", Parallel(world.physics))
    apart = rows_of_model(world, Still(), phi, states, **settings)
    spread = [rows.batches.std(axis=0).mean() for rows in (common, apart)]
    assert spread[0] < 0.9 * spread[1]


def test_rows_of_rollouts_repeat_themselves_when_seeded(lake):
    mdp, expert = lake
    args = (gym.make("FrozenLake-v1"), mdp, expert, OneHot(16), np.array([0, 6]), 3)
    once, again, other = (by_rollouts(*args, horizon=20, seed=seed).rows.d for seed in (1, 1, 2))
    np.testing.assert_array_equal(once, again)
    assert once.shape != other.shape or (once != other).any()


@pytest.mark.parametrize(("samples", "batches"), [(1, None), (3, 3), (5, 5), (12, 5)])
def test_rows_of_rollouts_are_the_mean_of_their_batches(lake, samples, batches):
    mdp, expert = lake
    found = by_rollouts(gym.make("FrozenLake-v1"), mdp, expert, OneHot(16), np.array([6, 10]), samples, horizon=10)
    assert (None if found.batches is None else len(found.batches)) == batches
    if samples in (3, 5):
        np.testing.assert_allclose(found.rows.d, found.batches.mean(axis=0), atol=1e-12)


# --- continuations ---


class Corner:
    """One feature of observations: near (1, 1)."""

    n_features = 1
    scaling = "Gaussian of unit height"

    def __call__(self, observations, columns=slice(None)):
        return np.exp(-20 * ((observations - 1) ** 2).sum(axis=1, keepdims=True))[:, columns]


class Still:
    """Always action 0."""

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        return np.zeros(len(observation), dtype=int), state


def sums(env, policy, states, action, **kwargs):
    settings = {"n": 1, "horizon": 5, "rng": np.random.default_rng(0), **kwargs}
    model = GenerativeModel(env, 0.5)
    return model.continuations(policy, OneHot(16), np.asarray(states, dtype=float)[:, None], action, **settings)


@pytest.fixture(scope="module")
def down():
    """Always down, on FrozenLake: 0 leads to 4, 8 and 12, a hole."""
    return acting(models.ring([[0] * 4] * 16), np.ones(16, dtype=int))


def test_continuations_begin_with_the_successor(down):
    env = gym.make("FrozenLake-v1", is_slippery=False)
    assert sums(env, down, [0], 2, horizon=1)[0].nonzero()[0].tolist() == [1, 5]  # right, then down into a hole


def test_continuations_count_the_end_once(down):
    found = sums(gym.make("FrozenLake-v1", is_slippery=False), down, [0], 1)[0]
    assert found[[4, 8, 12]].tolist() == [1, 0.5, 0.25] and found.sum() == 1.75


def test_continuations_stop_after_the_horizon(down):
    assert sums(gym.make("FrozenLake-v1", is_slippery=False), down, [1, 2], 0, horizon=1).sum() == 2 * 1.5


def test_continuations_do_not_depend_on_other_rollouts_that_end(down):
    env = gym.make("FrozenLake-v1", is_slippery=False)
    together = sums(env, down, [0, 13, 6, 2], 2)
    np.testing.assert_array_equal(together, np.concatenate([sums(env, down, [s], 2) for s in (0, 13, 6, 2)]))


# --- the model ---


def test_least_horizon_is_the_least_with_so_small_a_share():
    for gamma in (0.5, 0.9, 0.99):
        H = least_horizon(gamma)
        assert gamma**H <= 0.01 < gamma ** (H - 1)


def test_truncation_bound_is_the_rest_of_the_series():
    assert truncation_bound(0.9, 10, 2.0) == pytest.approx(2 * sum(0.9**t for t in range(11, 1000)))


def test_states_are_drawn_within_the_bounds():
    bounds = {"velocity": (-1.0, 2.0), "angular_velocity": (-3.0, -2.0)}
    drawn = GenerativeModel(gym.make("CartPole-v1"), 0.9, bounds).states(500, np.random.default_rng(0))
    np.testing.assert_allclose(drawn[:, [1, 3]].min(axis=0), [-1, -3], atol=0.02)
    np.testing.assert_allclose(drawn[:, [1, 3]].max(axis=0), [2, -2], atol=0.02)


def test_the_environment_itself_is_not_stepped():
    env = gym.make("FrozenLake-v1")
    env.reset(seed=0)
    GenerativeModel(env, 0.9).physics.transition(np.full((5, 1), 14.0), np.full(5, 2), np.random.default_rng(0))
    assert env.unwrapped.s == 0


@pytest.mark.parametrize("gamma", [0.0, 1.0, np.nan])
def test_a_discount_outside_the_interval_is_refused(gamma):
    with pytest.raises(InvalidDiscount, match=f"gamma is {gamma}"):
        GenerativeModel(gym.make("FrozenLake-v1"), gamma)


def test_an_environment_that_cannot_be_set_is_refused_when_it_is_used():
    model = GenerativeModel(gym.make("Blackjack-v1"), 0.9)
    with pytest.raises(NotSettable, match="BlackjackEnv"):
        model.states(3, np.random.default_rng(0))


def test_bounds_of_an_unknown_coordinate_are_refused():
    model = GenerativeModel(gym.make("CartPole-v1"), 0.9, {"speed": (0, 1)})
    with pytest.raises(InvalidParameter, match="bounds names 'speed'"):
        model.states(3, np.random.default_rng(0))


@pytest.mark.parametrize("actions", [[0, 4], [-1, 0], [0.0, 1.0], [0], [[0], [1]], 0, ["up", "up"]])
def test_a_policy_of_other_actions_is_refused(actions):
    class Wrong:
        def predict(self, observation, state=None, episode_start=None, deterministic=False):
            return np.array(actions), state

    model = GenerativeModel(gym.make("FrozenLake-v1"), 0.9)
    with pytest.raises(InvalidPolicy, match="for 2 observations: expected as many actions, 0 to 3"):
        model.actions(Wrong(), np.zeros((2, 1)))
