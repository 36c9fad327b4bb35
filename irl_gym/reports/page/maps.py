"""Maps: values and policies over the cells of a grid, or of a plane of two continuous coordinates.

A map has three layers: the ground (open, blocked, goals, holes), colours of values with numbers where there is room, and the
letters of the layout. Policies have arrows in place of colours; the page's script draws them from sets of actions, so that the
slider can change them. Axes: S states, A actions; a map is (rows, columns).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import plotly.graph_objects as go

from irl_gym._typing import ActionSets, Matrix, StateMask
from irl_gym.mdp.tabular_mdp import TransitionTable
from irl_gym.reports.page.panels import DIVERGING, REWARDS, Panel, axis, blank, plotted
from irl_gym.tables.cells import Cells
from irl_gym.tables.layouts import GridLayout
from irl_gym.written import listed

MOST_NUMBERS = 144
"""Maps of at most this many cells carry numbers."""
MOST_ARROWS = 40
"""Arrows a side; on larger maps every second, third, ... row and column has them."""
MOST_CELLS = 12_000
"""Cells of a map that are drawn; of larger ones every second, third, ... row and column."""
GROUND = ("open", "blocked", "goal", "hole", "end", "wrong")
COLOUR_BAR = {"thickness": 11, "outlinewidth": 0, "len": 0.95, "x": 1.02, "tickfont": {"color": "var(--muted)", "size": 11}}
SIDES = {(-1, 0), (0, 1), (1, 0), (0, -1), (0, 0)}
"""Down and right of each field of a cell that is cut up; the one in its middle is for staying."""


@dataclass(frozen=True, eq=False)
class Map:
    """Where the first states of a table lie."""

    layout: GridLayout
    """Cells in rows and columns, those of a plane too."""
    plane: Cells | None = None
    """The two coordinates, where it is a plane."""

    @classmethod
    def of(cls, layout: GridLayout | None, states: Any, table: TransitionTable) -> "Map | None":
        """The map of a run, if there is one."""
        if layout is not None:
            return cls(layout)
        if not isinstance(states, Cells) or len(states.shape) != 2:
            return None
        columns, rows = int(states.shape[0]), int(states.shape[1])
        blocked = ~table.reachable[: states.n_cells].reshape(columns, rows).T
        nowhere = np.zeros((table.n_actions, 2), dtype=int)
        no_ends, no_letters = np.zeros((rows, columns), dtype=bool), np.full((rows, columns), "", dtype="<U1")
        return cls(GridLayout((rows, columns), nowhere, blocked, no_ends, no_letters), states)

    def cells(self, values: np.ndarray) -> np.ndarray:
        """(rows, columns, ...) of values (S, ...)."""
        if self.plane is None:
            return self.layout.cells(values)
        across = np.asarray(values)[: self.plane.n_cells].reshape(*self.plane.shape, *np.shape(values)[1:])
        return np.swapaxes(across, 0, 1)

    @property
    def arrows(self) -> bool:
        """Do actions go somewhere on this map?"""
        return bool(self.layout.directions.any())

    @property
    def stride(self) -> int:
        """One of this many rows and columns is drawn."""
        return int(np.ceil(np.sqrt(self.layout.n_cells / MOST_CELLS)))

    @property
    def thinned(self) -> str:
        """What a caption says of that."""
        return "" if self.stride == 1 else f" One of every {self.stride} rows and columns is drawn."


def ground(place: Map, wrong: np.ndarray | None = None, covered: np.ndarray | None = None) -> go.Figure:
    """The lowest layer: what each cell is; (rows, columns) `wrong` cells are shaded, and `covered` ones left to a value."""
    layout, every = place.layout, place.stride
    kinds = np.zeros(layout.shape, dtype=int)
    for letter, kind in (("G", 2), ("H", 3), ("E", 4)):
        kinds[(layout.letters == letter) & layout.terminal] = kind
    if wrong is not None:
        kinds[wrong] = 5
    kinds[layout.blocked] = 1
    steps = np.linspace(0, 1, len(GROUND) + 1)
    scale = [[float(at), f"var(--{name})"] for i, name in enumerate(GROUND) for at in (steps[i], steps[i + 1])]
    figure = blank(xaxis=_side(place, 1), yaxis=_side(place, 0), plot_bgcolor="var(--seam)")
    drawn = np.where(np.zeros_like(kinds, dtype=bool) if covered is None else covered, np.nan, kinds)
    figure.add_heatmap(
        z=listed(drawn[::every, ::every]), zmin=-0.5, zmax=len(GROUND) - 0.5, colorscale=scale, showscale=False,
        hoverinfo="skip", name="ground", **_spacing(place),
    )  # fmt: skip
    return figure


def heat(
    name: str, title: str, place: Map, values: np.ndarray, *, scale: str, centred: bool, caption: str,
    shown: StateMask | None = None, alike: np.ndarray | None = None,
) -> Panel:  # fmt: skip
    """Colours of values (S,), none where they are NaN or not `shown`; colours and digits suit `alike`, if given."""
    at = np.array(place.cells(np.asarray(values, dtype=float)))
    hidden = place.layout.blocked if shown is None else place.layout.blocked | ~place.cells(shown)
    at[hidden] = np.nan
    figure, every = ground(place, covered=np.isfinite(at)), place.stride
    suited = at if alike is None else alike
    low, high = ends(suited, centred=centred)
    numbers = place.layout.n_cells <= MOST_NUMBERS
    figure.add_heatmap(
        z=listed(at[::every, ::every], 4), zmin=low, zmax=high, name="values",
        colorscale=DIVERGING if scale == REWARDS else scale, colorbar=COLOUR_BAR,
        texttemplate=f"%{{z:{number_format(suited)}}}" if numbers else "",
        hovertemplate=_hover(place, "%{z}"), **_spacing(place),
    )  # fmt: skip
    _letters(figure, place, centred=hidden | np.isnan(at) if numbers else np.ones(place.layout.shape, dtype=bool))
    return Panel(name, title, caption + place.thinned, figure, aspect=_aspect(place))


def crosses(name: str, title: str, place: Map, R: Matrix, actions: tuple[str, ...], *, caption: str, shown: StateMask) -> Panel:
    """A reward on steps (S, A): each cell is cut into a field a move; its centre is for an action that stays, or free."""
    layout, figure = place.layout, ground(place)
    rows, columns = layout.shape
    at = np.full((3 * rows, 3 * columns), np.nan)
    paid = np.where(place.cells(shown)[..., None], place.cells(R), np.nan)
    fields = [[""] * 3 for _ in range(3)]
    for a, (down, right) in enumerate(layout.directions):
        at[1 + down :: 3, 1 + right :: 3] = paid[..., a]
        fields[1 + down][1 + right] = plotted(actions[a])
    low, high = ends(paid, centred=True)
    thirds = (np.arange(3 * max(rows, columns)) - 1) / 3
    figure.add_heatmap(
        z=listed(at, 4), x=listed(thirds[: 3 * columns]), y=listed(thirds[: 3 * rows]), zmin=low, zmax=high,
        colorscale=DIVERGING, name="values", xgap=0.5, ygap=0.5,
        colorbar=COLOUR_BAR,
        hovertemplate="row %{customdata[0]}, column %{customdata[1]}, %{customdata[2]}: %{z}<extra></extra>",
    )  # fmt: skip
    _letters(figure, place, centred=np.full(layout.shape, not fields[1][1]))
    return Panel(name, title, caption, figure, aspect=_aspect(place), extra={"fields": fields})


def has_crosses(place: Map) -> bool:
    """Are the actions moves to different sides, and the cells few enough to be cut up?"""
    sides = {tuple(direction) for direction in place.layout.directions.tolist()}
    return len(sides) == len(place.layout.directions) and sides <= SIDES and max(place.layout.shape) <= MOST_ARROWS


def arrows(
    name: str, title: str, place: Map, sets: ActionSets, *, caption: str, shown: StateMask, wrong: StateMask | None = None
) -> Panel:
    """Arrows for the actions (S, A) of a policy, several where it has several; `wrong` states are shaded."""
    bad = np.zeros(place.layout.shape, dtype=bool) if wrong is None else place.cells(wrong & shown)
    figure = ground(place, bad)
    for layer, colour in (("arrows", "ink"), ("arrows off", "bad-ink")):
        figure.add_scatter(
            x=[], y=[], mode="lines", fill="toself", name=layer, hoverinfo="skip",
            line={"width": 0.5, "color": f"var(--{colour})"}, fillcolor=f"var(--{colour})",
        )  # fmt: skip
    _letters(figure, place, centred=place.layout.terminal)
    drawn = {"arrows": {"sets": bits(place, sets, shown), "off": bad.astype(int).ravel().tolist(), **geometry(place)}}
    return Panel(name, title, caption + place.thinned + _strided(place), figure, aspect=_aspect(place), extra=drawn)


def choices(name: str, title: str, place: Map, actions: np.ndarray, names: tuple[str, ...], *, caption: str) -> Panel:
    """Colours of actions (S,), NaN where there is none, on a plane where actions have no direction."""
    figure, every, n = ground(place), place.stride, len(names)
    at = place.cells(np.asarray(actions, dtype=float)).copy()
    at[place.layout.blocked] = np.nan
    steps = np.linspace(0, 1, n + 1)
    scale = [[float(edge), f"var(--action{a % 8})"] for a in range(n) for edge in (steps[a], steps[a + 1])]
    figure.add_heatmap(
        z=listed(at[::every, ::every]), zmin=-0.5, zmax=n - 0.5, colorscale=scale, name="values", **_spacing(place),
        colorbar={**COLOUR_BAR, "tickvals": list(range(n)), "ticktext": [plotted(one, 16) for one in names]},
        hovertemplate=_hover(place, "%{customdata[0]}"),
    )  # fmt: skip
    told = {"actions": [plotted(one) for one in names]}
    return Panel(name, title, caption + place.thinned, figure, aspect=_aspect(place), extra=told)


def bits(place: Map, sets: ActionSets, shown: StateMask) -> list[int]:
    """(rows * columns,) sets of actions as numbers, bit a for action a; 0 where nothing is to be drawn."""
    masks = (place.cells(sets & shown[:, None]) * (1 << np.arange(sets.shape[1]))).sum(axis=-1)
    return masks.ravel().tolist()


def geometry(place: Map) -> dict[str, Any]:
    """What the script needs to know of a map to draw arrows."""
    every = -(-max(place.layout.shape) // MOST_ARROWS)
    return {"shape": list(place.layout.shape), "directions": place.layout.directions.tolist(), "every": every}


def ends(values: np.ndarray, *, centred: bool) -> tuple[float, float]:
    """The ends of the colours, around 0 for rewards; never the same number twice."""
    finite = values[np.isfinite(values)]
    if centred or not finite.size:
        largest = float(np.abs(finite).max(initial=0.0)) or 1.0
        return -largest, largest
    low, high = float(finite.min()), float(finite.max())
    return (low, high) if high > low else (low - 0.5, high + 0.5)


def number_format(values: np.ndarray) -> str:
    """d3's way to write numbers of this size in a cell."""
    finite = values[np.isfinite(values)]
    largest = float(np.abs(finite).max(initial=0.0))
    if (np.abs(finite - np.rint(finite)) < 1e-9).all():
        return ".0f"
    return ".0f" if largest >= 100 else ".1f" if largest >= 10 else ".2f" if largest >= 0.1 else ".1e"


def _strided(place: Map) -> str:
    every = geometry(place)["every"]
    return f" Arrows stand in one of every {every} rows and columns." if every > 1 else ""


def _aspect(place: Map) -> float:
    rows, columns = place.layout.shape
    return 0.75 if place.plane is not None else rows / columns


def _spacing(place: Map) -> Mapping[str, Any]:
    """Where cells lie, and thin seams between large ones."""
    rows, columns = place.layout.shape
    every = place.stride
    gap = 1 if max(rows, columns) <= MOST_ARROWS else 0
    if place.plane is None:
        if every == 1:
            return {"xgap": gap, "ygap": gap}
        return {"x": list(range(0, columns, every)), "y": list(range(0, rows, every))}
    centres = [low + (np.arange(n) + 0.5) * width for low, n, width in _coordinates(place.plane)]
    return {"x": listed(centres[0][::every]), "y": listed(centres[1][::every])}


def _coordinates(plane: Cells) -> list[tuple[float, int, float]]:
    return [(float(low), int(n), float(w)) for low, n, w in zip(plane.coordinates.low, plane.shape, plane.widths, strict=True)]


def _side(place: Map, which: int) -> dict[str, Any]:
    """The axis of rows (0) or of columns (1)."""
    if place.plane is not None:
        return axis(title={"text": place.plane.coordinates.names[1 - which].replace("_", " ")}, showgrid=False, zeroline=False)
    n = place.layout.shape[which]
    few = {"tickvals": list(range(n))} if n <= 12 else {}
    span = [n - 0.5, -0.5] if which == 0 else [-0.5, n - 0.5]
    square = {"scaleanchor": "x", "constrain": "domain"} if which == 0 else {"constrain": "domain"}
    return axis(range=span, showgrid=False, zeroline=False, ticks="", **few, **square)


def _hover(place: Map, value: str) -> str:
    where = "row %{y}, column %{x}"
    if place.plane is not None:
        where = ", ".join(f"{name} %{{{letter}:.3g}}" for name, letter in zip(place.plane.coordinates.names, "xy", strict=True))
    return f"{where}: {value}<extra></extra>"


def _letters(figure: go.Figure, place: Map, *, centred: np.ndarray) -> None:
    """The letters of the layout: in the middle of a cell where `centred`, else in its upper left corner."""
    layout = place.layout
    if max(layout.shape) > MOST_ARROWS or not (layout.letters != "").any():
        return
    spots = np.argwhere(layout.letters != "")
    off = np.where(centred[spots[:, 0], spots[:, 1]], 0.0, 0.36)
    figure.add_scatter(
        x=listed(spots[:, 1] - off), y=listed(spots[:, 0] - off), text=[str(layout.letters[r, c]) for r, c in spots],
        mode="text", hoverinfo="skip", name="letters", textfont={"color": "var(--letter)", "size": 11, "weight": 700},
    )  # fmt: skip
