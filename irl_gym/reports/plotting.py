"""Figures: rewards, values, policies and learning curves. Only this module and its parts, `drawing`, import matplotlib.

Grid environments are drawn as maps (`layouts.grid_layout` finds the map); the others as sorted lines and counts. They
are made with matplotlib's objects, never with pyplot, so drawing changes no global state and needs no screen. Rewards
have a diverging colour map centred on 0 (red below, blue above), values viridis; both are safe for the colour-blind.
Axes: S states, A actions.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import CenteredNorm, Normalize
from matplotlib.figure import Figure

from irl_gym._typing import ActionSets, Matrix, Vector
from irl_gym.errors import InvalidParameter
from irl_gym.files.own_files import whole
from irl_gym.mdp.arrival_rewards import paid_on_arrival
from irl_gym.mdp.tabular_mdp import TransitionTable
from irl_gym.records import Record
from irl_gym.reports import drawing
from irl_gym.spaces.names import Names
from irl_gym.tables.layouts import GridLayout


@dataclass(frozen=True, eq=False)
class DrawnCurve(Record):
    """A learning curve."""

    steps: np.ndarray
    """(N,) environment steps, increasing."""
    values: np.ndarray
    """(N,) what was reached."""
    low: np.ndarray | None = None
    """(N,) lower end of an interval band."""
    high: np.ndarray | None = None
    """(N,) its upper end."""


def draw_rewards(
    layout: GridLayout | None,
    true: Vector | Matrix,
    learned: Vector | Matrix,
    table: TransitionTable,
    names: Names | None = None,
) -> Figure:
    """The environment's reward beside the learned one, each on its own scale.

    On a map a reward on states is what arrival pays. One on steps (S, A) is drawn like that too when some reward on states
    explains it (FrozenLake's); else each cell is cut into one triangle a move. Where there is no map all states or steps are
    sorted, and those that are paid most and least are named.

    Args:
        layout: the map, or None for an environment that has none.
        true: (S,) paid on arrival, or (S, A) of steps.
        learned: (S,) paid on arrival, or (S, A) of steps.
        table: S states, A actions.
        names: of states and actions; None for numbers.
    """
    if layout is None:
        figure, above, below = drawing.paired_panels()
        for sorted_, named, name, R in zip(above, below, ("True reward", "Learned reward"), (true, learned), strict=True):
            draw_sorted_reward(sorted_, named, name, R, table, names or Names.numbered(table.n_actions))
        drawing.small_titles(figure)
        return figure
    figure, axes = drawing.panels(layout)
    for axis, name, R in ((axes[0], "True reward", true), (axes[1], "Learned reward", learned)):
        axis.set_title(f"{name}, {reward_map(axis, layout, R, table)}")
    drawing.footnote(figure, layout)
    return figure


def reward_map(axis: Axes, layout: GridLayout, R: np.ndarray, table: TransitionTable) -> str:
    """A reward (S,) or (S, A) on one map; returns what was drawn, for the title."""
    on_states = R if R.ndim == 1 else paid_on_arrival(R, table)
    if on_states is None:
        return drawing.triangles(axis, layout, R)
    norm = CenteredNorm(0, halfrange=max(float(np.abs(on_states[table.reachable]).max()), 1e-9))
    drawing.cells(axis, layout, on_states, cmap="RdBu", norm=norm, label="reward on arrival")
    return "paid on arrival in a cell"


def draw_values(
    layout: GridLayout | None,
    true_values: Vector,
    learned_values: Vector,
    table: TransitionTable,
    names: Names | None = None,
) -> Figure:
    """The expert's discounted value under the true reward beside that under the learned reward.

    Args:
        layout: the map, or None for an environment that has none.
        true_values: (S,) expected discounted sum of true rewards from each state; NaN where the expert is not known.
        learned_values: (S,) the same with the learned reward; its unit is the learned reward's.
        table: S states.
        names: of states; None for numbers.
    """
    judged = table.reachable & ~table.terminal & np.isfinite(true_values)
    if layout is None:
        figure, axes, below = drawing.paired_panels()
        drawing.sorted_line(axes[0], true_values[judged])
        axes[0].set(title="Expert's value under the true reward", xlabel="states, best first", ylabel="discounted value")
        rows, called = np.flatnonzero(judged), names or Names.numbered(table.n_actions)
        for axis, kind, V in ((below[0], "true", true_values), (below[1], "learned", learned_values)):
            entries = drawing.telling(V[judged], lambda i: called.state(int(rows[i])))
            drawing.named_bars(axis, entries)
            axis.set(title=of_all(f"Value, {kind} reward", len(entries), rows.size, "states"), xlabel="discounted value")
        axes[1].scatter(true_values[judged], learned_values[judged], s=14, color=drawing.BLUE, alpha=0.55, linewidths=0)
        axes[1].set(
            title="The same states under the learned reward",
            xlabel="expert's value, true reward", ylabel="expert's value, learned reward",
        )  # fmt: skip
        drawing.plain(axes[1])
        drawing.small_titles(figure)
        return figure
    figure, axes = drawing.panels(layout)
    seen = "" if np.isfinite(true_values[table.reachable & ~table.terminal]).all() else ", where it was seen"
    titles = (f"Expert's value, true reward{seen}", f"Expert's value, learned reward{seen}")
    for axis, title, V in zip(axes, titles, (true_values, learned_values), strict=True):
        norm = Normalize(float(V[judged].min()), float(V[judged].max()))
        drawing.cells(axis, layout, V, cmap="viridis", norm=norm, label="discounted value", ends=False)
        axis.set_title(title)
    drawing.footnote(figure, layout)
    return figure


def draw_policies(
    layout: GridLayout | None,
    expert: ActionSets,
    retrained: Matrix,
    optimal: ActionSets,
    table: TransitionTable,
    names: Names | None = None,
) -> Figure:
    """The expert's actions beside the retrained agent's; where the agent's is not optimal the cell is shaded.

    Args:
        layout: the map, or None for an environment that has none.
        expert: (S, A) the actions the expert takes; none in states where it was not seen.
        retrained: (S, A) the agent's action probabilities; its most probable action is judged.
        optimal: (S, A) all actions that are optimal under the true reward.
        table: S states, A actions.
        names: of actions; None for numbers.
    """
    figure, axes = drawing.panels(layout)
    judged = table.reachable & ~table.terminal
    unseen = judged & ~expert.any(axis=1)
    where = f", seen in {int((judged & ~unseen).sum())} of {int(judged.sum())} states" if unseen.any() else ""
    taken = retrained.argmax(axis=1)
    wrong = judged & ~optimal[np.arange(table.n_states), taken]
    told = f"{int((judged & ~wrong).sum())} of {int(judged.sum())} states"
    if layout is None:
        right, chosen = judged & ~wrong, np.eye(table.n_actions, dtype=bool)[taken]
        called = (names or Names.numbered(table.n_actions)).actions
        drawing.action_counts(axes[0], {"expert": (expert & judged[:, None]).sum(axis=0)}, called)
        parts = {"optimal": (chosen & right[:, None]).sum(axis=0), "not optimal": (chosen & wrong[:, None]).sum(axis=0)}
        drawing.action_counts(axes[1], parts, called)
        several = (expert[judged].sum(axis=1) > 1).any()
        axes[0].set_title(f"Expert{where}" + (": every action of its set" if several else ""))
        axes[1].set_title(f"Retrained agent, optimal in {told}")
        axes[1].sharex(axes[0])
        return figure
    drawing.arrows(axes[0], layout, expert.astype(float), judged, np.zeros_like(judged))
    axes[0].set_title(f"Expert{where}")
    drawing.arrows(axes[1], layout, retrained, judged, wrong)
    axes[1].set_title(f"Retrained agent, optimal in {told}")
    shaded, blank = "not optimal" if wrong.any() else "", "the expert was not seen there" if unseen.any() else ""
    drawing.footnote(figure, layout, shaded=shaded, blank=blank, policies=True)
    return figure


def draw_learning_curve(
    curves: Mapping[str, DrawnCurve],
    *,
    expert: float,
    random: float,
    ylabel: str = "discounted value from the start, true reward",
    title: str = "Learning curve",
) -> Figure:
    """What the agent reaches as it learns, between the random policy's and the expert's level.

    Args:
        curves: by the name to print, for example {"learned reward": ..., "true reward": ...}.
        expert: the expert's level, in the unit of the curves.
        random: the random policy's level.
        ylabel: what the curves measure, with its unit.
        title: printed above.

    Raises:
        InvalidParameter: no curve, or one whose values are not as many as its steps.
    """
    if not curves:
        raise InvalidParameter("curves is empty: expected at least one curve.")
    figure = drawing.blank(8.0, 4.6)
    axis = figure.add_subplot()
    for level, name, colour in ((expert, "expert", drawing.GREEN), (random, "random", drawing.GREY)):
        axis.axhline(level, color=colour, linewidth=1.4, linestyle=(0, (5, 3)), zorder=1)
        axis.annotate(
            f"{name} {level:.4g}", (1, level), xytext=(5, 0), xycoords=("axes fraction", "data"),
            textcoords="offset points", va="center", color=colour, annotation_clip=False,
        )  # fmt: skip
    for (name, curve), colour in zip(curves.items(), cycle(drawing.SERIES), strict=False):
        if curve.steps.shape != curve.values.shape:
            raise InvalidParameter(f"curve {name!r} has {curve.steps.size} steps and {curve.values.size} values.")
        if curve.low is not None and curve.high is not None:
            axis.fill_between(curve.steps, curve.low, curve.high, color=colour, alpha=0.2, linewidth=0)
        axis.plot(curve.steps, curve.values, color=colour, linewidth=2, label=name, marker="o", markersize=3)
    if len(curves) > 1:
        axis.legend(frameon=False)
    axis.set(xlabel="environment steps", ylabel=ylabel, title=title)
    axis.xaxis.set_major_formatter(lambda n, _: f"{n:,.0f}")
    drawing.plain(axis)
    return figure


def draw_returns(points: Mapping[str, np.ndarray]) -> Figure:
    """Episodes' returns under the learned reward against the true reward: a reward worth having puts them in the same order.

    Args:
        points: by policy, (N, 2) undiscounted true return and return under the learned reward.
    """
    figure = drawing.blank(6.4, 4.6)
    axis = figure.add_subplot()
    for (name, pairs), colour, marker in zip(points.items(), cycle(drawing.SERIES), cycle("osx"), strict=False):
        style: dict[str, Any] = {"color": colour} if marker == "x" else {"facecolors": "none", "edgecolors": colour}
        axis.scatter(pairs[:, 0], pairs[:, 1], s=36, marker=marker, linewidths=1.1, label=name, **style)
    axis.legend(frameon=False)
    axis.set(xlabel="true return", ylabel="return under the recovered reward", title="Episodes under both rewards")
    drawing.plain(axis)
    return figure


def save_figure(figure: Figure, path: str | os.PathLike) -> None:
    """Write a png, svg or pdf beside, then rename. The same figure gives the same bytes: no date or version is written.

    Raises:
        InvalidParameter: another suffix.
    """
    path = Path(path)
    kind = path.suffix.lower().lstrip(".")
    blank: dict[str, dict[str, Any]] = {
        "png": {"Software": None},
        "svg": {"Date": None, "Creator": None},
        "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
    }
    if kind not in blank:
        raise InvalidParameter(f"the path {path} ends in {path.suffix!r}: expected .png, .svg or .pdf.")
    with matplotlib.rc_context({"svg.hashsalt": "irl_gym"}), whole(path) as file:
        figure.savefig(file, format=kind, dpi=130, metadata=blank[kind])


def draw_sorted_reward(
    sorted_: Axes | None, named: Axes, name: str, R: np.ndarray, table: TransitionTable, names: Names
) -> None:
    """A reward where there is no map: every state or step, best first; and the first and the last by name."""
    if R.ndim == 1:
        where, what, told = np.flatnonzero(table.reachable)[:, None], "states", "paid on arrival in a state"
    else:
        acting = np.flatnonzero(table.reachable & ~table.terminal)
        pairs = np.meshgrid(acting, np.arange(table.n_actions), indexing="ij")
        where, what, told = np.stack(pairs, axis=-1).reshape(-1, 2), "steps (s, a)", "expected for a step"
    values = R[tuple(where.T)]
    if sorted_ is not None:
        drawing.sorted_line(sorted_, values)
        sorted_.set(title=f"{name}, {told}", xlabel=f"{values.size:,} {what}, best first", ylabel="reward")

    def called(i: int) -> str:
        state, *action = where[i].tolist()
        return names.state(state) + "".join(f": {names.actions[a]}" for a in action)

    entries = drawing.telling(values, called)
    drawing.named_bars(named, entries)
    named.set(title=of_all(name, len(entries), values.size, what), xlabel="reward")


def of_all(name: str, shown: int, n: int, what: str) -> str:
    """A title that says how many of all are named."""
    return f"{name}: all {n} {what}" if shown == n else f"{name}: highest and lowest {shown // 2} of {n:,} {what}"
