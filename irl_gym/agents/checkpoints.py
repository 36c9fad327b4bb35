"""Training that is kept while it is under way, so that who was killed goes on inside it.

A checkpoint is an npz of numbers and text, taken between two rollouts: networks, optimisers, counters, the filled part of a
replay buffer, and every generator that is drawn from. Unlike SB3's own zip nothing in it is unpickled or called. On a
TabularVecEnv all that training depends on is in it: what goes on ends in the very bits of training in one go. The state of any
other environment cannot be kept: there episodes begin anew, from other seeds, and `resumed` says so.
"""

import importlib.metadata
import json
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from operator import attrgetter
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.buffers import DictReplayBuffer, ReplayBuffer
from stable_baselines3.common.callbacks import BaseCallback

from irl_gym.agents.checkpoint_checks import copies_stand, count, counter, moments_of, numbers, old_generator, same_shapes
from irl_gym.environments.tabular_vec_env import TabularVecEnv
from irl_gym.errors import DamagedFile, RunConflict
from irl_gym.files.archives import json_in, read_arrays
from irl_gym.files.own_files import write_arrays

EVERY = 0.05
"""Share of the training between two checkpoints."""
MOST_REPLAYED = 1 << 28
"""Bytes of a replay buffer that are kept: the newest steps of a larger one, and then what goes on is not the same."""
COUNTERS = ("num_timesteps", "_episode_num", "_n_updates", "_n_calls", "exploration_rate", "_current_progress_remaining")
"""Numbers of SB3's algorithms; each has some of them."""
_SURPRISES = (OSError, LookupError, ValueError, TypeError, AttributeError, RuntimeError, ArithmeticError)
"""What is raised of a state that is none."""
WHO = ("irl_gym", "stable_baselines3", "torch", "numpy")
"""Packages of another version of which a checkpoint is not gone on with."""


@runtime_checkable
class Seen(Protocol):
    """What was seen of the training so far, and belongs to it, such as a learning curve."""

    def arrays(self) -> Mapping[str, np.ndarray]:
        """As arrays of numbers, by name."""
        ...

    def take(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go on from what `arrays` gave."""
        ...


@dataclass
class Checkpoint:
    """Where the training of one agent is kept.

    Args:
        path: the file, which whoever trains deletes when the agent itself is kept.
        of: json of what is trained; a file of something else, or of other versions (`WHO`), is not gone on with.
        seen: kept too.
    """

    path: Path
    of: Any
    seen: Seen | None = None
    went_on: int | None = None
    """Environment steps from which training went on; None where it began anew."""
    resumed: list[int] = field(default_factory=list)
    """The same of each time after which the result may be another than that of training in one go."""

    def write(self, model: BaseAlgorithm, report_at: int) -> None:
        """Keep a model between two rollouts, and at how many steps the next report of it is due."""
        arrays = dict(_flat("model", _state(model)))
        replayed, told = _replayed(getattr(model, "replay_buffer", None))
        told |= _generators(model) | {
            "of": self._identity, "report_at": report_at, "resumed": self.resumed,
            "counters": {name: getattr(model, name) for name in COUNTERS if hasattr(model, name)},
        }  # fmt: skip
        seen = {} if self.seen is None else self.seen.arrays()
        write_arrays(
            self.path,
            {**{name: _numbers(one) for name, one in arrays.items()}, **replayed, **dict(_flat("seen", seen)),
             "told": np.array(json.dumps(told))},
        )  # fmt: skip

    def resume(self, model: BaseAlgorithm) -> int | None:
        """Set a new model, its environment and all generators to where the training was; None where nothing was kept of it.

        Returns:
            The steps at which the next report is due.

        Raises:
            RunConflict: the file cannot be read.
        """
        if not self.path.exists():
            return None
        try:
            found = read_arrays(self.path)
            told = json_in(found, "told")
            if told["of"] != self._identity:
                return None
            report_at, before = count("report_at", told["report_at"]), [count("resumed", one) for one in told["resumed"]]
            exact = _restore(model, found, told)
            if self.seen is not None:
                self.seen.take(_below("seen", found))
            self.went_on = model.num_timesteps
            self.resumed = [*before, *([] if exact else [model.num_timesteps])]
            return report_at
        except _SURPRISES as error:
            why = " ".join(str(error).split())[:200]
            raise RunConflict(
                f"{self.path} cannot be read ({type(error).__name__}: {why}): expected the training that was under way. "
                "Delete it, and its stage is run again."
            ) from error

    @cached_property
    def _identity(self) -> Any:
        return json.loads(json.dumps({"of": self.of, "by": {name: importlib.metadata.version(name) for name in WHO}}))


class Watching(BaseCallback):
    """Reports an agent in training, and keeps it between rollouts.

    Args:
        agent: has the model.
        total: environment steps of the whole training.
        progress: called with the steps made so far and the agent, about every `interval` steps; None for no one.
        interval: steps.
        checkpoint: where the training is kept; None for nowhere.
    """

    def __init__(
        self,
        agent: Any,
        total: int,
        progress: Callable[[int, Any], None] | None,
        interval: int,
        checkpoint: Checkpoint | None,
    ):
        super().__init__()
        self._agent, self._progress, self._interval, self._next = agent, progress, max(1, interval), 0
        self._checkpoint, self._every, self._due = checkpoint, max(1, int(EVERY * total)), 0

    def resume(self) -> bool:
        """Go on with what was kept, if there is any."""
        report_at = None if self._checkpoint is None else self._checkpoint.resume(self._agent.model)
        self._next = report_at or 0
        self._due = self._agent.model.num_timesteps + self._every
        return report_at is not None

    def _on_step(self) -> bool:
        if self._progress is not None and self.num_timesteps >= self._next:
            self._next = self.num_timesteps + self._interval
            self._progress(self.num_timesteps, self._agent)
        return True

    def _on_rollout_start(self) -> None:
        if self._checkpoint is not None and self.num_timesteps >= self._due:
            self._due = self.num_timesteps + self._every
            self._checkpoint.write(self._agent.model, self._next)

    def _on_training_end(self) -> None:
        if self._checkpoint is not None:
            self._checkpoint.write(self._agent.model, self._next)


def _flat(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """What is in nested mappings, by the names on the way to it."""
    if isinstance(value, Mapping):
        for key, one in value.items():
            yield from _flat(f"{name}/{key}", one)
    elif value is not None:
        yield name, value


def _below(name: str, found: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {key.removeprefix(f"{name}/"): one for key, one in found.items() if key.startswith(f"{name}/")}


def _numbers(value: Any) -> np.ndarray:
    return value.detach().cpu().numpy() if isinstance(value, torch.Tensor) else np.asarray(value)


def _state(model: Any) -> dict[str, Any]:
    """What a model has learned and noted, and where its environment stands."""
    weights = {name: one if "optimizer" not in name else one["state"] for name, one in model.get_parameters().items()}
    episodes = np.array([[one["r"], one["l"], one["t"]] for one in model.ep_info_buffer], dtype=np.float64)
    state: dict[str, Any] = {"weights": weights, "episodes": episodes.reshape(-1, 3)}
    scale = model.get_vec_normalize_env()
    if scale is not None:
        rms = scale.ret_rms
        state["scale"] = {"mean": rms.mean, "var": rms.var, "count": rms.count, "returns": scale.returns}
    world = model.get_env().unwrapped
    if isinstance(world, TabularVecEnv):
        state["world"] = world.moment()
    return state


def _restore(model: Any, found: Mapping[str, np.ndarray], told: Mapping[str, Any]) -> bool:
    """Set a model to a state; is all there that its training depends on?"""
    weights, N = model.get_parameters(), model.n_envs
    for name, one in weights.items():
        kept = _below(f"model/weights/{name}", found)
        if "optimizer" in name:
            weights[name] = {**one, "state": _of_optimizer(kept, moments_of(attrgetter(name)(model)))}
        else:
            same_shapes(name, kept, one)
            weights[name] = _tensors(kept)
    model.set_parameters(weights)
    for name in filter(lambda one: hasattr(model, one), COUNTERS):  # nothing else that a file names
        setattr(model, name, counter(name, told["counters"][name], getattr(model, name)))
    episodes = numbers(found, "model/episodes", (None, 3)).tolist()
    model.ep_info_buffer = deque(({"r": r, "l": int(n), "t": t} for r, n, t in episodes), maxlen=model._stats_window_size)
    model.ep_success_buffer = deque(maxlen=model._stats_window_size)
    exact = _refill(getattr(model, "replay_buffer", None), found, told)
    scale, world = model.get_vec_normalize_env(), model.get_env().unwrapped
    if scale is not None:
        kept, rms = _below("model/scale", found), scale.ret_rms
        rms.mean, rms.var = numbers(kept, "mean", ()), numbers(kept, "var", (), least=0.0)
        rms.count, scale.returns = float(numbers(kept, "count", (), least=0.0)), numbers(kept, "returns", (N,))
    if isinstance(world, TabularVecEnv):
        moment = copies_stand(_below("model/world", found), N, world.table.n_states)
        model._last_obs, model._last_episode_starts = world.go_on(moment)
        model._last_original_obs = None if scale is None else model._last_obs  # only what is paid is divided
    else:
        exact = False
        world.seed(int(model.seed or 0) + model.num_timesteps)  # takes effect at the reset that `learn` begins with
    torch.set_rng_state(torch.tensor(told["torch"], dtype=torch.uint8))
    np.random.set_state(old_generator(told["numpy"]))  # noqa: NPY002 (SB3 draws from it)
    model.action_space.np_random.bit_generator.state = told["actions"]
    return exact


def _tensors(kept: Mapping[str, np.ndarray]) -> dict[str, torch.Tensor]:
    return {name: torch.as_tensor(one) for name, one in kept.items()}


def _of_optimizer(kept: Mapping[str, np.ndarray], now: Mapping[int, Mapping[str, Any]]) -> dict[int, dict[str, torch.Tensor]]:
    """The state of an optimiser: by the number of a parameter, what is noted of it, as it is now after a step."""
    state: dict[int, dict[str, np.ndarray]] = {}
    for name, one in kept.items():
        number, _, what = name.partition("/")
        state.setdefault(int(number), {})[what] = one
    for number, one in state.items():
        same_shapes(f"moments of parameter {number}", one, now[number])
    return {number: _tensors(one) for number, one in state.items()}


def _generators(model: Any) -> dict[str, Any]:
    """The states of what a model and its exploration are drawn from."""
    drawn: Any = np.random.get_state()  # noqa: NPY002 (SB3 draws from it)
    kind, keys, *rest = drawn
    actions = model.action_space.np_random.bit_generator.state
    return {"torch": torch.get_rng_state().tolist(), "numpy": [kind, keys.tolist(), *rest], "actions": actions}


def _rows(buffer: ReplayBuffer) -> dict[str, np.ndarray]:
    """The arrays of a replay buffer, each with a row a step of all copies."""
    arrays = ((name, one) for name, one in _flat("replay", vars(buffer)) if isinstance(one, np.ndarray))
    return {name: one for name, one in arrays if one.ndim and len(one) == buffer.buffer_size}


def _replayed(buffer: ReplayBuffer | None) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """What is kept of a replay buffer: all that it holds, or as many of the newest steps as may be."""
    if buffer is None:
        return {}, {"replay": None}
    arrays, filled = _rows(buffer), buffer.size()
    most = MOST_REPLAYED // max(1, sum(one[0].nbytes for one in arrays.values()))
    if filled <= most:
        kept, told = {name: one[:filled] for name, one in arrays.items()}, [buffer.pos, buffer.full]
    else:
        newest = np.arange(buffer.pos - most, buffer.pos) % buffer.buffer_size
        kept, told = {name: one[newest] for name, one in arrays.items()}, [most, False]
    return kept, {"replay": told, "whole": filled <= most and type(buffer) in (ReplayBuffer, DictReplayBuffer)}


def _refill(buffer: ReplayBuffer | None, found: Mapping[str, np.ndarray], told: Mapping[str, Any]) -> bool:
    """Fill a replay buffer; does it hold all that it held?"""
    if buffer is None:
        return True
    (place, full), whole = told["replay"], told["whole"]
    if count("replay", place) >= buffer.buffer_size or type(full) is not bool or type(whole) is not bool:
        raise DamagedFile(f"its replay is {told['replay']!r:.60}, of a buffer for {buffer.buffer_size}")
    filled = buffer.buffer_size if full else place
    for name, one in _rows(buffer).items():
        kept = numbers(found, name, (filled, *one.shape[1:]), one.dtype.kind)
        _, what, *part = name.split("/")  # replay/next_observations/key
        space: Any = {"observations": buffer.observation_space, "actions": buffer.action_space}.get(what.removeprefix("next_"))
        space = space[part[0]] if part and isinstance(space, spaces.Dict) else space
        if isinstance(space, spaces.Discrete):
            numbers(found, name, kept.shape, one.dtype.kind, 0, int(space.n) - 1)
        one[:filled] = kept
    buffer.pos, buffer.full = place, full
    return whole
