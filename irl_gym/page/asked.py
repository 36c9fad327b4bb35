"""What was asked: what the command said, or what differs from the defaults; the configuration; and how to run it again."""

import inspect
import json
import shlex
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from irl_gym.experiment import Experiment
from irl_gym.learners.feature import FeatureLP
from irl_gym.learners.finite import FiniteLP
from irl_gym.learners.trajectory import TrajectoryLP
from irl_gym.page.sections import Section
from irl_gym.planners import SB3, ValueIteration
from irl_gym.runs import Run

PARTS = {kind.__name__: kind for kind in (FiniteLP, FeatureLP, TrajectoryLP, ValueIteration, SB3)}
"""Parts of an experiment whose defaults are known."""
_NO_DEFAULT = object()
AGAIN = "runs/again"
"""The folder of the run that is made again."""


def asked(run: Run) -> Section:
    """The configuration as a table, and the command."""
    command = run.version.get("command")
    if command is None:
        changed = [(key, written(value)) for key, value in differing(run.config)]
        lead = "Listed is what differs from the defaults; everything else is below."
    else:
        changed = [("environment", str(run.env_id or run.config.get("dataset"))), *typed(command)]
        lead = "Listed is what the command asked for; everything else, most of it by default, is below."
    whole = json.dumps(dict(run.config), indent=1, sort_keys=True)
    return Section("asked", "What was asked", lead, (), "asked", {"lines": changed, "raw": whole})


def reproduce(run: Run) -> Section:
    """The command that makes the run again; of a run from Python, the lines of Python."""
    title = "Run it again"
    if run.command is not None:
        lead = (
            "In the environment where irl_gym is installed this command makes the same run again, in a folder of its own: the "
            "same seed gives the same files."
        )
        again = shlex.join(into_new_folder(run.version["command"]))
        return Section("reproduce", title, lead, (), "command", {"command": again})
    lead = "The run was started from Python. These lines make it again:"
    return Section("reproduce", title, lead, (), "command", {"command": python_lines(run.config)})


def into_new_folder(command: Sequence[str]) -> list[str]:
    """The command with another --out: in the run's own folder everything is there already, and would be kept."""
    kept: list[str] = []
    skipped = False
    for word in map(str, command):
        if not skipped and word != "--out" and not word.startswith("--out="):
            kept.append(word)
        skipped = word == "--out"
    return [*kept, "--out", AGAIN]


def typed(command: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Flags and values of a command, in its order, but for the environment and the folder, which are told elsewhere."""
    flag, values = None, list[str]()
    for word in [*map(str, command), "--"]:
        if not word.startswith("--"):
            values.append(word)
            continue
        if flag is not None and flag not in ("--env-id", "--out"):
            yield flag, " ".join(values) or "yes"
        flag, equals, value = word.partition("=")
        values = [value] if equals else []


def differing(config: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Dotted names and values of what differs from the defaults; the environment and gamma, which have none, first."""
    plain = Experiment(env_id="any", gamma=0.5).to_json()
    for key in ("env_id", "gamma"):
        yield key, config.get(key)
    for key, value in config.items():
        if key in ("env_id", "gamma") or value == plain.get(key, _NO_DEFAULT):
            continue
        if isinstance(value, Mapping) and "type" in value:
            yield from _of_part(key, value, plain.get(key))
        elif value not in (None, [], {}):
            yield key, value


def _of_part(key: str, part: Mapping[str, Any], usual: Any) -> Iterator[tuple[str, Any]]:
    """A learner or a planner: its kind where that is not the usual one, and the fields that are not its defaults."""
    if not isinstance(usual, Mapping) or usual.get("type") != part["type"]:
        yield key, part["type"]
        usual = _defaults(part["type"])
    for name, value in part.items():
        if name != "type" and value != usual.get(name, _NO_DEFAULT):
            yield f"{key}.{name}", value


def _defaults(kind: str) -> dict[str, Any]:
    """The defaults of a part's fields, as json; fields without one are left out."""
    if kind not in PARTS:
        return {}
    return {
        name: json.loads(json.dumps(one.default, default=str))
        for name, one in inspect.signature(PARTS[kind]).parameters.items()
        if one.default is not inspect.Parameter.empty
    }


def written(value: Any) -> str:
    """A value of the configuration as text."""
    return value if isinstance(value, str) else json.dumps(value, sort_keys=True)


def python_lines(config: Mapping[str, Any]) -> str:
    """Python that makes the experiment of a configuration and runs it."""
    used: set[str] = set()
    told = []
    plain = Experiment(env_id="any", gamma=0.5).to_json()
    for key, value in config.items():
        if key in ("env_id", "gamma") or (value != plain.get(key, _NO_DEFAULT) and value is not None):
            told.append(f"    {key}={_python(value, used)},")
    names = "".join(f", {name}" for name in sorted(used))
    return "\n".join(
        [f"from irl_gym import Experiment, recover_and_retrain{names}", "", "asked = Experiment(", *told, ")",
         'report = recover_and_retrain(asked, "runs/again")']
    )  # fmt: skip


def _python(value: Any, used: set[str]) -> str:
    """A value as Python writes it; a part by its class, with the fields that are not its defaults."""
    if isinstance(value, Mapping) and isinstance(value.get("type"), str):
        used.add(value["type"])
        usual = _defaults(value["type"])
        fields = [
            f"{name}={_python(one, used)}"
            for name, one in value.items()
            if name != "type" and one != usual.get(name, _NO_DEFAULT)
        ]
        return f"{value['type']}({', '.join(fields)})"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key!r}: {_python(one, used)}" for key, one in value.items()) + "}"
    return repr(value)
