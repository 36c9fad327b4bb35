"""The parts of the figures in `plotting`: maps with colours, triangles or arrows, sorted lines and bars.

Colours are Okabe & Ito's. A cell that no episode visits is slate; letters are those of the layout.
Axes: S states, A actions.
"""

import io
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import CenteredNorm, Normalize, to_rgb
from matplotlib.figure import Figure

from irl_gym.tables.layouts import GridLayout

MOST_NUMBERS = 144
"""Maps of at most this many cells carry numbers."""
MOST_ARROWS = 45
"""Arrows a side; on larger maps every second, third, ... row and column has them."""
MOST_NAMED = 10
"""Entries at each end of a list that are named."""
LEAST_SHARE = 0.5
"""Actions less likely than this share of the most likely one have no arrow."""
BLUE, ORANGE, GREEN, GREY, INK = "#0072b2", "#d55e00", "#009e73", "#7d838d", "#22262e"
SERIES = (BLUE, ORANGE, "#cc79a7", "#56b4e9", "#e69f00")
BLOCKED, OPEN, WRONG = "#6b7483", "#f4f3ef", "#ffc08f"
ENDS = {"G": "#bfe8d8", "H": "#33363d", "E": "#d8d9dc"}
MEANINGS = {"S": "start", "G": "goal", "H": "hole or pit", "E": "end of the episode"}


class _Picture(Figure):
    """A figure that notebooks show, whether or not pyplot was imported."""

    def _repr_png_(self) -> bytes:
        content = io.BytesIO()
        self.savefig(content, format="png", dpi=100)
        return content.getvalue()


def blank(width: float, height: float) -> Figure:
    """A figure without pyplot; width and height in inches."""
    figure = _Picture(figsize=(width, height), layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def panels(layout: GridLayout | None) -> tuple[Figure, Sequence[Axes]]:
    """Two panels: side by side, or one above the other for a map much wider than high."""
    if layout is None:
        figure = blank(11, 4.4)
        return figure, tuple(figure.subplots(1, 2))
    rows, columns = layout.shape
    cell = cell_inches(layout)
    if columns > 2 * rows:
        figure = blank(max(columns * cell + 1.6, 5.5), 2 * (rows * cell + 1.05))
        return figure, tuple(figure.subplots(2, 1))
    figure = blank(2 * max(columns * cell + 1.6, 4.6), rows * cell + 1.3)
    return figure, tuple(figure.subplots(1, 2))


def paired_panels() -> tuple[Figure, Sequence[Axes], Sequence[Axes]]:
    """Two low panels side by side, and two high ones below them."""
    figure = blank(13, 8.2)
    above, below = figure.subplots(2, 2, height_ratios=(3, 5))
    return figure, tuple(above), tuple(below)


def small_titles(figure: Figure) -> None:
    """Titles that fit above panels with long names at their left."""
    for axis in figure.axes:
        axis.set_title(axis.get_title(), fontsize=10)


def footnote(figure: Figure, layout: GridLayout, *, shaded: str = "", blank: str = "", policies: bool = False) -> None:
    """Say below the panels what letters and shades mean."""
    told = [f"{letter} {meaning}" for letter, meaning in MEANINGS.items() if (layout.letters == letter).any()]
    told += ["slate: never visited"] if layout.blocked.any() else []
    told += [f"orange: {shaded}"] if shaded else []
    told += [f"without an arrow: {blank}"] if blank else []
    every = _stride(layout)
    told += [f"arrows in one of every {every} rows and columns"] if policies and every > 1 else []
    figure.supxlabel("     ".join(told), fontsize=9, color=GREY)


def cells(
    axis: Axes, layout: GridLayout, values: np.ndarray, *, cmap: str, norm: Normalize, label: str, ends: bool = True
) -> None:
    """A map coloured by values (S,), blank where NaN, with numbers where there is room; `ends=False` leaves ends blank."""
    unknown = ~np.isfinite(layout.cells(values)) & ~layout.blocked
    hidden = (layout.blocked if ends else layout.blocked | layout.terminal) | unknown
    shown = np.ma.masked_array(layout.cells(values), hidden)
    mappable = ScalarMappable(norm, cmap)
    colours = mappable.to_rgba(shown)[..., :3]
    colours[layout.blocked] = to_rgb(BLOCKED)
    colours[unknown] = to_rgb(OPEN)
    if not ends:
        _tint_ends(colours, layout)
    _show(axis, layout, colours)
    axis.figure.colorbar(mappable, ax=axis, label=label, shrink=0.85, aspect=25, pad=0.02)
    numbers = layout.n_cells <= MOST_NUMBERS
    if numbers:
        written, size = _written(shown.compressed()), _size(layout, 0.23)
        for row, column in np.argwhere(~hidden):
            ink = _ink(colours[row, column])
            axis.text(column, row + 0.06, written(shown[row, column]), ha="center", va="center", color=ink, fontsize=size)
    _letters(axis, layout, colours, centred=hidden if numbers else np.ones(layout.shape, dtype=bool))


def triangles(axis: Axes, layout: GridLayout, R: np.ndarray) -> str:
    """A map of R (S, A), each cell cut into one triangle a move; returns what was drawn, for the title.

    Where the actions are not moves to the four sides, or the cells too small, the largest reward over actions colours
    the cell.
    """
    shown = ~(layout.blocked | layout.terminal)
    largest = max(float(np.abs(layout.cells(R)[shown]).max(initial=0)), 1e-9)
    norm = CenteredNorm(0, halfrange=largest)
    sides = {tuple(direction) for direction in layout.directions.tolist()}
    distinct = len(sides) == len(layout.directions) and sides <= {(-1, 0), (0, 1), (1, 0), (0, -1)}
    if not distinct or max(layout.shape) > MOST_ARROWS:
        cells(axis, layout, R.max(axis=1), cmap="RdBu", norm=norm, label="reward of a step", ends=False)
        return "largest over actions"
    mappable = ScalarMappable(norm, "RdBu")
    colours = np.broadcast_to(to_rgb(OPEN), (*layout.shape, 3)).copy()
    colours[layout.blocked] = to_rgb(BLOCKED)
    _tint_ends(colours, layout)
    _show(axis, layout, colours)
    centres = np.argwhere(shown)[:, ::-1]  # (x, y)
    written = _written(layout.cells(R)[shown])
    for a, (down, right) in enumerate(layout.directions):
        along, across = np.array([right, down]) / 2, np.array([down, right]) / 2
        corners = np.stack([np.zeros(2), along + across, along - across])
        paid = layout.cells(R)[shown][:, a]
        shape = PolyCollection(list(centres[:, None] + corners), facecolors=mappable.to_rgba(paid), linewidths=0.4)
        shape.set_edgecolor("#e2e3e6" if cell_inches(layout) > 0.2 else "none")
        axis.add_collection(shape)
        for (x, y), value in zip(centres, paid, strict=True) if cell_inches(layout) >= 0.7 else ():
            ink = _ink(np.asarray(mappable.to_rgba(value)[:3]))
            spot = np.array([x, y]) + 0.54 * along
            axis.text(spot[0], spot[1], written(value), ha="center", va="center", color=ink, fontsize=_size(layout, 0.13))
    axis.figure.colorbar(mappable, ax=axis, label="reward of a step", shrink=0.85, aspect=25, pad=0.02)
    _letters(axis, layout, colours, centred=~shown, only=~shown)
    for row, column in np.argwhere(shown & (layout.letters != "")):  # where the triangles meet
        patch = {"boxstyle": "circle,pad=0.2", "facecolor": "white", "edgecolor": "none"}
        letter, size = str(layout.letters[row, column]), _size(layout, 0.13)
        axis.text(column, row, letter, ha="center", va="center", weight="bold", fontsize=size, bbox=patch)
    return "one triangle for each move"


def arrows(axis: Axes, layout: GridLayout, weights: np.ndarray, judged: np.ndarray, wrong: np.ndarray) -> None:
    """A map of arrows for weights (S, A), probabilities or sets; (S,) `judged` states have arrows, `wrong` a shade."""
    colours = np.broadcast_to(to_rgb(OPEN), (*layout.shape, 3)).copy()
    colours[layout.blocked] = to_rgb(BLOCKED)
    _tint_ends(colours, layout)
    colours[layout.cells(wrong)] = to_rgb(WRONG)
    _show(axis, layout, colours)
    every = _stride(layout)
    chosen = layout.cells(np.where(judged[:, None], weights, 0.0))[::every, ::every]
    share = chosen / np.maximum(chosen.max(axis=2, keepdims=True), 1e-300)
    row, column, a = np.nonzero(share >= LEAST_SHARE)
    alone = (share >= LEAST_SHARE).sum(axis=2)[row, column] == 1
    down, right = layout.directions[a].T
    length = every * np.where(alone, 0.6, 0.42 * share[row, column, a])
    back = every * np.where(alone, 0.3, 0.03)
    x, y = column * every, row * every
    off = layout.cells(wrong)[y, x]
    moves = (down != 0) | (right != 0)
    for mask, colour in ((moves & ~off, INK), (moves & off, "#8f2d00")):
        axis.quiver(
            (x - back * right)[mask], (y - back * down)[mask], (length * right)[mask], (length * down)[mask],
            angles="xy", scale_units="xy", scale=1, units="xy", color=colour,
            width=0.065 * every, headwidth=4, headlength=3.6, headaxislength=3.4, minlength=0, zorder=3,
        )  # fmt: skip
    axis.scatter(x[~moves], y[~moves], s=10, color=INK, zorder=3)
    _letters(axis, layout, colours, centred=layout.terminal)


def sorted_line(axis: Axes, values: np.ndarray) -> None:
    """Values from largest to smallest, filled down to 0."""
    ranks, ordered = np.arange(1, values.size + 1), np.sort(values)[::-1]
    axis.fill_between(ranks, ordered, 0, where=list(ordered >= 0), step="mid", color=BLUE, alpha=0.25, linewidth=0)
    axis.fill_between(ranks, ordered, 0, where=list(ordered <= 0), step="mid", color=ORANGE, alpha=0.25, linewidth=0)
    axis.step(ranks, ordered, where="mid", color=INK, linewidth=1.4)
    axis.axhline(0, color=GREY, linewidth=0.8)
    axis.margins(x=0.01)
    plain(axis)


def telling(values: np.ndarray, name: Callable[[int], str]) -> list[tuple[str, float]]:
    """The names and values of the entries that say most: the highest and the lowest, highest first."""
    order = np.argsort(-values, kind="stable")
    chosen = order if order.size <= 2 * MOST_NAMED else np.concatenate([order[:MOST_NAMED], order[-MOST_NAMED:]])
    return [(name(int(i)), float(values[i])) for i in chosen]


def named_bars(axis: Axes, entries: Sequence[tuple[str, float]]) -> None:
    """Horizontal bars with a name each, the first on top; a gap where entries between were left out."""
    names, values = [name for name, _ in entries], np.array([value for _, value in entries])
    places = np.arange(len(entries)) + (np.arange(len(entries)) >= MOST_NAMED) * (len(entries) == 2 * MOST_NAMED) * 0.8
    axis.barh(places, values, color=[BLUE if value >= 0 else ORANGE for value in values], height=0.75)
    axis.set_yticks(places, names, fontsize=8)
    axis.axvline(0, color=GREY, linewidth=0.8)
    axis.invert_yaxis()
    axis.margins(x=0.02, y=0.01)
    plain(axis)


def action_counts(axis: Axes, parts: Mapping[str, np.ndarray], names: Sequence[str]) -> None:
    """Horizontal bars: in how many states each action is taken; parts (A,) are stacked, actions have names (A,)."""
    places, left = np.arange(len(names)), np.zeros(len(names))
    for (name, counts), colour in zip(parts.items(), (BLUE, ORANGE) if len(parts) > 1 else (GREEN,), strict=False):
        axis.barh(places, counts, left=left, color=colour, label=name, height=0.7)
        left = left + counts
    for a, total in enumerate(left):
        axis.annotate(f"{int(total)}", (total, a), xytext=(4, 0), textcoords="offset points", va="center", color=INK)
    axis.set_yticks(places, names)
    axis.invert_yaxis()
    axis.margins(x=0.12)
    axis.set_xlabel("states in which the action is taken")
    if len(parts) > 1:
        axis.legend(frameon=False, loc="upper left", bbox_to_anchor=(0.0, -0.12), ncols=len(parts))
    plain(axis)


def plain(axis: Axes) -> None:
    """No box: lines at the left and below only."""
    axis.spines[["top", "right"]].set_visible(False)
    axis.set_axisbelow(True)


def cell_inches(layout: GridLayout) -> float:
    """The side of a cell."""
    rows, columns = layout.shape
    return float(np.clip((9.0 if columns > 2 * rows else 4.8) / max(rows, columns), 0.004, 1.0))


def _size(layout: GridLayout, share: float) -> float:
    """Font size, in points, of text as high as a share of a cell."""
    return float(np.clip(72 * share * cell_inches(layout), 4.5, 11))


def _stride(layout: GridLayout) -> int:
    return -(-max(layout.shape) // MOST_ARROWS)


def _show(axis: Axes, layout: GridLayout, colours: np.ndarray) -> None:
    """The coloured cells with thin lines between them."""
    rows, columns = layout.shape
    axis.imshow(colours, interpolation="nearest")
    axis.autoscale(False)  # arrows would make room for themselves
    if max(rows, columns) <= MOST_ARROWS:
        axis.set_xticks(np.arange(columns + 1) - 0.5, minor=True)
        axis.set_yticks(np.arange(rows + 1) - 0.5, minor=True)
        axis.grid(which="minor", color="white", linewidth=0.8)
    if max(rows, columns) <= 15:
        axis.set_xticks(np.arange(columns))
        axis.set_yticks(np.arange(rows))
    axis.tick_params(which="both", length=0, labelsize=8, labelcolor=GREY)
    axis.set_xlabel("column", fontsize=9, color=GREY)
    axis.set_ylabel("row", fontsize=9, color=GREY)
    axis.spines[:].set_color(BLOCKED)


def _tint_ends(colours: np.ndarray, layout: GridLayout) -> None:
    for letter, colour in ENDS.items():
        colours[(layout.letters == letter) & layout.terminal] = to_rgb(colour)


def _letters(
    axis: Axes, layout: GridLayout, colours: np.ndarray, *, centred: np.ndarray, only: np.ndarray | None = None
) -> None:
    """The letters of the layout: in the middle of a cell where `centred`, else in its upper left corner."""
    if max(layout.shape) > MOST_ARROWS:
        return
    for row, column in np.argwhere((layout.letters != "") & (True if only is None else only)):
        style: dict[str, Any] = {"color": _ink(colours[row, column]), "weight": "bold"}
        letter = str(layout.letters[row, column])
        if centred[row, column]:
            axis.text(column, row, letter, ha="center", va="center", fontsize=_size(layout, 0.36), **style)
        else:
            axis.text(column - 0.42, row - 0.42, letter, ha="left", va="top", fontsize=_size(layout, 0.2), **style)


def _ink(colour: np.ndarray) -> str:
    """Black or white, whichever can be read on a colour."""
    return INK if float(np.dot(colour[:3], (0.299, 0.587, 0.114))) > 0.52 else "white"


def _written(values: np.ndarray):
    """A short way to write numbers of this size: str of a float."""
    largest = float(np.abs(values).max(initial=0))
    whole = bool(np.all(values == np.rint(values)))
    digits = 0 if whole or largest >= 100 else 1 if largest >= 10 else 2 if largest >= 0.1 or largest == 0 else 3
    return lambda value: f"{round(float(value), digits) + 0.0:.{digits}f}" if largest >= 0.01 or whole else f"{value:.0e}"
