"""How the page writes numbers: few digits, thousands apart, and a word where there is none."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

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


def percent(share: Any) -> str:
    """A share as per cent with one decimal."""
    return (
        MISSING if share is None or not math.isfinite(share) else f"{share:.1%}".replace("%", "\u00a0%").replace("-0.0", "0.0")
    )


def interval(row: Mapping[str, Any]) -> str:
    """A mean return with its 95 % interval."""
    return f"{number(row['mean_return'])} ({number(row['return_low'])} to {number(row['return_high'])})"


def seconds(value: Any) -> str:
    """A time: 0.8 s, 12 s, 3 min 05 s."""
    if value is None:
        return MISSING
    if value < 120:
        return f"{value:.1f}\u00a0s" if value < 10 else f"{value:.0f}\u00a0s"
    minutes, rest = divmod(round(value), 60)
    return f"{minutes}\u00a0min {rest:02d}\u00a0s"


def counted(n: int, singular: str, plural: str | None = None) -> str:
    """A count with its noun: 1 state, 3 states."""
    return f"{n:,} {singular if n == 1 else plural or singular + 's'}"


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
