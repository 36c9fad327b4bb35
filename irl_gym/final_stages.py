"""The last stages of a run: what is left on disk for who looks at it later.

record      films/, grid.json, metrics.csv: episodes to watch, where the states lie, the figures for other tools
ambiguity   ambiguity.npz, diagnosis.json: how far the reward is left open, and what the doctor says of it
report      report.html, from what is on disk alone
"""

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from irl_gym.ambiguity.lambda_path import lambda_path
from irl_gym.ambiguity.widths import feasible_widths
from irl_gym.diagnoses.case import Case
from irl_gym.diagnosis import Diagnosis, diagnose, weights_of
from irl_gym.errors import IrlGymError
from irl_gym.figures import layout_of
from irl_gym.filming import film
from irl_gym.learners.finite import FiniteLP
from irl_gym.mdp import TabularMDP
from irl_gym.metrics_csv import write_metrics_csv
from irl_gym.page.report import write_report
from irl_gym.page.slider import MOST_PIECES
from irl_gym.run_folder import write_json
from irl_gym.runs import read_run
from irl_gym.status import Status
from irl_gym.worlds import TableWorld

if TYPE_CHECKING:
    from irl_gym.loop import Loop

FILMS = ("expert", "agent")
MOST_STATES = 500
"""States to act in, of a table whose feasible set is examined."""
MOST_STEPS = 2_500
"""Rewards of steps that are asked about; two programs each."""


def record(loop: "Loop", folder: Path) -> dict[str, Any]:
    """Write films, map and csv; tell which films have no pictures, and why."""
    (folder / "films").mkdir()
    without = {}
    for name in FILMS:
        made = film(loop, name)
        made.save(folder / "films")
        if made.without_frames is not None:
            without[name] = made.without_frames
    layout = layout_of(loop.env, loop.world) if isinstance(loop.world, TableWorld) else None
    if layout is not None:
        write_json(folder / "grid.json", layout.to_json())
    write_metrics_csv(loop.folder_metrics, folder / "metrics.csv", env=loop.env_id, config=loop.experiment.to_json())
    return {"without_frames": without}


def ambiguity(loop: "Loop", folder: Path) -> dict[str, Any]:
    """Write what the doctor says; for small tables how wide the feasible set is and how the reward depends on lambda.

    Size decides, not time, so that the same seed leaves the same files. An examination that fails does not undo the run:
    the diagnosis or the record says why.
    """
    told: dict[str, Any] = {}
    try:
        found = diagnose(_case(loop))
    except IrlGymError as error:
        found = Diagnosis((), "", f"the examination failed ({type(error).__name__}: {error})")
    write_json(folder / "diagnosis.json", found.to_json())
    why = _too_much(loop)
    if why is not None:
        return told | {"no_ambiguity": why}
    arrays = {}
    assert isinstance(loop.world, TableWorld)  # or there is too much
    for name, examine in (("widths", _widths), ("path", _path)):
        try:
            arrays |= {f"{name}.{key}": value for key, value in examine(loop, loop.world.table.mdp).items()}
        except IrlGymError as error:
            told[f"no_{name}"] = f"{type(error).__name__}: {error}"
    np.savez(folder / "ambiguity.npz", **arrays)
    return told


def _case(loop: "Loop") -> Case:
    """The evidence that the doctor works on, of a table or, without one, of the certificate alone."""
    made = loop.stage("reward")
    without = Case(
        claims=loop.certificate, status=Status(made["status"]), stats=made["stats"], judged=loop.folder_metrics,
        weights=weights_of(loop.learned),
    )  # fmt: skip
    if not isinstance(loop.world, TableWorld):
        return without
    table = loop.world.table
    return replace(
        without, mdp=table.mdp, expert=loop.known_expert, reward=loop.world.tabular(loop.learned), true=table.reward,
        shaped=loop.shaped,
    )  # fmt: skip


def _too_much(loop: "Loop") -> str | None:
    """Why the feasible set is not examined; None where it is."""
    learner, world = loop.experiment.learner, loop.world
    if not isinstance(learner, FiniteLP) or not isinstance(world, TableWorld):
        return f"the learner is {type(learner).__name__}: only FiniteLP's reward is examined"
    mdp = world.table.mdp
    n = int((mdp.reachable & ~mdp.terminal).sum())
    steps = n * mdp.n_actions if learner.reward_on == "state-action" else 0
    if n > MOST_STATES:
        return f"there are {n:,} states to act in: it is worked out for at most {MOST_STATES}"
    if steps > MOST_STEPS:
        return f"there are {steps:,} states and actions: it is worked out for at most {MOST_STEPS:,}"
    return None


def _widths(loop: "Loop", mdp: TabularMDP) -> dict[str, np.ndarray]:
    """How far apart the rewards of one state can be, or of one step."""
    learner: Any = loop.experiment.learner
    found = feasible_widths(mdp, loop.known_expert, r_max=learner.r_max, reward_on=learner.reward_on)
    return {"low": found.low, "high": found.high, "width": found.width}


def _path(loop: "Loop", mdp: TabularMDP) -> dict[str, np.ndarray]:
    """How the reward changes with lambda, with the cap on margins that the run's own program had."""
    learner: Any = loop.experiment.learner
    found = lambda_path(
        mdp,
        loop.known_expert,
        r_max=learner.r_max,
        margin_cap=loop.certificate["margin_cap"],
        reward_on=learner.reward_on,
        most_pieces=MOST_PIECES,
    )
    arrays = {name: getattr(found, name) for name in ("breakpoints", "rewards", "margins", "l1_norms", "total_margins")}
    arrays |= {"gap": np.array(found.gap), "exact": np.array(found.exact)}
    return arrays | {"changes": np.array(json.dumps([change.to_json() for change in found.changes]))}


def report(loop: "Loop", folder: Path) -> dict[str, Any]:
    """Write the page, from what is on disk; the table is at hand."""
    table = loop.world.table if isinstance(loop.world, TableWorld) else None
    write_report(read_run(loop.folder.path, table), folder / "report.html")
    return {}
