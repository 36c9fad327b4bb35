"""What a run gives a learner of somebody's own, and how what it gives is checked before anything is written of it."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest
from own_learners import Needy, Told, parts_of

from irl_gym.agents.planners import ValueIteration
from irl_gym.errors import InvalidParameter, InvalidPolicy
from irl_gym.facts import Fact
from irl_gym.features.feature_maps import OneHot
from irl_gym.learners.base import Outcome
from irl_gym.learners.needs import PARTS, Needs
from irl_gym.loop.loop import MAKERS
from irl_gym.loop.pipeline import recover_and_retrain
from irl_gym.mdp.rewards import TabularReward
from irl_gym.programs.status import Status
from irl_gym.runs.experiment import Experiment

pytestmark = pytest.mark.usefixtures("unchecked")
PAID = TabularReward(np.arange(4.0))


class Half:
    """Predicts half an action."""

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return np.full(np.shape(observation), 0.5), None


class Boastful(Outcome):
    """An outcome whose class says more than its proof."""

    def facts(self):
        return (Fact("certified", "optimal, take my word"),)


def outcome(reward=PAID, kind=Outcome, facts=(), own=None, **parts):
    proof = SimpleNamespace(facts=lambda: facts, to_json=lambda: {} if own is None else own)
    return kind(reward, Status.LEARNED, proof, **parts)


def nested(depth):
    made = []
    for _ in range(depth):
        made = [made]
    return made


CASES = {
    "half an action": (lambda: outcome(None, policy=Half()), InvalidPolicy, "Half predicts float64: expected whole numbers"),
    "a class": (lambda: outcome(None, policy=Half), InvalidParameter, "policy is the class Half"),
    "no facts": (lambda: outcome(facts=None), InvalidParameter, r"facts\(\) gave None: expected a tuple of `Fact`"),
    "text for facts": (lambda: outcome(facts="ab"), InvalidParameter, r"facts\(\) gave 'ab'"),
    "no notes": (lambda: outcome(stats=None), InvalidParameter, "stats is None: expected notes by name"),
    "a note of another kind": (lambda: outcome(stats={"rounds": 3}), InvalidParameter, "its rounds is 3: expected a list"),
    "names of two kinds": (lambda: outcome(own={1: 2, "a": 3}), InvalidParameter, "cannot be kept: '<' not supported"),
    "no Unicode": (lambda: outcome(own={"a": "\ud800"}), InvalidParameter, "cannot be kept: 'utf-8' codec"),
    "nested too deeply": (lambda: outcome(own={"a": nested(3000)}), InvalidParameter, "cannot be kept: maximum recursion"),
}


@dataclass(frozen=True)
class Giving:
    """Gives one of the cases."""

    which: str
    needs: ClassVar[Needs] = Needs(("dynamics",))

    def learn(self, problem, rng):
        return CASES[self.which][0]()


def learning(path, learner, **asked):
    tiny = {"env_kwargs": {"desc": ["SF", "FG"], "is_slippery": False}, "episodes": 2, "retrain": ValueIteration()}
    return recover_and_retrain(Experiment("FrozenLake-v1", 0.9, learner=learner, **tiny, **asked), path)


@pytest.mark.parametrize("part", [one for one in PARTS if one not in ("also", "horizon")])
def test_a_run_gives_a_learner_no_part_that_it_does_not_declare(tmp_path, monkeypatch, part):
    monkeypatch.setitem(MAKERS, "agent", (stop,))
    with pytest.raises(InvalidParameter, match="far enough"):
        learning(tmp_path / "run", Needy(part), features=OneHot(4))
    assert parts_of(Needy.given.pop()) == [part]


def stop():
    raise InvalidParameter("far enough")


@pytest.mark.parametrize("which", CASES)
def test_an_outcome_that_is_none_is_refused_in_a_sentence_and_nothing_is_kept_of_it(tmp_path, which):
    _, error, told = CASES[which]
    with pytest.raises(error, match=told):
        learning(tmp_path / "run", Giving(which))
    assert not (tmp_path / "run" / "certificate.json").exists()


def test_what_a_certificate_keeps_is_the_proof_s_and_not_what_a_class_makes_of_it():
    found = Boastful(PAID, Status.LEARNED, Told(6)).proved()["facts"]
    assert [one["label"] for one in found] == ["status", "dice"]
