"""Public records are shown in at most six lines, and `help` lists their fields with what each is."""

import inspect
import pickle
from dataclasses import dataclass, fields, is_dataclass

import gymnasium as gym
import numpy as np
import pytest

import irl_gym
from irl_gym import records
from irl_gym.features.feature_maps import OneHot
from irl_gym.mdp.policies import as_distribution
from irl_gym.mdp.shaping import ShapedReward
from irl_gym.records import Record

LAKE = gym.make("FrozenLake-v1", map_name="8x8", is_slippery=False, max_episode_steps=50)
TABLE = irl_gym.tabulate(LAKE, gamma=0.9)
SOLUTION = irl_gym.policy_iteration(TABLE.mdp, TABLE.reward)
RESULT = irl_gym.FiniteLP().fit(TABLE.mdp, SOLUTION)
ACTOR = irl_gym.TabularPolicy(as_distribution(SOLUTION, 64, 4), TABLE.states)
(EPISODE,) = irl_gym.collect(LAKE, ACTOR, 1)
ON_FEATURES = irl_gym.FeatureLP(np.eye(64))
SHOWN = [
    TABLE, TABLE.mdp, TABLE.evidence, TABLE.payments, TABLE.states, SOLUTION, RESULT, RESULT.reward, RESULT.proof, ACTOR,
    EPISODE,
    irl_gym.empirical_policy([EPISODE], TABLE.states, 4), irl_gym.certify(TABLE.mdp, SOLUTION, RESULT.reward),
    irl_gym.FiniteLP(),
    ON_FEATURES, ON_FEATURES.fit(TABLE.mdp, SOLUTION), irl_gym.TrajectoryLP(np.eye(64)), irl_gym.SB3(),
    irl_gym.ValueIteration(),
    irl_gym.Experiment("FrozenLake-v1", 0.9), irl_gym.Problem.of(TABLE, expert=SOLUTION.policy),
    irl_gym.Simulator(LAKE, irl_gym.ValueIteration(), 0.9), irl_gym.LinearReward(np.ones(64), OneHot(64)),
    ShapedReward.of(RESULT.reward, TABLE.mdp), irl_gym.worst_tie(TABLE.mdp, RESULT.reward, TABLE.reward),
    irl_gym.doctor(RESULT, TABLE.mdp, SOLUTION), RESULT.facts()[0],
]  # fmt: skip
OF_FACADE = [one for one in map(irl_gym.__getattr__, irl_gym.__all__) if is_dataclass(one) and one is not irl_gym.Fact]


@dataclass(frozen=True)
class Kept(Record):
    """A record of a test."""

    many: np.ndarray
    """(N,) numbers."""
    word: str = "a"
    told: tuple = ()


@pytest.mark.parametrize("one", SHOWN, ids=lambda one: type(one).__name__)
def test_a_record_is_shown_in_at_most_six_lines(one):
    lines = repr(one).splitlines()
    assert len(lines) <= 6 and all("[0. 0." not in line and "0., 0., 0." not in line for line in lines)
    assert type(one).__name__ in lines[0] and max(map(len, lines)) <= 250


@pytest.mark.parametrize("kind", OF_FACADE, ids=lambda one: one.__name__)
def test_help_lists_each_field_with_what_it_is(kind):
    told = inspect.getdoc(kind) or ""
    said = records.documented(kind)
    assert all(f"    {one.name}: " in told for one in fields(kind) if not one.name.startswith("_"))
    assert all(len(text) > 3 and text not in ("Any", "str") for text in said.values())


def test_a_field_is_told_in_the_words_under_it():
    assert (inspect.getdoc(Kept) or "").splitlines() == [
        "A record of a test.", "", "Attributes:", "    many: (N,) numbers.", "    word: str", "    told: tuple",
    ]  # fmt: skip


def test_help_has_names_and_types_where_there_is_no_source(monkeypatch):
    def gone(_):
        raise OSError("could not get source code")

    monkeypatch.setattr(records.inspect, "getsource", gone)
    assert records.documented(Kept) == {"many": "ndarray", "word": "str", "told": "tuple"}


@pytest.mark.parametrize(
    ("one", "shown"),
    [
        (Kept(np.arange(3)), "Kept(many=[0, 1, 2], word='a', told=())"),
        (Kept(np.array([0.5, np.nan] * 4)), "Kept(many=<float64 (8), 0.5 to 0.5, some not finite>, word='a', told=())"),
        (Kept(np.ones((2, 4), bool)), "Kept(many=<bool (2, 4), 8 true>, word='a', told=())"),
        (Kept(np.arange(1), told=(1 / 3, {"a": np.zeros((2, 2))})),
         "Kept(many=[0], word='a', told=(0.333333, {'a': <float64 (2, 2), 0 to 0>}))"),
        (Kept(np.arange(1), told=tuple(range(9))), "Kept(many=[0], word='a', told=tuple of 9)"),
    ],
)  # fmt: skip
def test_a_record_shows(one, shown):
    assert repr(one) == shown


def test_a_record_of_long_fields_ends_in_dots():
    assert len(repr(Kept(np.arange(2), "b" * 60, tuple("c" * 80 for _ in range(6)))).splitlines()) <= 6
    many = Kept(np.arange(1), told=tuple("word " * 15 for _ in range(1)))
    assert repr(many).startswith("Kept(")


def test_a_record_is_pickled_and_compared_as_before():
    one = irl_gym.FiniteLP(l1=0.5)
    assert pickle.loads(pickle.dumps(one)) == one and one != irl_gym.FiniteLP()
