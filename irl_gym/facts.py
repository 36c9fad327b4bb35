"""Facts: what an optimality, a proof or a result says of itself, each in a sentence that is written once, where it is known.

Terminal, page and comparison print facts, and do not ask who tells them. A fact that lies in a file is text that anybody may
have written: `facts_of` reads it.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from irl_gym.errors import DamagedFile

Mood = Literal["good", "open", "bad", "plain"]
"""Is it as one would wish, undecided, not as one would wish, or neither?"""
MOST_FACTS, LONGEST_LABEL, LONGEST_SENTENCE = 100, 80, 1_000
"""What a file may hold; none that this library writes comes near."""


@dataclass(frozen=True)
class Fact:
    """One thing that is the case."""

    label: str
    """What it is about, in a few words."""
    sentence: str
    """What is the case, as a person reads it: behind the label, without a full stop."""
    mood: Mood = "plain"

    def to_json(self) -> dict[str, str]:
        """As json holds it."""
        return {"label": self.label, "sentence": self.sentence, "mood": self.mood}


def facts_of(told: Any) -> tuple[Fact, ...]:
    """Facts as json held them; what a terminal would obey in them is spelled out.

    Raises:
        DamagedFile: something else than facts.
    """
    if not isinstance(told, list) or len(told) > MOST_FACTS:
        raise DamagedFile(f"facts are {told!r:.60}: expected a list of at most {MOST_FACTS}.")
    return tuple(_fact(i, one) for i, one in enumerate(told))


def _fact(i: int, told: Any) -> Fact:
    if not isinstance(told, dict) or set(told) != {"label", "sentence", "mood"}:
        raise DamagedFile(f"facts[{i}] is {told!r:.60}: expected a label, a sentence and a mood.")
    for key, longest in (("label", LONGEST_LABEL), ("sentence", LONGEST_SENTENCE)):
        if not isinstance(told[key], str) or len(told[key]) > longest:
            raise DamagedFile(f"facts[{i}] has the {key} {told[key]!r:.60}: expected text of at most {longest} characters.")
    if told["mood"] not in get_args(Mood):
        raise DamagedFile(f"facts[{i}] has the mood {told['mood']!r:.60}: expected one of {', '.join(get_args(Mood))}.")
    return Fact(one_line(told["label"]), one_line(told["sentence"]), told["mood"])


def harmless(text: str) -> str:
    """A text that may be out of a file, without what a terminal obeys: controls, and marks that turn its direction."""
    return "".join(one if one.isprintable() or one == "\n" else ascii(one)[1:-1] for one in text)


def one_line(text: str) -> str:
    """The same in one line, which nobody takes for two."""
    return harmless(text).replace("\n", "\\n")


def in_lines(told: Any) -> Any:
    """Content of json, with every name and every text of it harmless and in one line."""
    if isinstance(told, dict):
        return {one_line(key): in_lines(value) for key, value in told.items()}
    if isinstance(told, list | tuple):
        return [in_lines(one) for one in told]
    return one_line(told) if isinstance(told, str) else told


def aligned(facts: Iterable[Fact]) -> str:
    """Facts in lines that a person reads, their sentences one below the other."""
    told = tuple(facts)
    width = max((len(one.label) for one in told), default=0)
    return "\n".join(f"{one.label:<{width}}   {one.sentence}" for one in told)


def counted(n: int, noun: str = "state", plural: str | None = None) -> str:
    """A count with its noun: 1 state, 3 states."""
    return f"{n:,} {noun if n == 1 else plural or noun + 's'}"


def plain(record: Any, *properties: str) -> dict[str, Any]:
    """The fields of a record, and some of its properties, as json holds them: NaN and infinity become None."""
    found: dict[str, Any] = {}
    for name in (*record.__dataclass_fields__, *properties):
        value = getattr(record, name)
        if isinstance(value, np.ndarray):
            found[name] = [None if v != v else v for v in value.tolist()]
        else:
            found[name] = None if isinstance(value, float) and not math.isfinite(value) else value
    return found
