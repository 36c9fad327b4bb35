"""discretize: tables of continuous worlds, against the worlds themselves."""

import importlib

import gymnasium as gym
import numpy as np
import pytest

from irl_gym.demonstrations.datasets import read_minari, write_minari
from irl_gym.environments.learned_reward import LearnedReward
from irl_gym.environments.tabular_vec_env import TabularVecEnv
from irl_gym.errors import DatasetMismatch, InvalidDiscount, InvalidParameter, NotDiscrete, NotSettable
from irl_gym.mdp.episodes import collect, empirical_policy
from irl_gym.mdp.planning.dynamic_programming import value_iteration
from irl_gym.mdp.policies import TabularPolicy, as_distribution
from irl_gym.tables.discretize import discretize
from irl_gym.tables.tabulate import tabulate

CAR, SQUARE = "irl_gym_envs:irl_gym/MountainCar-v0", "irl_gym_envs:irl_gym/ContinuousGridWorld-v0"
UPRIGHT = {"velocity": (-2, 2), "angular_velocity": (-2, 2)}


def pendulum(bins=3):
    return gym.wrappers.DiscretizeAction(gym.make("Pendulum-v1"), bins)


def greedy(found):
    return value_iteration(found.mdp, found.reward, sweeps=20).policy


def lengths(env_id, found, policy, n):
    """Steps of n episodes of the true environment under a policy of the table, at most 500."""
    env, steps = gym.make(env_id, max_episode_steps=500), []
    for seed in range(n):
        observation, _ = env.reset(seed=seed)
        done, steps = False, [*steps, 0]
        while not done:
            observation, _, terminated, truncated, _ = env.step(int(policy[found.states.encode(observation)]))
            done, steps[-1] = terminated or truncated, steps[-1] + 1
    return steps


@pytest.fixture(scope="module")
def car():
    return discretize(gym.make(CAR), gamma=0.99, bins=120)


def test_discretize_drives_the_mountain_car_to_the_goal(car):
    steps = lengths(CAR, car, greedy(car), 20)
    assert max(steps) < 130


def test_discretize_drives_gymnasiums_mountain_car_to_the_goal():
    found = discretize(gym.make("MountainCar-v0"), gamma=0.99, bins=(60, 60))
    assert max(lengths("MountainCar-v0", found, greedy(found), 10)) < 130


def test_discretize_balances_cart_pole():
    env = gym.make("CartPole-v1")
    found = discretize(env, gamma=0.99, bins=(16, 16, 12, 12), bounds=UPRIGHT, successors="sampled", samples=8)
    assert lengths("CartPole-v1", found, greedy(found), 2) == [500, 500]


@pytest.mark.parametrize("successors", ["multilinear", "sampled"])
def test_discretize_finds_the_value_of_the_continuous_grid_world(successors):
    found = discretize(gym.make(SQUARE), gamma=0.9, bins=50, successors=successors, samples=20)
    on_arrival = found.mdp.d0 @ value_iteration(found.mdp, found.reward).V
    # Ng & Russell pay the first state too, which is in the goal with probability 0.04.
    assert 0.04 + 0.9 * on_arrival == pytest.approx(6.55, rel=0.02)


def test_discretize_of_a_discrete_world_is_its_table():
    env = gym.make("CliffWalking-v1")
    found, exact = discretize(env, gamma=0.9, bins=48), tabulate(env, gamma=0.9)
    V, true = (value_iteration(table.mdp, table.reward).V for table in (found, exact))
    seen = exact.mdp.reachable & ~exact.mdp.terminal
    np.testing.assert_allclose(V[:48][seen], true[seen])


def test_discretize_averages_noise():
    env = gym.make("FrozenLake-v1")
    found, exact = discretize(env, gamma=0.9, bins=16, samples=400), tabulate(env, gamma=0.9)
    moves = found.mdp.P[[14 * 4 + 2]].toarray()[0]
    np.testing.assert_allclose([moves[10], moves[14], moves[16:].sum()], [1 / 3] * 3, atol=0.08)
    assert found.reward.values[14, 2] == pytest.approx(exact.reward.values[14, 2], abs=0.08)
    assert found.payments.deviation[14, 2] == pytest.approx(exact.payments.deviation[14, 2], abs=0.08)


def test_discretize_moves_linear_functions_exactly():
    found = discretize(gym.make(SQUARE, noise=0.0, step_size=0.13), gamma=0.9, bins=(9, 11))
    centres = found.states.centres(np.arange(99))
    for a, move in enumerate([(0, 0.13), (0.13, 0), (0, -0.13), (-0.13, 0)]):
        ends = np.clip(centres + move, centres.min(axis=0), centres.max(axis=0))
        np.testing.assert_allclose(found.mdp.P_a(a) @ centres, ends, atol=1e-12)


@pytest.mark.parametrize(("env", "bins"), [(pendulum(), 21), (gym.make("Acrobot-v1"), 6)], ids=["Pendulum", "Acrobot"])
def test_discretize_makes_tables_of_worlds_with_angles(env, bins):
    found = discretize(env, gamma=0.9, bins=bins)
    sums = found.mdp.P.sum(axis=1).reshape(found.mdp.n_states, -1)
    np.testing.assert_allclose(sums[: found.states.n_cells], 1, atol=1e-12)
    assert not sums[found.states.n_cells :].any()


def test_discretize_wraps_angles_around():
    found = discretize(pendulum(), gamma=0.9, bins=(20, 9))
    row = found.states.encode(np.array([np.cos(3.1), np.sin(3.1), 7.0], dtype=np.float32))
    ends = found.mdp.P[[row * 3 + 1]].indices
    assert row // 9 == 19 and set(ends // 9) <= {0, 1, 2, 3}


def test_discretize_leads_ends_of_episodes_to_terminal_copies(car):
    found, n = car.mdp, car.states.n_cells
    assert found.n_states > n and car.evidence.split == found.n_states - n
    np.testing.assert_array_equal(found.terminal, np.arange(found.n_states) >= n)
    at_the_end = car.states.decode_batch(np.arange(n, found.n_states))[:, 0]
    assert (at_the_end > 0.5 - 1.7 / 120).all()  # all in the last cell
    assert not car.reward.values[n:].any() and (car.reward.values[:n] == -1).all()


def test_discretize_ends_nothing_when_nothing_ends():
    found = discretize(gym.make(CAR, terminal_goal=False), gamma=0.99, bins=20)
    assert not found.mdp.terminal.any() and found.mdp.n_states == 400


def test_discretize_begins_where_episodes_begin(car):
    begun = car.states.decode_batch(np.flatnonzero(car.mdp.d0))
    assert begun[:, 0].min() > -0.62 and begun[:, 0].max() < -0.38 and np.abs(begun[:, 1]).max() < 0.001
    assert not car.mdp.d0[car.mdp.terminal].any()
    assert car.mdp.d0 @ car.states.decode_batch(np.arange(car.mdp.n_states)) == pytest.approx([-0.5, 0], abs=0.01)


def test_discretize_counts_samples_from_the_whole_cell():
    found = discretize(gym.make(CAR, task="park"), gamma=0.99, bins=10, successors="sampled", samples=200, seed=1)
    row = found.states.encode(np.array([-0.605, 0.0], dtype=np.float32))  # from -0.69 to -0.52, velocities to 0.014
    P = found.mdp.P[[row * 3 + 1]]
    assert len(P.indices) >= 3 and (np.round(P.data * 200, 6) % 1 == 0).all()
    edge = found.states.encode(np.array([-0.73, 0.0], dtype=np.float32))  # the edge of the valley goes through it
    assert 0 < found.reward.values[edge, 1] < 1 and found.payments.deviation[edge, 1] > 0.1


def test_discretize_is_the_same_in_any_blocks(monkeypatch):
    whole = discretize(gym.make(CAR), gamma=0.9, bins=20)
    monkeypatch.setattr(importlib.import_module("irl_gym.tables.discretize"), "BLOCK", 500)  # the facade's name is the function
    shares = []
    parts = discretize(gym.make(CAR), gamma=0.9, bins=20, on_progress=shares.append)
    assert abs(whole.mdp.P - parts.mdp.P).max() == 0 and (whole.reward.values == parts.reward.values).all()
    assert len(shares) > 5 and shares == sorted(shares) and shares[-1] == 1


@pytest.mark.parametrize("successors", ["multilinear", "sampled"])
def test_discretize_is_the_same_when_seeded_the_same(successors):
    tables = [discretize(gym.make(SQUARE), gamma=0.9, bins=8, successors=successors, seed=s).mdp for s in (3, 3, 4)]
    assert abs(tables[0].P - tables[1].P).max() == 0 and (tables[0].d0 == tables[1].d0).all()
    assert abs(tables[0].P - tables[2].P).max() > 0 and (tables[0].d0 != tables[2].d0).any()


def test_discretize_says_that_it_is_not_exact(car):
    assert not car.evidence.exact and car.evidence.check is None
    assert "120 x 120 cells" in car.evidence.method and "1000 resets" in car.evidence.method


def test_discretize_leaves_the_environment_alone():
    env = gym.make("CartPole-v1")
    first, _ = env.reset(seed=0)
    discretize(env, gamma=0.9, bins=3)
    np.testing.assert_array_equal(env.unwrapped.state.astype(np.float32), first)


def test_discretize_gives_states_that_policies_and_demonstrations_use(car):
    policy = TabularPolicy(as_distribution(greedy(car), car.mdp.n_states, 3), car.states)
    actions, _ = policy.predict(car.states.decode_batch(np.arange(5)))
    assert actions.shape == (5,)
    vector = TabularVecEnv(car.mdp, car.reward, num_envs=4, states=car.states, seed=0)
    assert vector.observation_space == car.states.space and vector.observation_space.contains(vector.reset()[0])
    episodes = list(collect(gym.make(CAR, max_episode_steps=200), policy, 3, seed=0))
    assert empirical_policy(episodes, car.states, 3).counts.sum() == sum(len(episode) for episode in episodes)


def test_discretize_gives_states_that_a_learned_reward_uses(car):
    R = np.arange(car.mdp.n_states, dtype=float)
    env = LearnedReward(gym.make(CAR), R, car.states)
    env.reset(seed=0, options={"state": [0.49, 0.05]})
    observation, paid, terminated, _, _ = env.step(2)
    assert terminated and paid == car.states.encode(observation, terminated=True) >= car.states.n_cells


@pytest.mark.filterwarnings("ignore::UserWarning")  # Minari remarks on metadata left at their defaults
@pytest.mark.parametrize("env_id", [CAR, "CartPole-v1"])
def test_discretize_gives_states_that_datasets_are_checked_against(env_id, tmp_path):
    env = gym.make(env_id, max_episode_steps=20)
    states = discretize(env, gamma=0.9, bins=4).states
    actor = TabularPolicy(np.full((states.n_states, int(env.action_space.n)), 1 / int(env.action_space.n)), states)
    episodes = list(collect(env, actor, 2, seed=0))
    write_minari(episodes, "irl_gym/continuous-v0", env, root=tmp_path, algorithm="random")
    again = list(read_minari("irl_gym/continuous-v0", states=states, root=tmp_path))
    np.testing.assert_array_equal(again[0].rows(states), episodes[0].rows(states))
    with pytest.raises(DatasetMismatch, match="observations"):
        list(read_minari("irl_gym/continuous-v0", states=discretize(pendulum(), gamma=0.9, bins=3).states, root=tmp_path))


def test_tabulate_points_to_discretize_when_observations_are_floats():
    with pytest.raises(NotDiscrete, match=r"discretize\(env, gamma=..., bins=...\)"):
        tabulate(gym.make("CartPole-v1"), gamma=0.9)


def test_discretize_refuses_what_takes_too_much_memory_before_it_begins():
    with pytest.raises(InvalidParameter, match=r"100,000,000 states .* 3,200,000,000 transitions.* GB.*memory_limit"):
        discretize(gym.make("CartPole-v1"), gamma=0.9, bins=100)
    with pytest.raises(InvalidParameter, match="GB"):
        discretize(gym.make(CAR), gamma=0.9, bins=10, memory_limit=1e4)
    with pytest.raises(InvalidParameter, match="GB"):
        discretize(gym.make("CartPole-v1"), gamma=0.9, bins=10**9)


@pytest.mark.parametrize(
    "kwargs",
    [
        {"bins": 0},
        {"bins": (10, 10, 10)},
        {"bins": "many"},
        {"bounds": {"speed": (0, 1)}},
        {"successors": "nearest"},
        {"samples": 0},
        {"starts": 0},
        {"seed": -1},
        {"memory_limit": 0},
    ],
)
def test_discretize_refuses_bad_arguments(kwargs, unchecked):
    with pytest.raises(InvalidParameter, match=next(iter(kwargs))):
        discretize(gym.make(CAR), **{"gamma": 0.9, "bins": 10, **kwargs})


def test_discretize_refuses_a_discount_of_1():
    with pytest.raises(InvalidDiscount, match="gamma"):
        discretize(gym.make(CAR), gamma=1.0, bins=10)


def test_discretize_refuses_worlds_that_hide_their_state():
    with pytest.raises(NotSettable, match="BlackjackEnv"):
        discretize(gym.make("Blackjack-v1"), gamma=0.9, bins=10)


def test_discretize_refuses_tables():
    with pytest.raises(InvalidParameter, match="Use `tabulate"):
        discretize(gym.make("irl_gym_envs:irl_gym/GridWorld-v0"), gamma=0.9, bins=25)
