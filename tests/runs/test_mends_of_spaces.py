"""The mends that errors about observations, actions and features name are executed, and serve."""

import re

import gymnasium
import numpy as np
import pytest
from enumeration_envs import Corridor, Shows
from gymnasium import spaces
from mended import GAMMA, SHOWN, done, error_of, mends, named

from irl_gym.agents.planners import ValueIteration
from irl_gym.agents.simulator import Simulator
from irl_gym.errors import InvalidFeatures, InvalidParameter, NotDiscrete
from irl_gym.features.bases import RadialBasis
from irl_gym.runs.named_parts import features_named
from irl_gym.tables.counted.counting import Interaction, interact
from irl_gym.tables.discretize import discretize
from irl_gym.tables.tabulate import tabulate

pytestmark = pytest.mark.usefixtures("unchecked")


# --- observations ---


@pytest.mark.parametrize("name", SHOWN)
@pytest.mark.parametrize("by", [None, Interaction(500)], ids=["enumerated", "counted"])
def test_observations_that_are_whole_numbers_or_words_are_shown_as_integers(name, by):
    env = Shows(*SHOWN[name])
    message = error_of(env, NotDiscrete, by=by)
    assert tabulate(done(mends(message)[0], env), gamma=GAMMA, by=by).mdp.n_states == 7


def test_observations_that_are_not_whole_are_sent_to_cells():
    env = Shows(spaces.Box(0, 6, (1,), np.float64), lambda cell: np.array([cell / 4]))
    assert mends(error_of(env, NotDiscrete))[0].startswith("discretize(env")


# --- actions ---


class Does(Corridor):
    """Is told in some other way where to go."""

    def __init__(self, space, read):
        super().__init__()
        self.action_space, self.read, self.state = space, read, None

    def step(self, action):
        assert self.action_space.contains(action)
        return self.moved(self.read(action))


NUMBER = "Number its combinations, with"
ACTIONS = {
    "several": (spaces.MultiDiscrete([2, 3]), lambda a: int(a[0]), NUMBER),
    "several from others": (spaces.MultiDiscrete([2, 3], start=[-1, 4]), lambda a: int(a[0]) + 1, NUMBER),
    "a map of several": (spaces.MultiDiscrete([[2, 2], [2, 1]]), lambda a: int(a[0, 1]), NUMBER),
    "bits": (spaces.MultiBinary(3), lambda a: int(a[1]), NUMBER),
    "whole numbers": (spaces.Box(-1, 0, (2,), np.int8), lambda a: int(a[1]) + 1, NUMBER),
    "a whole number": (spaces.Box(3, 4, (), np.int64), lambda a: int(a) - 3, NUMBER),
    "numbers": (spaces.Box(-1, 1, (1,)), lambda a: int(a[0] > 0), "Take some of them, such as 5 along each axis, with"),
    "numbers without bounds": (
        spaces.Box(-np.inf, np.inf, (2,)),
        lambda a: int(a[1] > 0),
        "Bound them and take some",
    ),
}
ASKED = {
    "tabulate": lambda env: tabulate(env, gamma=GAMMA),
    "interact": lambda env: list(interact(env, 20, seed=0)),
    "Simulator": lambda env: Simulator(env, ValueIteration(), GAMMA).known,
}


@pytest.mark.parametrize("name", ACTIONS)
@pytest.mark.parametrize("asked", ASKED)
@pytest.mark.filterwarnings("ignore:.*MultiDiscrete")
def test_actions_that_are_no_single_number_are_made_one(name, asked):
    *does, says = ACTIONS[name]
    env = Does(*does)
    with pytest.raises((NotDiscrete, InvalidParameter), match=f"expected Discrete.*{says}") as caught:
        ASKED[asked](env)
    assert ASKED[asked](done(mends(str(caught.value))[0], env))


@pytest.mark.parametrize(("name", "number"), [("whole numbers", 4), ("a whole number", 2)])
def test_whole_numbers_as_actions_are_all_taken(name, number):
    env = Does(*ACTIONS[name][:2])
    made = tabulate(done(mends(error_of(env, NotDiscrete))[0], env), gamma=GAMMA)
    assert (made.mdp.n_states, made.mdp.n_actions) == (7, number)


def test_a_range_of_whole_numbers_is_taken_in_parts():
    assert "such as 5 along each axis" in error_of(Does(spaces.Box(0, 255, (9,), np.uint8), None), NotDiscrete)


def test_actions_that_are_numbered_as_the_error_says_make_a_table_of_cells():
    env = gymnasium.make("Pendulum-v1")
    with pytest.raises(NotDiscrete) as caught:
        discretize(env, gamma=GAMMA, bins=3)
    assert discretize(done(mends(str(caught.value))[0], env), gamma=GAMMA, bins=3).mdp.n_actions == 5


# --- features ---


def shows(space):
    return Shows(space, None)


def radial(env, **how):
    return features_named("radial", env, **how)


def by_code(env):
    return done(mends(message(radial, env))[0], env)


def message(breaks, *given):
    with pytest.raises(InvalidFeatures) as caught:
        breaks(*given)
    return str(caught.value)


TAXI, FREE = gymnasium.make("Taxi-v4"), spaces.Box(-np.inf, np.inf, (2,))
FEATURES = [
    ("Choose a smaller size,",
     lambda: radial(shows(spaces.Box(0, 1, (3,))), size=50),
     lambda: radial(shows(spaces.Box(0, 1, (3,))), size=5)),
    ("show fewer coordinates,",
     lambda: radial(shows(spaces.Box(0, 1, (3,))), size=50),
     lambda: radial(shows(spaces.Box(0, 1, (2,))), size=50)),
    ("or give features in Python.",
     lambda: radial(shows(spaces.Box(0, 1, (3,))), size=50), lambda: RadialBasis.grid([0] * 3, [1] * 3, 9)),
    ("Flatten them, with `gymnasium.wrappers.FlattenObservation(env)`.",
     lambda: radial(shows(spaces.Tuple([spaces.Discrete(2)] * 2))),
     lambda: radial(by_code(shows(spaces.Tuple([spaces.Discrete(2)] * 2))))),
    ("Clip them where they seldom go, as with `gymnasium.wrappers.TransformObservation(env, lambda seen: numpy.clip(seen, -10, "
     "10), gymnasium.spaces.Box(-10, 10, (2,)))`;",
     lambda: radial(shows(FREE)), lambda: radial(by_code(shows(FREE)))),
    ("or give features in Python.",
     lambda: radial(shows(FREE)), lambda: RadialBasis.grid([-10] * 2, [10] * 2, 5)),
    ("Name them,",
     lambda: radial(TAXI),
     lambda: radial(TAXI, size=2, coordinates=(5, 5, 5, 4))),
    ("or choose one-hot.",
     lambda: radial(TAXI), lambda: features_named("one-hot", TAXI)),
]  # fmt: skip


@pytest.mark.parametrize(("says", "breaks", "mended"), FEATURES)
def test_a_mend_that_an_error_about_features_names_serves(says, breaks, mended):
    assert says in message(breaks) and mended()


def test_every_mend_that_an_error_about_features_names_is_executed():
    said = " ".join(says for says, *_ in FEATURES)
    assert not [one for one in named("named_parts.py") if not re.search(one, said)]
