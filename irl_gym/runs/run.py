"""A run as it stands in its folder: everything that a page, a comparison or a notebook shows of it.
Axes: S states, A actions, n points of the learning curve, k pieces of the lambda path.
"""

import itertools
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces

from irl_gym.errors import InvalidInput, RunIncomplete
from irl_gym.features.linear_reward import LinearReward, load_reward
from irl_gym.files.archives import read_arrays
from irl_gym.files.own_files import check_links
from irl_gym.files.run_folder import START, read_json
from irl_gym.files.run_schema import Config, Diagnosed, Grid, Version, checked
from irl_gym.judging.curves import NO_CURVE, Curve, read_curve
from irl_gym.judging.diagnoses.findings import row_of
from irl_gym.judging.diagnoses.plain_words import with_names
from irl_gym.judging.scores import RETRAINED, others
from irl_gym.mdp.policies import load_actions
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.shaping import ShapedReward
from irl_gym.records import Record
from irl_gym.runs.certificates import read_certificate
from irl_gym.runs.films import Film, load_film
from irl_gym.runs.identity import ENVIRONMENT, FIRST, STAGES, check_format, shell_command
from irl_gym.runs.reading.belonging import at_odds, left_open, misshapen, strangers
from irl_gym.runs.reading.run_reader import RunReader
from irl_gym.runs.reading.verified import FILES, Claim, again, claims, recomputed, shares, with_again
from irl_gym.runs.scorecard import read_metrics, reward_told
from irl_gym.runs.summary import in_html
from irl_gym.runs.supply import supplied
from irl_gym.spaces.listed_states import usual_observation
from irl_gym.spaces.names import state_name
from irl_gym.tables.layouts import GridLayout
from irl_gym.tables.table_files import TABLE, load_table
from irl_gym.tables.tabulation import Tabulation

METRICS = "metrics.json"


@dataclass(frozen=True, eq=False)
class Run(Record):
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
    learned: TabularReward | LinearReward | None
    """The recovered reward, of rows or of observations; None of a learner of policies alone."""
    expert: np.ndarray | None
    """(S,) actions, or (S, A) probabilities with rows of NaN where nothing is known; None where there is no table."""
    agents: Mapping[str, np.ndarray]
    """(S,) actions, or (S, A), of the retrained agent, the learner's own policy and the clone, by their names in metrics.json;
    none without a table."""
    certificate: Mapping[str, Any]
    """The content of certificate.json; where `recomputed`, its optimality is not the record's but of these files."""
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
    """breakpoints (k+1,), rewards (k, S) or (k, S, A), margins (k, S), l1_norms (k,), total_margins (k,); exact, whether these
    are all pieces, and gap, what others can be worth; r_max and margin_cap of its program, NaN where margins have no cap."""
    vouched: bool
    """Is a digest recorded of each file that was read here? They were compared. False: an earlier version made the run."""
    recomputed: bool = False
    """Is what certificate and metrics say of the expert under the reward computed from these files, not the run's record?"""
    judged_again: bool = False
    """And what they say of values, scores, agreement, the worst tie and distances between rewards?"""

    @property
    def agent(self) -> np.ndarray | None:
        """(S,) actions of the retrained agent, or (S, A); None where there is none, or no table."""
        return self.agents.get(RETRAINED)

    @property
    def tabular(self) -> TabularReward | None:
        """The recovered reward on the rows of the table; None where there is none."""
        return None if self.table is None or self.learned is None else self.learned.tabular(self.table.states)

    @property
    def command(self) -> str | None:
        """The command that reproduces the run, for a shell; None where it was started from Python, or nobody noted it."""
        return shell_command(self.version.get("command"))

    @property
    def caution(self) -> str | None:
        """What is to be said of files that no digests vouch for; None where some do."""
        return None if self.vouched else "Nothing vouches for this run's files: as in earlier versions, no digests are kept."

    @property
    def whose(self) -> str:
        """Whose word it is, what is said of the run."""
        again = ("whether the expert is optimal under the reward",) if self.recomputed else ()
        if self.judged_again:
            of_reward = () if self.learned is None else ("the worst tie", "distances between rewards")
            again += ("values, scores and agreement", *of_reward, "the size of the table")
        if not again:
            return "Everything is the run's own record."
        of = ("the value of its expert's episodes",) if self.config.get("dataset") is not None else ()
        of += ("values by episodes",) if any("sampled_value" in row for row in self.metrics["policies"].values()) else ()
        of += tuple(f"what is said of {name}" for name in others(self.metrics["policies"]) if name not in self.agents)
        among = f", and among it {' and '.join(of)}" if of else ""
        return f"Computed again from its files: {'; '.join(again)}. All else is the run's own record{among}."

    def _repr_html_(self) -> str:
        return in_html(self.path, self.env_id, self.config, self.metrics, self.whose)

    def place_name(self, state: int, action: int | None = None) -> str:
        """A state, or a state and an action, by number, with their names behind where there is a table."""
        return row_of(state, action) if self.table is None else with_names(state, action, self.state_name, self.actions)

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
        RunIncomplete: no run, one that was killed before its end, or a file of it is gone, damaged, or not the one it left.
        RunConflict: no run of this library, or one with a link that leads out of its folder.
        RunNewer: a newer version wrote it.
    """
    path = Path(path)
    if not (path / "config.json").is_file():
        raise RunIncomplete(f"{path} holds no run: expected a folder with a config.json. Name the --out of a run.")
    check_links(path)
    reader = RunReader(path)
    older = not (path / "run.json").exists()
    version: dict[str, Any] = {} if older else reader.read("run.json", read_json)
    check_format(path, version)
    if not older:
        reader.read("run.json", lambda _: checked(version, Version))
    reader.command = version.get("command")
    config = reader.read("config.json", lambda one: read_json(one, Config))
    records = {name: record for name in (START, *STAGES) if (record := reader.record(name)) is not None}
    stages = {name: record for name, record in records.items() if name != START}
    for name in FIRST if older else STAGES[:-1]:
        if name not in stages:
            raise reader.incomplete(f"the stage {name!r} was not finished")
    for record in records.values():
        reader.check(record)
    env_id, observations, names = reader.environment()
    if config.get("env_id") not in (None, env_id):
        what = f"{ENVIRONMENT} is of {env_id!r}: expected {config['env_id']!r}, as config.json has"
        raise reader.incomplete(f"{what}; delete {ENVIRONMENT}, and it is written again")
    metrics, certificate = reader.read(METRICS, read_metrics), reader.read("certificate.json", read_certificate)
    there = {name for name in ("reward.npz", TABLE) if (path / name).exists()}
    for fault in at_odds(stages, metrics, certificate, there):
        raise reader.incomplete(fault)
    on_table, retrained = metrics.get("table") is not None, RETRAINED in metrics["policies"]
    judged = [name for name in FILES if on_table and name in metrics["policies"]]
    run = Run(
        path=path, config=config, version=version, env_id=env_id, actions=names,
        table=(table or _table(reader, config, observations)) if on_table else None,
        learned=reader.read("reward.npz", load_reward) if retrained else None,
        expert=reader.read("expert.npz", load_actions) if on_table else None,
        agents={name: reader.read(FILES[name], load_actions) for name in judged},
        certificate=certificate, metrics=metrics,
        curve=reader.read("learning_curve.csv", read_curve) if retrained else NO_CURVE, stages=stages,
        grid=reader.maybe("grid.json", lambda one: GridLayout.from_json(read_json(one, Grid))),
        films={name: reader.read(f"films/{name}.json", load_film) for name in ("expert", "agent")
               if (path / "films" / f"{name}.json").exists()},
        diagnosis=reader.maybe("diagnosis.json", lambda one: read_json(one, Diagnosed)),
        widths=reader.maybe("ambiguity.npz", lambda one: _part(one, "widths")),
        lambda_path=reader.maybe("ambiguity.npz", lambda one: _part(one, "path")),
        vouched=reader.files <= {name for one in records.values() for name in one.get("sha256", ())},
    )  # fmt: skip
    supplied(_check_together, run, reader=reader)
    return replace(run, **supplied(_computed, run, reader=reader))


def _table(reader: RunReader, config: Mapping[str, Any], observations: spaces.Space) -> Tabulation:
    """The table that is kept, also of cells."""
    if config.get("bins") is not None and not (reader.path / TABLE).exists():
        raise reader.incomplete(
            f"it has no {TABLE} of its cells (earlier versions kept none; nor is one kept of coordinates that a class of your "
            "own shows), and no environment is made to read a run; in Python, `read_run(path, discretize(env, ...))` reads it"
        )
    return reader.read(TABLE, lambda path: load_table(path, observations))


def _check_together(
    table: Tabulation | None, learned: TabularReward | LinearReward | None, expert: np.ndarray | None,
    agents: Mapping[str, np.ndarray], actions: tuple[str, ...], grid: GridLayout | None, diagnosis: Mapping[str, Any] | None,
    widths: Mapping[str, np.ndarray] | None, lambda_path: Mapping[str, Any] | None, reader: RunReader,
) -> None:  # fmt: skip
    """Check that what lies beside a table is of that table.

    Raises:
        RunIncomplete: something is not, by the name of its file.
    """
    if table is None:
        return
    rewards = {} if learned is None or learned.alpha is not None else {"reward.npz": learned.values}  # weights are of features
    policies = {} if expert is None else {"expert.npz": expert}
    policies |= {FILES[name]: one for name, one in agents.items()}
    shape = table.mdp.n_states, table.mdp.n_actions
    found = strangers(shape, actions, rewards, policies, grid, diagnosis)
    for fault in itertools.chain(found, left_open(shape, widths, lambda_path)):
        raise reader.incomplete(fault)


def _computed(
    path: Path, config: Mapping[str, Any], stages: Mapping[str, Mapping[str, Any]], certificate: Mapping[str, Any],
    metrics: Mapping[str, Any], table: Tabulation | None, expert: np.ndarray | None,
    agents: Mapping[str, np.ndarray], tabular: TabularReward | None, curve: Curve, reader: RunReader,
) -> dict[str, Any]:  # fmt: skip
    """What metrics.json says of a run's reward and policies as its files give it now, where they do: the fields that change.

    Raises:
        RunIncomplete: they contradict what was recorded.
    """
    _check_claims(claims(config, stages, certificate, metrics, table), metrics, reader)
    recorded, metrics = metrics, with_again(metrics, {"policies": shares(metrics["policies"])})
    if table is None:
        return {"metrics": metrics}
    try:
        now = again(config, recorded, table, expert, agents, tabular, curve)
        found = None if tabular is None else recomputed(path, config, certificate, table, expert, tabular)
    except InvalidInput as error:
        what, files = "table and expert", "table.npz and expert.npz"
        if tabular is not None:
            what, files = "table, expert and reward", "table.npz, expert.npz and reward.npz"
        mend = f"delete {files}, and what they hold is made again"
        raise reader.incomplete(f"its {what} do not bear out its record: {error}; {mend}") from error
    shaped = reader.maybe("reward_shaped.npz", ShapedReward.load)  # earlier versions kept none
    cap = certificate["proof"]["terms"].get("margin_cap")
    if shaped is not None and tabular is not None and (fault := misshapen(shaped, tabular, table.mdp, cap)) is not None:
        raise reader.incomplete(fault)
    if now is not None:
        _check_claims(now[0], metrics, reader)
        metrics = with_again(metrics, now[1])
    certificate = certificate if found is None else {**certificate, "optimality": found}
    metrics = {**metrics, "reward": {**metrics["reward"], **reward_told(certificate)}}
    return {
        "certificate": certificate, "metrics": metrics, "recomputed": found is not None, "judged_again": now is not None,
    }  # fmt: skip


def _check_claims(told: Iterable[Claim], metrics: Mapping[str, Any], reader: RunReader) -> None:
    for one in told:
        if (fault := one.fault(metrics)) is not None:
            raise reader.incomplete(fault)


def _part(path: Path, name: str) -> dict[str, Any] | None:
    """The arrays whose names begin so."""
    return {key.removeprefix(f"{name}."): one for key, one in read_arrays(path).items() if key.startswith(f"{name}.")} or None
