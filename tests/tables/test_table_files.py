"""Tables as files: the same table comes back, and nothing else is read as one."""

import errno
import os
import pickle
from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
import scipy.sparse as sp
from enumeration_envs import Board, Corridor, Lamps, Slippery
from gymnasium import spaces
from tiny_env import TableEnv, both_ways, lottery

from irl_gym.errors import InvalidMDP, InvalidParameter
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.tables.counted.counting import Interaction
from irl_gym.tables.discretize import discretize
from irl_gym.tables.enumeration.table import Enumeration
from irl_gym.tables.table_files import keep_table, kept_table, load_table, save_table
from irl_gym.tables.tabulate import tabulate


class Jumps(Corridor):
    """The last cell is an end by a step, and none by a jump."""

    def __init__(self):
        super().__init__(4)
        self.action_space = spaces.Discrete(3)

    def step(self, action):
        if action < 2:
            return self.moved(int(action))
        self.cell = 3
        return 3, 0.5, False, False, {}


TABLES = {
    "published": (lambda: gym.make("FrozenLake-v1"), {}),
    "published, split": (lambda: TableEnv(both_ways(), [1, 0, 0]), {}),
    "rewards not settled": (lambda: TableEnv(lottery(0.5), [1, 0]), {}),
    "enumerated": (lambda: Board(3), {}),
    "enumerated, split": (Jumps, {}),
    "parts": (Lamps, {}),
    "counted": (lambda: Slippery("normal", n=3), {"by": Enumeration(runs=20)}),
    "counted, from steps": (lambda: gym.make("FrozenLake-v1"), {"by": Interaction(300)}),
}


@pytest.fixture(scope="module")
def table():
    made = {}

    def get(name):
        if name not in made:
            env, kwargs = TABLES[name]
            made[name] = tabulate(env(), gamma=0.9, check_steps=100, **kwargs)
        return made[name]

    return get


def saved(table, path):
    save_table(table, path)
    return path


@pytest.mark.parametrize("name", TABLES)
def test_a_table_comes_back_byte_for_byte(table, name, tmp_path):
    there = table(name)
    back = load_table(saved(there, tmp_path / "table.npz"), there.states.space)
    for a, b in (
        (there.mdp.P.data, back.mdp.P.data), (there.mdp.P.indices, back.mdp.P.indices), (there.mdp.P.indptr, back.mdp.P.indptr),
        (there.mdp.d0, back.mdp.d0), (there.reward.values, back.reward.values), (there.payments.mean, back.payments.mean),
        (there.payments.deviation, back.payments.deviation),
    ):  # fmt: skip
        assert a.dtype == b.dtype and a.tobytes() == b.tobytes()
    assert np.array_equal(there.mdp.visits, back.mdp.visits) and (there.mdp.visits is None) == there.evidence.exact
    assert (back.mdp.gamma, back.evidence, back.payments.largest) == (0.9, there.evidence, there.payments.largest)


@pytest.mark.parametrize("name", TABLES)
def test_the_rewards_of_transitions_come_back_where_there_are_any(table, name, tmp_path):
    there = table(name)
    back = load_table(saved(there, tmp_path / "table.npz"), there.states.space)
    assert (there.payments.entries is None) == (back.payments.entries is None) == (name == "rewards not settled")
    assert there.payments.entries is None or there.payments.entries.tolist() == back.payments.entries.tolist()


@pytest.mark.parametrize("name", TABLES)
def test_states_come_back_with_their_numbering(table, name, tmp_path):
    there = table(name)
    back = load_table(saved(there, tmp_path / "table.npz"), there.states.space)
    assert type(back.states) is type(there.states) and back.states.terminal_copies == there.states.terminal_copies
    for row in range(there.mdp.n_states):
        ended = row in there.states.terminal_copies.values()
        assert back.states.encode(there.states.decode(row), terminated=ended) == row


def test_some_tables_of_the_test_are_split_and_some_are_not(table):
    assert {name for name in TABLES if table(name).states.terminal_copies} >= {"published, split", "enumerated, split"}


@pytest.mark.parametrize("name", ["published", "parts"])
def test_the_same_table_is_the_same_file(table, name, tmp_path):
    first, second = (saved(table(name), tmp_path / one).read_bytes() for one in ("a.npz", "b.npz"))
    assert first == second


def test_a_table_that_came_back_is_the_same_file_again(table, tmp_path):
    first = saved(table("parts"), tmp_path / "a.npz")
    back = load_table(first, Lamps.observation_space)
    assert saved(back, tmp_path / "b.npz").read_bytes() == first.read_bytes()


def test_a_table_is_written_beside_and_renamed(table, tmp_path, monkeypatch):
    path = saved(table("published"), tmp_path / "table.npz")
    before = path.read_bytes()

    def killed(*args):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", killed)
    with pytest.raises(KeyboardInterrupt):
        save_table(table("enumerated"), path)
    assert path.read_bytes() == before


def test_a_table_of_other_observations_is_refused(table, tmp_path):
    path = saved(table("enumerated"), tmp_path / "table.npz")
    with pytest.raises(InvalidMDP, match=r"table of observations MultiDiscrete\(\[3 3\]\): expected Discrete\(9\)"):
        load_table(path, spaces.Discrete(9))


def test_a_file_that_is_not_there_is_missing(tmp_path):
    with pytest.raises(FileNotFoundError, match="does not exist: expected a table"):
        load_table(tmp_path / "none.npz", spaces.Discrete(2))


def test_states_of_another_numbering_are_refused(table, tmp_path, unchecked):
    other = replace(table("published"), states=object())
    with pytest.raises(InvalidMDP, match="the states are object: expected a StateIndex, ListedStates, or Cells"):
        save_table(other, tmp_path / "table.npz")
    assert not list(tmp_path.iterdir())


CELLS = {"shown": ("MountainCar-v0", (4, 3)), "circular": ("Acrobot-v1", 3), "integer": ("FrozenLake-v1", 16)}


@pytest.mark.parametrize("name", CELLS)
def test_a_table_of_cells_comes_back_with_its_numbering(tmp_path, name):
    env = gym.make(CELLS[name][0])
    table = discretize(env, gamma=0.9, bins=CELLS[name][1], starts=5)
    again = load_table(saved(table, tmp_path / "table.npz"), env.observation_space)
    rows = np.arange(table.mdp.n_states)
    assert np.array_equal(again.states.decode_batch(rows), table.states.decode_batch(rows))
    assert again.states.terminal_copies == table.states.terminal_copies and again.states.bins == table.states.bins
    assert again.evidence == table.evidence and (again.mdp.P != table.mdp.P).nnz == 0


@pytest.mark.parametrize(
    ("part", "value"),
    [
        ("shown", "os.system"),
        ("low", np.zeros(3)),
        ("bins", [4, 4]),
        ("bins", [4, -3]),
        ("names", ["x"]),
        ("high", [np.inf, 1]),
    ],
)
def test_a_grid_that_contradicts_itself_is_refused(tmp_path, part, value):
    env = gym.make("MountainCar-v0")
    path = saved(discretize(env, gamma=0.9, bins=(4, 3), starts=5), tmp_path / "table.npz")
    with np.load(path) as archive:
        arrays = dict(archive)
    np.savez(path, **{**arrays, f"cells.{part}": np.array(value)})
    with pytest.raises(InvalidMDP):
        load_table(path, env.observation_space)


class Bomb:
    def __reduce__(self):
        return os.mkdir, ("unpickled",)


def _pickled_inside(path):
    with np.load(path, allow_pickle=False) as kept:
        parts = dict(kept)
    with path.open("wb") as file:
        np.savez(file, **parts | {"d0": np.array([Bomb()], dtype=object)})


def _without_evidence(path):
    with np.load(path, allow_pickle=False) as kept:
        parts = dict(kept)
    del parts["evidence"]
    with path.open("wb") as file:
        np.savez(file, **parts)


def _one_array(path):
    with path.open("wb") as file:
        np.save(file, np.arange(3))


def _flagged_as_encrypted(path):
    content = bytearray(path.read_bytes())
    content[content.rindex(b"PK\x01\x02") + 8] |= 1
    path.write_bytes(content)


def _copies_added(path):
    with np.load(path, allow_pickle=False) as kept:
        parts = dict(kept)
    with path.open("wb") as file:
        np.savez(file, **parts | {"copies": np.array([[0, 16]])})


DAMAGE = {
    "truncated": lambda path: path.write_bytes(path.read_bytes()[:-40]),
    "empty": lambda path: path.write_bytes(b""),
    "text": lambda path: path.write_text("nothing of the kind"),
    "a pickle": lambda path: path.write_bytes(pickle.dumps(Bomb())),
    "a pickle inside": _pickled_inside,
    "a part missing": _without_evidence,
    "one array": _one_array,
    "a bit": _flagged_as_encrypted,
}


@pytest.mark.parametrize("name", DAMAGE)
def test_a_file_that_holds_no_table_is_refused_and_never_unpickled(table, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    path = saved(table("published"), tmp_path / "table.npz")
    DAMAGE[name](path)
    with pytest.raises(InvalidMDP, match="holds no table"):
        load_table(path, spaces.Discrete(16))
    assert not Path("unpickled").exists()


def test_a_numbering_of_other_states_is_refused(table, tmp_path):
    path = saved(table("published"), tmp_path / "table.npz")
    _copies_added(path)
    with pytest.raises(InvalidMDP, match="the table has 16 states and a numbering of 17"):
        load_table(path, spaces.Discrete(16))


def test_a_folder_forgets_a_table_that_is_damaged(table, tmp_path):
    keep_table(table("published"), tmp_path)
    _flagged_as_encrypted(tmp_path / "table.npz")
    assert kept_table(tmp_path, spaces.Discrete(16)) is None and not list(tmp_path.iterdir())


def test_a_table_that_cannot_be_opened_now_stays(table, tmp_path, monkeypatch):
    keep_table(table("published"), tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(Path, "open", lambda *_, **__: (_ for _ in ()).throw(OSError(errno.EMFILE, "not now")))
        with pytest.raises(InvalidParameter, match=r"table.npz cannot be read now \(.*not now\)"):
            kept_table(tmp_path, spaces.Discrete(16))
    assert kept_table(tmp_path, spaces.Discrete(16)) is not None


def test_a_table_that_is_no_mdp_is_refused(table, tmp_path):
    path = saved(table("published"), tmp_path / "table.npz")
    with np.load(path, allow_pickle=False) as kept:
        parts = dict(kept)
    with path.open("wb") as file:
        np.savez(file, **parts | {"data": parts["data"] * 0.9})
    with pytest.raises(InvalidMDP, match=r"sums to 0\.9"):
        load_table(path, spaces.Discrete(16))


def test_a_horizon_comes_back_with_its_table(table, tmp_path):
    one = table("enumerated")
    finite = replace(one, mdp=TabularMDP(sp.csr_array(one.mdp.P.shape), 1.0, one.mdp.d0, horizon=3))
    bare = replace(finite, payments=replace(one.payments, entries=None))
    back = load_table(saved(bare, tmp_path / "table.npz"), one.states.space)
    assert (back.mdp.horizon, back.mdp.gamma) == (3, 1.0)
