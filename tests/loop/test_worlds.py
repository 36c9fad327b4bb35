"""Worlds train, run and judge policies in the same way, with a table or without."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from scipy.stats import ks_2samp
from tiny_env import TableEnv, coin

from irl_gym.agents.noise import Noisy
from irl_gym.agents.planners import FOR_CONTROL, SB3, Agent, ValueIteration
from irl_gym.errors import InvalidParameter
from irl_gym.features.feature_maps import Functions, OneHot
from irl_gym.features.linear_reward import LinearReward
from irl_gym.files.run_folder import RunFolder
from irl_gym.judging.metrics import policy_value
from irl_gym.loop.table_world import DEFAULT_EPISODE_STEPS, TableWorld, step_limit
from irl_gym.loop.worlds import SteppedWorld, discounted_mean
from irl_gym.mdp.episodes import Episode
from irl_gym.mdp.planning.dynamic_programming import policy_iteration
from irl_gym.mdp.policies import as_distribution, load_actions
from irl_gym.mdp.rewards import TabularReward
from irl_gym.tables.discretize import discretize
from irl_gym.tables.tabulate import tabulate

SHORT = SB3(total_timesteps=64, hyperparameters={"n_steps": 8, "batch_size": 16})
POLE = LinearReward(np.ones(1), Functions(lambda seen: np.ones((len(seen), 1)), 1))


@pytest.fixture(scope="module")
def lake():
    env = gym.make("FrozenLake-v1")
    return TableWorld(env, tabulate(env, gamma=0.9, check_steps=0), 8, 0)


@pytest.fixture(scope="module")
def cells():
    env = gym.make("MountainCar-v0")
    return TableWorld(env, discretize(env, gamma=0.9, bins=5), 8, 0)


@pytest.fixture
def cart():
    return SteppedWorld(gym.make("CartPole-v1", max_episode_steps=30), 0.9, 2, 20, 0)


def test_step_limit_is_the_environments_own():
    assert step_limit(gym.make("FrozenLake-v1")) == 100


@pytest.mark.parametrize("env", [gym.make("CliffWalking-v1"), TableEnv(coin(), [1.0, 0])])
def test_step_limit_is_ours_when_there_is_none(env):
    assert step_limit(env) == DEFAULT_EPISODE_STEPS


def test_discounted_mean_is_the_mean_of_discounted_returns():
    two = [Episode(np.zeros(3, int), np.zeros(2, int), np.array([1.0, 4.0]), True, False) for _ in range(2)]
    assert discounted_mean(two, 0.5) == 3.0


# --- with a table ---


def test_table_world_values_are_exact(lake):
    assert lake.value(lake.random) == pytest.approx(policy_value(lake.table.mdp, lake.table.reward, lake.random))
    assert lake.gamma == 0.9


def test_table_world_episodes_have_the_value_of_the_policy(lake):
    returns = [discounted_mean([one], 0.9) for one in lake.episodes(lake.random, 4000, 1)]
    assert abs(np.mean(returns) - lake.value(lake.random)) < 4 * np.std(returns) / np.sqrt(4000)


def test_table_world_trains_on_the_true_reward_when_none_is_given(lake):
    policy = lake.train(lake.expert(), None)
    assert lake.glance(policy)[0] == pytest.approx(float(max_value(lake)))


def max_value(world):
    return world.table.mdp.d0 @ policy_iteration(world.table.mdp, world.table.reward).V


@pytest.mark.parametrize("reward", [TabularReward(np.arange(16.0)), LinearReward(np.arange(16.0), OneHot(16))])
def test_table_world_trains_on_rewards_of_either_kind(lake, reward):
    kept = lake.train(ValueIteration(), reward)
    expected = lake.train(ValueIteration(), TabularReward(np.arange(16.0)))
    np.testing.assert_array_equal(kept.probabilities, expected.probabilities)


@pytest.mark.parametrize(("name", "file"), [("expert", "expert.npz"), ("agent", "agent_policy.npz")])
def test_table_world_keeps_actions(lake, tmp_path, name, file):
    policy = lake.train(ValueIteration(), None)
    lake.keep(policy, tmp_path, name)
    assert np.array_equal(load_actions(tmp_path / file), policy.probabilities.argmax(axis=1))


def test_table_world_runs_the_environment_itself_when_the_table_is_of_cells(cells):
    (first, *_) = cells.episodes(cells.random, 3, 0)
    centres = cells.table.states.decode_batch(np.arange(25))
    assert len(first) == 200 and first.truncated
    assert not any((np.abs(centres - seen) < 1e-6).all(axis=1).any() for seen in first.observations)


@pytest.mark.parametrize(("shaped", "settings"), [(True, True), (False, False)])
def test_table_world_plans_with_settings_that_suit_the_reward(lake, shaped, settings):
    assert bool(lake.planner(shaped=shaped).hyperparameters) == settings


def test_table_world_runs_the_environment_itself_when_the_table_is_an_estimate():
    env = gym.make("FrozenLake-v1", is_slippery=False)
    exact = tabulate(env, gamma=0.9, check_steps=0)
    wrong = replace(exact, evidence=replace(exact.evidence, exact=False))
    nowhere = TableWorld(env, replace(wrong, mdp=tabulate(gym.make("FrozenLake-v1"), gamma=0.9, check_steps=0).mdp), 8, 0)
    right = np.full(16, 2)
    assert {tuple(one.observations) for one in nowhere.episodes(right, 20, 0)} == {(0, 1, 2, *[3] * 98)}


def test_table_world_counts_the_steps_up_to_its_horizon_only(lake):
    cut = replace(lake, horizon=30)
    returns = [discounted_mean([one], 0.9) for one in replace(cut, env=limited(30)).episodes(cut.random, 4000, 1)]
    assert cut.value(cut.random) < lake.value(lake.random)
    assert abs(np.mean(returns) - cut.value(cut.random)) < 4 * np.std(returns) / np.sqrt(4000)


def limited(steps):
    return gym.make("FrozenLake-v1", max_episode_steps=steps)


@pytest.mark.parametrize("epsilon", [0.0, 0.25])
def test_table_world_keeps_the_noise_of_an_expert(lake, tmp_path, epsilon):
    policy = lake.train(ValueIteration(), None)
    lake.keep(policy, tmp_path, "expert", epsilon)
    kept = load_actions(tmp_path / "expert.npz")
    assert np.allclose(as_distribution(kept, 16, 4), (1 - epsilon) * policy.probabilities + epsilon / 4)


# --- without ---


def test_stepped_world_plans_for_control(cart):
    assert cart.expert() == cart.planner(shaped=False) == FOR_CONTROL


def test_stepped_world_refuses_an_environment_without_a_spec():
    with pytest.raises(InvalidParameter, match="has no spec"):
        SteppedWorld(TableEnv(coin(), [1.0, 0]), 0.9, 2, 20, 0)


def test_stepped_world_value_is_the_mean_of_episodes(cart):
    one, again = cart.value(cart.random), cart.value(cart.random)
    assert one == again and 5 < one < 10


def test_stepped_world_episodes_end_at_the_time_limit(cart):
    assert max(map(len, cart.episodes(cart.random, 50, 0))) == 30


def test_stepped_world_random_episodes_do_not_depend_on_those_before(cart):
    first, second = ([len(one) for one in cart.episodes(cart.random, 40, seed)] for seed in (3, 9_999))
    assert ks_2samp(first, second).pvalue > 0.01


def test_stepped_world_keeps_the_noise_of_an_expert_and_draws_it_from_the_seed_of_the_episodes(cart, tmp_path):
    folder = RunFolder(tmp_path / "run", {})
    cart.keep(cart.train(SHORT, None), folder.path, "expert", 0.5)
    first, again = cart.load(folder, "expert"), cart.load(folder, "expert")
    assert isinstance(first, Noisy) and first.epsilon == 0.5
    cart.episodes(first, 3, 0)  # as a run that goes on has drawn some, and one that is continued has not
    assert [len(one) for one in cart.episodes(first, 9, 1)] == [len(one) for one in cart.episodes(again, 9, 1)]
    assert [len(one) for one in cart.episodes(first, 9, 1)] != [len(one) for one in cart.episodes(first, 9, 2)]


@pytest.mark.parametrize("reward", [None, POLE])
def test_stepped_world_trains_keeps_and_loads_an_agent(cart, tmp_path, reward):
    agent = cart.train(SHORT, reward)
    folder = RunFolder(tmp_path / "run", {})
    cart.keep(agent, folder.path, "agent")
    seen = np.random.default_rng(0).normal(size=(30, 4)).astype(np.float32)
    again = cart.load(folder, "agent")
    assert isinstance(again, Agent)
    assert np.array_equal(agent.predict(seen, deterministic=True)[0], again.predict(seen, deterministic=True)[0])


def test_stepped_world_trains_the_same_agent_when_the_seed_is_the_same(cart):
    seen = np.random.default_rng(0).normal(size=(30, 4)).astype(np.float32)
    first, second = (cart.train(SHORT, POLE).predict(seen, deterministic=True)[0] for _ in range(2))
    assert np.array_equal(first, second)


def test_stepped_world_keeps_agents_only(cart, lake, tmp_path):
    with pytest.raises(InvalidParameter, match=r"TabularPolicy cannot be kept.*Use SB3"):
        cart.keep(lake.train(ValueIteration(), None), tmp_path, "agent")
