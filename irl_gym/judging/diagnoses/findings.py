"""What the doctor says: findings, each a sentence and a mend, and the diagnosis that they make."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from irl_gym._typing import Indices
from irl_gym.facts import counted as counted
from irl_gym.records import Record

MOST_NAMED = 5
"""States that a sentence names; the others are counted."""
WHERE = "{where}"
"""Stands in a sentence for its states and actions: whoever tells it names them for its reader (`told_finding`)."""


@dataclass(frozen=True, eq=False)
class Finding(Record):
    """One thing that is wrong, or that makes the reward less useful than it could be."""

    name: str
    """Short and fixed, such as "lambda-above-lambda-0"."""
    sentence: str
    """What is the case, with numbers; `WHERE` in it stands for the states and actions."""
    mend: str
    """What to do about it."""
    states: Indices = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    """(k,) rows of the table that it is about; none where it is about all of it."""
    actions: tuple[int, ...] = ()
    """k actions, one for each of the states, which are repeated where several actions are meant; or none."""
    flags: tuple[str, ...] = ()
    """What the mend, the first where there are several, is on the command line of `irl-gym run`: flags that go
    together, such as "--l1 0"; without a value where that is the reader's to choose, such as "--episodes". Or none."""

    def to_json(self) -> dict[str, Any]:
        """As json holds it."""
        return {
            "name": self.name,
            "sentence": self.sentence,
            "mend": self.mend,
            "states": self.states.tolist(),
            "actions": list(self.actions),
            "flags": list(self.flags),
        }


Health = Literal["healthy", "findings", "not examined"]


@dataclass(frozen=True, eq=False)
class Diagnosis(Record):
    """All that the doctor found."""

    findings: tuple[Finding, ...]
    """In order of importance."""
    examined: str
    """What was looked at, and what was not and why, in sentences."""
    why: str | None = None
    """Why too little could be looked at to call the reward healthy; None where enough was."""

    @property
    def answer(self) -> Health:
        """What is wrong was found, or nothing is wrong, or that cannot be said."""
        return "findings" if self.findings else "healthy" if self.why is None else "not examined"

    @property
    def healthy(self) -> bool:
        """Was enough looked at, and nothing found?"""
        return self.answer == "healthy"

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the findings."""
        return tuple(one.name for one in self.findings)

    def __str__(self) -> str:
        """The diagnosis as a person reads it."""
        told = [
            f"{number}. {told_finding(one.to_json())}\n   Mend: {one.mend}" for number, one in enumerate(self.findings, start=1)
        ]
        return "\n".join([f"{told_answer(self.to_json())} {self.examined}".strip(), *told])

    def to_json(self) -> dict[str, Any]:
        """As json holds it."""
        return {
            "answer": self.answer,
            "why": self.why,
            "examined": self.examined,
            "findings": [one.to_json() for one in self.findings],
        }


def told_answer(diagnosis: Mapping[str, Any]) -> str:
    """The answer of a diagnosis as json holds it, in words, with why where it was not examined."""
    if diagnosis["answer"] == "findings":
        return f"{counted(len(diagnosis['findings']), 'finding')}."
    return "Healthy." if diagnosis["answer"] == "healthy" else f"Not examined: {diagnosis['why']}."


def row_of(state: int, action: int | None = None) -> str:
    """A state, or a state and an action, by their numbers in the table."""
    return f"s={state}" if action is None else f"s={state} a={action}"


def told_finding(found: Mapping[str, Any], place: Callable[[int, int | None], str] = row_of) -> str:
    """The sentence of a finding as json holds it, with its first few states and actions, and how many more there are.

    Args:
        found: the finding.
        place: what a state is called, or a state and an action, such as `Run.place_name`.
    """
    states, actions = found["states"], found["actions"] or (None,) * len(found["states"])
    told = [place(state, action) for state, action in zip(states[:MOST_NAMED], actions[:MOST_NAMED], strict=True)]
    more = len(states) - MOST_NAMED
    return found["sentence"].replace(WHERE, f"{', '.join(told)}{f' and {more:,} more' if more > 0 else ''}", 1)


NO_REWARD = Diagnosis((), "", "the learner gives a policy, and no reward to examine")
"""Of a learner of policies."""
