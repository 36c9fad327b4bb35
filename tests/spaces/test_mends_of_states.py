"""The mends that errors about states name, how they are set, shown, revealed and begun, are executed, and serve."""

import re
import threading
from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest
from enumeration_envs import Corridor, Shows
from gymnasium import spaces
from gymnasium.wrappers import FilterObservation, TransformObservation, TransformReward
from mended import GAMMA, SHOWN, done, mends, told, unsaid

from irl_gym.environments.physics import Moves
from irl_gym.environments.reveal import Reveal
from irl_gym.environments.seeded_starts import SeededStarts
from irl_gym.spaces.coordinates import Coordinates
from irl_gym.spaces.listed_states import ListedStates
from irl_gym.spaces.states import StateIndex
from irl_gym.tables.discretize import discretize
from irl_gym.tables.tabulate import make, tabulate

pytestmark = pytest.mark.usefixtures("unchecked")
FREE, LINE, SEVEN = spaces.Box(-np.inf, np.inf, (1,)), spaces.Box(-2.0, 2.0, (1,)), spaces.Discrete(7)


class Drift(gym.Env):
    """Goes left or right on a line, where it begins at 0; keeps the place where it is told to."""

    metadata = {"render_modes": ["human"]}  # noqa: RUF012
    action_space = spaces.Discrete(2)

    def __init__(self, kept="state", space=None, show=None, pays=1, render_mode=None, physics=None):
        self.observation_space = LINE if space is None else space
        self.kept, self.show, self.pays, self.render_mode, self.physics = (
            kept,
            show or (lambda at: at),
            pays,
            render_mode,
            physics,
        )
        self.window = render_mode and threading.Lock()

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return self._gone(0.0), {}

    def _gone(self, place):
        setattr(self, self.kept, [place])
        return np.array(self.show([place]), self.observation_space.dtype)

    def step(self, action):
        shown = self._gone(getattr(self, self.kept)[0] + 0.1 * int(action))
        return shown, float(self.pays), getattr(self, self.kept)[0] > 1, False, {}


class Set(Drift):
    def get_state(self):
        return np.array(getattr(self, self.kept))

    def set_state(self, state):
        setattr(self, self.kept, state.tolist())


class Locked(Drift):
    """Cannot be copied, or leaves out what cannot."""

    def __init__(self):
        super().__init__()
        self.window = threading.Lock()


class LeftOut(Locked):
    def __deepcopy__(self, memo):
        return Drift()


def moved(states, actions, rng):
    following = states + 0.1 * actions[:, None]
    return Moves(following, np.ones(len(states)), following[:, 0] > 1)


def physical(space, **how):
    """The same with physics, which says what it shows."""
    coordinates = Coordinates(space, ("x",), np.array([-2.0]), np.array([2.0]), np.zeros(1, bool))
    physics = SimpleNamespace(
        coordinates=coordinates, n_actions=2, start=lambda n, rng: np.zeros((n, 1)), transition=moved
    )  # fmt: skip
    return Drift(space=space, physics=physics, **how)


def cells(env, **how):
    return discretize(env, gamma=GAMMA, bins=3, **how)


PAIR, COLUMN = spaces.Box(-2.0, 2.0, (2,)), spaces.Box(-2.0, 2.0, (1, 1))
NEGATIVE = {"show": lambda at: [-at[0] - 1]}


class Counter(gym.Env):
    """Hides how many steps were taken, and other things."""

    observation_space, action_space = spaces.Discrete(2), spaces.Discrete(2)
    observation = 0

    def __init__(self, first=0):
        self.first, self.goal, self.bag, self.open = first, (2, 1), {"key": 1}, {3}

    @property
    def opened(self):
        return 3 in self.open

    @property
    def seen(self):
        return self.observation

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.count, self.last = self.first, None
        return 0, {}

    def step(self, action):
        self.count, self.last = self.count + 1, "right" if action else "left"
        return 0, 0.0, False, False, {}


def shows(shown=None, first=0, steps=1):
    env = Reveal(Counter(first), shown)
    seen = [env.reset(seed=0)[0], *(env.step(1)[0] for _ in range(steps))]
    assert all(env.observation_space.contains(one) for one in seen)
    return seen


def as_told(**how):
    """What `shown=...` of the error shows, in place of what it was."""
    return shows(
        eval(re.search(r"shown=(\{.*?\})", told(lambda: shows(**how)))[1]), **{k: v for k, v in how.items() if k != "shown"}
    )


def words(env):
    return tabulate(env, gamma=GAMMA, check_steps=100)


class Tells(Corridor):
    """A cell, and beside it a story that never is the same."""

    stories = 0

    def __init__(self):
        super().__init__()
        self.observation_space = spaces.Dict({"cell": SEVEN, "story": spaces.Text(9)})

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return self._told(), {}

    def step(self, action):
        _, *rest = self.moved(int(action))
        return self._told(), *rest

    def _told(self):
        self.stories += 1
        return {"cell": self.cell, "story": str(self.stories)}


EMPTY = Shows(spaces.Dict({"cell": spaces.Discrete(7), "none": spaces.Box(0, 1, (0,), np.int8)}),
              lambda cell: {"cell": cell, "none": np.zeros(0, np.int8)})  # fmt: skip
LIST = Shows(spaces.Sequence(spaces.Discrete(7)), lambda cell: (cell,))
WIDE, LARGE = spaces.Box(-(2**62), 2**62, (1,), np.int64), spaces.MultiDiscrete([2**31] * 3)
WHOLE = Shows(*SHOWN["whole numbers as floats"])
SHOW_SO = ("Show them so, with `gymnasium.wrappers.TransformObservation(env, lambda o: numpy.int64(o), "
           "gymnasium.spaces.Box(0, 6, (2,), numpy.int64))`.")  # fmt: skip

CASES = [
    # states that are set
    ("Add `get_state()` and `set_state(state)`.", lambda: cells(Drift("_at")), lambda: cells(Set("_at"))),
    ("Give the environment a `physics`.", lambda: cells(Drift(space=PAIR)), lambda: cells(physical(LINE))),
    ("Give the environment a `physics`, which says how its observations show the state.",
     lambda: cells(Drift(**NEGATIVE)), lambda: cells(physical(LINE, **NEGATIVE))),
    ("expected a vector of floats that is its state. Give the environment a `physics`, which says how",
     lambda: cells(Drift(space=COLUMN)), lambda: cells(physical(COLUMN))),
    ("Make it without a render mode.", lambda: cells(Drift(render_mode="human")), lambda: cells(Drift())),
    ("Give it a __deepcopy__ that leaves this out.", lambda: cells(Locked()), lambda: cells(LeftOut())),
    ("Take it off, or give the environment that change itself.",
     lambda: cells(TransformReward(Drift(), lambda paid: 2 * paid)), lambda: cells(Drift()), lambda: cells(Drift(pays=2))),
    ("Give them, as in bounds={'x0': (low, high)}.",
     lambda: cells(Drift(space=FREE)), lambda: cells(Drift(space=FREE), bounds={"x0": (-2, 2)})),
    # states that are revealed
    ("Say so with shown={'count': 2}", lambda: shows({"count": 1}), lambda: as_told(shown={"count": 1})),
    ("List its values, as in shown={'count': [-1, 0, 1, 2]}", lambda: shows({"count": 3}, -1),
     lambda: as_told(shown={"count": 3}, first=-1)),
    ("List its values, as in shown={'last': [None]}", lambda: shows({"last": 3}), lambda: as_told(shown={"last": 3}, steps=0)),
    ("List it too, in `shown`.", lambda: shows({"last": [None]}), lambda: shows({"last": [None, "right"]})),
    ("Give `shown`, such as {'fickle_step': 2}.", shows, lambda: shows({"count": 2})),
    ("Leave one out.", lambda: shows({"last": [None, "right", None]}), lambda: shows({"last": [None, "right"]})),
    ("Show the parts of it, as in 'goal[0]'", lambda: shows({"goal": 3}), lambda: shows({"goal[0]": 3})),
    ("Show the parts of it, as in \"bag['key']\"", lambda: shows({"bag": 3}), lambda: shows({"bag['key']": 3})),
    ("Give the environment an integer attribute that says the same, and show that",
     lambda: shows({"open": 2}), lambda: shows({"opened": 2})),
    ("Give the attribute a property of another name.", lambda: shows({"observation": 2}), lambda: shows({"seen": 2})),
    ("It is (2, 1).", lambda: shows({"goal[7]": 3}), lambda: shows({"goal[1]": 3})),
    ("One seed is one layout.", lambda: SeededStarts(Corridor(), []), lambda: SeededStarts(Corridor(), [0])),
    # states that are numbered
    ("Show the same as one of these, with `gymnasium.wrappers.TransformObservation`.", lambda: words(LIST),
     lambda: words(TransformObservation(LIST, lambda seen: seen[0], spaces.Discrete(7)))),
    ("Leave text out, with a wrapper that shows the rest, as `gymnasium.wrappers.FilterObservation(env, ('key',))`.",
     lambda: words(Tells()), lambda: words(FilterObservation(Tells(), ("cell",)))),
    ("Leave it out, with a wrapper that shows the rest, as `gymnasium.wrappers.FilterObservation(env, ('key',))`.",
     lambda: words(EMPTY), lambda: words(FilterObservation(EMPTY, ("cell",)))),
    ("Discretise the environment first, with `discretize(env, gamma=..., bins=...)` if its state can be set.",
     lambda: words(Drift()), lambda: cells(Drift())),
    (SHOW_SO, lambda: words(WHOLE), lambda: words(done(mends(told(words, WHOLE))[0], WHOLE))),
    ("Give it narrower bounds.", lambda: StateIndex(WIDE), lambda: StateIndex(spaces.Box(-9, 9, (1,), np.int64))),
    ("`encode` takes one.", lambda: StateIndex(SEVEN).encode_batch(3), lambda: StateIndex(SEVEN).encode(3)),
    ("Number those that occur, with ListedStates.",
     lambda: StateIndex(LARGE), lambda: ListedStates(LARGE, np.ones((1, 3), int))),
]  # fmt: skip
MINI_GRID = "MiniGrid's environments have their whole state as integers in `irl_gym_envs:irl_gym/MiniGrid-v0`."
FILES = [f"{name}.py" for name in "physics coordinates reveal seeded_starts integer_spaces observed_integers states".split()]


@pytest.mark.parametrize(("says", "breaks", "mended"), [(says, breaks, rest) for says, breaks, *rest in CASES],
                         ids=[one[0] for one in CASES])  # fmt: skip
def test_a_mend_that_an_error_about_states_names_serves(says, breaks, mended):
    assert says in told(breaks) and all(each() is not None for each in mended)


def test_a_task_of_mini_grid_is_sent_to_the_one_that_shows_its_state():
    pytest.importorskip("minigrid")
    assert MINI_GRID in told(lambda: tabulate(gym.make("MiniGrid-Empty-5x5-v0"), gamma=GAMMA))
    assert words(make(mends(MINI_GRID)[0], task="Empty-5x5"))


def test_every_mend_that_an_error_about_states_names_is_executed():
    assert not unsaid([*CASES, (MINI_GRID,)], *FILES)
