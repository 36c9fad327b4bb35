"""A person plays: keys become steps of a rendered environment, and its episodes become demonstrations.

`Play` is the whole game without a screen or a keyboard: `press` takes a key and gives back what is to be seen and said. A front
end (`irl-gym play`: a terminal or a window) reads keys and shows. An episode that was begun again, or not finished, is not a
demonstration; each attempt has a seed of its own, so that nobody can rehearse a lucky start.
"""

import copy
import shlex
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import count
from typing import Any, Literal

import gymnasium as gym
import minari
import numpy as np
from gymnasium.vector.utils import concatenate, create_empty_array

from irl_gym.checks import checked_number
from irl_gym.commands.demonstrating.keyboard import HELP, QUIT, RESTART, Controls, controls_of, described
from irl_gym.demonstrations.datasets import described as description_of
from irl_gym.demonstrations.datasets import writable_root, write_minari
from irl_gym.demonstrations.minari_files import check_free, check_id, unkept
from irl_gym.environments.reveal import Reveal, known_hidden
from irl_gym.errors import InvalidParameter
from irl_gym.mdp.episodes import Episode
from irl_gym.tables.tabulate import make

Mode = Literal["terminal", "window"]
_RENDER_MODES: dict[str, tuple[str, ...]] = {"terminal": ("ansi", "rgb_array"), "window": ("rgb_array", "human")}
PLAYER = "a person at the keyboard"
"""Whom datasets name as the algorithm."""


@dataclass(frozen=True, eq=False)
class Turn:
    """What is shown after a key."""

    frame: Any
    """What the environment renders: text, an (H, W, 3) uint8 picture, or None where there is nothing new."""
    said: str
    """A line to go with it."""


@dataclass(frozen=True, eq=False)
class KeyStep:
    """What a key did."""

    action: int
    """Counted from 0."""
    reward: float
    """What it was paid."""
    observation: Any
    """What came of it."""
    terminated: bool
    """Did it end the episode?"""
    truncated: bool
    """Did a time limit?"""


class Play:
    """A game of some episodes.

    Args:
        env: with Discrete actions; rendered where it has a render mode.
        controls: which key is which action.
        n_episodes: after which the game is over.
        seed: of the first attempt; each further one has the next.
        keep_unfinished: keep an episode that is broken off at the end of the game, as a truncated one.

    Raises:
        InvalidParameter: fewer than 1 episodes, or a negative seed.
    """

    def __init__(
        self, env: gym.Env, controls: Controls, n_episodes: int, *, seed: int = 0, keep_unfinished: bool = False
    ) -> None:
        checked_number("episodes", n_episodes, "a whole number of at least 1", least=1, whole=True)
        checked_number("seed", seed, "a whole number of at least 0", least=0, whole=True)
        self.env, self.controls = env, controls
        self.episodes: list[Episode] = []
        self.over = False
        self._wanted, self._keep, self._seed = n_episodes, keep_unfinished, seed - 1
        self._beginning: Any = None
        self._steps: list[KeyStep] = []

    def start(self) -> Turn:
        """Begin the first episode."""
        return self._begin(f"{self.controls}\n")

    def press(self, key: str) -> list[Turn]:
        """What comes of a key: usually one turn; two where an episode ended and the next has begun."""
        if self.over:
            return []
        if key.lower() == QUIT:
            return [Turn(None, self.stop())]
        if key == HELP:
            return [Turn(None, str(self.controls))]
        if key.lower() == RESTART:
            return [self._begin(f"{_steps(len(self._steps))} discarded. ")]
        action = self.controls.action(key)
        if action is None:
            return [Turn(None, f"{key!r} is no key here: {HELP} shows them.")]
        return self._step(action)

    def stop(self) -> str:
        """End the game, and say what became of an episode that was under way. Finished ones are in `episodes`."""
        self.over = True
        steps, self._steps = self._steps, []
        if not steps:
            return ""
        last = steps[-1]
        if last.terminated or last.truncated:  # interrupted just before it was put down
            self._put_down(self._episode(steps))
            return ""
        if not self._keep:
            return f"The unfinished episode of {_steps(len(steps))} is discarded."
        steps[-1] = KeyStep(last.action, last.reward, last.observation, False, True)
        self._put_down(self._episode(steps))
        return f"The unfinished episode of {_steps(len(steps))} is kept, as truncated."

    def _begin(self, said: str) -> Turn:
        self._seed += 1
        self._steps = []
        observation, _ = self.env.reset(seed=self._seed)
        self._beginning = copy.deepcopy(observation)
        now = described(self.env, observation)
        begun = f"{said}Episode {len(self.episodes) + 1} of {self._wanted} begins. {_sentence(now)}"
        return Turn(self._frame(), begun.rstrip())

    def _step(self, action: int) -> list[Turn]:
        first_action = int(getattr(self.env.action_space, "start", 0))
        observation, reward, terminated, truncated, _ = self.env.step(action + first_action)
        step = KeyStep(action, float(reward), copy.deepcopy(observation), bool(terminated), bool(truncated))
        self._steps.append(step)  # all of a step at once: an interruption finds whole ones
        total = sum(one.reward for one in self._steps)
        name = self.controls.names[action]
        did = f"action {name}" if name.isdigit() else name
        said = f"Step {len(self._steps)}: {did}, reward {step.reward:g}, return {total:g}."
        turn = Turn(self._frame(), " ".join(filter(None, (said, _sentence(described(self.env, observation))))))
        if not (terminated or truncated):
            return [turn]
        episode = self._episode(self._steps)
        self._put_down(episode)
        self._steps = []
        why = "it ended" if terminated else "cut by the time limit"
        ended = f"{turn.said}\nEpisode {len(self.episodes)}: return {episode.total_reward:g} in {_steps(len(episode))}, {why}."
        self.over = len(self.episodes) >= self._wanted
        return [Turn(turn.frame, ended)] + ([] if self.over else [self._begin("")])

    def _episode(self, steps: list[KeyStep]) -> Episode:
        space, seen = self.env.observation_space, [self._beginning, *(step.observation for step in steps)]
        return Episode(
            concatenate(space, seen, create_empty_array(space, n=len(seen))),
            np.array([step.action for step in steps]), np.array([step.reward for step in steps]),
            steps[-1].terminated, steps[-1].truncated, self._seed,
        )  # fmt: skip

    def _put_down(self, episode: Episode) -> None:
        if not self.episodes or self.episodes[-1].seed != episode.seed:  # once, whenever the interruption came
            self.episodes.append(episode)

    def _frame(self) -> Any:
        return None if self.env.render_mode is None else self.env.render()


def _steps(count: int) -> str:
    return f"{count} step{'' if count == 1 else 's'}"


def _sentence(words: str) -> str:
    return f"{words[0].upper()}{words[1:]}." if words else ""


def stage(env_id: str, env_kwargs: Mapping[str, Any], mode: Mode) -> tuple[gym.Env, gym.Env]:
    """Make an environment twice: as a dataset records it, without a render mode, and as it is shown.

    Raises:
        UnknownEnvironment: no such id.
        NotDiscrete: actions that are not Discrete.
        InvalidParameter: it renders nothing that can be shown there, or the arguments choose a render mode.
    """
    if "render_mode" in env_kwargs:
        raise InvalidParameter(f"env-kwargs has render_mode={env_kwargs['render_mode']}: expected none. Choose with the mode.")
    plain = make(env_id, **env_kwargs)
    plain = Reveal(plain) if known_hidden(plain) else plain  # as the loop records it
    controls_of(plain)
    offered = list(plain.metadata.get("render_modes") or ())
    found = [one for one in _RENDER_MODES[mode] if one in offered]
    if not found:
        other = next((f" Play in the {name}." for name, modes in _RENDER_MODES.items() if {*modes} & {*offered}), "")
        raise InvalidParameter(
            f"{env_id} renders {', '.join(offered) or 'nothing'}: expected {' or '.join(_RENDER_MODES[mode])} for a {mode}."
            f"{other or ' Give it a `render`, and metadata with its `render_modes` and `render_fps`.'}"
        )
    shown = make(env_id, **env_kwargs, render_mode=found[0])
    shown = Reveal(shown) if known_hidden(shown) else shown
    try:
        shown.reset(seed=0)
        shown.render()
    except (RuntimeError, ImportError, gym.error.Error) as error:  # pygame's are RuntimeErrors
        raise InvalidParameter(
            f"{env_id} cannot be rendered here as {found[0]} ({error}): expected a display, or what it draws with."
        ) from error
    return plain, shown


def free_dataset(dataset_id: str | None, env: gym.Env, root: str | None) -> str:
    """The id of a dataset that can be written, before anybody has played for it; for None, the first free version of a default.

    Raises:
        InvalidParameter: a malformed id, a root that cannot be written, or episodes that Minari cannot keep.
        DatasetExists: the id is taken.
    """
    name = (env.spec.id if env.spec else type(env.unwrapped).__name__).rpartition("/")[2].lower()
    if dataset_id is not None:
        check_id(dataset_id)
    with writable_root(root) as base:
        versions = (f"irl_gym/{name}-played-v{version}" for version in count())
        chosen = dataset_id or next(one for one in versions if not (base / one).exists())
        check_free(base, chosen)
    _rehearse(env, chosen)
    return chosen


def _rehearse(env: gym.Env, dataset_id: str) -> None:
    """Write an episode of one step where nobody sees it: what Minari cannot keep is found out before it is played."""
    description_of(dataset_id, _told(env), env.observation_space, env.action_space, "hdf5", {})
    game = Play(env, controls_of(env), 1, keep_unfinished=True)
    try:
        game.start()
        game.press("0")
        game.stop()
    except (ValueError, TypeError, KeyError, IndexError) as error:
        raise InvalidParameter(
            f"an episode of {env} cannot be put together ({error}): expected observations of {env.observation_space}. Mend its "
            "`observation_space`, or what `reset` and `step` return."
        ) from error
    with tempfile.TemporaryDirectory() as folder:
        _write(game.episodes, "rehearsal-v0", env, folder)


def write_played(play: Play, dataset_id: str, env: gym.Env, root: str | None) -> minari.MinariDataset:
    """Write the finished episodes of a game.

    Args:
        play: with at least one.
        dataset_id: from `free_dataset`.
        env: as a dataset records it, from `stage`.
        root: Minari's root folder; None for the one in force.
    """
    return _write(play.episodes, dataset_id, env, root)


def _write(episodes: list[Episode], dataset_id: str, env: gym.Env, root: str | None) -> minari.MinariDataset:
    about = " ".join(filter(None, ("Played with irl_gym.", unkept(env.spec))))
    return write_minari(
        episodes, dataset_id, _told(env), root=root, algorithm=PLAYER, description=about,
        observation_space=env.observation_space, action_space=env.action_space,
    )  # fmt: skip


def _told(env: gym.Env) -> gym.Env | None:
    """The environment, where a dataset can say that it was recorded there."""
    return None if unkept(env.spec) else env


def learn_command(dataset_id: str, root: str | None, env_id: str | None = None) -> str:
    """The command that learns from a dataset; it names the environment where the dataset does not."""
    where = () if env_id is None else ("--env-id", env_id)
    where += ("--dataset-root", root) if root is not None else ()
    return shlex.join(["irl-gym", "run", "--dataset", dataset_id, *where])
