"""MiniGrid's tasks as finite MDPs: the whole state in the observation, one layout or a few.

MiniGrid (Chevalier-Boisvert et al. 2023) shows the agent what lies before it, draws a new layout at each reset, and pays less
the longer an episode took. None of that is an MDP over its observations, so here

- the observation is the whole grid, and what MiniGrid's own full picture leaves out: what is carried, what is in a box, and
  what the task is where layouts differ in it;
- the layouts are those of the seeds in `layout`, each as likely at a reset;
- success pays 1 (MiniGrid: 1 - 0.9 * step_count / max_steps, and no observation shows step_count) and there is no step limit
  but the TimeLimit that `gym.make` adds.

An observation is a (width, height, 4) picture. The first three channels are MiniGrid's: object (1 empty, 2 wall, 4 door, 5 key,
6 ball, 7 box, 8 goal, 9 lava, 10 the agent), colour, and state (a door is open, closed or locked; the agent looks right, down,
left or up). The fourth is 0 but in two kinds of cell. A box shows the number of what it holds. The agent's cell shows
carried + (1 + n) * kind, where the n things that can be carried have numbers 1..n, and kind is the number of the layout's
mission and fixed cells, which the agent may cover: 0 where all layouts have the same.

Departs: in Dynamic-Obstacles the order in which obstacles move stays hidden. The moves depend on it a little, and their draws
cannot be listed.
"""

import difflib
import importlib
import numbers
import os
from collections.abc import Hashable, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.envs.registration import load_env_creator

from irl_gym.environments.seeded_starts import SeededStarts
from irl_gym.errors import InvalidInput, InvalidParameter, NotInstalled
from irl_gym_envs.render_modes import check_render_mode, warn_of_no_render_mode

PREFIX, SUFFIX = "MiniGrid-", "-v0"
AGENT, COLOURS, STATES = 10, 6, 4
"""MiniGrid's number of the agent; of colours; of the agent's directions, the most states there are."""
NOTHING = (1, 0, 0, 0)
"""An empty cell."""


class MiniGridEnv(gym.Env):
    """A task of MiniGrid with the whole state in the observation, and a reward of 1 for success.

    All chance is drawn from this environment's own generator: which layout, and what moves by itself.

    Args:
        task: the name of a task of MiniGrid, such as "DoorKey-6x6" for MiniGrid-DoorKey-6x6-v0.
        layout: the seed of the layout, as MiniGrid's `reset(seed=...)` takes it, or a list of seeds.
        render_mode: "human", "rgb_array" or None.

    Raises:
        NotInstalled: the package minigrid is missing.
        InvalidParameter: an unknown task, or seeds that are not whole numbers from 0.
    """

    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 10}  # noqa: RUF012 (as Gymnasium)

    def __init__(self, task: str = "Empty-5x5", layout: int | Sequence[int] = 0, render_mode: str | None = None):
        check_render_mode(render_mode, self.metadata)
        base = _mini_grid(task)
        # Nobody looks at its partial view, and most of a step's time goes into that: 80 us a step with it, 2 us without.
        base.gen_obs = dict
        seeds: Any = [layout] if isinstance(layout, numbers.Integral) else layout
        self.inner = SeededStarts(base, seeds)
        """MiniGrid's environment; `inner.unwrapped` has its grid, agent_pos, agent_dir and carrying."""
        self._base: Any = base
        self._things: dict[Hashable, int] = {}
        self._kinds: dict[str, int] = {}
        self._survey()
        self._kind: int | None = None
        self.render_mode = base.render_mode = render_mode
        self.action_space = spaces.Discrete(base.action_space.n)
        hidden = max(1, (1 + len(self._things)) * len(self._kinds) - 1)
        high = np.zeros((base.width, base.height, 4), dtype=np.min_scalar_type(max(AGENT, hidden)))
        high[:] = AGENT, COLOURS - 1, STATES - 1, hidden
        low = np.zeros_like(high)
        low[:] = NOTHING
        self.observation_space = spaces.Box(low, high, dtype=high.dtype.type)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode in one of the layouts.

        Args:
            seed: of the choice of the layout and of the chance of later steps.
            options: none are known.
        """
        super().reset(seed=seed)
        self.inner.chooser = self._base.np_random = self.np_random
        self.inner.reset()
        _share_walls(self._base.grid)
        self._kind = self._kinds[_kind_of(self._base)]
        return self._observation(), {"mission": self._base.mission}

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Turn, move, pick up, drop or toggle, as MiniGrid does; success pays 1.

        Raises:
            InvalidInput: an action outside the action space, or before reset.
        """
        if self._kind is None:
            raise InvalidInput("step before the first episode: call reset first.")
        if not self.action_space.contains(action):
            raise InvalidInput(f"action {action!r} is unknown: expected a member of {self.action_space}.")
        self._base.np_random = self.np_random
        self._base.step_count = 0  # so that MiniGrid never truncates, and always pays a success
        _, paid, terminated, _, _ = self._base.step(int(action))
        # Less than 0 is Dynamic-Obstacles' -1 for a collision.
        reward = 1.0 if paid > 0 else float(paid)
        return self._observation(), reward, bool(terminated), False, {"mission": self._base.mission}

    def render(self) -> Any:
        """MiniGrid's picture: (H, W, 3) uint8 ("rgb_array"), or a window ("human")."""
        if self.render_mode is None:
            return warn_of_no_render_mode(self, "rgb_array")
        if self._kind is None:
            raise InvalidInput("render before the first episode: call reset first.")
        return self.inner.render()

    def close(self) -> None:
        """Close the window."""
        self.inner.close()

    def _survey(self) -> None:
        """Number what can be carried and the kinds of layouts, over all layouts."""
        things: dict[Hashable, None] = {}
        for seed in self.inner.seeds:
            self._base.reset(seed=seed)
            self._kinds.setdefault(_kind_of(self._base), len(self._kinds))
            for thing in self._base.grid.grid:
                while thing is not None and thing.can_pickup():
                    things[_name(thing)] = None
                    thing = thing.contains
        self._things = {name: 1 + i for i, name in enumerate(sorted(things, key=repr))}

    def _observation(self) -> np.ndarray:
        base = self._base
        cells = [NOTHING if thing is None else (*thing.encode(), self._number(thing.contains)) for thing in base.grid.grid]
        rows = np.array(cells, dtype=self.observation_space.dtype).reshape(base.height, base.width, 4)
        picture = np.ascontiguousarray(rows.swapaxes(0, 1))
        hidden = self._number(base.carrying) + (1 + len(self._things)) * (self._kind or 0)
        picture[tuple(base.agent_pos)] = AGENT, 0, base.agent_dir, hidden
        return picture

    def _number(self, thing: Any) -> int:
        """Of something that can be carried; 0 is nothing."""
        return 0 if thing is None else self._things[_name(thing)]


def _share_walls(grid: Any) -> None:
    """Let one wall stand in all cells that have one: they are alike, and copies of the environment become much cheaper."""
    walls: dict[str, Any] = {}
    grid.grid = [
        walls.setdefault(thing.color, thing) if thing is not None and thing.type == "wall" else thing for thing in grid.grid
    ]


def _name(thing: Any) -> Hashable:
    """All there is to know of an object that can be carried: two of the same name are the same to the agent."""
    return thing.type, thing.color, None if thing.contains is None else _name(thing.contains)


def _kind_of(base: Any) -> str:
    """What no step changes in a layout: its mission, its target if it has one, and all cells but what can be carried."""
    fixed = tuple(None if thing is None or thing.can_pickup() else (thing.type, thing.color) for thing in base.grid.grid)
    return repr((base.mission, str(getattr(base, "target_pos", None)), fixed))


def _mini_grid(task: str) -> Any:
    """MiniGrid's own environment for a task."""
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")  # MiniGrid imports pygame, which prints a greeting
    try:
        importlib.import_module("minigrid")  # importing it registers its environments
    except ModuleNotFoundError as error:
        raise NotInstalled(
            f"MiniGrid's {task} needs the package {error.name}, which is not installed: expected an optional extra. Install it "
            'with `pip install "irl_gym[minigrid]"`.'
        ) from error
    known = {
        id.removeprefix(PREFIX).removesuffix(SUFFIX) for id in gym.registry if id.startswith(PREFIX) and id.endswith(SUFFIX)
    }
    if task not in known:
        bare = str(task).removeprefix(PREFIX).removesuffix(SUFFIX)
        close = difflib.get_close_matches(bare, sorted(known), n=3, cutoff=0.4)
        offer = f"The closest are {', '.join(close)}." if close else f"They are {', '.join(sorted(known))}."
        raise InvalidParameter(f"task is {task!r}: expected a task of MiniGrid, without its prefix and version. {offer}")
    spec = gym.registry[PREFIX + task + SUFFIX]
    # Not gym.make, which warns of tasks that have a newer version, and wraps.
    creator = load_env_creator(spec.entry_point) if isinstance(spec.entry_point, str) else spec.entry_point
    assert creator is not None, f"{spec.id} is registered without an entry point"
    try:
        return creator(**spec.kwargs)
    except gym.error.DependencyNotInstalled as error:
        raise NotInstalled(f"MiniGrid's {task} needs more than MiniGrid: {error}") from error
