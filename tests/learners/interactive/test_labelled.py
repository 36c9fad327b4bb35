"""The aggregated set is a Minari dataset in which what was done and what the oracle said are two fields."""

import gymnasium as gym
import minari
import numpy as np
import pytest
from models import random_model

from irl_gym.agents.planners import ValueIteration
from irl_gym.agents.simulator import Simulator
from irl_gym.demonstrations.datasets import read_minari
from irl_gym.errors import InvalidDemonstrations
from irl_gym.learners.cloning.clone import Clone
from irl_gym.learners.interactive.dagger import DAgger
from irl_gym.learners.interactive.labelled import LabelledEpisode, write_labelled
from irl_gym.learners.problem import Oracle, Problem, Spaces
from irl_gym.mdp.rewards import TabularReward

MODEL = random_model(2)
LEARNER = DAgger(rounds=2, learner=Clone(smoothing=5.0), episodes=4, max_episode_steps=6)


def drawn(**parts):
    known = Problem.of(MODEL.mdp, oracle=Oracle(lambda row, info: int(MODEL.expert[row])), **parts)
    return LEARNER.learn(known, np.random.default_rng(0)), known


def written(outcome, spaces, root, monkeypatch, **more):
    write_labelled(outcome.labelled, "me/asked-v0", None, root=root, observation_space=spaces.observations,
                   action_space=spaces.actions, **more)  # fmt: skip
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(root))
    return minari.load_dataset("me/asked-v0")


@pytest.mark.parametrize("data_format", ["hdf5", "arrow"])
def test_minari_opens_the_set_and_has_both_fields(tmp_path, monkeypatch, data_format):
    found, known = drawn(reward=TabularReward(MODEL.R))
    data = written(found, known.spaces, tmp_path, monkeypatch, data_format=data_format)
    episodes = list(data.iterate_episodes())
    assert len(episodes) == 8 and sum(map(len, episodes)) == found.proof.steps == found.proof.queries
    executed, said = [], []
    for i, one in enumerate(episodes):
        infos = {name: np.asarray(values) for name, values in one.infos.items()}
        np.testing.assert_array_equal(infos["oracle_action"][:-1], MODEL.expert[one.observations[:-1]])
        np.testing.assert_array_equal(one.rewards, MODEL.R[one.observations[1:]])
        assert infos["labelled"][:-1].all() and infos["asked"][:-1].all() and (infos["round"] == 1 + i // 4).all()
        assert infos["oracle_action"][-1] == -1 and not infos["labelled"][-1]  # nothing is labelled after the end
        executed.append(one.actions)
        said.append(infos["oracle_action"][:-1])
    assert np.array_equal(np.concatenate(executed[:4]), np.concatenate(said[:4]))  # beta is 1
    assert (np.concatenate(executed[4:]) != np.concatenate(said[4:])).any()


def test_the_executed_actions_are_those_that_the_transitions_come_of(tmp_path, monkeypatch):
    found, known = drawn()
    written(found, known.spaces, tmp_path, monkeypatch, paid=False)
    for one in read_minari("me/asked-v0", root=tmp_path):
        following = MODEL.P[one.observations[:-1], one.actions, one.observations[1:]]
        assert (following > 0).all() and not one.rewards.any()
    assert "No reward was known" in minari.load_dataset("me/asked-v0").storage.metadata["description"]


def test_labels_count_from_where_actions_do(tmp_path, monkeypatch):
    episode = LabelledEpisode(np.arange(3), np.array([0, 1]), np.zeros(2), False, True, labels=np.array([1, -1]),
                              asked=np.array([True, False]))  # fmt: skip
    write_labelled([episode], "me/one-v0", None, root=tmp_path, observation_space=gym.spaces.Discrete(3),
                   action_space=gym.spaces.Discrete(2, start=5))  # fmt: skip
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    (one,) = minari.load_dataset("me/one-v0").iterate_episodes()
    assert one.actions.tolist() == [5, 6] and one.infos["oracle_action"].tolist() == [6, 4, 4]
    assert one.infos["labelled"].tolist() == [True, False, False]


def test_episodes_of_an_environment_are_its_own():
    lake = gym.make("FrozenLake-v1", is_slippery=False, max_episode_steps=30)
    known = Problem(Spaces(lake.observation_space, lake.action_space), oracle=Oracle(lambda seen, info: 1 if seen < 8 else 2),
                    environment=Simulator(lake, ValueIteration(), 0.9))  # fmt: skip
    found = DAgger(rounds=1, episodes=1).learn(known, np.random.default_rng(0))
    (one,) = found.labelled
    assert one.observations.tolist() == [0, 4, 8, 9, 10, 11] and one.terminated and one.labels.tolist() == [1, 1, 2, 2, 2]


def test_exact_visits_have_no_episodes():
    known = Problem.of(MODEL.mdp, oracle=Oracle(lambda row, info: 0))
    assert DAgger(rounds=1).learn(known, np.random.default_rng(0)).labelled is None


def test_labels_that_are_not_one_a_step_are_refused():
    with pytest.raises(InvalidDemonstrations, match=r"labels have shape \(3,\): expected \(2,\)"):
        LabelledEpisode(
            np.arange(3), np.array([0, 1]), np.zeros(2), False, True, labels=np.zeros(3, int), asked=np.zeros(2, bool)
        )
