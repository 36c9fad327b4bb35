"""Experts that are given as files, in the loop's place of a planner."""

import numpy as np
import pytest
from gymnasium import spaces
from stable_baselines3.common.env_util import make_vec_env

from irl_gym.agents.expert_files import FromFile, check_agent
from irl_gym.agents.planners import SB3, Agent, load_agent
from irl_gym.environments.tabular_vec_env import TabularVecEnv
from irl_gym.errors import DatasetMismatch, InvalidParameter, InvalidPolicy, NotTabular
from irl_gym.spaces.states import StateIndex

PAIRS = spaces.Tuple([spaces.Discrete(4), spaces.Discrete(4)])
SHORT = SB3(total_timesteps=64, hyperparameters={"n_steps": 8, "batch_size": 8})


def lake(toy_text, space=None, **kwargs):
    """FrozenLake's table as SB3 trains on it; with a space of 16 elements, as if these were observed."""
    table = toy_text("FrozenLake 4x4 slippery")
    states = table.states if space is None else StateIndex(space)
    return TabularVecEnv(table.mdp, table.reward, num_envs=2, states=states, seed=0, **kwargs)


@pytest.fixture
def saved(tmp_path):
    def save(**arrays):
        np.savez(tmp_path / "expert.npz", **arrays)
        return FromFile.at(str(tmp_path / "expert.npz"))

    return save


def test_a_table_of_actions_is_the_policy(toy_text, saved):
    actions = np.arange(16) % 4
    policy = saved(actions=actions).plan(lake(toy_text), gamma=0.9)
    assert np.array_equal(policy.predict(np.arange(16), deterministic=True)[0], actions)


def test_a_table_of_probabilities_is_the_policy(toy_text, saved):
    table = np.random.default_rng(0).dirichlet(np.ones(4), size=16)
    assert np.array_equal(saved(probabilities=table).plan(lake(toy_text), gamma=0.9).probabilities, table)


def test_a_table_acts_on_the_observations_of_the_environment(toy_text, saved):
    policy = saved(actions=np.arange(16) % 4).plan(lake(toy_text, PAIRS, show_rows=True), gamma=0.9)
    assert policy.predict((2, 3), deterministic=True)[0] == (2 * 4 + 3) % 4


@pytest.mark.parametrize(
    ("table", "error", "match"),
    [
        (np.zeros(15, int), InvalidPolicy, "15"),
        (np.full(16, 4), InvalidPolicy, "4"),
        (np.full((16, 3), 1 / 3), InvalidPolicy, "3"),
        (np.where(np.arange(16)[:, None] == 5, np.nan, np.full((16, 4), 0.25)), InvalidParameter, "of 1 states, such as 5"),
    ],
)
def test_a_table_that_does_not_fit_is_refused(toy_text, saved, table, error, match):
    with pytest.raises(error, match=match):
        saved(actions=table).plan(lake(toy_text), gamma=0.9)


def test_a_table_is_refused_where_there_is_none(saved):
    with pytest.raises(NotTabular, match="expected an agent's zip"):
        saved(actions=np.zeros(16, int)).plan(make_vec_env("CartPole-v1", 1), gamma=0.9)


# --- agents ---


def kept(agent, path):
    agent.save(path / "agent.zip")
    return FromFile.at(str(path / "agent.zip"))


def test_an_agent_trained_on_observations_acts_as_it_did(toy_text, tmp_path):
    agent = SHORT.plan(lake(toy_text), gamma=0.9)
    again = kept(agent, tmp_path).plan(lake(toy_text), gamma=0.9)
    assert np.array_equal(*(one.predict(np.arange(16), deterministic=True)[0] for one in (agent, again)))


@pytest.mark.parametrize(
    ("space", "one"), [(PAIRS, (1, 2)), (spaces.Dict(a=spaces.Discrete(4), b=spaces.Discrete(4)), {"a": 1, "b": 2}),
                       (spaces.Box(np.zeros(2, int), np.full(2, 3), dtype=np.int64), np.array([1, 2])),
                       (spaces.Discrete(16, start=5), 11)],
)  # fmt: skip
def test_an_agent_trained_on_rows_is_shown_rows(toy_text, tmp_path, space, one):
    env = lake(toy_text, space, show_rows=True)
    agent = SHORT.plan(env, gamma=0.9)
    again = kept(agent, tmp_path).plan(env, gamma=0.9)
    assert again.states.space == space
    rows = agent.model.predict(np.arange(16), deterministic=True)[0]
    assert np.array_equal(again.predict(env.states.decode_batch(np.arange(16)), deterministic=True)[0], rows)
    assert again.predict(one, deterministic=True)[0] == rows[6]


@pytest.mark.parametrize("space", [None, PAIRS])
def test_an_agent_of_another_environment_is_refused(toy_text, tmp_path, space):
    agent = SHORT.plan(make_vec_env("CartPole-v1", 1), gamma=0.9)
    with pytest.raises(DatasetMismatch, match="Name the environment that it was trained in"):
        kept(agent, tmp_path).plan(lake(toy_text, space, show_rows=space is not None), gamma=0.9)


def test_an_agent_of_a_smaller_table_is_refused(toy_text, tmp_path):
    table = toy_text("FrozenLake 8x8 slippery")
    agent = SHORT.plan(TabularVecEnv(table.mdp, table.reward, num_envs=2, states=table.states), gamma=0.9)
    with pytest.raises(DatasetMismatch, match=r"Discrete\(64\).*Discrete\(16\)"):
        kept(agent, tmp_path).plan(lake(toy_text), gamma=0.9)


def test_an_agent_of_an_environment_that_is_stepped_is_taken(tmp_path):
    env = make_vec_env("CartPole-v1", 1)
    agent = SHORT.plan(env, gamma=0.9)
    assert isinstance(kept(agent, tmp_path).plan(env, gamma=0.9), Agent)
    check_agent(load_agent(tmp_path / "agent.zip", "PPO"), env.observation_space, env.action_space)


def test_an_agent_of_other_actions_is_refused():
    env = make_vec_env("CartPole-v1", 1)
    with pytest.raises(DatasetMismatch, match=r"actions Discrete\(2\).*Discrete\(3\)"):
        check_agent(SHORT.plan(env, gamma=0.9), env.observation_space, spaces.Discrete(3))


# --- the file ---


def test_a_file_that_is_not_there_is_refused():
    with pytest.raises(InvalidParameter, match=r"'gone\.zip', which is no file"):
        FromFile.at("gone.zip")


def test_a_file_that_was_changed_is_refused(saved):
    one = saved(actions=np.zeros(16, int))
    saved(actions=np.ones(16, int))
    with pytest.raises(InvalidParameter, match="not the file that it was"):
        FromFile(one.path, one.sha256)


@pytest.mark.parametrize("name", ["a.zip", "a.npz"])
def test_a_file_that_holds_no_expert_is_refused(toy_text, tmp_path, name):
    (tmp_path / name).write_text("nothing")
    with pytest.raises(InvalidParameter, match="holds no expert"):
        FromFile.at(str(tmp_path / name)).plan(lake(toy_text), gamma=0.9)


@pytest.mark.parametrize("path", [None, 5, ""])
def test_what_is_no_path_is_refused(unchecked, path):
    with pytest.raises(InvalidParameter, match="which is no file"):
        FromFile.at(path)
