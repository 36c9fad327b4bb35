"""The mends that errors about observations and actions name are executed, and serve."""

import gymnasium
import numpy as np
import pytest
from enumeration_envs import Corridor, Shows
from gymnasium import spaces
from mended import GAMMA, SHOWN, done, error_of, mends

from irl_gym.counting import Interaction, interact
from irl_gym.discretize import discretize
from irl_gym.errors import (
    InvalidParameter,
    NotDiscrete,
)
from irl_gym.planners import ValueIteration
from irl_gym.simulator import Simulator
from irl_gym.tabulate import tabulate

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


ACTIONS = {
    "several": (spaces.MultiDiscrete([2, 3]), lambda a: int(a[0])),
    "several from others": (spaces.MultiDiscrete([2, 3], start=[-1, 4]), lambda a: int(a[0]) + 1),
    "a map of several": (spaces.MultiDiscrete([[2, 2], [2, 1]]), lambda a: int(a[0, 1])),
    "bits": (spaces.MultiBinary(3), lambda a: int(a[1])),
    "numbers": (spaces.Box(-1, 1, (1,)), lambda a: int(a[0] > 0)),
    "numbers without bounds": (spaces.Box(-np.inf, np.inf, (2,)), lambda a: int(a[1] > 0)),
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
    env = Does(*ACTIONS[name])
    with pytest.raises((NotDiscrete, InvalidParameter), match="expected Discrete") as caught:
        ASKED[asked](env)
    assert ASKED[asked](done(mends(str(caught.value))[0], env))


def test_actions_that_are_numbered_as_the_error_says_make_a_table_of_cells():
    env = gymnasium.make("Pendulum-v1")
    with pytest.raises(NotDiscrete) as caught:
        discretize(env, gamma=GAMMA, bins=3)
    assert discretize(done(mends(str(caught.value))[0], env), gamma=GAMMA, bins=3).mdp.n_actions == 5
