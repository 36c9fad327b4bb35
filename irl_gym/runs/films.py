"""Films: episodes of the expert and of the retrained agent, step by step, with what each step was paid and a picture of it.

A film of T steps has T + 1 moments: the start, and what each step led to. Its json and its pictures lie in the folder of a run:
    films/agent.json   films/agent/000.webp ...
"""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from irl_gym.files import run_schema
from irl_gym.files.run_folder import read_json, write_text
from irl_gym.records import Record

FORMAT = "irl_gym.Film/1"
MOST_BYTES = 700_000
"""Of the pictures of a film: they are made smaller until they fit, and a page leaves out what is still too much."""


@dataclass(frozen=True)
class Moment:
    """What is so at one time of an episode, and the step that led there."""

    text: str
    """The observation, in words or numbers."""
    state: int | None
    """Its row in the table; None where there is none."""
    action: int | None
    """The action that led here, counted from 0; None at the start."""
    action_name: str | None
    """What it is called."""
    true_reward: float | None
    """What the environment paid for it; None at the start."""
    learned_reward: float | None
    """What the recovered reward pays for it."""
    true_total: float
    """Sum of the true rewards so far, undiscounted."""
    learned_total: float
    """Sum of the learned ones."""
    frame: int | None = None
    """Number of its picture among the film's frames; None where this moment has none of its own."""


@dataclass(frozen=True, eq=False)
class Film(Record):
    """One episode, as a person watches it."""

    name: str
    """Whose: expert or agent."""
    seed: int | None
    """Given to `reset`; None where the episode is a dataset's or a table's."""
    steps: tuple[Moment, ...]
    """T + 1 moments."""
    ends: str
    """terminated, truncated (by a time limit), or cut (the film stops before the episode does)."""
    frames: tuple[bytes, ...] = ()
    """Pictures, as files hold them; empty where the environment has none."""
    kind: str = "webp"
    """Their format: webp or png."""
    without_frames: str | None = None
    """Why there are none."""

    def save(self, folder: Path) -> None:
        """Write the film into a folder: name.json, and name/000.webp and so on."""
        told = {
            "format": FORMAT, "name": self.name, "seed": self.seed, "ends": self.ends, "kind": self.kind,
            "frames": len(self.frames), "without_frames": self.without_frames, "steps": [asdict(one) for one in self.steps],
        }  # fmt: skip
        if self.frames:
            (folder / self.name).mkdir()
        for number, picture in enumerate(self.frames):
            (folder / self.name / f"{number:03d}.{self.kind}").write_bytes(picture)
        write_text(folder / f"{self.name}.json", json.dumps(told, indent=1, sort_keys=True, allow_nan=False) + "\n")


def load_film(path: Path) -> Film:
    """Read a film that `Film.save` wrote; `path` is its json.

    Raises:
        OSError: a file is missing.
        DamagedFile: it holds something else. The kind of its pictures is part of their names: it is one of two.
    """
    told: Any = read_json(path, run_schema.FilmFile)
    pictures = (path.with_suffix("") / f"{number:03d}.{told['kind']}" for number in range(told["frames"]))
    return Film(
        told["name"], told["seed"], tuple(Moment(**one) for one in told["steps"]), told["ends"],
        tuple(one.read_bytes() for one in pictures), told["kind"], told["without_frames"],
    )  # fmt: skip
