"""Where an experiment takes place: a table, exact or of cells; else the environment, which is stepped."""

import json
import shlex
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium as gym
from gymnasium import spaces

from irl_gym.agents.planners import Planner, ValueIteration
from irl_gym.errors import (
    EnumerationLimit,
    EnvironmentFailed,
    HiddenState,
    InvalidParameter,
    NotDiscrete,
    NotSettable,
    NotTabular,
)
from irl_gym.learners.needs import PARTS
from irl_gym.loop.table_world import TableWorld, step_limit
from irl_gym.loop.worlds import RunWorld, SteppedWorld
from irl_gym.runs.choices import PROGRAM
from irl_gym.runs.experiment import Experiment
from irl_gym.spaces.coordinates import coordinates_of
from irl_gym.tables.discretize import discretize
from irl_gym.tables.enumeration.table import Enumeration
from irl_gym.tables.table_files import UNDER_WAY, kept_table
from irl_gym.tables.tabulate import tabulate
from irl_gym.tables.tabulation import Tabulation

ON_COMMAND_LINE: dict[type[Exception], str] = {
    HiddenState: "(On the command line: --start-seeds 0, --reveal name=number, --table sample.)",
    EnumerationLimit: "(On the command line: --max-states, with --out naming the same folder.)",
}
"""How the mends of errors are asked for there."""
CELLS = 1000
"""Of a table that is offered, about: a run of so many takes a minute."""


def place_of(asked: Experiment, env: gym.Env, out: Path, tell: Callable[[float | None, str], None]) -> RunWorld:
    """The world of an experiment.

    Args:
        asked: the experiment.
        env: its environment.
        out: folder of the run, which is held (`own_files.held`), where a table may be kept, or an enumeration that was killed.
        tell: told the share of the table that is made, None where that cannot be known, and what is known of it.

    Raises:
        InvalidParameter: cells asked for where states are discrete.
        NotTabular, NotDiscrete: no table can be made, and the learner needs one.
    """
    seed = asked.seed
    limit = step_limit(env) if asked.dataset is not None else None
    if asked.bins is not None and isinstance(env.observation_space, spaces.Discrete):
        raise InvalidParameter(
            f"bins is {asked.bins}, but {asked.env_id} has discrete states: expected continuous ones. Leave bins out."
        )
    if asked.bins is not None:
        method: dict[str, Any] = {"successors": "sampled", "samples": asked.samples} if asked.samples else {}
        table = kept_table(out, env.observation_space)  # as the cells of an earlier start were kept
        if table is None:
            table = discretize(
                env, gamma=asked.gamma, bins=asked.bins, seed=seed, on_progress=lambda share: tell(share, ""), **method
            )
        return TableWorld(env, table, asked.num_envs or 64, seed, limit)
    try:
        return TableWorld(env, _table(asked, env, out, tell), asked.num_envs or 64, seed, limit)
    except (NotTabular, NotDiscrete) as error:
        if not isinstance(env.action_space, spaces.Discrete):
            raise
        of_table = asked.learner.needs.lacking({*PARTS} - {"dynamics", "reward"})
        if of_table is not None or getattr(asked.learner, "on_rows", False):
            raise type(error)(f"no table of {asked.env_id or asked.dataset}: {error}{_instead(error, env, asked)}") from error
        world = SteppedWorld(env, asked.gamma, asked.num_envs or 8, asked.eval_episodes, seed)
        for name in ("expert", "inner", "retrain"):
            _check_stepping(name, getattr(asked, name), env)
        return world


def _check_stepping(name: str, planner: Planner | None, env: gym.Env) -> None:
    """Check that a planner needs no table.

    Raises:
        InvalidParameter: ValueIteration, which does.
    """
    if isinstance(planner, ValueIteration):
        raise InvalidParameter(
            f"{name} is value-iteration, but {env} has no table: expected an SB3 agent, such as ppo. Or make a table of cells "
            "with bins."
        )


def _instead(error: NotTabular | NotDiscrete, env: gym.Env, asked: Experiment) -> str:
    """What else can be asked for where no table was made: only what does not lead to the same error."""
    space, kind, command = env.observation_space, type(error), _command(asked)
    ways = []
    if kind in ON_COMMAND_LINE:
        ways.append(ON_COMMAND_LINE[kind])
    elif kind is NotTabular:
        ways.append("Or count what random steps do (--table sample).")
    elif kind is NotDiscrete and isinstance(space, spaces.Box) and space.dtype.kind == "f":
        each = max(2, int(CELLS ** (1 / max(1, len(_coordinates(env))))))
        ways.append(f"Or make a table of cells, if its state can be set: `{command} --bins {each} --retrain value-iteration`.")
    if kind is not EnvironmentFailed and isinstance(space, spaces.Box | spaces.Discrete | spaces.MultiDiscrete):
        ways.append(f"Or learn from episodes alone, with TrajectoryLP: `{command} --learner trajectory-lp`.")
    return "".join(f" {way}" for way in ways)


def _coordinates(env: gym.Env) -> Sequence[str]:
    """Names of what cells divide."""
    try:
        return coordinates_of(env.unwrapped).names
    except NotSettable:
        return ()


def _command(asked: Experiment) -> str:
    """The command of a run in the same place, whose other options are the defaults."""
    where = [("--env-id", asked.env_id), ("--dataset", asked.dataset), ("--dataset-root", asked.dataset_root)]
    words = [*PROGRAM, *(word for flag, value in where if value is not None for word in (flag, str(value)))]
    if asked.env_kwargs:
        words += ["--env-kwargs", json.dumps(dict(asked.env_kwargs))]
    return shlex.join(words)


def _table(asked: Experiment, env: gym.Env, out: Path, tell: Callable[[float | None, str], None]) -> Tabulation:
    """The table that an earlier start kept, or a new one; an enumeration that was killed is continued."""
    kept = kept_table(out, env.observation_space)
    if kept is not None:
        return kept
    by = asked.table or Enumeration(known=True)
    if isinstance(by, Enumeration) and by.checkpoint is None:
        by = replace(by, checkpoint=out / UNDER_WAY)
    return tabulate(env, gamma=asked.gamma, by=by, seed=asked.seed, progress=telling(by, tell))


def telling(by: Any, tell: Callable[[float | None, str], None]) -> Callable[[int, int], None]:
    """What a way to make a table is to call with how much is done, and of how much; it tells the share, where that is known."""
    if isinstance(by, Enumeration):  # how many states there are is known at the end only
        return lambda done, of: tell(None, f"{of:,} states found, {done:,} tried")
    return lambda done, of: tell(done / max(of, 1), "")
