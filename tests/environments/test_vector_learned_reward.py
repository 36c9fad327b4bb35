"""VectorLearnedReward pays each environment of a vector as LearnedReward pays it alone."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import TimeLimit
from tiny_env import TableEnv, both_ways

from irl_gym.environments.learned_reward import LearnedReward, VectorLearnedReward
from irl_gym.errors import InvalidInput
from irl_gym.features.bases import RadialBasis
from irl_gym.features.linear_reward import LinearReward
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.mdp.planning.dynamic_programming import policy_iteration
from irl_gym.mdp.rewards import TabularReward
from irl_gym.tables.tabulate import tabulate

LAKE = {"is_slippery": False, "max_episode_steps": 9}
UPRIGHT = LinearReward(np.array([-1.0, 2.0]), RadialBasis(np.array([[0.0] * 4, [1.0] * 4]), np.array([1.0, np.inf, 0.2, 1.0])))


@pytest.fixture(scope="module")
def lake():
    return tabulate(gym.make("FrozenLake-v1", **LAKE), gamma=0.9)


@pytest.fixture(scope="module")
def outcome(lake):
    return FiniteLP().fit(lake.mdp, policy_iteration(lake.mdp, lake.reward).policy)


def paths(env, actions):
    """Observation, payment, end, true and learned reward of steps, an environment at a time, begun anew where they end."""
    env.reset(seed=5)
    for action in actions.tolist():
        _, paid, terminated, truncated, info = env.step(action)
        yield float(paid), terminated or truncated, float(info["true_reward"]), float(info["learned_reward"])
        if terminated or truncated:
            env.reset()


@pytest.mark.parametrize("mode", list(AutoresetMode))
@pytest.mark.parametrize("split", [False, True])
def test_a_vector_environment_is_paid_as_each_of_its_environments(lake, outcome, mode, split):
    def make():
        return TimeLimit(TableEnv(both_ways(), [1, 0, 0]), 4) if split else gym.make("FrozenLake-v1", **LAKE)

    if split:
        table, reward = tabulate(TableEnv(both_ways(), [1, 0, 0]), gamma=0.9, check_steps=0), np.array([0.0, 1.0, 2.0, 7.0])
    else:
        table, reward = lake, outcome
    venv = VectorLearnedReward(SyncVectorEnv([make] * 3, autoreset_mode=mode), reward, shaping=table)
    rng, taken, found = np.random.default_rng(1), [[], [], []], [[], [], []]
    ended = np.zeros(3, dtype=bool)
    venv.reset(seed=5)
    for _ in range(40):
        if mode is AutoresetMode.DISABLED and ended.any():
            venv.reset(options={"reset_mask": ended})
        actions = rng.integers(0, venv.single_action_space.n, 3)
        _, paid, terminated, truncated, infos = venv.step(actions)
        for i in range(3):
            if mode is AutoresetMode.NEXT_STEP and ended[i]:
                assert paid[i] == 0
                continue
            taken[i].append(actions[i])
            row = paid[i], terminated[i] or truncated[i], infos["true_reward"][i], infos["learned_reward"][i]
            found[i].append(tuple(map(float, row)))
        ended = terminated | truncated
    assert ended.shape == (3,)
    for i in range(3):
        assert found[i] == list(paths(LearnedReward(make(), reward, shaping=table), np.array(taken[i])))


def test_a_linear_reward_is_paid_to_a_vector_environment_of_floats():
    venv = VectorLearnedReward(gym.make_vec("CartPole-v1", 2, vectorization_mode="vector_entry_point"), UPRIGHT)
    venv.reset(seed=0)
    observations, paid, *_ = venv.step(np.array([0, 1]))
    assert paid == pytest.approx(UPRIGHT.of(observations))


def test_a_step_of_a_vector_environment_before_the_first_episode_is_refused():
    with pytest.raises(InvalidInput, match="call reset first"):
        VectorLearnedReward(gym.make_vec("FrozenLake-v1", 2), TabularReward(np.zeros(16))).step(np.array([0, 0]))
