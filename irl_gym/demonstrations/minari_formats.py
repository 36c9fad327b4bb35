"""Where Minari looks for an episode, in the two formats that it can read here.

    hdf5    data/main_data.hdf5: a group an episode, a resizable dataset a column
    arrow   data/N/part-0.arrow and data/N/metadata.json: a folder an episode, one batch of T + 1 rows

Minari has no word for an action that is not known: here it is a number that is none (`mask`), for all of an episode or none.
The layouts are Minari's own, to the byte for Arrow. Its writers would spend most of their time elsewhere: the one for Arrow
measures the whole folder after each episode.
Axes: T steps, N episodes.
"""

import contextlib
import io
import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

import h5py
import numpy as np
from gymnasium import spaces

from irl_gym.errors import InvalidParameter
from irl_gym.mdp.episodes import Episode

DataFormat = Literal["hdf5", "arrow"]
Add = Callable[[int, Episode], None]
"""Writes the episode of a number."""
Writer = Callable[[Path, spaces.Space, int], contextlib.AbstractContextManager[Add]]
"""Opens a folder for episodes with observations of a space, whose actions start at a number."""

ENDING = "irl_gym_ending"
"""Name of `Episode.ending` in the metadata of an episode; not there where the last observation was seen."""
LONGEST_ARROW = 131_072
"""Rows of an Arrow episode that Minari reads as one; it would take a longer one for two."""
_low: Any = h5py  # what its high level is made of, which type checkers do not see
ONE_CHUNK = 8192
"""Bytes of a column that h5py keeps in one chunk."""


def mask(first_action: int) -> int:
    """What stands for an action that is not known: -1, or what is below every action of a space that has negative ones."""
    return min(first_action, 0) - 1


def recorded_actions(episode: Episode, first_action: int) -> np.ndarray:
    """(T,) actions as a file holds them; of an episode of states alone all are masked, by a number that is no action."""
    masked = np.full(len(episode), mask(first_action), dtype=np.int64)
    return masked if episode.actions is None else episode.actions + first_action


def known_actions(recorded: np.ndarray, first_action: int) -> np.ndarray | None:
    """(T,) actions from 0 of what a file holds; None where all are masked."""
    return None if (recorded == mask(first_action)).all() else recorded.astype(np.int64) - first_action


def _columns(episode: Episode, first_action: int) -> dict[str, Any]:
    """An episode in Minari's words."""
    ends = np.zeros((2, len(episode)), dtype=bool)
    ends[:, -1] = episode.terminated, episode.truncated
    return {
        "observations": episode.observations,
        "actions": recorded_actions(episode, first_action),
        "rewards": np.asarray(episode.rewards),
        "terminations": ends[0],
        "truncations": ends[1],
    }


def _metadata(number: int, episode: Episode) -> dict[str, Any]:
    """What is told of an episode."""
    told: dict[str, Any] = {"id": number, "total_steps": len(episode)}
    if episode.seed is not None:
        told["seed"] = episode.seed
    if episode.ending != "seen":
        told[ENDING] = episode.ending
    return told


@contextlib.contextmanager
def _hdf5(data: Path, space: spaces.Space, first_action: int) -> Iterator[Add]:
    # 1.10's format: a third of the size of the oldest, which h5py takes by default, and every library since 2016 reads it.
    with (
        _Failing(data / "main_data.hdf5") as target,
        h5py.File(target, "w", track_order=True, libver=("v110", "v110")) as file,
    ):

        def add(number: int, episode: Episode) -> None:
            target.check()
            group = file.create_group(f"episode_{number}")
            for name, value in _metadata(number, episode).items():
                group.attrs[name] = value
            for name, values in _columns(episode, first_action).items():
                _put(group, name, values)
            _put(group, "infos", episode.infos(first_action))

        yield add


class _Failing(io.RawIOBase):
    """A file for HDF5 to write into, which ends the process where a write fails: so the failure is kept, and raised later."""

    def __init__(self, path: Path):
        self._file, self._failure = path.open("w+b", buffering=0), None

    def check(self) -> None:
        """Raise what went wrong since, if anything did."""
        if self._failure is not None:
            raise self._failure

    def close(self) -> None:
        """Close the file; raise what went wrong."""
        if not self.closed:
            super().close()
            self._file.close()
            self.check()

    def seek(self, offset: int, whence: int = 0) -> int:
        """As files have it, and so the next three."""
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """The place."""
        return self._file.tell()

    def readinto(self, buffer: Any) -> int | None:
        """Read."""
        return self._file.readinto(buffer)

    def write(self, content: Any) -> int:
        """Write, or keep why not."""
        return self._kept(lambda: self._file.write(content), len(content))

    def truncate(self, size: int | None = None) -> int:
        """Make it shorter or longer, or keep why not."""
        return self._kept(lambda: self._file.truncate(size), size or 0)

    def _kept(self, do: Callable[[], int | None], otherwise: int) -> int:
        try:
            return do() or 0
        except OSError as error:
            self._failure = self._failure or error
            return otherwise


def _put(group: h5py.Group, name: str, values: Any) -> None:
    if isinstance(values, tuple):
        values = {f"_index_{i}": one for i, one in enumerate(values)}
    if isinstance(values, dict):
        inner = group.create_group(name)
        for key, one in values.items():
            _put(inner, key, one)
        return
    array, dtype = np.asarray(values), None
    if array.dtype.kind in "iufb" and 0 < array.nbytes < ONE_CHUNK:
        _put_small(group, name, array)
        return
    if array.dtype.kind == "U":
        array, dtype = array.astype(object), h5py.string_dtype(encoding="utf-8")
    group.create_dataset(name, data=array, dtype=dtype, chunks=True, maxshape=(None, *array.shape[1:]))


def _put_small(group: h5py.Group, name: str, array: np.ndarray) -> None:
    """What `create_dataset` does with few numbers, in half the time."""
    array = np.ascontiguousarray(array)
    h5d, h5p, h5s, h5t = _low.h5d, _low.h5p, _low.h5s, _low.h5t
    properties = h5p.create(h5p.DATASET_CREATE)
    properties.set_chunk(array.shape)
    properties.set_obj_track_times(False)
    place = h5s.create_simple(array.shape, (h5s.UNLIMITED, *array.shape[1:]))
    made = h5d.create(group.id, name.encode(), h5t.py_create(array.dtype, logical=True), place, properties)
    made.write(h5s.ALL, h5s.ALL, array)


@contextlib.contextmanager
def _arrow(data: Path, space: spaces.Space, first_action: int) -> Iterator[Add]:
    import pyarrow as pa

    def add(number: int, episode: Episode) -> None:
        if len(episode) >= LONGEST_ARROW:
            raise InvalidParameter(
                f"episode {number} has {len(episode)} steps: expected at most {LONGEST_ARROW - 1}, which Minari reads from "
                "Arrow. Choose hdf5."
            )
        found = _columns(episode, first_action)
        columns = {"observations": _arrow_column(space, found.pop("observations"))}
        # As Minari has it, an empty row stands beside the last observation.
        columns.update({name: pa.array(np.append(values, values.dtype.type(0))) for name, values in found.items()})
        if infos := episode.infos(first_action):
            columns["infos"] = pa.StructArray.from_arrays([pa.array(one) for one in infos.values()], names=[*infos])
        place = data / str(number)
        place.mkdir()
        batch = pa.RecordBatch.from_pydict(columns)
        with pa.OSFile(str(place / "part-0.arrow"), "wb") as file, pa.ipc.new_file(file, batch.schema) as writer:
            writer.write_batch(batch)
        (place / "metadata.json").write_text(json.dumps(_metadata(number, episode)))

    yield add


def _arrow_column(space: Any, values: Any) -> Any:
    """The observations of a space as a column: structures of columns, lists of one length, or numbers."""
    import pyarrow as pa

    if isinstance(space, spaces.Dict):
        return pa.StructArray.from_arrays([_arrow_column(space[key], values[key]) for key in values], names=list(values))
    if isinstance(space, spaces.Tuple):
        parts = [_arrow_column(one, values[i]) for i, one in enumerate(space)]
        return pa.StructArray.from_arrays(parts, names=[str(i) for i in range(len(parts))])
    if isinstance(space, spaces.Discrete):
        return pa.array(np.asarray(values, dtype=space.dtype))
    if isinstance(space, spaces.Box | spaces.MultiDiscrete | spaces.MultiBinary):
        flat = np.asarray(values, dtype=space.dtype).reshape(len(values), -1)
        kind = pa.list_(pa.from_numpy_dtype(space.dtype), list_size=flat.shape[1])
        return pa.FixedSizeListArray.from_arrays(pa.array(flat.reshape(-1)), type=kind)
    return pa.array(list(values))


WRITERS: Mapping[str, Writer] = {"hdf5": _hdf5, "arrow": _arrow}
