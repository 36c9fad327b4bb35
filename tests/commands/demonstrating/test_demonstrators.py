"""Any expert in any environment with discrete actions; an episode is known by its number."""

from itertools import islice

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3 import PPO

from irl_gym.commands.demonstrating import demonstrators
from irl_gym.commands.demonstrating.demonstrators import NAMED, Drawn, Recording, Stepped
from irl_gym.errors import (
    DatasetMismatch,
    EnumerationLimit,
    InvalidDiscount,
    InvalidParameter,
    InvalidPolicy,
    NotDiscrete,
    NotTabular,
)


def made(folder, env_id="FrozenLake-v1", expert="value-iteration", **kwargs):
    return Recording(expert, 0.99, **kwargs).demonstrator(gym.make(env_id), folder)


def take(demonstrator, first, n):
    return [str(vars(one)) for one in islice(demonstrator.episodes(first), n)]


def table_file(folder, actions):
    np.savez(folder / "expert.npz", actions=actions)
    return str(folder / "expert.npz")


@pytest.mark.parametrize(
    ("env_id", "expert", "kind"),
    [
        ("FrozenLake-v1", "value-iteration", Drawn),
        ("FrozenLake-v1", "random", Drawn),
        ("CartPole-v1", "random", Stepped),
        ("CartPole-v1", "ppo", Stepped),
    ],
)
@pytest.mark.parametrize("epsilon", [0.0, 0.3])
def test_episode_i_is_the_same_from_wherever_it_is_reached(tmp_path, monkeypatch, env_id, expert, kind, epsilon):
    monkeypatch.setattr(demonstrators, "CHUNK", 3)
    trained = {"total_timesteps": 64} if expert == "ppo" else {}
    one = made(tmp_path, env_id, expert, epsilon=epsilon, **trained)
    assert isinstance(one, kind)
    straight = take(one, 0, 8)
    assert len(set(straight)) > 4
    assert take(one, 6, 2) == straight[6:]
    assert take(made(tmp_path, env_id, expert, epsilon=epsilon, **trained), 4, 4) == straight[4:]


def test_another_seed_gives_other_episodes(tmp_path):
    assert take(made(tmp_path), 0, 5) != take(made(tmp_path, seed=1), 0, 5)


def test_a_noisy_table_errs_with_epsilon(tmp_path):
    policy = made(tmp_path, expert="value-iteration", epsilon=0.2).policy
    assert np.allclose(np.sort(policy, axis=1)[0], [0.05, 0.05, 0.05, 0.85])


def test_a_table_of_actions_acts(tmp_path):
    one = made(tmp_path, expert=table_file(tmp_path, np.full(16, 2)))
    assert all((episode.actions == 2).all() for episode in islice(one.episodes(0), 5))


def test_a_table_of_actions_acts_where_the_environment_has_none(tmp_path):
    n = 32 * 11 * 2  # Blackjack: sum, card, ace
    one = made(tmp_path, "Blackjack-v1", table_file(tmp_path, np.zeros(n, dtype=int)))
    assert all((episode.actions == 0).all() for episode in islice(one.episodes(0), 5))


def test_an_agent_of_a_zip_acts(tmp_path):
    PPO("MlpPolicy", "CartPole-v1", n_steps=8, batch_size=8, device="cpu").save(tmp_path / "agent.zip")
    assert len(take(made(tmp_path, "CartPole-v1", str(tmp_path / "agent.zip")), 0, 2)) == 2


def test_an_agent_of_another_environment_is_refused(tmp_path):
    PPO("MlpPolicy", "CartPole-v1", n_steps=8, batch_size=8, device="cpu").save(tmp_path / "agent.zip")
    with pytest.raises(DatasetMismatch, match="Name the environment that it was trained in"):
        made(tmp_path, "FrozenLake-v1", str(tmp_path / "agent.zip"))


def test_a_table_of_another_environment_is_refused(tmp_path):
    with pytest.raises(InvalidPolicy, match=r"\(4,\)"):
        made(tmp_path, expert=table_file(tmp_path, np.zeros(4, dtype=int)))


def test_an_agent_is_trained_once(tmp_path):
    made(tmp_path, expert="a2c", total_timesteps=512)
    before = (tmp_path / "expert.zip").stat().st_mtime_ns
    made(tmp_path, expert="a2c", total_timesteps=512)
    assert (tmp_path / "expert.zip").stat().st_mtime_ns == before


@pytest.mark.parametrize(("env_id", "error"), [("Blackjack-v1", NotTabular), ("CartPole-v1", NotDiscrete)])
def test_planning_without_a_table_says_what_needs_none(tmp_path, env_id, error):
    try:
        made(tmp_path, env_id)
    except error as found:
        assert "Or choose ppo, dqn or a2c" in str(found)
    else:
        assert env_id == "Blackjack-v1"  # a table of it may be made by now


def test_an_enumeration_stops_at_the_states_allowed(tmp_path):
    env = gym.wrappers.ClipReward(gym.make("FrozenLake-v1", is_slippery=False), 0, 1)  # no table is known of it
    with pytest.raises(EnumerationLimit, match="Or choose ppo, dqn or a2c"):
        Recording("value-iteration", 0.9, max_states=5).demonstrator(env, tmp_path)
    assert isinstance(Recording("value-iteration", 0.9, max_states=16).demonstrator(env, tmp_path), Drawn)


def test_continuous_actions_are_refused(tmp_path):
    with pytest.raises(NotDiscrete, match="DiscretizeAction"):
        made(tmp_path, "Pendulum-v1", "random")


def test_episodes_are_cut_at_the_limit(tmp_path):
    episodes = list(islice(made(tmp_path, expert="random", max_episode_steps=2).episodes(0), 20))
    assert max(map(len, episodes)) == 2 and any(one.truncated for one in episodes)


@pytest.mark.parametrize(
    ("wrong", "error"),
    [
        ({"expert": "nobody.zip"}, InvalidParameter),
        ({"gamma": 1.0}, InvalidDiscount),
        ({"epsilon": 1.5}, InvalidParameter),
        ({"seed": -1}, InvalidParameter),
        ({"max_episode_steps": 0}, InvalidParameter),
        ({"max_states": 0}, InvalidParameter),
    ],
)
def test_a_wrong_field_is_refused(wrong, error):
    with pytest.raises(error, match=next(iter(wrong))):
        Recording(**{"expert": "random", "gamma": 0.9, **wrong})


def test_the_plan_tells_files_apart_by_their_content(tmp_path):
    env = gym.make("FrozenLake-v1")
    plans = [Recording(table_file(tmp_path, np.full(16, a)), 0.9).plan(env)["expert"] for a in (0, 1, 0)]
    assert plans[0] == plans[2] != plans[1]


def test_the_plan_tells_environments_apart():
    plans = [Recording(NAMED[0], 0.9).plan(gym.make("FrozenLake-v1", is_slippery=slippery)) for slippery in (True, False)]
    assert plans[0] != plans[1]
