"""The lambda slider: how reward, policy and margins change with the price of ||R||_1, piece by piece.

The path of the program's optimum is piecewise constant in lambda; each position of the slider is one piece, and a last one
stands for lambda above lambda_0, where R = 0. Everything is worked out here; the script only shows it.
Axes: S states, A actions, k pieces.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from irl_gym._typing import ActionSets, StateMask
from irl_gym.judging.ambiguity.path_changes import Change, changes
from irl_gym.judging.metrics import optimal_actions
from irl_gym.mdp.planning.discounted import Discounted
from irl_gym.mdp.planning.dynamic_programming import backup, tied
from irl_gym.mdp.rewards import TabularReward
from irl_gym.reports.page import maps, panels
from irl_gym.reports.page.panels import Panel, axis, blank, plotted, telling
from irl_gym.reports.page.scene import Scene
from irl_gym.reports.page.sections.absent import LAMBDA
from irl_gym.reports.page.sections.section import Section
from irl_gym.written import listed, number

MOST_PIECES = 240
"""Positions of the slider."""
FAINT = 0.1
"""Share of the path's largest reward below which colours suit the piece."""
NOTHING = 1e-9
"""Share of a piece's largest reward up to which a reward or a margin is 0."""
MOST_CELLS = 90_000
"""Pieces times cells of a map that the page holds."""
BARS = 24


@dataclass(frozen=True, eq=False)
class Pieces:
    """The pieces that are shown, the last with R = 0."""

    low: np.ndarray
    """(k,) where each begins."""
    high: np.ndarray
    """(k,) where it ends; infinite for the last."""
    rewards: np.ndarray
    """(k, S) or (k, S, A)."""
    margins: np.ndarray
    """(k, S) NaN where the expert is compared with nothing."""
    l1_norms: np.ndarray
    """(k,) ||R||_1."""
    changes: tuple[Change, ...]
    """(k,) what changes where each begins."""
    of: int
    """Pieces of the whole path."""

    @cached_property
    def largest(self) -> np.ndarray:
        """(k,) the largest |R| of each piece."""
        return np.nan_to_num(np.abs(self.rewards)).reshape(len(self.rewards), -1).max(axis=1)

    @cached_property
    def faint(self) -> StateMask:
        """(k,) is a piece so small beside the largest that one scale for all would leave it without colours?"""
        return (self.largest > 0) & (self.largest < FAINT * self.largest.max())

    def rounded(self, values: np.ndarray) -> np.ndarray:
        """Rewards or margins (k, S), with 0 for what is nothing in its piece."""
        return np.where(np.abs(values) <= NOTHING * self.largest[:, None], 0.0, values)

    @classmethod
    def of_path(cls, path: Mapping[str, Any], most: int) -> "Pieces":
        """At most `most` pieces of a path, evenly, with the first and the last."""
        ends, rewards, margins = (np.asarray(path[name], dtype=float) for name in ("breakpoints", "rewards", "margins"))
        k = len(rewards)
        kept = np.unique(np.linspace(0, k - 1, min(k, max(most, 2))).astype(int))
        following = np.append(kept[1:], k)
        totals, norms = (np.asarray(path[name], dtype=float) for name in ("total_margins", "l1_norms"))
        r_max, cap = float(path["r_max"]), float(path["margin_cap"])
        passed = changes(ends, rewards, margins, totals, norms, r_max=r_max, margin_cap=None if np.isnan(cap) else cap)
        low, high, norms, rewards, margins = ends[kept], ends[following], norms[kept], rewards[kept], margins[kept]
        low, high, norms = np.append(low, ends[-1]), np.append(high, np.inf), np.append(norms, 0.0)
        rewards = np.concatenate([rewards, np.zeros_like(rewards[:1])])  # above lambda_0 nothing is worth its price
        margins = np.concatenate([margins, np.where(np.isnan(margins[:1]), np.nan, 0.0)])
        return cls(low, high, rewards, margins, norms, tuple(passed[i] for i in (*kept, k)), k)


def lambda_slider(scene: Scene, lambda_path: Mapping[str, Any], certificate: Mapping[str, Any]) -> Section:
    """What the optimum is at each price, and at which the run's own reward is."""
    size = scene.place.layout.n_cells if scene.place is not None else 3 * BARS
    pieces = Pieces.of_path(lambda_path, min(MOST_PIECES, MOST_CELLS // size))
    sets = greedy_sets(scene, pieces.rewards)
    shown = [_rewards(scene, pieces), _policy(scene, sets), _margins(scene, pieces), _norms(pieces)]
    data = {
        "start": _own(pieces, certificate["proof"]["terms"].get("l1")),
        "pieces": [_told(pieces, i, scene) for i in range(len(pieces.low))],
        "figures": {panel.name: changing for panel, changing in shown},
    }
    thinned = "" if pieces.of <= len(pieces.low) else f" Of {pieces.of:,} pieces, {len(pieces.low) - 1:,} are shown."
    if not lambda_path["exact"]:
        more = number(float(lambda_path["gap"]), 2)
        stopped = not lambda_path.get("whole", lambda_path["exact"])
        thinned += (
            f" There are more pieces than were worked out: between these the objective can be {more} larger."
            if stopped
            else f" The path is not certified: the optimum can be {more} above it, and pieces may lack."
        )
    if certificate["proof"]["terms"].get("slack") is not None:
        thinned += " Its rows are hard, where the run's own program prices violations: so its lambda_0 is another."
    lead = (
        "A price lambda on ||R||_1 makes the reward simpler. Between two breakpoints the reward does not change; from "
        f"lambda_0 = {number(pieces.low[-1])} on it is 0. Move the slider to walk through the pieces.{thinned}"
    )
    made = [panel for panel, _ in shown]
    steps = {"last": len(pieces.low) - 1, "start": data["start"], "first": data["pieces"][data["start"]]}
    return Section(*LAMBDA, lead, made, "lambda", steps, {"slider": data})


def greedy_sets(scene: Scene, rewards: np.ndarray) -> list[ActionSets]:
    """The (S, A) greedy actions under each reward: all at once where the expert is optimal, else planned for."""
    mdp, expert = scene.mdp, scene.expert
    factor = Discounted(sp.csr_array(mdp.mixing(expert) @ mdp.P), mdp.gamma)
    found = []
    for values in rewards:
        reward = TabularReward.learned(values, {})
        R, tolerance = reward.expected(mdp), reward.tolerance
        V = factor.solve((expert * R).sum(axis=1))
        Q = backup(mdp, R, V)
        optimal = (Q.max(axis=1) <= V + tolerance + 1e-12)[~mdp.terminal].all()
        found.append(tied(Q, tolerance + 1e-12) if optimal else optimal_actions(mdp, reward))
    return found


def _own(pieces: Pieces, l1: Any) -> int:
    """The piece that the run's own lambda lies in; at a breakpoint the one before it."""
    at = float(l1) if isinstance(l1, int | float) else 0.0
    return max(int(np.searchsorted(pieces.low, at)) - 1, 0)


def _told(pieces: Pieces, i: int, scene: Scene) -> dict[str, str]:
    """The words at a position."""
    high = pieces.high[i]
    span = f"{number(pieces.low[i])} to {number(high)}" if np.isfinite(high) else f"above {number(pieces.low[i])}"
    least = NOTHING * max(float(pieces.largest[i]), 1e-300)
    with_margin = int((pieces.margins[i] > least).sum())
    judged = int(np.isfinite(pieces.margins[i]).sum())
    paid = int((np.abs(pieces.rewards[i]) > least).sum())
    return {
        "span": span,
        "number": f"{i + 1} of {len(pieces.low)}",
        "norm": number(pieces.l1_norms[i]),
        "margins": f"{with_margin:,} of {judged:,}",
        "paid": f"{paid:,}",
        "colours": "this piece" if pieces.faint[i] else "all pieces",
        "change": pieces.changes[i].sentence(scene.place_name),
    }


def _shown_rewards(pieces: Pieces) -> np.ndarray:
    """(k, S) rewards of states; of steps the largest over actions."""
    return pieces.rewards if pieces.rewards.ndim == 2 else pieces.rewards.max(axis=2)


def _rewards(scene: Scene, pieces: Pieces) -> tuple[Panel, dict[str, Any]]:
    over = "" if pieces.rewards.ndim == 2 else ", the largest over actions"
    return _changing(
        scene,
        pieces,
        "path-reward",
        "Reward",
        _shown_rewards(pieces),
        panels.REWARDS,
        True,
        f"Reward at this lambda{over}.",
        "reward",
    )


def _margins(scene: Scene, pieces: Pieces) -> tuple[Panel, dict[str, Any]]:
    caption = "How much better the expert's action is than the next best, at this lambda."
    return _changing(scene, pieces, "path-margin", "Margins", pieces.margins, panels.WIDTHS, False, caption, "margin")


def _changing(
    scene: Scene, pieces: Pieces, name: str, title: str, values: np.ndarray, scale: str, centred: bool, caption: str, unit: str
) -> tuple[Panel, dict[str, Any]]:
    """A figure of values (k, S), one row a position, with one scale for all of them but the faint, which have their own."""
    place, shown = scene.place, scene.mdp.reachable if centred else scene.acting
    values = pieces.rounded(values)
    if place is not None:
        suited = values[:, shown]
        panel = maps.heat(
            name, title, place, values[0], scale=scale, centred=centred, caption=caption, shown=shown, alike=suited
        )
        panel = replace(panel, extra={**panel.extra, "short": True})
        every = place.stride
        hidden = place.layout.blocked | ~place.cells(shown)
        pictures = [listed(np.where(hidden, np.nan, place.cells(one))[::every, ::every], 4) for one in values]
        ends = _scales(pieces, values[:, shown], lambda one: maps.ends(one, centred=centred))
        return panel, {"kind": "z", "trace": 1, "values": pictures, "ends": ends}
    rows = np.flatnonzero(shown & np.isfinite(values).all(axis=0))
    rows = rows[np.argsort(-np.ptp(values[:, rows], axis=0), kind="stable")][:BARS]
    rows = rows[telling(values[0][rows])]
    caption += f" Drawn are the {rows.size} states in which it changes most."
    panel = panels.bars(name, title, values[0][rows], scene.names(rows), what=unit, caption=caption, unit=unit)
    panel.figure.data[0].marker = {"color": "var(--learned)"}
    ends = _scales(pieces, values[:, rows], panels.span)
    panel.figure.layout.xaxis.range = ends[0]
    return panel, {"kind": "x", "trace": 0, "values": [listed(one[rows], 4) for one in values], "ends": ends}


def _scales(pieces: Pieces, values: np.ndarray, ends: Callable[[np.ndarray], Sequence[float]]) -> list[list[float]]:
    """The ends of the scale at each position, of values (k, n)."""
    usual = [*ends(values)]
    return [[*ends(one)] if faint else usual for one, faint in zip(values, pieces.faint, strict=True)]


def _policy(scene: Scene, sets: list[ActionSets]) -> tuple[Panel, dict[str, Any]]:
    """The greedy actions at each position."""
    place, acting = scene.place, scene.acting
    if place is not None and place.arrows:
        caption = "The best actions under this reward; several arrows where several are equally good."
        panel = maps.arrows("path-policy", "Best actions", place, sets[0], caption=caption, shown=acting)
        return panel, {"kind": "arrows", "values": [maps.bits(place, one, acting) for one in sets]}
    counts = [(one & acting[:, None]).sum(axis=0) for one in sets]
    caption = "In how many states each action is a best one under this reward; ties count for each."
    panel = panels.grouped_bars(
        "path-policy", "Best actions", {"best": counts[0]}, scene.actions, caption=caption, unit="states"
    )
    panel.figure.layout.xaxis.range = [0, 1.05 * float(acting.sum())]
    return panel, {"kind": "x", "trace": 0, "values": [listed(one) for one in counts]}


def _norms(pieces: Pieces) -> tuple[Panel, dict[str, Any]]:
    """||R||_1 along the path, with a mark at the slider's position."""
    last = float(pieces.low[-1])
    end = 1.08 * last or 1.0
    x = [float(one) for low, high in zip(pieces.low, pieces.high, strict=True) for one in (low, min(high, end))]
    figure = blank(
        xaxis=axis(title={"text": "lambda"}, range=[0, end]),
        yaxis=axis(title={"text": "||R||<sub>1</sub>"}, rangemode="tozero"),
        shapes=[{"type": "line", "xref": "x", "yref": "paper", "y0": 0, "y1": 1, "x0": 0, "x1": 0,
                 "line": {"color": "var(--warn)", "width": 3}}],
    )  # fmt: skip
    figure.add_scatter(
        x=listed(np.array(x)), y=listed(np.repeat(pieces.l1_norms, 2)), mode="lines",
        line={"color": "var(--learned)", "width": 2}, name=plotted("||R||_1"), hovertemplate="lambda %{x}: %{y}<extra></extra>",
    )  # fmt: skip
    caption = "The norm of the reward along the path; the upright line is the slider."
    middle = [(low + min(high, end)) / 2 for low, high in zip(pieces.low, pieces.high, strict=True)]
    return Panel("path-norm", "Norm of the reward", caption, figure, height=230), {
        "kind": "cursor", "values": listed(np.array(middle)),
    }  # fmt: skip
