"""Episodes in which an oracle said what is to be done: what was done and what it said are two fields, never mixed.

As a Minari dataset `actions` are those that were executed; what the oracle said is in `infos`, of each of the T + 1 moments:
    oracle_action   what it said; one below the first action where it said nothing, which it never does after the end
    labelled        did it say something?
    asked           was it asked here, or had it answered in that state before?
    round           in which round was that?
Axes: T steps.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass

import gymnasium as gym
import minari
import numpy as np
from gymnasium import spaces

from irl_gym.demonstrations.datasets import write_minari
from irl_gym.demonstrations.minari_files import unkept
from irl_gym.demonstrations.minari_formats import DataFormat
from irl_gym.errors import InvalidDemonstrations
from irl_gym.mdp.episodes import Episode

UNLABELLED = -1
"""In place of a label, where the oracle said nothing."""
INFOS = ("oracle_action", "labelled", "asked", "round")
"""Names of what a dataset says of each moment."""


@dataclass(frozen=True, eq=False, kw_only=True)
class LabelledEpisode(Episode):
    """An episode, and what the oracle said.

    Raises:
        InvalidDemonstrations: as an Episode; or labels that are not one a step.
    """

    labels: np.ndarray
    """(T,) what is to be done, from 0; -1 where the oracle said nothing."""
    asked: np.ndarray
    """(T,) was it asked here, or had it answered in that state before?"""
    round: int = 1
    """From 1."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.actions is None:
            raise InvalidDemonstrations("actions are None: expected what was done at each step.")
        for name in ("labels", "asked"):
            if np.shape(getattr(self, name)) != (len(self),):
                raise InvalidDemonstrations(
                    f"{name} have shape {np.shape(getattr(self, name))}: expected ({len(self)},), one a step."
                )

    @property
    def labelled(self) -> np.ndarray:
        """(T,) did the oracle say something?"""
        return self.labels != UNLABELLED

    def infos(self, first_action: int) -> dict[str, np.ndarray]:
        """What a dataset keeps besides, (T + 1,) each; see the module."""
        told = (self.labels + first_action, self.labelled, self.asked, np.full(len(self), self.round))
        after = (first_action - 1, False, False, self.round)
        return {name: np.append(one, last).astype(one.dtype) for name, one, last in zip(INFOS, told, after, strict=True)}


def write_labelled(
    episodes: Sequence[LabelledEpisode], dataset_id: str, env: gym.Env | None, *, root: str | os.PathLike | None,
    observation_space: spaces.Space, action_space: spaces.Space, paid: bool = True, data_format: DataFormat = "hdf5",
) -> minari.MinariDataset:  # fmt: skip
    """Write the aggregated set as a Minari dataset, round by round.

    Args:
        episodes: at least one.
        dataset_id: `namespace/name-v0`.
        env: where they took place; None where it is not known.
        root: Minari's root folder; None for the one in force.
        observation_space: of the episodes.
        action_space: of the episodes.
        paid: are the rewards known? Else they are 0.
        data_format: as `write_minari`.

    Raises:
        DatasetExists, InvalidDemonstrations, InvalidParameter: as `write_minari`.
    """
    lost = None if env is None else unkept(env.spec)
    about = "Actions are those that were executed, the learner's own among them; what an oracle said is in infos/oracle_action."
    about = " ".join(filter(None, (about, None if paid else "No reward was known: it is 0.", lost)))
    return write_minari(
        episodes, dataset_id, None if lost else env, root=root, algorithm="a learner and its oracle", description=about,
        observation_space=observation_space, action_space=action_space, code_permalink="irl-gym run",
        data_format=data_format,
    )  # fmt: skip
