"""What a run's files say that no run says: it is named, with its file, its value and what was expected."""

import json
import re

import numpy as np
import pytest

from irl_gym.errors import RunIncomplete
from irl_gym.files.run_folder import read_json, write_json
from irl_gym.runs.run import read_run

TIED = {"name": "ties", "sentence": "Tied in {where}.", "mend": "x", "states": [5, 6], "actions": [0, 1], "flags": []}
"""A finding of the doctor, in json."""


def put(content, to, value):
    """Content of json with one entry changed, by its dotted name; `...` leaves it out."""
    *before, last = to.split(".")
    holder = content
    for key in before:
        holder = holder[int(key)] if isinstance(holder, list) else holder[key]
    holder[last] = value
    if value is ...:
        del holder[last]


@pytest.mark.parametrize(
    ("name", "entry", "value", "told"),
    [
        ("metrics.json", "policies", None, "its policies is None: expected an object"),
        ("metrics.json", "policies.expert.value", True, "its policies.expert.value is True: expected a number"),
        (
            "metrics.json",
            "policies.retrained",
            ...,
            "its policies is .*: expected a policy that is judged, beside",
        ),
        ("metrics.json", "reward.status", "splendid", "its reward.status is 'splendid': expected one of optimal, learned"),
        ("metrics.json", "table.states", 16.5, "its table.states is 16.5: expected a whole number"),
        ("certificate.json", "optimality.margin", "wide", "its optimality.margin is 'wide': expected a list"),
        (
            "certificate.json",
            "proof.terms.objective",
            float("nan"),
            "it is no json of text and numbers: NaN is no finite number",
        ),
        ("config.json", "learner", "FiniteLP", "its learner is 'FiniteLP': expected an object"),
        ("config.json", "seed", ..., "its seed is missing: expected it"),
        ("run.json", "command", [7], "its command.0 is 7: expected a text"),
        ("environment.json", "actions", "left", "its actions is 'left': expected a list"),
        ("diagnosis.json", "answer", "well", "its answer is 'well': expected 'healthy', 'findings' or 'not examined'"),
        ("diagnosis.json", "answer", "findings", "it is .*: expected findings where that is the answer, and else none"),
        ("grid.json", "shape", [4, -4], "its shape.1 is -4: expected greater than or equal to 1"),
        ("films/agent.json", "kind", "../x", "its kind is '../x': expected 'webp' or 'png'"),
        (".stages/reward.json", "seconds", "long", "its seconds is 'long': expected a number"),
        (".stages/reward.json", "files", ["../x"], "it is of '../x': expected a file in the folder"),
        (".stages/reward.json", "files", ["é" * 200], "it is of 'é.*: expected a file in the folder"),
    ],
)
def test_an_entry_that_no_run_says_is_named_with_its_file_and_what_was_expected(unvouched, name, entry, value, told):
    content = read_json(unvouched / name)
    put(content, entry, value)
    (unvouched / name).write_text(json.dumps(content))
    with pytest.raises(RunIncomplete, match=rf"{re.escape(name)} cannot be read.*{told}"):
        read_run(unvouched)


@pytest.mark.parametrize(
    ("name", "entry", "value", "told"),
    [
        ("environment.json", "actions", ["left"], "environment.json names 1 actions, but the table has 4"),
        ("grid.json", "shape", [2, 2], "grid.json cannot be read"),
        ("diagnosis.json", "findings", [TIED | {"states": [5, 99]}], "has 99 among the states of 'ties', of 16 in the table"),
        ("diagnosis.json", "findings", [TIED | {"actions": [4, 0]}], "has 4 among the actions of 'ties', of 4 in the table"),
        ("diagnosis.json", "findings", [TIED | {"actions": [0]}], "cannot be read.*expected an action for each of its states"),
        ("diagnosis.json", "findings", [TIED | {"states": [-1, 5]}], "cannot be read.*expected greater than or equal to 0"),
        ("diagnosis.json", "findings", [TIED | {"states": ["5", 6]}], "cannot be read.*expected a whole number"),
    ],
)  # fmt: skip
def test_an_entry_of_another_table_is_named_with_its_file(unvouched, name, entry, value, told):
    content = read_json(unvouched / name)
    put(content, entry, value)
    write_json(unvouched / name, content | ({"answer": "findings"} if entry == "findings" else {}))
    with pytest.raises(RunIncomplete, match=told):
        read_run(unvouched)


@pytest.mark.parametrize("change", [
    {"widths.low": np.zeros(15)}, {"path.rewards": np.zeros((3, 15))}, {"path.margins": np.full((18, 16), np.inf)},
    {"path.r_max": np.array(0.0)}, {"path.margin_cap": np.array(-1.0)},
    {"path.total_margins": np.zeros(3)}, {"path.breakpoints": np.full(19, -1.0)},
])  # fmt: skip
def test_what_is_left_open_of_another_table_is_named(unvouched, change):
    with np.load(unvouched / "ambiguity.npz") as file:
        arrays = {**file} | change
    np.savez(unvouched / "ambiguity.npz", **arrays)
    with pytest.raises(RunIncomplete, match=r"ambiguity\.npz has .*delete it, and its stage is run again"):
        read_run(unvouched)
