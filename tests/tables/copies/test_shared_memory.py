"""What is written through one array and read through another, which shares its memory, is the same in a copy."""

import array
import mmap

import gymnasium as gym
import numpy as np
import pytest
import scipy.sparse
from gymnasium import spaces
from walk_env import Stubborn, Walk, snapshots_of

from irl_gym.errors import NotCopied
from irl_gym.tables.copies.snapshots import ConstantChanged
from irl_gym.tables.enumeration.table import Enumeration

N = 5


class Line(gym.Env):
    """A line of five cells; the place is written into one of two things that share memory and read from the other."""

    observation_space, action_space = spaces.Discrete(N), spaces.Discrete(2)

    def __init__(self, held, write, read):
        self.held, self.write, self.read = held, write, read

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.write(self.held, 0)
        return int(self.read(self.held)), {}

    def step(self, action):
        place = int(self.read(self.held)) + (1 if action else -1)
        self.write(self.held, min(max(place, 0), N - 1))
        return int(self.read(self.held)), 0.0, place == N - 1, False, {}


def put(first, at):
    def write(held, value):
        held[first][at] = value

    return write


def pair(made, *parts):
    return [made, *(part(made) for part in parts)]


SHARED = {
    "a row": lambda: Line(pair(np.zeros((3, 4)), lambda big: big[1]), put(1, 2), lambda held: held[0][1, 2]),
    "two parts": lambda: Line(pair(np.zeros(9), lambda b: b[:6], lambda b: b[3:])[1:], put(0, 4), lambda held: held[1][1]),
    "a part run backwards": lambda: Line(pair(np.zeros((4, 3)).T, lambda b: b[::-1, 1:]), put(1, (0, 0)), lambda h: h[0][2, 1]),
    "a field": lambda: Line(pair(np.zeros(3, "i4, f8"), lambda b: b["f0"]), put(1, 1), lambda held: held[0][1]["f0"]),
    "objects": lambda: Line(pair(np.full((3, 4), 0, object), lambda b: b[1]), put(1, 2), lambda held: held[0][1, 2]),
    "objects that hold": lambda: Line(
        pair(np.array([[0], None], object), lambda b: b[:1], lambda b: b[0]), put(2, 0), lambda held: held[1][0][0]
    ),
    "rows of a structured array": lambda: Line([*np.zeros(3, "i4, f8")], put(1, "f0"), lambda held: held[1]["f0"]),
    "a row of a large one": lambda: Line(pair(np.zeros((40, 40)), lambda b: b[1]), put(1, 2), lambda held: held[0][1, 2]),
    "what cannot be pickled": lambda: Line([*pair(np.zeros(3), lambda b: b[1:]), Stubborn()], put(1, 0), lambda h: h[0][1]),
    "a sparse matrix's": lambda: Line(
        pair(scipy.sparse.csr_matrix(np.eye(3)), lambda b: b.data[1:]), put(1, 0), lambda held: held[0][1, 1]
    ),
}


@pytest.mark.parametrize("name", SHARED)
def test_arrays_that_share_memory_share_it_in_copies(name):
    table = Enumeration().table(SHARED[name](), 0.9)
    P = table.mdp.P.toarray().reshape(N, 2, N)[: N - 1].argmax(-1)
    assert (P.tolist(), table.evidence.exact) == ([[max(s - 1, 0), s + 1] for s in range(N - 1)], True)


def over(buffer):
    return Line(pair(buffer, lambda one: np.frombuffer(one, np.uint8)), put(0, 0), lambda held: held[1][0])


def tensors():
    torch = pytest.importorskip("torch")
    return Line(pair(torch.zeros(3, 4), lambda big: big[1]), put(1, 2), lambda held: held[0][1, 2])


def parameters(tied):
    torch = pytest.importorskip("torch")
    first, second = torch.nn.Linear(2, 2), torch.nn.Linear(2, 2)
    second.weight = first.weight
    return Line([first, second.weight if tied else second.weight.data], weigh, lambda held: held[1][0, 1].item())


def weigh(held, value):
    held[0].weight.data[0, 1] = value


def test_a_parameter_of_two_modules_is_one_in_copies():
    table = Enumeration().table(parameters(tied=True), 0.9)
    P = table.mdp.P.toarray().reshape(N, 2, N)[: N - 1].argmax(-1)
    assert (P.tolist(), table.evidence.exact) == ([[max(s - 1, 0), s + 1] for s in range(N - 1)], True)


REFUSED = {
    "a bytearray": lambda: over(bytearray(4)),
    "an array.array": lambda: over(array.array("B", [0] * 4)),
    "tensors": tensors,
    "a parameter and its data": lambda: parameters(tied=False),
    "a row of a structured array": lambda: Line(
        pair(np.zeros(3, "i4, f8"), lambda b: b[1]), put(1, "f0"), lambda h: h[0][1][0]
    ),
    "a masked array": lambda: Line(pair(np.zeros(3), np.ma.asarray), put(1, 1), lambda held: held[0][1]),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_else_shares_memory_is_refused(name):
    with pytest.raises(NotCopied, match="share memory, which copies of them would not"):
        Enumeration().table(REFUSED[name](), 0.9)


def test_a_table_of_pandas_and_its_column_are_named_and_a_copy_of_the_column_mends_it():
    pandas = pytest.importorskip("pandas")

    def line(copy):
        table = pandas.DataFrame({"x": np.arange(N), "y": np.arange(N)})
        env = Line([0], lambda held, at: held.__setitem__(0, at), None)
        env.table, env.column = table, table["y"].to_numpy(copy=copy)
        env.read = lambda held: env.column[held[0]]
        return env

    with pytest.raises(NotCopied, match=r"in Line\.column and .* in Line\.table share memory"):
        Enumeration().table(line(False), 0.9)
    assert Enumeration().table(line(True), 0.9).evidence.exact


def two_of_a_file(path, mode):
    return [np.memmap(path, np.uint8, mode, shape=(4,)), np.memmap(path, np.uint8, mode, shape=(4,))]


MAPPED = {
    "two of a file": lambda path: two_of_a_file(path, "r+"),
    "a part as a plain array": lambda path: [np.asarray(one)[:1] for one in two_of_a_file(path, "w+")],
    "a buffer": lambda path: [np.frombuffer(mmap.mmap(-1, 4), np.uint8)] * 2,
}


@pytest.mark.parametrize("name", MAPPED)
def test_an_array_that_writes_to_a_file_is_refused_by_name(name, tmp_path):
    (tmp_path / "held").write_bytes(bytes(4))
    with pytest.raises(NotCopied, match=r"Line\.held leads to a .* that writes to a file .* Load it in __init__"):
        Enumeration().table(Line(MAPPED[name](tmp_path / "held"), put(1, 0), lambda held: held[0][0]), 0.9)


def test_an_array_that_writes_to_a_file_is_refused_when_a_step_opens_it(tmp_path):
    (tmp_path / "held").write_bytes(bytes(4))
    env, snapshots = snapshots_of(Walk(row=None))
    env.row = np.memmap(tmp_path / "held", np.uint8, "r+")
    with pytest.raises(NotCopied, match="that writes to a file"):
        snapshots.take()


MENDED = {
    "loaded": lambda path: [np.array(np.memmap(path, np.uint8, "r+"))],
    "written to in memory": lambda path: [np.memmap(path, np.uint8, "c")],
    "read alone": lambda path: [np.zeros(1, int), np.memmap(path, np.uint8, "r")],
}


@pytest.mark.parametrize("name", MENDED)
def test_a_file_that_is_loaded_or_not_written_to_is_none_to_refuse(name, tmp_path):
    (tmp_path / "held").write_bytes(bytes(4))
    table = Enumeration().table(Line(MENDED[name](tmp_path / "held"), put(0, 0), lambda held: held[0][0]), 0.9)
    assert (table.mdp.n_states, table.evidence.exact) == (N, True)


class Told(Line):
    def get_state(self):
        return int(self.read(self.held))

    def set_state(self, state):
        self.write(self.held, state)


def test_get_state_and_set_state_mend_what_is_refused():
    buffer = bytearray(4)
    env = Told([buffer, np.frombuffer(buffer, np.uint8)], put(0, 0), lambda held: held[1][0])
    table = Enumeration().table(env, 0.9)
    assert (table.mdp.n_states, table.evidence.exact) == (N, True)


def test_a_snapshot_restores_arrays_that_share_memory_and_a_part_that_is_not_to_be_written():
    env, snapshots = snapshots_of(Walk(big=np.zeros((3, 4)), row=None, fixed=None))
    env.row, env.fixed = env.big[1], env.big[2].view()
    env.fixed.flags.writeable = False
    state = snapshots.take()
    env.big = env.row = None
    snapshots.restore(state)
    env.row[2] = 5
    assert (env.big[1, 2], env.fixed.flags.writeable, np.shares_memory(env.fixed, env.big)) == (5, False, True)


def test_a_constant_that_shares_memory_with_the_state_is_none():
    env, snapshots = snapshots_of(Walk(map=np.zeros((40, 40)), row=None))
    snapshots.take()
    env.row = env.map[3]
    with pytest.raises(ConstantChanged, match="map"):
        snapshots.take()
