"""Episodes kept in a folder, a closed file for some at a time, so that what is written is never lost.

A shard is an npz of columns, all its episodes one after the other: lengths, ends, seeds, endings (those of earlier versions
have none), actions (-1 where only the states are known), rewards, and the parts of the observations. It is written beside its
place and renamed. When a folder is opened, every shard is read against its checksums; a damaged one, and those after it, are
set aside under names that end in `.damaged`, and their episodes are missing again.
Axes: T steps, N episodes of a shard, M = sum of T.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces

from irl_gym.demonstrations.minari_formats import known_actions, recorded_actions
from irl_gym.errors import DamagedFile, InvalidDemonstrations, InvalidParameter
from irl_gym.files.archives import read_arrays
from irl_gym.files.own_files import write_arrays
from irl_gym.mdp.episodes import Episode

SHARD_BYTES = 4 << 20
"""Of episodes, about: as many are held in memory at a time."""
NO_SEED = -1


class Shards:
    """The episodes of a folder, in order.

    Args:
        folder: made with the first shard; what an earlier process left is kept.
        space: of the observations.

    Raises:
        InvalidParameter: a shard that is there and cannot be opened now; nothing is moved.
    """

    def __init__(self, folder: Path, space: spaces.Space):
        self.folder, self.space = folder, space
        self.n_episodes, self.n_steps = 0, 0
        self._n_shards = 0
        while (lengths := _lengths(self._path(self._n_shards), space)) is not None:
            self._n_shards += 1
            self.n_episodes, self.n_steps = self.n_episodes + lengths.size, self.n_steps + int(lengths.sum())
        for path in set(folder.glob("*.npz")) - set(map(self._path, range(self._n_shards))):
            path.replace(path.with_name(f"{path.name}.damaged"))

    def _path(self, number: int) -> Path:
        return self.folder / f"{number:06}.npz"

    def append(self, episodes: Sequence[Episode]) -> None:
        """Write some episodes; none for none.

        Raises:
            InvalidDemonstrations: a seed that 64 bits do not hold, or observations that are no numbers and no text.
        """
        if not episodes:
            return
        for i, one in enumerate(episodes):
            if one.seed is not None and not 0 <= one.seed < 2**63:
                raise InvalidDemonstrations(
                    f"episode {self.n_episodes + i} has seed {one.seed}: expected 0 to 2^63 - 1, or None."
                )
        columns = {
            "lengths": np.array([len(one) for one in episodes]),
            "terminated": np.array([one.terminated for one in episodes]),
            "truncated": np.array([one.truncated for one in episodes]),
            "endings": np.array([one.ending for one in episodes]),
            "seeds": np.array([NO_SEED if one.seed is None else one.seed for one in episodes]),
            "actions": np.concatenate([recorded_actions(one, 0) for one in episodes]),
            "rewards": np.concatenate([np.asarray(one.rewards, dtype=np.float64) for one in episodes]),
        }
        parts = [dict(_parts(self.space, one.observations)) for one in episodes]
        columns.update({name: np.concatenate([one[name] for one in parts]) for name in parts[0]})
        objects = [name for name, column in columns.items() if column.dtype.hasobject]
        if objects:  # np.savez would pickle them, and nothing is unpickled
            raise InvalidDemonstrations(f"{objects[0]} are Python objects: expected numbers or text, as of {self.space}.")
        self.folder.mkdir(exist_ok=True)
        write_arrays(self._path(self._n_shards), columns)
        self._n_shards += 1
        self.n_episodes, self.n_steps = self.n_episodes + len(episodes), self.n_steps + int(columns["lengths"].sum())

    def __iter__(self) -> Iterator[Episode]:
        for number in range(self._n_shards):
            columns = self._whole(number)
            step = 0
            for i, length in enumerate(columns["lengths"].tolist()):
                steps, seen = slice(step, step + length), slice(step + i, step + i + length + 1)
                seed = int(columns["seeds"][i])
                ending: Any = str(columns["endings"][i]) if "endings" in columns else "seen"
                yield Episode(
                    _joined(self.space, columns, seen), known_actions(columns["actions"][steps], 0), columns["rewards"][steps],
                    bool(columns["terminated"][i]), bool(columns["truncated"][i]), None if seed == NO_SEED else seed, ending,
                )  # fmt: skip
                step += length

    def _whole(self, number: int) -> dict[str, np.ndarray]:
        try:
            return _columns(self._path(number), self.space)
        except (FileNotFoundError, DamagedFile) as error:
            raise InvalidDemonstrations(
                f"shard {self._path(number)} was damaged since it was opened ({error}): expected the episodes that were "
                "written. Ask for the same again: its episodes, and those after them, are then made anew."
            ) from error


def size_of(space: spaces.Space, episode: Episode) -> int:
    """Bytes of an episode."""
    return 16 * len(episode) + sum(part.nbytes for _, part in _parts(space, episode.observations))


def _columns(path: Path, space: spaces.Space) -> dict[str, np.ndarray]:
    """The columns of a shard, as many rows of each as its lengths say.

    Raises:
        FileNotFoundError: there is none.
        InvalidParameter: it cannot be read now, which says nothing about what is in it.
        DamagedFile: it is not what was written.
    """
    try:
        found = read_arrays(path)
    except FileNotFoundError:
        raise
    except OSError as error:
        raise InvalidParameter(
            f"{path} cannot be read now ({error}): expected a shard of episodes. Nothing is lost; ask again when it can."
        ) from error
    lengths = found.get("lengths", np.zeros(0))
    if lengths.ndim != 1 or lengths.dtype.kind not in "iu" or not lengths.size or lengths.min() < 1:
        raise DamagedFile(
            f"{path} has lengths of shape {lengths.shape} and dtype {lengths.dtype}: expected (N,) of at least 1."
        )
    N, M = lengths.size, sum(lengths.tolist())  # Python's integers do not wrap around
    rows = {"terminated": ("b", N), "truncated": ("b", N), "seeds": ("iu", N), "actions": ("iu", M), "rewards": ("f", M)}
    rows |= dict.fromkeys(_names(space), ("biufU", N + M)) | ({"endings": ("U", N)} if "endings" in found else {})
    for name, (kinds, n) in rows.items():
        if name not in found or found[name].shape[:1] != (n,) or found[name].dtype.kind not in kinds:
            there = f"of shape {found[name].shape} and dtype {found[name].dtype}" if name in found else "not there"
            raise DamagedFile(f"{path} has {name} {there}: expected {n} rows.")
    return found


def _lengths(path: Path, space: spaces.Space) -> np.ndarray | None:
    """(N,) steps of the episodes in a shard; None if there is none, or if it is damaged."""
    try:
        return _columns(path, space)["lengths"]
    except (FileNotFoundError, DamagedFile):
        return None


def _names(space: Any, name: str = "observations") -> Iterator[str]:
    """What `_parts` calls the arrays that observations of a space are made of."""
    if isinstance(space, spaces.Dict | spaces.Tuple):
        inside: Any = space.values() if isinstance(space, spaces.Dict) else space
        for i, one in enumerate(inside):
            yield from _names(one, f"{name}.{i}")
    else:
        yield name


def _parts(space: Any, observations: Any, name: str = "observations") -> Iterator[tuple[str, np.ndarray]]:
    """The arrays that stacked observations are made of, each with a name of its own."""
    if isinstance(space, spaces.Dict | spaces.Tuple):
        inside: Any = space.items() if isinstance(space, spaces.Dict) else enumerate(space)
        for i, (key, one) in enumerate(inside):
            yield from _parts(one, observations[key], f"{name}.{i}")
    else:
        yield name, np.asarray(observations)


def _joined(space: Any, columns: dict[str, np.ndarray], rows: slice, name: str = "observations") -> Any:
    """Some rows of the observations that `_parts` took apart."""
    if isinstance(space, spaces.Dict):
        return {key: _joined(one, columns, rows, f"{name}.{i}") for i, (key, one) in enumerate(space.items())}
    if isinstance(space, spaces.Tuple):
        return tuple(_joined(one, columns, rows, f"{name}.{i}") for i, one in enumerate(space))
    return columns[name][rows]
