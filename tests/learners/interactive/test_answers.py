"""What was asked is kept, and who goes on asks no more than in one go, and ends where that does."""

import gymnasium as gym
import numpy as np
import pytest
import torch
from models import random_model

from irl_gym.agents.neural_clone import NeuralClone
from irl_gym.agents.noise import noisy
from irl_gym.agents.planners import ValueIteration
from irl_gym.agents.simulator import Simulator
from irl_gym.errors import RunConflict
from irl_gym.features.feature_maps import OneHot
from irl_gym.learners.cloning.clone import Clone
from irl_gym.learners.cloning.softmax import SoftmaxClone
from irl_gym.learners.interactive.answers import ANSWERS
from irl_gym.learners.interactive.dagger import DAgger
from irl_gym.learners.problem import Oracle, Problem, Spaces
from irl_gym.mdp.policies import TabularPolicy, as_distribution
from irl_gym.spaces.states import StateIndex

MODEL = random_model(2)
SAMPLED = DAgger(rounds=3, learner=Clone(smoothing=1.0), episodes=3, max_episode_steps=6, beta="exponential")
PRIOR = DAgger(rounds=3, learner=SoftmaxClone(OneHot(7)), beta="linear")


class Leaves(Exception):
    """Of somebody who was asked enough."""


class Person:
    """Knows the way, and leaves after a number of answers."""

    def __init__(self, most=10**9):
        self.left, self.most = most, most

    @property
    def answers(self):
        return self.most - self.left

    def __call__(self, row, info):
        if not self.left:
            raise Leaves
        self.left -= 1
        return int(MODEL.expert[row])


def asked(person, learner, folder=None, seed=0, **oracle):
    known = Problem.of(MODEL.mdp, oracle=Oracle(person, **oracle))
    return learner.learn(known, np.random.default_rng(seed), folder)


def files(folder):
    return {one.name: one.read_bytes() for one in folder.iterdir()}


@pytest.mark.parametrize("learner", [SAMPLED, PRIOR], ids=["by episodes", "exactly, by a softmax"])
@pytest.mark.parametrize("most", [1, 12])
def test_who_goes_on_asks_no_more_than_in_one_go_and_ends_where_that_does(tmp_path, learner, most):
    whole = asked(Person(), learner, tmp_path / "whole")
    first, second = Person(most), Person()
    with pytest.raises(Leaves):
        asked(first, learner, tmp_path / "parts")
    found = asked(second, learner, tmp_path / "parts")
    assert first.answers == most and most + second.answers == whole.proof.queries == found.proof.queries
    assert repr(found.proof) == repr(whole.proof) and found.stats == whole.stats
    np.testing.assert_array_equal(found.policy, whole.policy)
    assert files(tmp_path / "parts") == files(tmp_path / "whole")


def test_nothing_is_learned_twice_where_it_was_learned(tmp_path, monkeypatch):
    found = asked(Person(), PRIOR, tmp_path)
    monkeypatch.setattr(SoftmaxClone, "fit", None)
    nobody = Person(0)
    np.testing.assert_array_equal(asked(nobody, PRIOR, tmp_path).policy, found.policy)


def test_what_was_learned_is_learned_again_where_its_file_is_damaged(tmp_path):
    found = asked(Person(), SAMPLED, tmp_path)
    for one in tmp_path.glob("fit-*.npz"):
        one.write_bytes(one.read_bytes()[:50])
    np.testing.assert_array_equal(asked(Person(0), SAMPLED, tmp_path).policy, found.policy)


@pytest.mark.parametrize("change", [np.nan, 1e30, "x", None], ids=str)
def test_a_network_whose_file_is_not_that_of_its_labels_is_trained_again(tmp_path, change):
    learner = DAgger(rounds=1, learner=NeuralClone(net_arch=(2,), epochs=1), episodes=2, max_episode_steps=3)
    whole = asked(Person(), learner, tmp_path / "kept")
    (path,) = (tmp_path / "kept").glob("fit-*.npz")
    with np.load(path) as found:
        arrays = dict(found)
    name = next(name for name in arrays if name.endswith("action_net.weight"))
    one = arrays.pop(name)
    held = {} if change is None else {name: np.array(change) if isinstance(change, str) else np.full_like(one, change)}
    np.savez(path, **arrays, **held)
    again = asked(Person(), learner, tmp_path / "kept")
    assert torch.equal(*(one.policy.model.policy.action_net.weight for one in (whole, again)))


def test_without_a_folder_nothing_is_kept_and_the_same_is_found(tmp_path):
    np.testing.assert_array_equal(asked(Person(), SAMPLED).policy, asked(Person(), SAMPLED, tmp_path).policy)


def test_an_oracle_that_draws_its_mistakes_draws_the_same_where_it_goes_on(tmp_path):
    def erring(most=None):
        states = StateIndex(Problem.of(MODEL.mdp).spaces.observations)
        policy = TabularPolicy(noisy(as_distribution(MODEL.expert, 7, 3), 0.5), states)
        if most is not None:
            person = Person(most)

            class Tired(TabularPolicy):
                def predict(self, observation, *more, **options):
                    person(observation, {})
                    return super().predict(observation, *more, **options)

            return Tired(policy.probabilities, states)
        return policy

    whole = asked(erring(), SAMPLED, tmp_path / "whole", deterministic=False)
    with pytest.raises(Leaves):
        asked(erring(20), SAMPLED, tmp_path / "parts", deterministic=False)
    asked(erring(), SAMPLED, tmp_path / "parts", deterministic=False)
    assert whole.proof.contradicted and files(tmp_path / "parts") == files(tmp_path / "whole")


def test_a_line_that_a_kill_cut_is_asked_again(tmp_path):
    whole = asked(Person(), SAMPLED, tmp_path)
    answers = tmp_path / ANSWERS
    content = answers.read_bytes()
    answers.write_bytes(content[:-3])
    again = Person()
    assert asked(again, SAMPLED, tmp_path).proof.queries == whole.proof.queries
    assert again.answers == 1 and answers.read_bytes() == content


@pytest.mark.parametrize(
    "change",
    [
        lambda line: "ask 0123456789abcdef 1",
        lambda line: line[:-1] + "7",
        lambda line: line.replace("ask", "gate"),
        lambda line: "nothing",
    ],
    ids=["of another observation", "no action", "of the gate", "no answer"],
)
def test_answers_to_other_questions_are_refused(tmp_path, change):
    asked(Person(), SAMPLED, tmp_path)
    lines = (tmp_path / ANSWERS).read_text().splitlines()
    (tmp_path / ANSWERS).write_text("\n".join([lines[0], change(lines[1]), *lines[2:]]) + "\n")
    with pytest.raises(RunConflict, match=r"line 2 is .* expected the answer to ask"):
        asked(Person(), SAMPLED, tmp_path)


def test_a_policy_that_says_something_else_now_is_refused(tmp_path):
    asked(TabularPolicy(np.eye(3)[MODEL.expert], StateIndex(gym.spaces.Discrete(7))), SAMPLED, tmp_path)
    with pytest.raises(RunConflict, match="as from the same seed, environment and oracle"):
        asked(TabularPolicy(np.eye(3)[(MODEL.expert + 1) % 3], StateIndex(gym.spaces.Discrete(7))), SAMPLED, tmp_path)


def test_answers_that_are_no_text_are_refused(tmp_path):
    (tmp_path / ANSWERS).write_bytes(b"\xff\xfe")
    with pytest.raises(RunConflict, match="cannot be read"):
        asked(Person(), SAMPLED, tmp_path)


def test_an_environment_that_is_stepped_shows_the_same_again(tmp_path):
    lake = gym.make("FrozenLake-v1", max_episode_steps=8)
    counted = []

    def answer(seen, info):
        counted.append(seen)
        if len(counted) == 7:
            raise Leaves
        return 2

    def learned(folder):
        here = Spaces(lake.observation_space, lake.action_space)
        known = Problem(here, oracle=Oracle(answer), environment=Simulator(lake, ValueIteration(), 0.9))
        return DAgger(rounds=2, episodes=3).learn(known, np.random.default_rng(0), folder)

    with pytest.raises(Leaves):
        learned(tmp_path / "parts")
    found = learned(tmp_path / "parts")
    assert found.proof.queries == len(counted) - 1  # that which was not answered was asked again
    learned(tmp_path / "whole")
    assert files(tmp_path / "parts") == files(tmp_path / "whole")
