"""The search over states: what it meets that is odd, and what it refuses."""

import threading

import gymnasium as gym
import numpy as np
import pytest
from enumeration_envs import Board, Corridor, Racetrack, Shows, same_table
from gymnasium import spaces

from irl_gym.environments.seeded_starts import SeededStarts
from irl_gym.errors import IrlGymError, NotDiscrete, NotTabular, UnknownObservation
from irl_gym.tables.copies.snapshots import Snapshots
from irl_gym.tables.enumeration.explorer import Explorer
from irl_gym.tables.enumeration.table import Enumeration
from irl_gym.tables.tabulate import tabulate

pytestmark = pytest.mark.usefixtures("unchecked")


def table_of(env, **limits):
    return Enumeration(**limits).table(env, 0.9)


class Map(Corridor):
    """A large map is changed in place: from cell 0 a gap is opened that lets episodes go on to the end."""

    shown = True

    def __init__(self, n=9):
        super().__init__(n)
        self.observation_space = spaces.Tuple([spaces.Discrete(n), spaces.Discrete(2)])
        self.map = np.zeros((60, 60), dtype=np.int64)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.map[5, 5] = 0
        self.done = 0
        return (self.cell, 0), {}

    def step(self, action):
        before = self.cell
        self.moved(int(action))
        if self.cell == self.n - 2 and not self.map[5, 5] and before < self.cell:
            self.cell = before
        if before == 0 and self.cell == 0:
            self.map[5, 5] = 1
        return (self.cell, int(self.map[5, 5])), float(self.cell == self.n - 1), self.cell == self.n - 1, False, {}


class RareMap(Map):
    """The gap takes 40 steps to the left: no walk of a few random steps opens it."""

    def __init__(self):
        super().__init__(90)


@pytest.mark.parametrize("kind", [Map, RareMap])
def test_a_large_array_that_is_changed_in_place_is_part_of_the_state(kind):
    table = tabulate(kind(), gamma=0.9, check_steps=2000)
    n = kind().n
    closed = [table.states.encode((cell, 0)) for cell in range(n - 2)]
    open_ = [table.states.encode((cell, 1)) for cell in range(n - 1)]
    assert table.mdp.n_states == len(closed) + len(open_) + 1
    assert table.mdp.P[[closed[n - 3] * 2 + 1]].toarray()[0, closed[n - 3]] == 1
    assert table.mdp.P[[open_[n - 3] * 2 + 1]].toarray()[0, open_[n - 2]] == 1


@pytest.mark.parametrize("rebuilt", [False, True])
def test_a_large_map_beside_a_growing_path_is_in_no_state(monkeypatch, rebuilt):
    sizes = []
    monkeypatch.setattr(Snapshots, "take", lambda self, take=Snapshots.take: sizes.append(len(take(self))) or take(self))
    table = table_of(Racetrack(5, rebuilt=rebuilt), revisits=0)
    assert table.evidence.exact and max(sizes) < 1000


def test_a_map_inside_an_attribute_changes_no_table_by_being_held_constant():
    assert same_table(table_of(Racetrack(5), revisits=0), table_of(Racetrack(5, tiles=5), revisits=0))


class Inside(Map):
    """The same with the map inside an attribute that changes at each step."""

    def __init__(self, n=90):
        super().__init__(n)
        self.world = {"map": np.zeros((60, 60), dtype=np.int64), "steps": 0}
        del self.map

    map = property(lambda self: self.world["map"], lambda self, value: None, lambda self: None)

    def step(self, action):
        self.world["steps"] = 1 - self.world["steps"]
        return super().step(action)


def test_a_large_array_inside_an_attribute_that_is_changed_rarely_is_part_of_the_state():
    table = tabulate(Inside(), gamma=0.9, check_steps=2000)
    assert table.mdp.n_states == (90 - 2) + (90 - 1) + 1


class Locked(Corridor):
    def __init__(self):
        super().__init__()
        self.lock = threading.Lock()


class Handed(Locked):
    """Cannot be copied, but can be set."""

    def get_state(self):
        return self.cell

    def set_state(self, state):
        self.cell = state


def test_an_environment_that_cannot_be_copied_is_refused_by_the_name_of_what_cannot():
    with pytest.raises(NotTabular, match=r"Locked\.lock is a lock, which cannot be copied.*get_state\(\) and set_state"):
        table_of(Locked())


def test_an_environment_that_can_be_set_need_not_be_copied():
    found, plain = table_of(Handed()), table_of(Corridor())
    assert (found.mdp.P != plain.mdp.P).nnz == 0 and np.array_equal(found.reward.values, plain.reward.values)


WRONG = {
    "outside Discrete": (spaces.Discrete(6), int),
    "below its start": (spaces.Discrete(7, start=2), int),
    "a float": (spaces.Discrete(7), float),
    "half": (spaces.Discrete(7), lambda cell: cell + 0.5),
    "nothing": (spaces.Discrete(7), lambda cell: None),
    "a float in a Box": (spaces.Box(0, 6, (1,), np.int64), lambda cell: np.array([cell + 0.5])),
    "outside Box": (spaces.Box(0, 6, (1,), np.uint8), lambda cell: np.array([cell + 254])),
    "another shape": (spaces.Box(0, 6, (2,), np.int64), lambda cell: np.array([cell])),
    "too few parts": (spaces.Tuple([spaces.Discrete(7)] * 2), lambda cell: (cell,)),
    "no key": (spaces.Dict({"cell": spaces.Discrete(7)}), lambda cell: {"place": cell}),
    "no dict": (spaces.Dict({"cell": spaces.Discrete(7)}), lambda cell: cell),
}


@pytest.mark.parametrize("name", WRONG)
def test_an_observation_that_is_no_member_of_its_space_is_refused(name):
    with pytest.raises(UnknownObservation, match=r"expected .*"):
        table_of(Shows(*WRONG[name]))


RIGHT = {
    "Discrete with a start": (spaces.Discrete(7, start=5), lambda cell: cell + 5),
    "negative start": (spaces.Discrete(7, start=-3), lambda cell: np.int64(cell - 3)),
    "MultiBinary": (spaces.MultiBinary(3), lambda cell: np.array([cell >> i & 1 for i in range(3)], dtype=np.int8)),
    "MultiDiscrete": (spaces.MultiDiscrete([4, 2]), lambda cell: np.array([cell // 2, cell % 2])),
    "Dict": (
        spaces.Dict({"b": spaces.Discrete(4), "a": spaces.MultiBinary(1)}),
        lambda cell: {"b": cell // 2, "a": np.array([cell % 2], dtype=np.int8)},
    ),
    "nested": (
        spaces.Tuple([spaces.Dict({"x": spaces.Discrete(4, start=1)}), spaces.Box(-1, 1, (1, 1), np.int32)]),
        lambda cell: ({"x": 1 + cell // 2}, np.array([[cell % 2]], dtype=np.int32)),
    ),
    "Box of no axis": (spaces.Box(0, 6, (), np.int64), lambda cell: np.array(cell)),
}  # fmt: skip


@pytest.mark.parametrize("name", RIGHT)
def test_any_observation_of_integers_is_a_state(name):
    space, show = RIGHT[name]
    table = tabulate(Shows(space, show), gamma=0.9, check_steps=500)
    assert table.mdp.n_states == 7
    for cell in range(6):
        row = table.states.encode(show(cell))
        right = table.states.encode(show(cell + 1), terminated=cell == 5)
        assert table.mdp.P[[row * 2 + 1]].toarray()[0, right] == 1


def test_floats_are_refused_before_anything_is_copied():
    with pytest.raises(NotDiscrete, match=r"holds floats: expected integers\. Discretise"):
        table_of(Shows(spaces.Box(0, 1, (1,), np.float32), float))


class Layouts(gym.Env):
    """Draws one of very many layouts at reset."""

    observation_space, action_space = spaces.Box(0, 2**40, (1,), np.int64), spaces.Discrete(1)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.layout = int(self.np_random.integers(2**40))
        return np.array([self.layout]), {}

    def step(self, action):
        return np.array([self.layout]), 0.0, True, False, {}


def test_too_many_layouts_are_refused_with_a_mend():
    with pytest.raises(NotTabular, match=r"500 resets gave 500 different observations.*SeededStarts\(env, seeds=\(0,\)\)"):
        table_of(Layouts(), start_runs=500)


def test_the_mend_for_too_many_layouts_works():
    table = table_of(SeededStarts(Layouts(), seeds=(0, 1, 2)))
    assert table.evidence.exact and np.flatnonzero(table.mdp.d0).size == 3 and table.mdp.d0.max() == pytest.approx(1 / 3)


class Nowhere(Corridor):
    def reset(self, *, seed=None, options=None):
        raise RuntimeError("nobody at home")


def test_a_reset_that_fails_is_told():
    with pytest.raises(NotTabular, match=r"raised RuntimeError \(nobody at home\): expected a reset"):
        table_of(Nowhere())


class PaysNothing(Corridor):
    def step(self, action):
        observation, _, *rest = self.moved(int(action))
        return observation, float("nan"), *rest


def test_a_reward_that_is_no_number_is_refused():
    with pytest.raises(IrlGymError, match="nan"):
        table_of(PaysNothing())


class EndsAtOnce(Corridor):
    """Its only states are where it starts and where every step ends."""

    def step(self, action):
        return 0, 1.0, True, False, {}


def test_an_environment_of_one_step_has_a_table():
    table = table_of(EndsAtOnce())
    assert table.mdp.n_states == 2 and table.mdp.terminal.tolist() == [True, False]


def test_progress_is_told_to_the_end():
    told = []
    Enumeration().table(Board(4), 0.9, lambda tried, found: told.append((tried, found)))
    assert told[-1] == (15, 15)  # the sixteenth cell is the end


def test_a_lack_of_memory_is_no_unknown_observation(monkeypatch):
    def key_of(observation):
        raise MemoryError

    env = Corridor()
    env.reset(seed=0)
    explorer = Explorer(env, Enumeration(), None, frozenset(), False)
    monkeypatch.setattr(explorer, "_key_of", key_of)
    with pytest.raises(MemoryError):
        explorer.key(0)
