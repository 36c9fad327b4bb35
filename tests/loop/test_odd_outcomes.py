"""What a learner of somebody's own gives is checked before anything is written of it: one sentence, and no traceback."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest
from own_learners import Told

from irl_gym.agents.planners import ValueIteration
from irl_gym.errors import InvalidParameter, InvalidPolicy
from irl_gym.facts import Fact
from irl_gym.learners.base import Outcome
from irl_gym.learners.needs import Needs
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


@pytest.mark.parametrize("which", CASES)
def test_an_outcome_that_is_none_is_refused_in_a_sentence_and_nothing_is_kept_of_it(tmp_path, which):
    tiny = {"env_kwargs": {"desc": ["SF", "FG"], "is_slippery": False}, "episodes": 2, "retrain": ValueIteration()}
    _, error, told = CASES[which]
    with pytest.raises(error, match=told):
        recover_and_retrain(Experiment("FrozenLake-v1", 0.9, learner=Giving(which), **tiny), tmp_path / "run")
    assert not (tmp_path / "run" / "certificate.json").exists()


def test_what_a_certificate_keeps_is_the_proof_s_and_not_what_a_class_makes_of_it():
    found = Boastful(PAID, Status.LEARNED, Told(6)).proved()["facts"]
    assert [one["label"] for one in found] == ["status", "dice"]
