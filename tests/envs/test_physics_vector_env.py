"""Vector environments on a physics: Gymnasium's conventions, and the same episodes as single environments."""

import time

import gymnasium as gym
import numpy as np
import pytest

from irl_gym.errors import InvalidInput, InvalidParameter

CAR, SQUARE = "irl_gym_envs:irl_gym/MountainCar-v0", "irl_gym_envs:irl_gym/ContinuousGridWorld-v0"


def make(env_id=CAR, num_envs=3, **kwargs):
    return gym.make_vec(env_id, num_envs=num_envs, vectorization_mode="vector_entry_point", **kwargs)


def test_physics_vector_env_steps_as_single_environments_do():
    states = np.random.default_rng(0).uniform([-1.2, -0.07], [0.5, 0.07], size=(3, 2))
    vector = make(terminal_goal=False, task="park")
    vector.reset(options={"state": states})
    singles = [gym.make(CAR, terminal_goal=False, task="park") for _ in range(3)]
    for env, state in zip(singles, states, strict=True):
        env.reset(options={"state": state})
    for t in range(200):
        actions = np.array([t % 3, 2, 0])
        observations, rewards, terminated, truncated, _ = vector.step(actions)
        expected = [env.step(a) for env, a in zip(singles, actions, strict=True)]
        np.testing.assert_array_equal(observations, [line[0] for line in expected])
        np.testing.assert_array_equal(rewards, [line[1] for line in expected])
        assert not terminated.any() and not truncated.any()


def test_physics_vector_env_begins_anew_at_the_step_after_an_end():
    vector = make(num_envs=2)
    vector.reset(seed=0, options={"state": [[0.49, 0.05], [-0.5, 0.0]]})
    observations, rewards, terminated, _, _ = vector.step(np.array([2, 2]))
    assert terminated.tolist() == [True, False] and observations[0, 0] == 0.5
    observations, rewards, terminated, _, _ = vector.step(np.array([2, 2]))
    assert (terminated.tolist(), rewards.tolist()) == ([False, False], [0.0, -1.0])
    assert -0.6 <= observations[0, 0] <= -0.4 and observations[0, 1] == 0


def test_physics_vector_env_truncates_as_a_time_limit_does():
    vector, other = make(SQUARE, max_episode_steps=4), gym.make_vec(SQUARE, 3, "sync", max_episode_steps=4)
    found, expected = [], []
    for env, flags in ((vector, found), (other, expected)):
        env.reset(seed=0)
        flags.extend(env.step(np.zeros(3, dtype=np.int64))[3].tolist() for _ in range(15))
    assert found == expected


def test_physics_vector_env_takes_the_time_limit_of_the_registration():
    assert make(SQUARE).max_episode_steps == 50


def test_physics_vector_env_walks_the_same_way_when_seeded_the_same():
    walks = []
    for _ in range(2):
        vector = make(SQUARE)
        first, _ = vector.reset(seed=4)
        walks.append([first, *(vector.step(np.array([0, 1, 2]))[0] for _ in range(60))])
    np.testing.assert_array_equal(*walks)


def test_physics_vector_env_observations_are_in_its_space():
    vector = make(SQUARE)
    observations, _ = vector.reset(seed=0)
    assert vector.observation_space.contains(observations)
    assert vector.observation_space.contains(vector.step(vector.action_space.sample())[0])


@pytest.mark.slow
def test_physics_vector_env_steps_5000_copies_in_the_time_of_10_single_steps():
    def steps(num_envs):
        """Processor seconds of 100 steps, the least of five."""
        vector, actions = make(num_envs=num_envs), np.random.default_rng(0).integers(3, size=num_envs)
        vector.reset(seed=0)

        def once():
            began = time.process_time()
            for _ in range(100):
                vector.step(actions)
            return time.process_time() - began

        return min(once() for _ in range(5))

    ratio = steps(5000) / steps(1)
    print(f"5,000 copies take {ratio:.1f} times as long as one")
    assert ratio < 10


@pytest.mark.parametrize(
    ("actions", "said"), [([0, 1], "shape"), ([0.0, 1.0, 2.0], "float64"), ([0, 1, 3], "range from 0 to 3")]
)
def test_physics_vector_env_refuses_bad_actions(actions, said):
    vector = make()
    vector.reset(seed=0)
    with pytest.raises(InvalidInput, match=said):
        vector.step(np.array(actions))


@pytest.mark.parametrize("state", [[0.0], [[9.0, 0.0]] * 3, "here"])
def test_physics_vector_env_refuses_bad_states(state):
    with pytest.raises(InvalidInput, match="state"):
        make().reset(options={"state": state})


def test_physics_vector_env_refuses_to_step_before_reset():
    with pytest.raises(InvalidInput, match="reset first"):
        make().step(np.zeros(3, dtype=np.int64))


@pytest.mark.parametrize("kwargs", [{"num_envs": 0}, {"max_episode_steps": 0}, {"render_mode": "human"}])
def test_physics_vector_env_refuses_bad_arguments(kwargs):
    with pytest.raises(InvalidParameter, match=next(iter(kwargs))):
        make(**kwargs)
