"""A search kept in a file is continued to the same table; a file of anything else is refused, and none is ever unpickled."""

import os
import pickle
import signal
from functools import cache
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from enumeration_envs import Board, Corridor, Slippery, same_table
from stopped import run_until

from irl_gym.errors import EnumerationLimit, IrlGymError, RunConflict
from irl_gym.tables.enumeration.explored import Explored, load_explored
from irl_gym.tables.enumeration.table import Enumeration

pytestmark = pytest.mark.usefixtures("unchecked")


class Interrupted:
    """Lets somebody press Ctrl-C after some calls."""

    def __init__(self, after):
        self.left = after

    def __call__(self):
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt


class Large(Board):
    """Opens a cell of a large map in the far corner only: what was held to be constant is none."""

    def __init__(self, size=8, pause=None):
        super().__init__(size, pause)
        self.map = np.zeros((40, 40), dtype=np.int64)

    def step(self, action):
        before = self.x, self.y
        result = super().step(action)
        if before == (self.size - 2, self.size - 1):
            self.map[0, 0] = 1
        return result

    def reset(self, *, seed=None, options=None):
        self.map[0, 0] = 0
        return super().reset(seed=seed)


def table_of(env, **limits):
    return Enumeration(**{"runs": 100, "start_runs": 100} | limits).table(env, 0.9)


def stopped(env, path, states, **limits):
    """Search until so many states are found, and a file is left."""
    with pytest.raises(EnumerationLimit):
        table_of(env, checkpoint=path, max_states=states, **limits)
    assert path.exists()
    return path


ENVIRONMENTS = {
    "a board": lambda: Board(6),
    "FrozenLake": lambda: gym.make("FrozenLake-v1", map_name="8x8"),
    "normal draws": lambda: Slippery("normal", n=30),
    "mixed draws": lambda: Slippery("mixed", n=30),
    "draws from outside": lambda: Slippery("imported from random", n=30),
    "draws from a module": lambda: Slippery("module random", n=30),
    "a map that changes": Large,
}


@cache
def in_one_go(name):
    return table_of(ENVIRONMENTS[name]())


@pytest.mark.parametrize("name", ENVIRONMENTS)
@pytest.mark.parametrize("states", [2, 11, 25])
def test_a_search_that_was_stopped_goes_on_to_the_same_table(tmp_path, name, states):
    make = ENVIRONMENTS[name]
    path = stopped(make(), tmp_path / "search.npz", states)
    assert same_table(table_of(make(), checkpoint=path), in_one_go(name))


def test_the_evidence_is_the_same_when_a_search_was_stopped_and_goes_on(tmp_path):
    class Ages(Corridor):
        """Counts its steps, harmlessly, so that states are met in other inner states."""

        age = 0

        def step(self, action):
            self.age += 1
            return self.moved(int(action))

    path = tmp_path / "search.npz"
    stopped(Ages(), path, 4)
    assert table_of(Ages(), checkpoint=path).evidence == table_of(Ages()).evidence


class Anywhere(Slippery):
    """Begins in any cell of the first half."""

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.cell = int(self.np_random.integers(self.n // 2))
        return self.cell, {}


def test_a_search_with_draws_at_its_start_goes_on_to_the_same_table(tmp_path):
    path = stopped(Anywhere(n=30), tmp_path / "search.npz", 20)
    found = table_of(Anywhere(n=30), checkpoint=path)
    assert same_table(found, table_of(Anywhere(n=30))) and (found.mdp.d0 > 0).sum() == 15


@pytest.mark.parametrize("after", [400, 405, 410, 437, 520])
def test_an_interrupted_search_is_kept_and_goes_on_to_the_same_table(tmp_path, after):
    path, pause = tmp_path / "search.npz", Interrupted(after)
    with pytest.raises(KeyboardInterrupt):
        table_of(Paused(pause), checkpoint=path)
    with np.load(path, allow_pickle=False) as kept:
        assert 1 <= len(kept["first_line"]) - 1 < len(kept["states"])
    assert same_table(table_of(Paused(None), checkpoint=path), table_of(Paused(None)))


class Paused(Board):
    def __init__(self, pause):
        super().__init__(8, None)
        type(self).called = staticmethod(pause or (lambda: None))

    def step(self, action):
        self.called()
        return super().step(action)


def test_an_evidence_of_counts_does_not_change_by_an_interruption(tmp_path):
    whole = table_of(Slippery("normal", n=30))
    path = stopped(Slippery("normal", n=30), tmp_path / "search.npz", 20)
    assert table_of(Slippery("normal", n=30), checkpoint=path).evidence == whole.evidence


def test_a_finished_search_is_read_again_without_searching(tmp_path):
    path = tmp_path / "search.npz"
    first = table_of(Board(20), checkpoint=path)
    calls = []
    again = Enumeration(runs=100, start_runs=100, checkpoint=path).table(Board(20, pause=None), 0.9, lambda *n: calls.append(n))
    assert same_table(first, again) and calls == [(399, 399)]


def test_a_search_that_was_killed_goes_on_to_the_same_table(tmp_path):
    path, script = tmp_path / "search.npz", tmp_path / "search.py"
    script.write_text(
        "from enumeration_envs import Board\nfrom irl_gym.tables.enumeration.table import Enumeration\n"
        f"Enumeration(checkpoint={str(path)!r}, every=0).table(Board(15, lambda: None), 0.9)\n"
    )
    expanded = [0]
    for where, nth in (("os:replace", 20), ("enumeration_envs:Board.step", 1_200)):  # before the file is renamed; in a step
        made = run_until(script, where=where, nth=nth, sent=signal.SIGKILL)
        assert made.returncode == -signal.SIGKILL, made.stderr
        with np.load(path, allow_pickle=False) as kept:
            expanded.append(len(kept["first_line"]))
    assert 0 < expanded[1] < expanded[2] < 225
    env = Board(15, lambda: None)
    assert same_table(Enumeration(checkpoint=path).table(env, 0.9), Enumeration().table(env, 0.9))
    script.unlink()
    assert [one.name for one in tmp_path.iterdir()] == ["search.npz"]


class Harder(Slippery):
    def slips(self):
        return self.np_random.random() < 0.5


class Backwards(Corridor):
    def step(self, action):
        return self.moved(1 - int(action))


@pytest.mark.parametrize("states", [4, 7])
def test_the_same_class_that_now_does_something_else_is_refused(tmp_path, states):
    """Its words are the same, its steps are not: other arguments, or an edited source."""

    class Changing(Slippery):
        chance = 0.2

        def slips(self):
            return self.np_random.random() < self.chance

    path = tmp_path / "search.npz"
    if states == 7:
        table_of(Changing(), checkpoint=path)
    else:
        stopped(Changing(), path, states)
    Changing.chance = 0.3
    with pytest.raises(RunConflict, match=r"was kept goes on from .* otherwise than the environment does now"):
        table_of(Changing(), checkpoint=path)


@pytest.mark.parametrize(
    ("env", "other"),
    [
        (Board(8), "observations"), (Corridor(), "environment"), (gym.wrappers.TransformReward(Board(6), float), "wrappers"),
    ],
)  # fmt: skip
def test_a_search_of_another_environment_is_refused(tmp_path, env, other):
    path = stopped(Board(6), tmp_path / "search.npz", 10)
    with pytest.raises(RunConflict, match=rf"the enumeration of something else \(other: .*{other}"):
        table_of(env, checkpoint=path)


def test_a_search_with_other_settings_is_refused(tmp_path):
    path = stopped(Board(6), tmp_path / "search.npz", 10)
    with pytest.raises(RunConflict, match=r"something else \(other: settings\)"):
        table_of(Board(6), checkpoint=path, seed=1)


def test_a_larger_limit_is_no_other_setting(tmp_path):
    path = stopped(Board(6), tmp_path / "search.npz", 10)
    assert table_of(Board(6), checkpoint=path, max_states=100, max_bytes=1e9).mdp.n_states == 36


class Bomb:
    def __reduce__(self):
        return os.mkdir, ("unpickled",)


def _pickled(path):
    path.write_bytes(pickle.dumps(Bomb()))


def _pickled_inside(path):
    with np.load(path, allow_pickle=False) as kept:
        parts = dict(kept)
    with path.open("wb") as file:
        np.savez(file, **parts | {"scripts": np.array([Bomb()], dtype=object)})


def _no_archive(path):
    with path.open("wb") as file:
        np.save(file, np.arange(3))


DAMAGE = {
    "truncated": lambda path: path.write_bytes(path.read_bytes()[:-40]),
    "half": lambda path: path.write_bytes(path.read_bytes()[: path.stat().st_size // 2]),
    "empty": lambda path: path.write_bytes(b""),
    "text": lambda path: path.write_text("nothing of the kind"),
    "a pickle": _pickled,
    "a pickle inside": _pickled_inside,
    "one array": _no_archive,
    "another archive": lambda path: np.savez(path, a=np.arange(3)),
}


@pytest.mark.parametrize("name", DAMAGE)
def test_a_file_that_holds_no_search_is_refused_and_left_alone(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    path = stopped(Board(6), tmp_path / "search.npz", 10)
    DAMAGE[name](path)
    before = path.read_bytes()
    with pytest.raises(RunConflict, match=r"holds no enumeration .*Remove it to begin anew"):
        table_of(Board(6), checkpoint=path)
    assert path.read_bytes() == before and not Path("unpickled").exists()


def test_a_half_of_a_state_is_never_kept(tmp_path):
    """What was found while a state was being tried is left out, and is found again."""
    explored = Explored(2)
    explored.starts[explored.add(0, -1, -1, ())] = 1.0
    explored.settle()
    explored.add(1, 0, 0, (1,))
    explored.end(2)
    explored.rows.append(0)
    space = gym.spaces.Discrete(3)
    explored.save(tmp_path / "search.npz", space, {})
    with np.load(tmp_path / "search.npz", allow_pickle=False) as kept:
        assert (kept["states"].tolist(), kept["ends"].size, kept["rows"].size, kept["scripts"].size) == ([[0]], 0, 0, 0)


@pytest.mark.parametrize("name", ["scripts", "rows", "states", "sampled"])
def test_a_search_with_a_number_in_place_of_a_column_is_refused(tmp_path, name):
    found, space = Explored(2), gym.spaces.Discrete(3)
    found.starts[found.add(0, -1, -1, ())] = 1.0
    found.expand(0, [(0, 0, 1.0, 0.0), (1, 0, 1.0, 0.0)])
    found.save(tmp_path / "search.npz", space, {})
    np.savez(tmp_path / "search.npz", **{**np.load(tmp_path / "search.npz"), name: np.array(5)})
    with pytest.raises(IrlGymError, match=f"its {name} have shape"):
        load_explored(tmp_path / "search.npz", space, 2, {})
