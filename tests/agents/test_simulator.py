"""A simulator's sums are the values of features, on the table and in the environment alike."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from tiny_env import TableEnv

from irl_gym.agents.planners import SB3, ValueIteration, tabular_actions
from irl_gym.agents.simulator import RandomPolicy, Simulator
from irl_gym.errors import InvalidDiscount, InvalidFeatures, InvalidParameter, NotDiscrete, NotTabular
from irl_gym.features.bases import RadialBasis
from irl_gym.features.feature_maps import Functions, OneHot, Table
from irl_gym.features.linear_reward import LinearReward
from irl_gym.judging.metrics import policy_value
from irl_gym.learners.linear_programs.trajectory import World
from irl_gym.mdp.planning.dynamic_programming import occupancy, policy_iteration
from irl_gym.mdp.policies import TabularPolicy, as_distribution
from irl_gym.mdp.rewards import TabularReward
from irl_gym.tables.discretize import discretize

GAMMA = 0.9
LONG = 200  # 0.9^200 < 1e-9
PHI = np.random.default_rng(5).normal(size=(16, 3))


ONES = Functions(lambda seen: np.ones((len(seen), 1)), 1)


def constant(value):
    return LinearReward(np.array([value]), ONES)


class NoPlanner:
    """A planner that is never asked: the simulator makes no table for it."""

    def plan(self, env, *, gamma, seed=0, progress=None):
        raise AssertionError("nothing is to be planned")


def lake(**kwargs):
    return gym.make("FrozenLake-v1", max_episode_steps=10_000, **kwargs)


@pytest.fixture(scope="module")
def on_table():
    return Simulator(lake(), ValueIteration(), GAMMA)


@pytest.fixture(scope="module")
def stepped():
    return Simulator(lake(), NoPlanner(), GAMMA)


def exact(table, policy, phi=PHI):
    """(K,) what sums are an estimate of: occupancy @ phi, and phi of the ends, which count once and have no successors."""
    mdp = table.mdp
    taken = occupancy(mdp, policy)
    ends = np.where(mdp.terminal, mdp.gamma * (mdp.P.T @ taken.ravel()), 0.0)
    return (taken.sum(axis=1) + ends) @ phi


def actor(table, actions):
    return TabularPolicy(as_distribution(actions, table.mdp.n_states, table.mdp.n_actions), table.states)


def z_scores(sums, mean):
    return np.abs(sums.mean(axis=0) - mean) / (sums.std(axis=0, ddof=1) / np.sqrt(len(sums)))


@pytest.mark.parametrize("path", ["on_table", "stepped"])
def test_sums_agree_with_the_exact_occupancy(path, request, on_table):
    policy = np.arange(16) % 4
    sums = request.getfixturevalue(path).sums(actor(on_table.known, policy), Table(PHI), 3000, horizon=LONG, seed=0)
    assert z_scores(sums, exact(on_table.known, policy)).max() < 3.5


@pytest.mark.parametrize("path", ["on_table", "stepped"])
def test_sums_of_no_policy_are_those_of_random_actions(path, request, on_table):
    sums = request.getfixturevalue(path).sums(None, Table(PHI), 3000, horizon=LONG, seed=1)
    assert z_scores(sums, exact(on_table.known, np.full((16, 4), 0.25))).max() < 3.5


def test_sums_count_the_first_state_and_the_last():
    env = TableEnv([[[(1.0, 1, 0.0, False)]], [[(1.0, 2, 0.0, True)]], [[(1.0, 2, 0.0, True)]]], [1.0, 0, 0])
    for planner in (ValueIteration(), NoPlanner()):
        (row,) = Simulator(env, planner, 0.5).sums(None, OneHot(3), 1, horizon=9, seed=0)
        assert row.tolist() == [1.0, 0.5, 0.25]


@pytest.mark.parametrize("path", ["on_table", "stepped"])
def test_sums_are_cut_after_the_horizon(path, request):
    sums = request.getfixturevalue(path).sums(None, Table(np.ones((16, 1))), 200, horizon=3, seed=0)
    assert sums.max() == pytest.approx(1 + 0.9 + 0.81 + 0.729) and sums.min() >= 1 + 0.9


@pytest.mark.parametrize(("planner", "limit"), [(ValueIteration(), None), (NoPlanner(), 2)])
def test_sums_are_cut_by_the_time_limit_where_the_environment_is_run(planner, limit):
    world = Simulator(gym.make("FrozenLake-v1", max_episode_steps=2), planner, GAMMA)
    sums = world.sums(None, Table(np.ones((16, 1))), 50, horizon=LONG, seed=0)
    assert world.limit == limit and (sums.max() > 3) == (limit is None)


@pytest.mark.parametrize("path", ["on_table", "stepped"])
def test_sums_are_the_same_when_the_seed_is(path, request):
    world = request.getfixturevalue(path)
    first, second, third = (world.sums(None, OneHot(16), 20, horizon=9, seed=seed) for seed in (4, 4, 5))
    np.testing.assert_array_equal(first, second)
    assert not np.array_equal(first, third)


def test_sums_are_the_same_when_phi_is_not_kept_in_a_table(on_table, monkeypatch):
    kept = on_table.sums(None, Table(PHI), 20, horizon=9, seed=0)
    monkeypatch.setattr("irl_gym.agents.simulator.MOST_TABLED", 1)
    np.testing.assert_array_equal(on_table.sums(None, Table(PHI), 20, horizon=9, seed=0), kept)


@pytest.mark.parametrize("path", ["on_table", "stepped"])
def test_sums_refuse_features_that_are_not_finite(path, request):
    broken = Functions(lambda seen: np.where(seen[:, None] == 0, np.nan, 1.0), 1)
    with pytest.raises(InvalidFeatures, match="nan"):
        request.getfixturevalue(path).sums(None, broken, 3, horizon=9, seed=0)


def test_sums_of_tuple_observations():
    world = Simulator(gym.make("Blackjack-v1"), NoPlanner(), GAMMA)
    mine = Functions(lambda seen: np.stack([seen[0], seen[2]], axis=1), 2)
    assert world.sums(None, mine, 30, horizon=20, seed=0)[:, 0].min() >= 4  # the least sum of two cards


def test_a_discretisation_is_not_what_is_run():
    env = gym.make("MountainCar-v0")
    world = Simulator(env, ValueIteration(), 0.99, discretize(env, gamma=0.99, bins=6))
    seen = []
    spy = Functions(lambda observations: seen.append(observations) or np.ones((len(observations), 1)), 1)
    world.sums(None, spy, 20, horizon=1, seed=0)
    assert len(np.unique(seen[0][:, 0])) == 20  # cells have 6 centres only


# --- plans ---


def test_plan_on_a_table_is_optimal_for_the_reward(on_table):
    alpha = np.random.default_rng(0).normal(size=16)
    mdp, reward = on_table.known.mdp, TabularReward(alpha)
    policy = on_table.plan(LinearReward(alpha, OneHot(16)))
    best = float(mdp.d0 @ policy_iteration(mdp, reward.expected(mdp)).V)
    assert policy_value(mdp, reward, tabular_actions(policy, on_table.known.states)) == pytest.approx(best)


def test_plan_on_cells_acts_on_the_observations_of_the_environment():
    env = gym.make("MountainCar-v0")
    world = Simulator(env, ValueIteration(), 0.99, discretize(env, gamma=0.99, bins=6))
    phi = RadialBasis.grid([-1.2, -0.07], [0.6, 0.07], 2)
    actions, _ = world.plan(LinearReward(np.array([1.0, 0, 0, 1]), phi)).predict(
        env.observation_space.sample()[None], deterministic=True
    )
    assert actions.shape == (1,) and 0 <= actions[0] < 3


class Kept:
    """A planner that keeps the world it is given."""

    def plan(self, env, *, gamma, seed=0, progress=None):
        self.env, self.gamma, self.seed = env, gamma, seed
        return RandomPolicy(2, np.random.default_rng(seed))


def test_plan_steps_the_environment_when_there_is_no_table():
    planner = Kept()
    Simulator(gym.make("CartPole-v1"), planner, 0.95, num_envs=3).plan(constant(2.0), seed=7)
    planner.env.reset()
    planner.env.step(np.zeros(3, dtype=int))
    assert (planner.env.num_envs, planner.gamma, planner.seed) == (3, 0.95, 7)
    assert planner.env.get_original_reward().tolist() == [2.0] * 3


def test_plan_copies_an_environment_that_has_no_spec():
    planner = Kept()
    env = TableEnv([[[(1.0, 0, 0.0, False)]]], [1.0])
    Simulator(env, planner, 0.9, num_envs=2).plan(constant(1.0))
    assert planner.env.get_attr("P") == [env.P] * 2


def test_plan_trains_on_the_table_that_is_given(on_table):
    agent = Simulator(lake(), SB3(total_timesteps=2048), GAMMA, on_table.known).plan(LinearReward(np.ones(16), OneHot(16)))
    assert agent.model.num_timesteps >= 2048 and agent.model.observation_space == spaces.Discrete(16)


def test_plan_is_the_same_when_the_seed_is():
    world = Simulator(gym.make("CartPole-v1"), SB3(total_timesteps=64, hyperparameters={"n_steps": 8}), 0.9)
    seen = np.random.default_rng(0).normal(size=(50, 4)).astype(np.float32)
    first, second = (world.plan(constant(1.0), seed=3).model.predict(seen)[0] for _ in range(2))
    assert np.array_equal(first, second)


# --- refusals ---


def test_value_iteration_says_what_to_do_when_coordinates_have_no_table():
    world = Simulator(gym.make("CartPole-v1"), ValueIteration(), GAMMA)
    with pytest.raises(NotDiscrete, match=r"discretize\(env, gamma=\.\.\., bins=\.\.\.\)"):
        world.plan(constant(1.0))


def test_value_iteration_says_what_to_do_when_an_environment_hides_something():
    with pytest.raises(NotTabular, match=r"a natural.*reveal.Reveal\(env\).*plan with SB3"):
        _ = Simulator(gym.make("Blackjack-v1"), ValueIteration(), GAMMA).known


def test_continuous_actions_are_refused_with_a_mend():
    with pytest.raises(InvalidParameter, match="DiscretizeAction"):
        Simulator(gym.make("Pendulum-v1"), ValueIteration(), GAMMA)


def test_discretised_actions_are_taken():
    env = gym.wrappers.DiscretizeAction(gym.make("Pendulum-v1"), 3)
    assert Simulator(env, NoPlanner(), GAMMA).sums(None, ONES, 2, horizon=4, seed=0).shape == (2, 1)


@pytest.mark.parametrize("gamma", [0.0, 1.0, float("nan")])
def test_a_discount_outside_the_interval_is_refused(gamma):
    with pytest.raises(InvalidDiscount):
        Simulator(lake(), ValueIteration(), gamma)


@pytest.mark.parametrize("num_envs", [0, -1, 1.5])
def test_fewer_than_one_copy_is_refused(num_envs, unchecked):
    with pytest.raises(InvalidParameter, match="num_envs is"):
        Simulator(lake(), ValueIteration(), GAMMA, num_envs=num_envs)


def test_simulator_is_a_world(on_table):
    assert isinstance(on_table, World)
