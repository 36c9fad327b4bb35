"""Episodes kept in shards come back, and a shard that was cut off is dropped."""

import numpy as np
import pytest
from gymnasium import spaces

from irl_gym.demonstrations import Episode
from irl_gym.shards import Shards, size_of

SPACE = spaces.Dict(b=spaces.Tuple((spaces.Discrete(9), spaces.MultiBinary(2))), a=spaces.Box(0, 1, (3,)))


def episode(length, seed=None):
    rng = np.random.default_rng(length)
    n = length + 1
    observations = {"b": (rng.integers(9, size=n), rng.integers(2, size=(n, 2), dtype=np.int8)), "a": rng.random((n, 3))}
    return Episode(observations, rng.integers(3, size=length), rng.random(length), length % 2 == 0, length % 2 == 1, seed)


def same(one, other):
    return str(vars(one)) == str(vars(other))


@pytest.fixture
def shards(tmp_path):
    made = Shards(tmp_path / "shards", SPACE)
    made.append([episode(3, seed=5), episode(1)])
    made.append([episode(2)])
    return made


def test_episodes_come_back_in_order(shards):
    for again, before in zip(shards, [episode(3, seed=5), episode(1), episode(2)], strict=True):
        assert same(again, before)


def test_totals_are_counted(shards):
    assert (shards.n_episodes, shards.n_steps) == (3, 6)


def test_what_is_there_is_found_again(shards):
    again = Shards(shards.folder, SPACE)
    again.append([episode(4)])
    assert [len(one) for one in again] == [3, 1, 2, 4] and (again.n_episodes, again.n_steps) == (4, 10)


def test_a_broken_shard_is_dropped_with_those_after_it(shards):
    first = shards.folder / "000000.npz"
    first.write_bytes(first.read_bytes()[:100])
    again = Shards(shards.folder, SPACE)
    assert (again.n_episodes, list(again), list(shards.folder.iterdir())) == (0, [], [])


def test_nothing_is_written_for_no_episodes(tmp_path):
    Shards(tmp_path / "shards", SPACE).append([])
    assert not list(tmp_path.iterdir())


def test_an_episodes_size_counts_every_part():
    assert size_of(SPACE, episode(3)) == 3 * 16 + 4 * (8 + 2 + 3 * 8)
