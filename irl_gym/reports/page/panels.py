"""Figures as Plotly's json, and what the page says of them.

Colours are names of the style sheet, `var(--name)`, which the page's script looks up, so that figures follow light and dark.
"""

import html
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import plotly.graph_objects as go

from irl_gym.written import listed, sum_of

ROW = 19
"""Pixels of a bar."""
REWARDS, VALUES, WIDTHS = "RdBu", "Viridis", "Cividis"
"""Colour scales, all safe for the colour-blind; rewards are red below 0 and blue above."""
DIVERGING = [[i / 10, f"var(--reward{i})"] for i in range(11)]
"""The colours of rewards: of the style sheet, so that 0 is pale where the page is light and dark where it is dark."""
MOST_BARS = 40
LINE, LINES = 39, 3
"""Characters of a line of a name beside a bar, and lines at most."""


@dataclass(frozen=True, eq=False)
class Panel:
    """One figure: what is drawn, and the words for those who cannot see it."""

    name: str
    """Of the element; the same in every run of a page."""
    title: str
    caption: str
    """What it shows, in a sentence or two."""
    figure: go.Figure
    aspect: float | None = None
    """Height over width of the plotted area; None for a fixed height."""
    height: int = 340
    """Pixels, where there is no aspect."""
    extra: Mapping[str, Any] = field(default_factory=dict)
    """More for the page's script: arrows, for one."""

    def spec(self) -> dict[str, Any]:
        """As json holds it."""
        drawn = self.figure.to_plotly_json()
        drawn["layout"].pop("template", None)
        size = {"aspect": self.aspect, "height": self.height}
        return {"data": drawn["data"], "layout": drawn["layout"], "title": self.title, **size, **self.extra}


def blank(**layout: Any) -> go.Figure:
    """An empty figure with narrow margins."""
    base = {
        "template": go.layout.Template(),
        "margin": {"l": 8, "r": 8, "t": 8, "b": 8},
        "font": {"color": "var(--ink)", "size": 12},
        "paper_bgcolor": "rgba(0,0,0,0)", "plot_bgcolor": "rgba(0,0,0,0)",
        "dragmode": False, "showlegend": False, "hoverlabel": {"namelength": -1},
    }  # fmt: skip
    return go.Figure(layout={**base, **layout})


def axis(**more: Any) -> dict[str, Any]:
    """An axis in the page's colours."""
    plain = {"gridcolor": "var(--line)", "zerolinecolor": "var(--muted)", "linecolor": "var(--line)", "automargin": True}
    return {**plain, "tickfont": {"color": "var(--muted)"}, **more}


def named(text: str) -> str:
    """A name beside a bar, in lines: where names are long it is often their ends that tell them apart, so none is cut short."""
    lines = textwrap.wrap(text, LINE) or [""]
    if len(lines) > LINES:
        return plotted(text, LINE)
    return "<br>".join(plotted(one) for one in lines)


def bar_axis() -> dict[str, Any]:
    """The axis of names: names that are numbers stay names."""
    return axis(autorange="reversed", type="category", showgrid=False, ticklabelstandoff=4)


def plotted(text: str, longest: int | None = None) -> str:
    """Text of a run inside a figure: Plotly would read tags in it. What is too long is cut in the middle; ends tell apart."""
    if longest is not None and len(text) > longest:
        tail = longest // 2 - 1
        text = f"{text[: longest - tail - 3]}...{text[-tail:]}"
    return html.escape(text, quote=False)


def telling(values: np.ndarray, most: int = MOST_BARS) -> np.ndarray:
    """Indices of the values that tell most, largest first: the largest and the smallest, half and half."""
    order = np.argsort(-values, kind="stable")
    order = order[np.isfinite(values[order])]
    if order.size <= most:
        return order
    return np.concatenate([order[: most - most // 2], order[-(most // 2) :]])


def bars(
    name: str, title: str, values: np.ndarray, names: Sequence[str], *, what: str, caption: str, unit: str,
    alike: np.ndarray | None = None,
) -> Panel:  # fmt: skip
    """Horizontal bars, largest first, of values (n,) that are chosen and in order; all of them are `what`.

    The scale has room for all values `alike`, if given, so that figures can share one.
    """
    labels = _different([named(one) for one in names])
    colours = ["var(--learned)" if value >= 0 else "var(--bad)" for value in values]
    figure = blank(
        xaxis=axis(title={"text": unit}, zeroline=True, **({} if alike is None else {"range": span(alike)})),
        yaxis=bar_axis(), bargap=0.25,
    )  # fmt: skip
    figure.add_bar(
        x=listed(values), y=labels, orientation="h", marker={"color": colours},
        hovertemplate=f"%{{y}}: %{{x}}<extra>{plotted(what)}</extra>",
    )  # fmt: skip
    lines = max((label.count("<br>") for label in labels), default=0)
    return Panel(name, title, caption, figure, height=70 + (ROW + 11 * lines) * max(len(labels), 3))


def span(values: np.ndarray) -> list[float]:
    """The ends of a scale for bars, which begin at 0."""
    finite = values[np.isfinite(values)]
    low, high = float(finite.min(initial=0.0)), float(finite.max(initial=0.0))
    return [1.05 * low, 1.05 * high] if high > low else [-1.0, 1.0]


def _different(labels: list[str]) -> list[str]:
    """Plotly adds up bars of one name."""
    seen: dict[str, int] = {}
    told = []
    for label in labels:
        seen[label] = seen.get(label, 0) + 1
        told.append(label if seen[label] == 1 else f"{label} [{seen[label]}]")
    return told


def grouped_bars(
    name: str, title: str, series: Mapping[str, np.ndarray], names: Sequence[str], *, caption: str, unit: str
) -> Panel:
    """Bars of several series beside one another, one group a name."""
    figure = blank(
        xaxis=axis(title={"text": unit}), yaxis=bar_axis(),
        barmode="group", showlegend=True, legend=below(), margin={"l": 8, "r": 8, "t": 34, "b": 8},
    )  # fmt: skip
    for (series_name, values), colour in zip(series.items(), ("expert", "learned", "bad", "warn"), strict=False):
        figure.add_bar(
            x=listed(values), y=[named(one) for one in names], orientation="h", name=plotted(series_name),
            marker={"color": f"var(--{colour})"}, hovertemplate="%{y}: %{x}",
        )  # fmt: skip
    return Panel(name, title, caption, figure, height=110 + len(names) * len(series) * 17)


def below() -> dict[str, Any]:
    """A legend in a line above the plotted area."""
    return {"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom", "bgcolor": "rgba(0,0,0,0)"}


def dots(
    name: str, title: str, x: np.ndarray, y: np.ndarray, names: Sequence[str], *, labels: tuple[str, str], caption: str
) -> Panel:
    """A point for each state: x (n,) against y (n,)."""
    figure = blank(xaxis=axis(title={"text": labels[0]}), yaxis=axis(title={"text": labels[1]}))
    figure.add_scatter(
        x=listed(x), y=listed(y), mode="markers", text=[plotted(one) for one in names],
        marker={"color": "var(--learned)", "size": 7, "opacity": 0.6},
        hovertemplate="%{text}: %{x}, %{y}<extra></extra>",
    )  # fmt: skip
    return Panel(name, title, caption, figure, height=380)


def spread(values: np.ndarray) -> str:
    """The least and the largest of some values, in words."""
    finite = values[np.isfinite(values)]
    return f"from {sum_of(float(finite.min()))} to {sum_of(float(finite.max()))}" if finite.size else "nowhere defined"
