"""Stable-Baselines3's buffers, filled by its algorithms and by hand, become the episodes that were played."""

import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium import spaces
from stable_baselines3 import DQN, PPO
from stable_baselines3.common.buffers import DictReplayBuffer, ReplayBuffer, RolloutBuffer
from stable_baselines3.common.vec_env import DummyVecEnv

from irl_gym.demonstrations.imports.buffers import from_rollouts
from irl_gym.errors import InvalidDemonstrations, NotDiscrete

SPACE, ACTIONS = spaces.Discrete(16), spaces.Discrete(4)


def lines(copies):
    """(T, E): copy e observes e, e + 1, ..., takes action t mod 4, ends after 3 steps by termination and after 6 by a limit."""
    for t in range(8):
        observed = np.arange(copies) + t
        done, limit = t in (2, 5), t == 5
        yield observed, observed + 1, np.full(copies, t % 4), np.full(copies, float(t)), np.full(copies, done), limit


def replay(size=8, copies=2, **kwargs):
    buffer = ReplayBuffer(size * copies, SPACE, ACTIONS, n_envs=copies, **kwargs)
    for observed, after, actions, rewards, done, limit in lines(copies):
        buffer.add(observed, after, actions, rewards, done, [{"TimeLimit.truncated": limit}] * copies)
    return buffer


def rollout(copies=2, size=8):
    buffer = RolloutBuffer(size, SPACE, ACTIONS, n_envs=copies)
    start = np.ones(copies)
    for observed, _, actions, rewards, done, _ in lines(copies):
        buffer.add(observed, actions, rewards, start, torch.zeros(copies), torch.zeros(copies))
        start = done.astype(float)
    return buffer


PLAYED = [([0, 1, 2, 3], [0, 1, 2], True), ([3, 4, 5, 6], [3, 0, 1], False), ([6, 7, 8], [2, 3], False)]


def seen(episodes):
    return [(one.observations.tolist(), one.actions.tolist(), one.terminated) for one in episodes]


def shifted(episodes, by):
    return [([one + by for one in observations], actions, ended) for observations, actions, ended in episodes]


def test_a_replay_buffer_gives_whole_episodes_copy_after_copy():
    episodes = from_rollouts(replay())
    assert seen(episodes) == PLAYED + shifted(PLAYED, 1)
    assert [one.truncated for one in episodes] == [False, True, True] * 2
    assert episodes[1].rewards.tolist() == [3.0, 4.0, 5.0]


def test_a_full_replay_buffer_is_read_from_its_oldest_step():
    assert seen(from_rollouts(replay(size=6)))[:3] == [([2, 3], [2], True), *PLAYED[1:]]


def test_a_replay_buffer_that_is_not_full_is_read_as_far_as_it_is():
    assert seen(from_rollouts(replay(size=100))) == PLAYED + shifted(PLAYED, 1)


def test_a_replay_buffer_without_last_observations_follows_the_rule():
    buffer = replay(copies=1, optimize_memory_usage=True, handle_timeout_termination=False)
    with pytest.warns(UserWarning, match="the last action of 3 of 3 episodes is dropped"):
        episodes = from_rollouts(buffer, last="drop")
    overwritten = [([1, 2], [1], False), ([3, 4, 5], [3, 0], False), ([6, 7], [2], False)]
    assert seen(episodes) == overwritten


def test_dictionaries_are_read():
    space = spaces.Dict(a=SPACE, b=spaces.Box(0, 20, (2,), np.float32))
    buffer = DictReplayBuffer(8, space, ACTIONS)
    for observed, after, actions, rewards, done, limit in lines(1):
        both = [{"a": one, "b": np.stack([one, one], axis=1).astype(np.float32)} for one in (observed, after)]
        buffer.add(*both, actions, rewards, done, [{"TimeLimit.truncated": limit}])
    episodes = from_rollouts(buffer)
    assert [one.observations["a"].tolist() for one in episodes] == [observations for observations, _, _ in PLAYED]
    assert episodes[0].observations["b"].shape == (4, 2)


@pytest.mark.parametrize("used", [False, True], ids=["as collected", "after an update"])
def test_a_rollout_buffer_drops_each_last_action_when_told(used):
    buffer = rollout()
    if used:
        next(buffer.get(4))  # flattens the arrays
    dropped = [(observations[:-1], actions[:-1], False) for observations, actions, _ in PLAYED]
    with pytest.warns(UserWarning, match="the last action of 6 of 6 episodes is dropped"):
        assert seen(from_rollouts(buffer, last="drop")) == dropped + shifted(dropped, 1)


def test_a_rollout_buffer_keeps_each_last_action():
    episodes = from_rollouts(rollout(copies=1))
    assert [one.actions.tolist() for one in episodes] == [actions for _, actions, _ in PLAYED]
    assert {(one.ending, one.truncated) for one in episodes} == {("unseen", True)}


def test_a_rollout_buffer_repeats_each_last_observation_when_told():
    episodes = from_rollouts(rollout(copies=1), last="repeat")
    assert [one.actions.tolist() for one in episodes] == [actions for _, actions, _ in PLAYED]
    assert all(one.observations[-1] == one.observations[-2] and one.truncated for one in episodes)


def test_a_rollout_episode_of_one_step_is_left_out_where_its_action_is_dropped_and_counted():
    buffer = rollout(copies=1)
    buffer.episode_starts[7] = 1  # the last row begins an episode
    with pytest.warns(UserWarning, match="the last action of 2 of 2 episodes is dropped, .*, and 2 of one step are left out"):
        assert [len(one) for one in from_rollouts(buffer, last="drop")] == [2, 2]
    assert [len(one) for one in from_rollouts(buffer)] == [3, 3, 1, 1]


def test_a_rollout_of_single_steps_is_refused():
    buffer = rollout(copies=1)
    buffer.episode_starts[:] = 1
    with pytest.raises(InvalidDemonstrations, match="every episode in the buffer has one step"):
        from_rollouts(buffer, last="drop")


class Watched(gym.Wrapper):
    """Remembers what happened."""

    def __init__(self, env):
        super().__init__(env)
        self.played = []

    def reset(self, **kwargs):
        observation, info = super().reset(**kwargs)
        self.played.append(([observation], []))
        return observation, info

    def step(self, action):
        after = super().step(action)
        self.played[-1][0].append(after[0])
        self.played[-1][1].append(int(action))
        return after


def test_what_dqn_played_comes_back():
    env = Watched(gym.make("FrozenLake-v1", max_episode_steps=9))
    model = DQN("MlpPolicy", env, learning_starts=1000, buffer_size=200, seed=0, device="cpu").learn(150)
    episodes = from_rollouts(model.replay_buffer)
    played = [one for one in env.played if one[1]]
    assert [one.actions.tolist() for one in episodes] == [actions for _, actions in played]
    assert [one.observations.tolist() for one in episodes] == [observations for observations, _ in played]
    assert {one.truncated for one in episodes} == {True, False}


def test_what_ppo_played_comes_back_but_for_the_last_observations():
    env = Watched(gym.make("CartPole-v1"))
    model = PPO("MlpPolicy", DummyVecEnv([lambda: env]), n_steps=128, batch_size=64, n_epochs=1, seed=0, device="cpu").learn(
        128
    )
    episodes = from_rollouts(model.rollout_buffer, env=env)
    played = [one for one in env.played if one[1]]
    assert [one.actions.tolist() for one in episodes] == [actions for _, actions in played]
    assert all(np.array_equal(one.observations[:-1], seen[:-1]) for one, (seen, _) in zip(episodes, played, strict=True))


def test_no_buffer_is_refused():
    with pytest.raises(InvalidDemonstrations, match="the buffer is a list: expected a RolloutBuffer or a ReplayBuffer"):
        from_rollouts([1, 2])


@pytest.mark.parametrize("kind", [ReplayBuffer, RolloutBuffer])
def test_an_empty_buffer_is_refused(kind):
    with pytest.raises(InvalidDemonstrations, match="there are no rows: the buffer is empty"):
        from_rollouts(kind(8, SPACE, ACTIONS))


def test_continuous_actions_are_refused():
    with pytest.raises(NotDiscrete, match="Box"):
        from_rollouts(ReplayBuffer(8, SPACE, spaces.Box(-1, 1, (1,))))


def test_a_step_of_another_environment_is_named_by_copy_and_step():
    buffer = replay()
    buffer.actions[4, 1] = 7
    with pytest.raises(InvalidDemonstrations, match=r"copy 1, step 4 \(from 0\) has action 7"):
        from_rollouts(buffer)
