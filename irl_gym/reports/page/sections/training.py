"""The learning curve, and how wide the feasible set leaves each state's reward."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from irl_gym.judging.curves import Curve
from irl_gym.judging.scores import agent_of
from irl_gym.reports.page import panels
from irl_gym.reports.page.panels import Panel, axis, below, blank, plotted, spread
from irl_gym.reports.page.scene import Scene, chosen
from irl_gym.reports.page.sections.absent import LEARNING, WIDTHS
from irl_gym.reports.page.sections.compared import of_states
from irl_gym.reports.page.sections.section import Section
from irl_gym.runs.scorecard import resumed_told
from irl_gym.written import listed, number

COLOURS = tuple(f"run{i}" for i in range(6))
"""Of the lines of one figure, in turn: far apart in hue and lightness, for the colour-blind too; levels have others."""
DASHES = ("solid", "9px,3px", "9px,3px,2px,3px", "4px,2px", "9px,3px,2px,3px,2px,3px")
SYMBOLS = ("circle", "square", "diamond", "triangle-up", "cross")
"""Of lines, and of the points on them, once all colours were used: these go on to the next when the colours begin again."""


class Stroke(NamedTuple):
    """How one of several lines is drawn."""

    colour: str
    dash: str
    marker: Mapping[str, Any]
    """Small points where the colour says enough; else few, and large enough for their shape to be seen."""


def stroke(i: int) -> Stroke:
    """How line i of a figure is drawn; up to 30 lines are all drawn differently."""
    turn = i // len(COLOURS) % len(SYMBOLS)
    shape = {"size": 4} if turn == 0 else {"size": 9, "maxdisplayed": 12}
    return Stroke(COLOURS[i % len(COLOURS)], DASHES[turn], {"symbol": SYMBOLS[turn], **shape})


class Level(NamedTuple):
    """A level line across a figure of curves: what a policy is worth."""

    name: str
    value: float | None
    """None where it is not known: there is no line."""
    colour: str
    dash: str
    listed: bool = True
    """Is it in the legend?"""
    marker: Mapping[str, Any] | None = None
    """At its ends, where the line is that of a curve whose colour another curve has too."""


def usual_levels(expert: float | None, random: float | None) -> tuple[Level, Level]:
    """The expert, dashed, and random actions, dotted, where there is one of each; in colours that no curve has."""
    return Level("expert", expert, "ink", "dash"), Level("random", random, "muted", "dot")


def learning(curve: Curve, policies: Mapping[str, Any], training: Mapping[str, Any]) -> Section:
    """What the agent earned under the true reward as it trained."""
    made = [_values(curve, policies)]
    if np.isfinite(curve.mean).any():
        made.append(_returns(curve, policies))
    told = "" if policies[agent_of(policies)]["score"] is None else _settled(training)
    lead = f"The agent is paid by the learned reward only. Drawn is what that earned under the true reward.{told}"
    resumed = resumed_told(training)
    lead += f" The training was {resumed}." if resumed else ""
    return Section(*LEARNING, lead, made)


def _settled(training: Mapping[str, Any]) -> str:
    """When the agent was as good as it should be."""
    taken = training.get("steps_to_0.99")
    if taken is None:
        return " The score did not stay at 0.99 or more."
    return f" From {taken:,} environment steps on the score stays at 0.99 or more."


def _values(curve: Curve, policies: Mapping[str, Any]) -> Panel:
    expert, random = policies["expert"]["value"], policies["random"]["value"]
    levels = usual_levels(expert, random)
    figure = curves({"retrained agent": (curve.steps, curve.value, None)}, levels, "discounted value from the start")
    caption = (
        f"Discounted value under the true reward, ending at {number(curve.value[-1])}; the expert has "
        f"{number(expert)}, random actions {number(random)}."
    )
    return Panel("curve-value", "Value", caption, figure)


def _returns(curve: Curve, policies: Mapping[str, Any]) -> Panel:
    expert, random = policies["expert"]["mean_return"], policies["random"]["mean_return"]
    band = (curve.low, curve.high)
    levels = usual_levels(expert, random)
    figure = curves({"retrained agent": (curve.steps, curve.mean, band)}, levels, "mean return of episodes")
    caption = (
        f"Mean undiscounted return of sampled episodes with its 95 % interval (shaded), {spread(curve.mean)}; the expert has "
        f"{number(expert)}, random actions {number(random)}."
    )
    return Panel("curve-return", "Mean return", caption, figure)


def curves(
    series: Mapping[str, tuple[np.ndarray, np.ndarray, tuple[np.ndarray, np.ndarray] | None]],
    levels: Sequence[Level],
    ylabel: str,
    thin: Mapping[str, Sequence[np.ndarray]] = MappingProxyType({}),
) -> Any:
    """Lines over environment steps, with bands where there are intervals, and levels; `thin` are beside one, at its steps."""
    figure = blank(
        xaxis=axis(title={"text": "environment steps"}, separatethousands=True, rangemode="tozero"),
        yaxis=axis(title={"text": ylabel}), showlegend=True, legend=below(), margin={"l": 8, "r": 12, "t": 44, "b": 8},
    )  # fmt: skip
    last = max(float(steps[-1]) for steps, *_ in series.values())
    for i, (name, (steps, values, band)) in enumerate(series.items()):
        colour, dash, marker = stroke(i)
        if band is not None:
            x, y = _outline(steps, *band)
            figure.add_scatter(
                x=listed(x, 9), y=listed(y), mode="lines", fill="toself", fillcolor=f"var(--{colour})", opacity=0.22,
                line={"width": 0}, hoverinfo="skip", name="95 % interval",
            )  # fmt: skip
        for one in thin.get(name, ()):
            figure.add_scatter(
                x=listed(steps, 9), y=listed(one), mode="lines", hoverinfo="skip", showlegend=False, opacity=0.6,
                line={"color": f"var(--{colour})", "width": 1}, name=f"one of {plotted(name)}",
            )  # fmt: skip
        figure.add_scatter(
            x=listed(steps, 9), y=listed(values), mode="lines+markers", name=plotted(name),
            line={"color": f"var(--{colour})", "width": 2, "dash": dash}, marker=marker, hovertemplate="%{x:,} steps: %{y}",
        )  # fmt: skip
    for level in levels:
        if level.value is not None:
            figure.add_scatter(
                x=[0, last], y=[level.value] * 2, mode="lines+markers" if level.marker else "lines", marker=level.marker,
                name=f"{plotted(level.name)} {number(level.value)}", hoverinfo="skip", showlegend=level.listed,
                line={"color": f"var(--{level.colour})", "dash": level.dash, "width": 2},
            )  # fmt: skip
    return figure


def _outline(steps: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A closed line around each run of points whose interval is known, with NaN in between."""
    known = np.flatnonzero(np.isfinite(low) & np.isfinite(high))
    x, y = [], []
    for part in np.split(known, np.flatnonzero(np.diff(known) > 1) + 1):
        x += [*steps[part], *steps[part][::-1], np.nan]
        y += [*high[part], *low[part][::-1], np.nan]
    return np.array(x[:-1]), np.array(y[:-1])


def widths(
    scene: Scene, widths: Mapping[str, np.ndarray], learner: Mapping[str, Any], certificate: Mapping[str, Any]
) -> Section:
    """How far the reward of each state is left open by what the expert does."""
    over = {"width": np.fmax, "low": np.fmin, "high": np.fmax}
    width, low, high = (_of_states(widths[key], scene, which) for key, which in over.items())
    shown = np.isfinite(width) & scene.mdp.reachable
    of_steps = " Drawn is that of the step which the expert takes." if np.ndim(widths["width"]) == 2 else ""
    if not shown.any():
        return Section(*WIDTHS, "No state's reward is bounded by what the expert does.")
    largest = float(learner.get("r_max") or 1.0)
    lead = (
        f"Considered are all rewards within +-{number(largest)} under which the expert is optimal with a margin of "
        f"at least {_least_margin(learner, certificate)} over every action that it can be better than. The width is how far "
        "a state's reward can move among them: 0 says that the expert settles it, a wide one that almost anything goes."
    )
    made = [of_states("widths-map", "Feasible width", width, scene, f"Widths {spread(width[shown])}.{of_steps}",
                      scale=panels.WIDTHS, centred=False, shown=shown, unit="width")]  # fmt: skip
    if scene.place is not None:
        made += [
            of_states(f"widths-{key}", name, bound, scene, f"{name} of each state, {spread(bound[shown])}.{of_steps}",
                      scale=panels.REWARDS, centred=True, shown=shown)
            for key, name, bound in (("low", "Least feasible reward", low), ("high", "Largest feasible reward", high))
        ]  # fmt: skip
    return Section(*WIDTHS, lead, made)


def _least_margin(learner: Mapping[str, Any], certificate: Mapping[str, Any]) -> str:
    """The margin that the feasible rewards have: half the largest that all states can have at once, as FiniteLP's own cap."""
    told = "half the largest that all states can have at once"
    cap = certificate["proof"]["terms"].get("margin_cap")
    own = learner.get("margin_cap") == "auto" and isinstance(cap, int | float)
    return f"{number(cap)}, {told}," if own else told


def _of_states(values: Any, scene: Scene, over: np.ufunc) -> np.ndarray:
    """(S,) numbers of states; of steps (S, A) that of the step the expert takes, the largest or the least where it has several.

    Other steps say little: nothing bounds how bad they are, so their least reward is always the scale's end.
    """
    array = np.asarray(values, dtype=float)
    if array.ndim == 1:
        return array
    return over.reduce(np.where(chosen(scene.expert) & scene.seen[:, None], array, np.nan), axis=1)
