"""What changes in a learned reward where the price of ||R||_1 passes a breakpoint of the path.

A `Change` compares the rewards of the two pieces that meet. What it says of single states is of the two rewards shown: where a
piece has several optimal rewards, another choice may move other states, but not ||R||_1 and the total margin.
Axes: S states, A actions; a place is a state (n,), or a state and action (n, 2) for rewards R(s, a).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from irl_gym._typing import Indices

MOVED = 1e-7
"""A reward or margin that moves by less, relative to R_max or the cap, the smaller, does not."""
NAMED = 6
"""States that a sentence names; of more it gives the number."""


@dataclass(frozen=True, eq=False)
class Change:
    """What changes as the price rises past one breakpoint."""

    price: float
    """The breakpoint."""
    to_zero: np.ndarray
    """Places whose reward becomes 0."""
    from_zero: np.ndarray
    """Places whose reward leaves 0."""
    to_bound: np.ndarray
    """Places whose reward reaches R_max or -R_max, from 0 or the other bound included."""
    from_bound: np.ndarray
    """Places whose reward leaves R_max or -R_max."""
    moved: np.ndarray
    """Places whose reward changes otherwise: neither from nor to 0 or a bound."""
    tied: Indices
    """States whose margin falls to 0: the expert comes to tie with another action."""
    untied: Indices
    """States whose margin rises from 0: a tie is broken."""
    lowered: Indices
    """States whose margin falls, but not to 0."""
    raised: Indices
    """States whose margin rises, but not from 0."""
    l1_norm: float
    """||R||_1 beyond the breakpoint."""
    total_margin: float
    """The total margin beyond it."""
    l1_norm_change: float
    """By how much ||R||_1 changes; 0 at price 0, below 0 elsewhere."""
    total_margin_change: float
    """By how much the total margin changes; 0 at price 0, below 0 elsewhere."""

    def __str__(self) -> str:
        """The change in a sentence, places by their numbers."""
        return self.sentence(None)

    def sentence(self, name: Callable[..., str] | None) -> str:
        """The change in a sentence.

        Args:
            name: what a state is called, `name(s)`, or a state and an action, `name(s, a)`; None for their numbers.
        """
        if self.l1_norm_change == 0:
            state = f"||R||_1 is {self.l1_norm:.6g}, the total margin {self.total_margin:.6g}"
            return f"At price {self.price:.6g} the path begins: {state}."
        parts = [text for text in self._parts(name) if text]
        told = "; ".join(parts) + "; " if parts else ""
        return (
            f"At price {self.price:.6g} {told}||R||_1 falls by {-self.l1_norm_change:.6g} to {self.l1_norm:.6g}, the total "
            f"margin by {-self.total_margin_change:.6g} to {self.total_margin:.6g}."
        )

    def _parts(self, name: Callable[..., str] | None) -> Iterator[str]:
        for which, said in (
            ("to_zero", "becomes 0"), ("from_zero", "leaves 0"), ("to_bound", "reaches a bound"),
            ("from_bound", "leaves a bound"), ("moved", "moves"),
        ):  # fmt: skip
            yield _told("the reward", getattr(self, which), said, name)
        for which, said in (("tied", "falls to 0"), ("untied", "rises from 0"), ("lowered", "falls"), ("raised", "rises")):
            yield _told("the margin", getattr(self, which), said, name)

    def to_json(self) -> dict[str, Any]:
        """As json holds it."""
        values = {one.name: getattr(self, one.name) for one in fields(self)}
        return {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in values.items()}


def _told(what: str, places: np.ndarray, said: str, name: Callable[..., str] | None) -> str:
    """`the reward of states 3, 7 becomes 0`, or nothing where no place does."""
    if not len(places):
        return ""
    kind = "state" if places.ndim == 1 else "step"
    if len(places) > NAMED:
        return f"{what} of {len(places)} {kind}s {said}"
    if name is not None:
        *others, last = (f"({name(*place)})" for place in places.reshape(len(places), -1).tolist())
        return f"{what} of {', '.join(others)}{' and ' if others else ''}{last} {said}"
    names = ", ".join(str(place) if places.ndim == 1 else f"({place[0]}, {place[1]})" for place in places.tolist())
    return f"{what} of {kind}{'s' * (len(places) > 1)} {names} {said}"


def changes(
    breakpoints: np.ndarray, rewards: np.ndarray, margins: np.ndarray, totals: np.ndarray, norms: np.ndarray, *, r_max: float,
    margin_cap: float | None,
) -> tuple[Change, ...]:  # fmt: skip
    """One change for each of the k+1 breakpoints: the first is where the path begins, the last where R becomes 0.

    Args:
        breakpoints: (k+1,).
        rewards: (k, S) or (k, S, A).
        margins: (k, S), NaN where there is none.
        totals: (k,) total margins.
        norms: (k,) ||R||_1.
        r_max: bound on |R|.
        margin_cap: cap on margins; None where there is none.
    """
    unit = r_max if margin_cap is None else min(r_max, margin_cap)
    R = np.concatenate([rewards[:1], rewards, np.zeros_like(rewards[:1])])
    flat = np.where(np.isnan(margins[:1]), np.nan, 0.0)
    M = np.concatenate([margins[:1], margins, flat])
    T, N = np.concatenate([totals[:1], totals, [0.0]]), np.concatenate([norms[:1], norms, [0.0]])
    return tuple(
        _change(float(price), R[i : i + 2], M[i : i + 2], T[i : i + 2], N[i : i + 2], r_max, MOVED * unit)
        for i, price in enumerate(breakpoints)
    )


def _change(
    price: float, R: np.ndarray, M: np.ndarray, T: np.ndarray, N: np.ndarray, r_max: float, least: float
) -> Change:  # fmt: skip
    """Compare rewards R (2, ...) and margins M (2, S) before and after."""
    moved = np.abs(R[1] - R[0]) > least
    zero, bound = np.abs(R) <= least, np.abs(R) >= r_max - least
    ends = zero | bound
    shift = np.nan_to_num(M[1] - M[0])
    none = np.abs(np.nan_to_num(M)) <= least
    fell, rose = shift < -least, shift > least
    return Change(
        price=price,
        to_zero=_places(moved & zero[1]),
        from_zero=_places(moved & zero[0]),
        to_bound=_places(moved & bound[1]),
        from_bound=_places(moved & bound[0]),
        moved=_places(moved & ~ends[0] & ~ends[1]),
        tied=np.flatnonzero(fell & none[1]),
        untied=np.flatnonzero(rose & none[0]),
        lowered=np.flatnonzero(fell & ~none[1]),
        raised=np.flatnonzero(rose & ~none[0]),
        l1_norm=float(N[1]),
        total_margin=float(T[1]),
        l1_norm_change=float(N[1] - N[0]),
        total_margin_change=float(T[1] - T[0]),
    )


def _places(mask: np.ndarray) -> np.ndarray:
    """(n,) states, or (n, 2) states and actions."""
    return np.flatnonzero(mask) if mask.ndim == 1 else np.argwhere(mask)
