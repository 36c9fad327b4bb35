"""How numbers are written for people: few digits, thousands apart, and a word where there is none."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from irl_gym.facts import counted as counted
from irl_gym.intervals import TOO_FEW, Interval

MISSING = "not known"
ROUNDING = 1e-9
"""Rewards and values below this are 0."""


def number(value: Any, digits: int = 4) -> str:
    """A number in a few significant digits, or that it is not known."""
    if value is None or isinstance(value, str | bool) or not math.isfinite(value):
        return str(value) if isinstance(value, str) else MISSING
    if float(value) == round(value) and abs(value) < 1e15:
        return f"{int(value):,}"
    size = abs(value)
    if size < 1e-3 or size >= 1e7:
        return f"{value:.{max(digits - 2, 1)}e}"
    decimals = max(digits - 1 - math.floor(math.log10(size)), 0)
    text = f"{value:,.{decimals}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def sum_of(value: float, digits: int = 4) -> str:
    """A sum of rewards, without what rounding leaves of 0."""
    return number(0.0 if abs(value) < ROUNDING else value, digits)


def aligned(values: np.ndarray) -> list[str]:
    """Numbers of one column: as many decimals as its largest needs, and what is too small for them said in words."""
    largest = float(np.abs(values).max(initial=0.0))
    decimals = min(max(3 - math.floor(math.log10(largest)), 0), 12) if largest > 0 else 0
    least = 10.0**-decimals
    return [
        "0"
        if abs(one) < ROUNDING * max(largest, 1.0)
        else f"below {least:.{decimals}f}"
        if 0 < one < least
        else f"{one:,.{decimals}f}"
        for one in np.asarray(values, dtype=float).tolist()
    ]


def percent(share: Any) -> str:
    """A share as per cent with one decimal; 100.0 only where nothing is missing."""
    if share is not None and 0.9995 <= share < 1 - 1e-6:
        return "over 99.9\u00a0%"
    return (
        MISSING if share is None or not math.isfinite(share) else f"{share:.1%}".replace("%", "\u00a0%").replace("-0.0", "0.0")
    )


def with_ends(found: Interval, how: Callable[[Any], str] = number) -> str:
    """An estimate with its interval, or that there are too few values to say."""
    return f"{how(found.estimate)} " + (f"({how(found.low)} to {how(found.high)})" if found.known else f"({TOO_FEW})")


def seconds(value: Any) -> str:
    """A time: 0.8 s, 12 s, 3 min 05 s."""
    if value is None:
        return MISSING
    if value < 120:
        return f"{value:.1f}\u00a0s" if value < 10 else f"{value:.0f}\u00a0s"
    minutes, rest = divmod(round(value), 60)
    return f"{minutes}\u00a0min {rest:02d}\u00a0s"


def state_called(name: str) -> str:
    """What a state is called where names stand alone: a bare number says what it is of, and a flag of 0 or 1 what it says."""
    if name.isdecimal():
        return f"state {name}"
    return (
        name.removesuffix(", natural 0") + ", no natural"
        if name.endswith(", natural 0")
        else name.replace(", natural 1", ", a natural")
    )


def sentence_of(text: Any) -> str:
    """A reason as a sentence: with a capital and a full stop; nothing where there is none."""
    told = str(text or "").strip()
    return told and f"{told[0].upper()}{told[1:]}{'' if told[-1] in '.!?' else '.'}"


def listed(values: np.ndarray, digits: int = 5) -> Any:
    """Nested lists of an array as json holds them: few digits, None for NaN and for infinities."""
    array = np.asarray(values)
    if array.ndim > 1:
        return [listed(row, digits) for row in array]
    if array.dtype.kind in "biu":
        return array.tolist()
    return [None if not math.isfinite(one) else _short(one, digits) for one in array.tolist()]


def _short(value: float, digits: int) -> float | int:
    """The number that `digits` significant digits write; a whole number without its point."""
    short = float(f"{value:.{digits}g}")
    return int(short) if short == int(short) and abs(short) < 1e15 else short
