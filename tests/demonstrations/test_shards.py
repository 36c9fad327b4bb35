"""Episodes kept in shards come back, and a damaged shard is set aside."""

import errno
from pathlib import Path

import numpy as np
import pytest
from gymnasium import spaces

from irl_gym.demonstrations.shards import Shards, size_of
from irl_gym.errors import InvalidDemonstrations, InvalidParameter
from irl_gym.mdp.episodes import Episode

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


def names(shards):
    return sorted(path.name for path in shards.folder.iterdir())


def flip(path):
    """Change a byte of the rewards, as a disk may: the directory of the archive is whole."""
    content = bytearray(path.read_bytes())
    content[content.index(b"rewards.npy") + 150] ^= 255
    path.write_bytes(content)


@pytest.mark.parametrize(
    "damage", [lambda path: path.write_bytes(path.read_bytes()[:100]), flip, lambda path: path.write_text("")]
)
def test_a_damaged_shard_is_set_aside_with_those_after_it(shards, damage):
    damage(shards.folder / "000000.npz")
    again = Shards(shards.folder, SPACE)
    assert (again.n_episodes, list(again), names(shards)) == (0, [], ["000000.npz.damaged", "000001.npz.damaged"])


@pytest.mark.parametrize("number", [errno.EMFILE, errno.EACCES, errno.EIO])
def test_a_shard_that_cannot_be_opened_now_costs_nothing(shards, monkeypatch, number):
    with monkeypatch.context() as patch:
        patch.setattr(Path, "open", lambda *_, **__: (_ for _ in ()).throw(OSError(number, "not now")))
        with pytest.raises(InvalidParameter, match=r"000000.npz cannot be read now \(.*not now\)"):
            Shards(shards.folder, SPACE)
    assert names(shards) == ["000000.npz", "000001.npz"]


def test_a_shard_damaged_while_it_is_read_is_named(shards):
    flip(shards.folder / "000001.npz")
    with pytest.raises(InvalidDemonstrations, match=r"shard .*000001.npz was damaged .* Ask for the same again"):
        list(shards)


def test_nothing_is_written_for_no_episodes(tmp_path):
    Shards(tmp_path / "shards", SPACE).append([])
    assert not list(tmp_path.iterdir())


def test_an_episodes_size_counts_every_part():
    assert size_of(SPACE, episode(3)) == 3 * 16 + 4 * (8 + 2 + 3 * 8)


@pytest.mark.parametrize("seed", [-1, 2**63])
def test_a_seed_that_would_come_back_as_another_is_refused(shards, seed):
    with pytest.raises(InvalidDemonstrations, match=f"episode 4 has seed {seed}: expected 0 to"):
        shards.append([episode(2), episode(2, seed=seed)])


def test_objects_are_refused_and_nothing_is_pickled(tmp_path):
    graphs = Shards(tmp_path / "shards", spaces.Sequence(spaces.Discrete(3)))
    made = Episode(np.array([None, {}, ()], dtype=object), np.array([0, 1]), np.zeros(2), True, False)
    with pytest.raises(InvalidDemonstrations, match="observations are Python objects: expected numbers or text"):
        graphs.append([made])
    assert not graphs.folder.exists()
