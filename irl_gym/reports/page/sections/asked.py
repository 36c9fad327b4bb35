"""What was asked: what the command said, or what differs from the defaults; the configuration; and how to run it again."""

import json
import shlex
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from irl_gym.reports.page.python_code import NOT_HERE, defaults, is_part, missing, python_lines, usual
from irl_gym.reports.page.sections.section import Section
from irl_gym.runs.identity import flag_of, into_folder, ours

_NO_DEFAULT = object()


def asked(
    version: Mapping[str, Any], env_id: str | None, config: Mapping[str, Any], stages: Mapping[str, Mapping[str, Any]]
) -> Section:
    """The configuration as a table, and the command."""
    command = version.get("command")
    if command is None:
        changed = [(key, written(value)) for key, value in differing(config)]
        lead = "Listed is what differs from the defaults; everything else is below."
    else:
        changed = [("environment", str(env_id or config.get("dataset"))), *typed(command)]
        lead = "Listed is what the command asked for; everything else, most of it by default, is below."
    lost = stages.get("demonstrations", {}).get("no_environment")
    changed += [("demonstrations", str(lost))] if lost else []
    whole = json.dumps(dict(config), indent=1, sort_keys=True)
    return Section("asked", "What was asked", lead, (), "asked", {"lines": changed, "raw": whole})


def reproduce(version: Mapping[str, Any], config: Mapping[str, Any]) -> Section:
    """The command that makes the run again; where there was none, lines of Python."""
    title, command = "Run it again", version.get("command")
    if command is not None:
        lead = (
            "In the environment where irl_gym is installed this command makes the same run again, in a folder of its own: the "
            "same seed gives the same files."
        )
        if not ours(command):
            lead = "The run notes this command, which is of another program than irl_gym: look at it before you run it."
        again = shlex.join(into_folder(command))
        return Section("reproduce", title, lead, (), "command", {"command": again})
    lead = (
        "The run was started from Python."
        if version
        else "An earlier version of irl_gym made the run, which did not note how it was started."
    )
    absent = missing(config)
    if absent:
        lead += (
            f" This page cannot make it again: of some things it holds a digest or a name alone. Put your own in place of each "
            f"{NOT_HERE} in these lines: {'; '.join(absent)}."
        )
    else:
        lead += " These lines of Python make it again:"
    return Section("reproduce", title, lead, (), "command", {"command": python_lines(config)})


def typed(command: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Flags and values of a command, in its order, but for the environment and the folder, which are told elsewhere."""
    flag, values = None, list[str]()
    for word in [*map(str, command), "--"]:
        if not word.startswith("--"):
            values.append(word)
            continue
        if flag is not None and flag not in ("--env-id", "--out"):
            yield flag, " ".join(values) or "yes"
        flag, (_, equals, value) = flag_of(word), word.partition("=")
        values = [value] if equals else []


def differing(config: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Dotted names and values of what differs from the defaults; the environment and gamma, which have none, first."""
    plain = usual()
    for key in ("env_id", "gamma"):
        yield key, config.get(key)
    for key, value in config.items():
        if key in ("env_id", "gamma") or value == plain.get(key, _NO_DEFAULT):
            continue
        if is_part(key, value):
            yield from _of_part(key, value, plain.get(key))
        elif value not in (None, [], {}):
            yield key, value


def _of_part(key: str, part: Mapping[str, Any], plain: Any) -> Iterator[tuple[str, Any]]:
    """A learner or a planner: its kind where that is not the usual one, and the fields that are not its defaults."""
    if not isinstance(plain, Mapping) or plain.get("type") != part["type"]:
        yield key, part["type"]
        plain = defaults(part["type"])
    for name, value in part.items():
        if name != "type" and value != plain.get(name, _NO_DEFAULT):
            yield f"{key}.{name}", value


def written(value: Any) -> str:
    """A value of the configuration as text."""
    return value if isinstance(value, str) else json.dumps(value, sort_keys=True)
