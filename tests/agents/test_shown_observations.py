"""An agent's zip acts in the environment itself: what it was shown in place of observations is beside it."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces

from irl_gym.agents.expert_files import FromFile, check_agent, fingerprint
from irl_gym.agents.experts import load_expert
from irl_gym.agents.planners import SB3
from irl_gym.agents.shown_observations import read_shown, write_shown
from irl_gym.commands.demonstrating.demonstrators import Recording
from irl_gym.environments.tabular_vec_env import TabularVecEnv
from irl_gym.errors import DatasetMismatch, InvalidParameter
from irl_gym.loop.loop import MAKERS
from irl_gym.loop.pipeline import recover_and_retrain
from irl_gym.mdp.episodes import collect
from irl_gym.runs.experiment import Experiment
from irl_gym.spaces.listed_states import ListedStates
from irl_gym.spaces.states import StateIndex

SHORT = SB3(total_timesteps=16, hyperparameters={"n_steps": 8, "batch_size": 16, "n_epochs": 1})
SPACES = {
    "pairs": spaces.Tuple([spaces.Discrete(4), spaces.Discrete(4, start=-2)]),
    "dictionaries": spaces.Dict(a=spaces.Discrete(4), b=spaces.Discrete(4)),
    "whole numbers": spaces.Box(np.full(2, 3), np.full(2, 6), dtype=np.int64),
    "several from elsewhere": spaces.MultiDiscrete([4, 4], start=[5, 7]),
    "numbers from 5": spaces.Discrete(16, start=5),
}


class Corridor(gym.Env):
    """Five cells called 5 to 9, left and right; the last one ends an episode and pays."""

    observation_space, action_space = spaces.Discrete(5, start=5), spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.at = 5
        return self.at, {}

    def step(self, action):
        self.at = max(5, self.at + 2 * int(action) - 1)
        return self.at, float(self.at == 9), self.at == 9, False, {}


gym.register("Corridor-from-5-v0", entry_point=Corridor, max_episode_steps=30)


def lake(toy_text, states):
    table = toy_text("FrozenLake 4x4")
    return TabularVecEnv(table.mdp, table.reward, num_envs=2, states=states, show_rows=True)


@pytest.mark.parametrize("kind", SPACES)
def test_an_agent_trained_on_rows_is_loaded_with_its_numbering(toy_text, tmp_path, kind):
    states = StateIndex(SPACES[kind])
    agent = SHORT.plan(lake(toy_text, states), gamma=0.9)
    agent.save(tmp_path / "agent.zip")
    again = load_expert(tmp_path / "agent.zip")
    every = states.decode_batch(np.arange(16))
    rows = agent.model.predict(np.arange(16), deterministic=True)[0]
    assert again.observation_space == SPACES[kind]
    np.testing.assert_array_equal(again.predict(every, deterministic=True)[0], rows)
    assert again.predict(states.decode(6), deterministic=True)[0] == rows[6]


def test_an_agent_of_listed_states_is_loaded_with_its_numbering(toy_text, tmp_path):
    states = ListedStates(spaces.Discrete(99, start=5), 5 + 3 * np.arange(16)[:, None])
    agent = SHORT.plan(lake(toy_text, states), gamma=0.9)
    agent.save(tmp_path / "agent.zip")
    again = load_expert(tmp_path / "agent.zip")
    assert again.predict(5 + 3 * 6, deterministic=True)[0] == agent.model.predict(6, deterministic=True)[0]


def test_the_sentence_beside_it_is_enough_without_the_library(toy_text, tmp_path):
    SHORT.plan(lake(toy_text, StateIndex(SPACES["several from elsewhere"])), gamma=0.9).save(tmp_path / "agent.zip")
    with np.load(tmp_path / "agent.shown.npz", allow_pickle=False) as told:
        assert "np.ravel_multi_index(observation - low, counts)" in str(told["how"])
        assert np.ravel_multi_index(np.array([6, 9]) - told["low"], told["counts"]) == 6


def test_an_agent_that_is_shown_observations_has_nothing_beside_it(toy_text, tmp_path):
    table = toy_text("FrozenLake 4x4")
    agent = SHORT.plan(TabularVecEnv(table.mdp, table.reward, num_envs=2, states=table.states), gamma=0.9)
    (tmp_path / "agent.shown.npz").write_text("of another agent")
    agent.save(tmp_path / "agent.zip")
    assert not (tmp_path / "agent.shown.npz").exists()
    assert load_expert(tmp_path / "agent.zip").states is None


def test_a_file_beside_it_that_says_nothing_is_refused(toy_text, tmp_path):
    SHORT.plan(lake(toy_text, StateIndex(SPACES["pairs"])), gamma=0.9).save(tmp_path / "agent.zip")
    (tmp_path / "agent.shown.npz").write_text("nothing")
    with pytest.raises(InvalidParameter, match=r"agent\.shown\.npz cannot be read"):
        load_expert(tmp_path / "agent.zip")


def test_rows_of_what_is_never_observed_are_refused(tmp_path):
    write_shown(tmp_path / "agent.zip", ListedStates(spaces.Discrete(4), np.array([[1], [3]])), None)
    with np.load(tmp_path / "agent.shown.npz") as told:
        np.savez(tmp_path / "agent.shown.npz", **{**told, "numbers": np.array([[1], [4]])})
    with pytest.raises(
        InvalidParameter, match=r"does not say what agent\.zip is shown .observation 4 is outside Discrete\(4\)"
    ):
        read_shown(tmp_path / "agent.zip")


def test_the_file_beside_it_is_part_of_what_a_run_knows_again(toy_text, tmp_path):
    SHORT.plan(lake(toy_text, StateIndex(SPACES["pairs"])), gamma=0.9).save(tmp_path / "agent.zip")
    before = fingerprint(str(tmp_path / "agent.zip"))
    (tmp_path / "agent.shown.npz").write_text("something else")
    assert fingerprint(str(tmp_path / "agent.zip")) != before


def test_an_agent_of_another_numbering_is_refused(toy_text, tmp_path):
    SHORT.plan(lake(toy_text, StateIndex(SPACES["numbers from 5"])), gamma=0.9).save(tmp_path / "agent.zip")
    with pytest.raises(DatasetMismatch, match=r"Discrete\(16, start=5\)"):
        check_agent(load_expert(tmp_path / "agent.zip"), SPACES["pairs"], spaces.Discrete(4))


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(MAKERS, "figures", ())
        asked = Experiment("Corridor-from-5-v0", 0.9, episodes=2, eval_episodes=5, retrain=SHORT, num_envs=2)
        return recover_and_retrain(asked, tmp_path_factory.mktemp("run") / "run")


def test_the_agent_of_a_run_acts_in_the_environment_itself(run):
    agent = load_expert(run.out / "agent.zip")
    kept = np.load(run.out / "agent_policy.npz")["actions"]
    acted = [int(agent.predict(cell, deterministic=True)[0]) for cell in range(5, 9)]
    assert acted == kept[:4].tolist()
    (episode,) = collect(gym.make("Corridor-from-5-v0"), agent, 1, deterministic=True)
    assert episode.total_reward == run.metrics["policies"]["retrained"]["mean_return"]


def test_the_agent_of_a_run_is_an_expert_for_another(run, tmp_path, monkeypatch):
    monkeypatch.setitem(MAKERS, "figures", ())
    expert = FromFile.at(str(run.out / "agent.zip"))
    again = recover_and_retrain(
        Experiment("Corridor-from-5-v0", 0.9, episodes=2, eval_episodes=5, expert=expert, retrain=SHORT, num_envs=2),
        tmp_path / "run",
    )
    np.testing.assert_array_equal(*(np.load(out / f"{name}.npz")["actions"] for out, name in
                                    ((run.out, "agent_policy"), (again.out, "expert"))))  # fmt: skip


def test_an_agent_that_is_trained_for_a_dataset_acts_where_observations_start_elsewhere(tmp_path):
    recording = Recording("ppo", 0.9, total_timesteps=2_048)
    episode = next(recording.demonstrator(gym.make("Corridor-from-5-v0"), tmp_path).episodes(0))
    assert episode.observations[0] == 5
