"""The episodes of a Minari dataset as a sequence, read from its files one at a time."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, overload

import minari
import numpy as np

from irl_gym.demonstrations.dataset_files import check_episode, check_episodes
from irl_gym.demonstrations.endings import AfterEnd, episode_of
from irl_gym.errors import InvalidDemonstrations
from irl_gym.files.hdf5_files import BROKEN
from irl_gym.mdp.episodes import Episode


class MinariEpisodes(Sequence):
    """Some episodes of a dataset, in its order: `len`, an index, a slice, or a loop, which reads them again each time.

    Args:
        dataset: with discrete actions.
        indices: which of its episodes.
        after_end: what to do with one that goes on after its end (`irl_gym.demonstrations.endings`).

    Raises:
        InvalidDemonstrations: when an episode is read that no environment could have produced, or whose file is broken.
    """

    def __init__(self, dataset: minari.MinariDataset, indices: Any, after_end: AfterEnd):
        self.dataset, self.indices = dataset, np.asarray(indices)
        self.after_end: AfterEnd = after_end

    def __len__(self) -> int:
        return len(self.indices)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({len(self)} of {self.dataset.spec.dataset_id!r})"

    @overload
    def __getitem__(self, which: int) -> Episode: ...
    @overload
    def __getitem__(self, which: slice) -> "MinariEpisodes": ...
    def __getitem__(self, which: int | slice) -> "Episode | MinariEpisodes":
        if isinstance(which, slice):
            return MinariEpisodes(self.dataset, self.indices[which], self.after_end)
        return next(self._read([self.indices[which]]))

    def __iter__(self) -> Iterator[Episode]:
        return self._read(self.indices)

    def _read(self, indices: Any) -> Iterator[Episode]:
        first = int(getattr(self.dataset.spec.action_space, "start", 0))
        for episode, metadata in _stored(self.dataset, indices):
            here = f"dataset {self.dataset.spec.dataset_id!r}, episode {episode.id}"
            yield episode_of(here, episode, metadata, first, self.after_end)


def _stored(dataset: minari.MinariDataset, indices: Any) -> Iterator[tuple[Any, Any]]:
    """Episodes and their metadata, as Minari gives them, once their files are known to be sound."""
    try:
        check_episodes(Path(dataset.storage.data_path), dataset.storage.FORMAT, map(int, indices))
        metadatas = dataset.storage.get_episode_metadata(indices)
        for episode, metadata in zip(dataset.iterate_episodes(indices), metadatas, strict=True):
            check_episode(episode, metadata, dataset.spec.observation_space, dataset.spec.action_space)
            yield episode, metadata
    except BROKEN as error:
        raise broken(dataset.spec.dataset_id, error) from error


def broken(dataset_id: str, error: Exception) -> InvalidDemonstrations:
    """The error of a dataset that cannot be read."""
    reason = " ".join(str(error).split())
    return InvalidDemonstrations(
        f"dataset {dataset_id!r} cannot be read ({type(error).__name__}: {reason}): expected a whole Minari dataset. Copy or "
        "download it again, or record it anew under another id."
    )
