"""The last stages of a run: what is left on disk for who looks at it later.

record      films/, grid.json, metrics.csv: episodes to watch, where the states lie, the figures for other tools
ambiguity   ambiguity.npz, diagnosis.json: how far the reward is left open, and what the doctor says of it
report      report.html, from what is on disk alone
Parts are those of `irl_gym.loop.loop.Loop.sources`.
"""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from irl_gym.errors import IrlGymError
from irl_gym.features.linear_reward import LinearReward
from irl_gym.files.run_folder import write_json
from irl_gym.judging.ambiguity.lambda_path import lambda_path
from irl_gym.judging.ambiguity.widths import feasible_widths
from irl_gym.judging.diagnoses.case import Case
from irl_gym.judging.diagnoses.doctor import Diagnosis, diagnose
from irl_gym.judging.diagnoses.findings import NO_REWARD
from irl_gym.learners.base import Learner
from irl_gym.loop.filming import film
from irl_gym.loop.worlds import RunWorld
from irl_gym.mdp.episodes import Episode, seen_parts
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.programs.status import Status
from irl_gym.reports.page.report import write_report
from irl_gym.reports.page.sections.slider import MOST_PIECES
from irl_gym.runs.certificates import claims_in
from irl_gym.runs.metrics_csv import write_metrics_csv
from irl_gym.runs.run import read_run
from irl_gym.tables.layouts import GridLayout
from irl_gym.tables.tabulation import Tabulation

MOST_STATES = 500
"""States to act in, of a table whose feasible set is examined."""
MOST_STEPS = 2_500
"""Rewards of steps that are asked about; two programs each."""


def films(
    folder: Path, world: RunWorld, env: gym.Env, env_id: str | None, given: list[Episode] | None, demonstrations: list[Episode],
    expert: Any, agent: Any, learned_policy: Any, learned: TabularReward | LinearReward | None, seed: int,
) -> dict[str, Any]:  # fmt: skip
    """An episode of the expert, the first of a dataset where one was given, and one of the agent, which without a reward is the
    learner's; why some have no pictures.
    """
    (folder / "films").mkdir()
    first = world.chooser(expert, seed) if given is None else (seen_parts(demonstrations) or demonstrations)[0]
    without = {}
    shown_agent = world.chooser(learned_policy if agent is None else agent, seed)
    for name, shown in {"expert": first, "agent": shown_agent}.items():
        made = film(name, env, shown, seed, partial(world.pays, learned), env_id)
        made.save(folder / "films")
        if made.without_frames is not None:
            without[name] = made.without_frames
    return {"without_frames": without}


def grid(folder: Path, layout: GridLayout) -> dict[str, Any]:
    """The map."""
    write_json(folder / "grid.json", layout.to_json())
    return {}


def figures_as_csv(folder: Path, judged: Mapping[str, Any], env_id: str | None, config: Mapping[str, Any]) -> dict[str, Any]:
    """What was measured, for other tools."""
    write_metrics_csv(judged, folder / "metrics.csv", env=env_id, config=config)
    return {}


def diagnosis(
    folder: Path, mdp: TabularMDP | None, known_expert: Any, learned: TabularReward | LinearReward | None,
    tabular: TabularReward | None, true: TabularReward | None, certificate: Mapping[str, Any], solved: Mapping[str, Any],
    shaping: bool, judged: Mapping[str, Any],
) -> dict[str, Any]:  # fmt: skip
    """What the doctor says. An examination that fails does not undo the run: the diagnosis says why."""
    status, weights = Status(solved["status"]), None if learned is None else learned.alpha
    claims = claims_in(certificate)
    case = Case(mdp, known_expert, tabular, claims, status, solved["stats"], true, shaping, judged, weights)
    try:
        found = NO_REWARD if learned is None else diagnose(case)
    except IrlGymError as error:
        found = Diagnosis((), "", f"the examination failed ({type(error).__name__}: {error})")
    write_json(folder / "diagnosis.json", found.to_json())
    return {}


def feasible_set(folder: Path, learner: Learner, mdp: Any, known_expert: Any, certificate: Mapping[str, Any]) -> dict[str, Any]:
    """For small tables how wide the feasible set is, and how the reward depends on lambda; why not, where it is not examined.

    Size decides, not time, so that the same seed leaves the same files.
    """
    why = _too_much(learner, mdp)
    if why is not None:
        return {"no_ambiguity": why}
    told, arrays = {}, {}
    path = partial(_path, margin_cap=certificate["proof"]["terms"].get("margin_cap"))
    for name, examine in (("widths", _widths), ("path", path)):
        try:
            found = examine(learner, mdp, known_expert)
            arrays |= {f"{name}.{key}": value for key, value in found.items()}
        except IrlGymError as error:
            told[f"no_{name}"] = f"{type(error).__name__}: {error}"
    np.savez(folder / "ambiguity.npz", **arrays)
    return told


def _too_much(learner: Any, mdp: TabularMDP | None) -> str | None:
    """Why the feasible set is not examined; None where it is."""
    if not getattr(learner, "of_feasible_set", False):
        return f"{type(learner).__name__} does not say that its reward is one of the feasible set"
    for name, what in (("r_max", "the bound on its rewards"), ("reward_on", '"state" or "state-action"')):
        if not hasattr(learner, name):
            return f"{type(learner).__name__} says that its reward is one of the feasible set, and has no {name}, {what}"
    if mdp is None:
        return "there is no table to work it out on"
    n = int((mdp.reachable & ~mdp.terminal).sum())
    steps = n * mdp.n_actions if learner.reward_on == "state-action" else 0
    if n > MOST_STATES:
        return f"there are {n:,} states to act in: it is worked out for at most {MOST_STATES}"
    if steps > MOST_STEPS:
        return f"there are {steps:,} states and actions: it is worked out for at most {MOST_STEPS:,}"
    return None


def _widths(learner: Any, mdp: TabularMDP, expert: Any) -> dict[str, np.ndarray]:
    """How far apart the rewards of one state can be, or of one step."""
    found = feasible_widths(mdp, expert, r_max=learner.r_max, reward_on=learner.reward_on)
    return {"low": found.low, "high": found.high, "width": found.width}


def _path(learner: Any, mdp: TabularMDP, expert: Any, *, margin_cap: float | None) -> dict[str, np.ndarray]:
    """How the reward changes with lambda, with the cap on margins that the run's own program had."""
    found = lambda_path(
        mdp,
        expert,
        r_max=learner.r_max,
        margin_cap=margin_cap,
        reward_on=learner.reward_on,
        most_pieces=MOST_PIECES,
    )
    arrays = {name: getattr(found, name) for name in ("breakpoints", "rewards", "margins", "l1_norms", "total_margins")}
    cap = np.nan if found.margin_cap is None else found.margin_cap
    numbers = {"gap": found.gap, "r_max": found.r_max, "margin_cap": cap}
    return arrays | {name: np.array(one, dtype=float) for name, one in numbers.items()} | {"exact": np.array(found.exact)}


def report(folder: Path, path: Path, table: Tabulation | None) -> dict[str, Any]:
    """The page, from what is on disk; the table is at hand."""
    write_report(read_run(path, table), folder / "report.html")
    return {}
