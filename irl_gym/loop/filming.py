"""Filming: an episode is run in the environment itself, with pictures where it draws them.

Every k-th moment is drawn; k doubles when there are too many pictures, and the last moment is always drawn. Pictures that are
equal are kept once. Axes: T steps.
"""

import contextlib
import io
import os
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from PIL import Image, features

from irl_gym.environments.closing import close
from irl_gym.environments.rollouts import maker_of
from irl_gym.errors import UnknownObservation
from irl_gym.loop.table_world import Choose, step_limit
from irl_gym.mdp.episodes import Episode
from irl_gym.runs.films import MOST_BYTES, Film, Moment
from irl_gym.spaces.batches import take
from irl_gym.spaces.names import action_names, state_name
from irl_gym.tables.layouts import grid_shape

MOST_FRAMES = 60
"""Pictures of a film."""
MOST_STEPS = 1000
"""Steps after which a film is cut."""
SIZES = ((320, 80), (320, 55), (240, 50), (160, 45), (96, 40))
"""Pixels of the longer side, and webp's quality: tried in this order."""
Pays = Callable[..., tuple[list[int | None], np.ndarray]]
"""T + 1 observations, T actions and whether the episode `terminated` -> rows, None where there is none, and (T,) what a learned
reward pays, NaN where that is not known."""


@dataclass
class _Take:
    """An episode that was run, with pictures as the environment draws them."""

    observations: list[Any]
    actions: list[int | None] = field(default_factory=list)
    """None where they were not recorded."""
    rewards: list[float] = field(default_factory=list)
    ends: str = "cut"
    pictures: dict[int, np.ndarray] = field(default_factory=dict)
    without: str | None = None


def film(name: str, env: gym.Env, shown: Choose | Episode, seed: int | None, pays: Pays, env_id: str | None) -> Film:
    """Film an episode that is run, or that was recorded.

    Args:
        name: such as "expert" or "agent".
        env: a copy of it is filmed.
        shown: who acts; or the episode, which is run again for its pictures.
        seed: of the reset, where it is run.
        pays: what the learned reward pays.
        env_id: the environment's, by which states are called.
    """
    stage, without = _stage(env)
    try:
        if isinstance(shown, Episode):
            made, seed = _replayed(stage, shown, without), shown.seed
        else:
            made = _run(stage, shown, seed, min(step_limit(env), MOST_STEPS), without)
    finally:
        close(stage)
    rows, learned = pays(made.observations, made.actions, terminated=made.ends == "terminated")
    columns = columns_of(env)
    texts = [state_name(env_id, one, columns) for one in made.observations]
    return _developed(name, seed, made, texts, rows, learned, action_names(env))


def _stage(env: gym.Env) -> tuple[gym.Env, str | None]:
    """A copy of the environment that draws, or one that does not, and why."""
    if "rgb_array" not in (env.metadata.get("render_modes") or ()):
        return maker_of(env)(), "the environment draws no pictures"
    spec: Any = env.spec
    if spec is None or any(wrapper.kwargs is None for wrapper in spec.additional_wrappers):
        return maker_of(env)(), "the environment cannot be made again from its spec"
    try:
        with _quietly():
            return gym.make(spec, render_mode="rgb_array"), None
    except Exception as error:  # the environment's own code
        return maker_of(env)(), f"the environment cannot be made to draw: {_told(error)}"


@contextlib.contextmanager
def _quietly() -> Iterator[None]:
    """Environments draw with pygame, which greets on standard output and complains where there is no screen or no sound.

    What the user has set stays as it is.
    """
    quiet = {"PYGAME_HIDE_SUPPORT_PROMPT": "1", "SDL_VIDEODRIVER": "dummy", "SDL_AUDIODRIVER": "dummy"}
    unset = [name for name in quiet if name not in os.environ]
    os.environ.update({name: quiet[name] for name in unset})
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        for name in unset:
            os.environ.pop(name, None)


def _told(error: Exception) -> str:
    return f"{type(error).__name__}: {str(error).splitlines()[0] if str(error) else 'no message'}"


def _run(env: gym.Env, choose: Choose, seed: int | None, most: int, without: str | None) -> _Take:
    """Run one episode."""
    first = int(getattr(env.action_space, "start", 0))
    made, camera = _Take([env.reset(seed=seed)[0]], without=without), _Camera(env)
    camera.draw(made, 0)
    for time in range(most):
        try:
            action = choose(made.observations[-1])
        except UnknownObservation:  # a table that was sampled may not know it
            break
        observation, reward, terminated, truncated, _ = env.step(action + first)
        made.observations.append(observation)
        made.actions.append(action)
        made.rewards.append(float(reward))
        made.ends = "terminated" if terminated else "truncated" if truncated or time + 1 == most < MOST_STEPS else "cut"
        over = terminated or truncated or time + 1 == most
        camera.draw(made, time + 1, last=over)
        if over:
            break
    return made


class _Camera:
    """Draws every `stride`-th moment, and the last."""

    def __init__(self, env: gym.Env):
        self.env, self.stride = env, 1

    def draw(self, made: _Take, time: int, *, last: bool = False) -> None:
        """Draw the environment as it is, if it is time to."""
        if made.without is not None or (time % self.stride and not last):
            return
        try:
            with _quietly():
                drawn: Any = self.env.render()
            made.pictures[time] = np.asarray(drawn, dtype=np.uint8)
            if made.pictures[time].ndim != 3:
                raise TypeError(f"it drew an array of shape {made.pictures[time].shape}")
        except Exception as error:  # the environment's own code
            made.pictures.clear()
            made.without = f"drawing failed: {_told(error)}"
            return
        if len(made.pictures) >= MOST_FRAMES and not last:
            self.stride *= 2
            made.pictures = {t: one for t, one in made.pictures.items() if t % self.stride == 0}


def _replayed(env: gym.Env, episode: Episode, without: str | None) -> _Take:
    """An episode that was given, with pictures if its seed and its actions lead to the same observations."""
    n = min(len(episode), MOST_STEPS)
    shown = [take(episode.observations, t) for t in range(n + 1)]
    ends = "cut" if n < len(episode) else "terminated" if episode.terminated else "truncated"
    actions: list[Any] = [None] * n if episode.actions is None else episode.actions[:n].tolist()
    given = _Take(shown, actions, np.asarray(episode.rewards, dtype=float)[:n].tolist(), ends)
    if without is None and episode.actions is None:
        without = "the dataset does not say which actions were taken"
    if without is None and episode.seed is None:
        without = "the dataset does not say with which seed the episode was recorded"
    if without is None:
        replayed = iter(actions)
        again = _run(env, lambda _: next(replayed), episode.seed, n, None)
        same = len(again.observations) == len(shown) and all(map(_equal, again.observations, shown))
        if same:
            given.pictures, without = again.pictures, again.without
        else:
            without = "the episode goes another way when its seed and its actions are tried again"
    given.without = without
    return given


def _equal(one: Any, other: Any) -> bool:
    if isinstance(one, dict):
        return all(_equal(one[key], other[key]) for key in one)
    if isinstance(one, tuple):
        return all(map(_equal, one, other))
    return np.array_equal(one, other)


def _developed(
    name: str,
    seed: int | None,
    made: _Take,
    texts: list[str],
    rows: list[int | None],
    learned: np.ndarray,
    actions: Sequence[str],
) -> Film:
    """The film of a take: what each step was paid, and its pictures as files hold them."""
    numbers, frames, kind = _frames(made)
    moments = [Moment(texts[0], rows[0], None, None, None, None, 0.0, 0.0, numbers.get(0))]
    totals = zip(np.cumsum(made.rewards).tolist(), np.nancumsum(learned).tolist(), strict=True)
    for time, (true_total, learned_total) in enumerate(totals, 1):
        action, paid = made.actions[time - 1], learned[time - 1]
        moments.append(
            Moment(
                texts[time], rows[time], action, None if action is None else actions[action], made.rewards[time - 1],
                None if np.isnan(paid) else float(paid), true_total, learned_total, numbers.get(time),
            )
        )  # fmt: skip
    return Film(name, seed, tuple(moments), made.ends, frames, kind, made.without)


def columns_of(env: gym.Env) -> int | None:
    """Columns of the map whose cells the observations number; None where they do not."""
    shape, space = grid_shape(env), env.observation_space
    return shape[1] if shape is not None and isinstance(space, spaces.Discrete) and np.prod(shape) == space.n else None


def _frames(made: _Take) -> tuple[dict[int, int], tuple[bytes, ...], str]:
    """Time -> number of its picture; the pictures, small enough; their format."""
    kind = "webp" if features.check("webp") else "png"
    known: dict[bytes, int] = {}
    numbers = {time: known.setdefault(picture.tobytes(), len(known)) for time, picture in made.pictures.items()}
    different = {number: made.pictures[time] for time, number in reversed(numbers.items())}
    files: list[bytes] = []
    for side, quality in SIZES:
        files = [_encoded(different[number], side, quality, kind) for number in sorted(different)]
        if sum(map(len, files)) <= MOST_BYTES:
            break
    return numbers, tuple(files), kind


def _encoded(picture: np.ndarray, side: int, quality: int, kind: str) -> bytes:
    image = Image.fromarray(picture[..., :3])
    image.thumbnail((side, side), Image.Resampling.LANCZOS)
    file = io.BytesIO()
    image.save(file, kind, **({"quality": quality, "method": 4} if kind == "webp" else {"optimize": True}))
    return file.getvalue()
