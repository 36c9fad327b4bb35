"""A run as it stands in its folder: everything that a page, a comparison or a notebook shows of it.
Axes: S states, A actions, n points of the learning curve, k pieces of the lambda path.
"""

import contextlib
import json
import os
import zipfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces
from minari.serialization import deserialize_space

from irl_gym.choices import environment_of
from irl_gym.claims import AGAIN, FIRST, STAGES, check_format, into_folder, shell_command
from irl_gym.curves import Curve, read_curve
from irl_gym.discretize import discretize
from irl_gym.errors import IrlGymError, RunIncomplete
from irl_gym.films import Film, load_film
from irl_gym.layouts import GridLayout
from irl_gym.linear_reward import LinearReward, load_reward
from irl_gym.listed_states import usual_observation
from irl_gym.names import action_names, state_name
from irl_gym.rewards import TabularReward
from irl_gym.run_folder import RECORDS, read_json
from irl_gym.table_files import TABLE, load_table
from irl_gym.tabulation import Tabulation

SURPRISES = (ArithmeticError, AttributeError, IndexError, KeyError, RecursionError, TypeError, ValueError)
"""What is raised by content that no run leaves."""
ONCE = ("config.json", "run.json")
"""Files that no stage writes: they are there from the start."""


@dataclass(frozen=True, eq=False)
class Run:
    """What a run left."""

    path: Path
    """The folder."""
    config: Mapping[str, Any]
    """The content of config.json: the experiment."""
    version: Mapping[str, Any]
    """The content of run.json: format, irl_gym, command; empty for a run of an earlier version."""
    env_id: str | None
    """The environment's id."""
    actions: tuple[str, ...]
    """(A,) names of the actions."""
    table: Tabulation | None
    """P, d0, gamma, the true reward and the states; None where the environment was stepped."""
    learned: TabularReward | LinearReward
    """The recovered reward, of rows or of observations."""
    expert: np.ndarray | None
    """(S,) actions, or (S, A) probabilities with rows of NaN where nothing is known; None where there is no table."""
    agent: np.ndarray | None
    """(S,) actions of the retrained agent, or (S, A); None where there is no table."""
    certificate: Mapping[str, Any]
    """The content of certificate.json."""
    metrics: Mapping[str, Any]
    """The content of metrics.json."""
    curve: Curve
    """The learning curve; without points where the agent was planned exactly."""
    stages: Mapping[str, Mapping[str, Any]]
    """The record of each finished stage."""
    grid: GridLayout | None
    """Where the states lie on a map."""
    films: Mapping[str, Film]
    """By name: expert, agent."""
    diagnosis: Mapping[str, Any] | None
    """What the doctor says of the reward."""
    widths: Mapping[str, np.ndarray] | None
    """low, high, width: (S,) how far the reward of a state is left open; NaN where it is never reached."""
    lambda_path: Mapping[str, Any] | None
    """breakpoints (k+1,), rewards (k, S) or (k, S, A), margins (k, S), l1_norms (k,), total_margins (k,), changes (a list);
    exact, whether these are all pieces, and gap, what others can be worth."""

    @property
    def tabular(self) -> TabularReward | None:
        """The recovered reward on the rows of the table; None where there is none."""
        if self.table is None:
            return None
        return self.learned.tabular(self.table.states) if isinstance(self.learned, LinearReward) else self.learned

    @property
    def command(self) -> str | None:
        """The command that reproduces the run, for a shell; None where it was started from Python, or nobody noted it."""
        return shell_command(self.version.get("command"))

    def state_name(self, row: int) -> str:
        """What a state is called: its observation, in words.

        Raises:
            RunIncomplete: there is no table.
        """
        if self.table is None:
            raise RunIncomplete(f"{self.path} has no table, so row {row} has no name: expected a run with states.")
        observation = self.table.states.decode(row)
        columns = None if self.grid is None else self.grid.shape[1]
        return state_name(self.env_id, observation, columns, usual_observation(self.table.states))


def read_run(path: str | os.PathLike, table: Tabulation | None = None) -> Run:
    """Read the folder of a run whose figures and numbers are complete; its page may be missing.

    Args:
        path: the folder.
        table: the run's, if it is at hand; else it is read.

    Raises:
        RunIncomplete: no run, one that was killed before its end, or a file of it is gone or damaged.
        RunConflict: no run of this library.
        RunNewer: a newer version wrote it.
    """
    path = Path(path)
    if not (path / "config.json").is_file():
        raise RunIncomplete(f"{path} holds no run: expected a folder with a config.json. Name the --out of a run.")
    reader = _Reader(path)
    older = not (path / "run.json").exists()
    version: dict[str, Any] = {} if older else reader.read("run.json", read_json)
    check_format(path, version)
    reader.command = version.get("command")
    config = reader.read("config.json", read_json)
    stages = {name: record for name in STAGES if (record := reader.record(name)) is not None}
    for name in FIRST if older else STAGES[:-1]:
        if name not in stages:
            raise reader.incomplete(f"the stage {name!r} was not finished")
    env_id, observations, names = _environment(reader, config)
    metrics = reader.read("metrics.json", read_json)
    on_table = metrics.get("table") is not None
    films = path / "films"
    run = Run(
        path=path, config=config, version=version, env_id=env_id, actions=names,
        table=(table or _table(reader, config, observations)) if on_table else None,
        learned=reader.read("reward.npz", load_reward),
        expert=reader.read("expert.npz", _actions) if on_table else None,
        agent=reader.read("agent_policy.npz", _actions) if on_table else None,
        certificate=reader.read("certificate.json", read_json), metrics=metrics,
        curve=reader.read("learning_curve.csv", read_curve), stages=stages,
        grid=reader.maybe("grid.json", lambda one: GridLayout.from_json(read_json(one))),
        films={name: reader.read(f"films/{name}.json", load_film) for name in ("expert", "agent")
               if (films / f"{name}.json").exists()},
        diagnosis=reader.maybe("diagnosis.json", read_json),
        widths=_part(reader.maybe("ambiguity.npz", _arrays), "widths"),
        lambda_path=_part(reader.maybe("ambiguity.npz", _arrays), "path"),
    )  # fmt: skip
    _check_shapes(run, reader)
    return run


@contextlib.contextmanager
def understood(*paths: str | os.PathLike) -> Iterator[None]:
    """For what is made of folders that anybody may have written: json that no run leaves is the run's fault, no traceback.

    Args:
        paths: the folders.

    Raises:
        RunIncomplete: in place of what the surprise raised, which it names.
    """
    try:
        yield
    except IrlGymError:
        raise
    except SURPRISES as error:
        raise not_understood(error, *paths) from error


def not_understood(error: Exception, *paths: str | os.PathLike) -> RunIncomplete:
    """The error of folders whose files can be read and say what no run says."""
    told = ", ".join(map(str, paths))
    return RunIncomplete(
        f"{told} cannot be understood ({type(error).__name__}: {error}): expected files as a run leaves them. If they "
        "were changed, or another program wrote them, make the run again; if not, it is a defect of irl_gym: please report it."
    )


class _Reader:
    """Reads files of one folder, and says which is wrong."""

    def __init__(self, path: Path):
        self.path, self.command = path, None

    def incomplete(self, what: str) -> RunIncomplete:
        """The error of a run that has to be continued."""
        here = None if self.command is None else into_folder(self.command, str(self.path))
        again = shell_command(here) or f"recover_and_retrain(experiment, {str(self.path)!r}) with the same experiment"
        return RunIncomplete(
            f"{self.path} is incomplete: {what}: expected a finished run. The same command continues it: {again}"
        )

    def lost(self, what: str) -> RunIncomplete:
        """The error of a run that cannot be continued, since what says which run it is is gone."""
        again = shell_command(None if self.command is None else into_folder(self.command))
        told = f"with another --out: {again}" if again else f"in a new folder: recover_and_retrain(experiment, {AGAIN!r})"
        return RunIncomplete(
            f"{self.path} is damaged: {what}: expected what the run wrote at its start, which no stage writes again. Make the "
            f"run again, {told}"
        )

    def read(self, name: str, read: Callable[[Path], Any]) -> Any:
        """The content of a file."""
        try:
            return read(self.path / name)
        except FileNotFoundError as error:
            missing = Path(error.filename or name)
            told = missing.relative_to(self.path) if missing.is_relative_to(self.path) else name
            raise self.incomplete(f"{told} is missing") from error
        except (OSError, *SURPRISES, EOFError, zipfile.BadZipFile, IrlGymError) as error:
            what = f"{name} cannot be read ({type(error).__name__}: {error})"
            if name in ONCE:
                raise self.lost(what) from error
            raise self.incomplete(f"{what}; delete it, and its stage is run again") from error

    def maybe(self, name: str, read: Callable[[Path], Any]) -> Any:
        """The content of a file that not every run has."""
        return self.read(name, read) if (self.path / name).exists() else None

    def record(self, stage: str) -> dict[str, Any] | None:
        """The record of a stage; None where it was not finished."""
        try:
            return read_json(self.path / RECORDS / f"{stage}.json")
        except (OSError, ValueError):
            return None


def _environment(reader: _Reader, config: Mapping[str, Any]) -> tuple[str | None, spaces.Space, tuple[str, ...]]:
    """Id, observation space and names of the actions; of a run of an earlier version from the environment itself."""
    told = reader.maybe("environment.json", _told)
    if told is not None:
        return told
    env = _made(config)
    env_id = config.get("env_id") if env.spec is None else env.spec.id
    return env_id, env.observation_space, action_names(env)


def _told(path: Path) -> tuple[str | None, spaces.Space, tuple[str, ...]]:
    content = read_json(path)
    return content["id"], deserialize_space(json.loads(content["observations"])), tuple(content["actions"])


def _made(config: Mapping[str, Any]) -> Any:
    return environment_of(
        config.get("env_id"), config.get("env_kwargs", {}), config.get("dataset"), config.get("dataset_root"),
        start_seeds=config.get("start_seeds", ()), reveal=config.get("reveal", "known"),
    )  # fmt: skip


def _table(reader: _Reader, config: Mapping[str, Any], observations: spaces.Space) -> Tabulation:
    """The table that is kept; one of cells is made again, which takes as long as the first time."""
    if config.get("bins") is None:
        return reader.read(TABLE, lambda path: load_table(path, observations))
    method: dict[str, Any] = {"successors": "sampled", "samples": config["samples"]} if config["samples"] else {}
    return discretize(_made(config), gamma=config["gamma"], bins=config["bins"], seed=config["seed"], **method)


def _check_shapes(run: Run, reader: _Reader) -> None:
    """Check that rewards and policies are of the run's own table: a file may have been copied from another run.

    Raises:
        RunIncomplete: one is not, by the name of its file.
    """
    if run.table is None:
        return
    learned = run.learned.values if isinstance(run.learned, TabularReward) else None  # weights are of features
    shape = (run.table.mdp.n_states, run.table.mdp.n_actions)
    for name, found in (("reward.npz", learned), ("expert.npz", run.expert), ("agent_policy.npz", run.agent)):
        if found is not None and found.shape not in (shape, shape[:1]):
            raise reader.incomplete(
                f"{name} has shape {found.shape}, but the table asks for ({shape[0]},) or {shape}; delete it, and its stage is "
                "run again"
            )


def _actions(path: Path) -> np.ndarray:
    return _arrays(path)["actions"]


def _arrays(path: Path) -> dict[str, np.ndarray]:
    with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


def _part(arrays: Mapping[str, np.ndarray] | None, name: str) -> dict[str, Any] | None:
    """The arrays whose names begin so; what is text is json."""
    found = {key.partition(".")[2]: one for key, one in (arrays or {}).items() if key.startswith(f"{name}.")}
    return {key: json.loads(str(one)) if one.dtype.kind == "U" else one for key, one in found.items()} or None
