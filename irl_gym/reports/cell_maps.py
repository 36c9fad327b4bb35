"""Pictures of a plane of cells: rewards, values and actions over the two coordinates of a discretised environment.

Only cells that some episode reaches are coloured; terminal copies are not on the plane. Axes: S states, A actions.
"""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import CenteredNorm, ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from irl_gym.mdp.tabular_mdp import TransitionTable
from irl_gym.reports import drawing
from irl_gym.tables.cells import Cells

ACTIONS = ("#0072b2", "#d7d7d2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#f0e442")
"""Colours of actions 0, 1, ...; more actions than these share them."""


def draw_planes(cells: Cells, table: TransitionTable, panels: Mapping[str, np.ndarray], *, label: str, centred: bool) -> Figure:
    """Values side by side, each on its own scale.

    Args:
        cells: of two coordinates.
        table: S states.
        panels: by title, (S,) values.
        label: of the colour bars.
        centred: is 0 in the middle of the colours (rewards), or not (values)?
    """
    figure = drawing.blank(5.6 * len(panels), 4.4)
    for axis, (title, values) in zip(np.atleast_1d(figure.subplots(1, len(panels))), panels.items(), strict=True):
        plane(axis, cells, table, values, label=label, centred=centred)
        axis.set_title(title)
    return figure


def plane(axis: Axes, cells: Cells, table: TransitionTable, values: np.ndarray, *, label: str, centred: bool) -> None:
    """Values (S,) in one panel; the rest as of `draw_planes`."""
    shown = _plane(cells, table, values)
    largest = float(np.abs(shown).max()) or 1.0
    norm = CenteredNorm(0, halfrange=largest) if centred else Normalize(float(shown.min()), float(shown.max()))
    mappable = _show(axis, cells, shown, cmap="RdBu" if centred else "viridis", norm=norm)
    axis.figure.colorbar(mappable, ax=axis, label=label, aspect=25, pad=0.02)


def draw_actions(cells: Cells, table: TransitionTable, panels: Mapping[str, np.ndarray], n_actions: int) -> Figure:
    """Policies side by side; panels are (S,) actions by title."""
    figure, handles = drawing.blank(5.2 * len(panels), 4.8), []
    for axis, (title, actions) in zip(np.atleast_1d(figure.subplots(1, len(panels))), panels.items(), strict=True):
        handles = plane_of_actions(axis, cells, table, actions, tuple(f"action {a}" for a in range(n_actions)))
        axis.set_title(title)
    figure.legend(handles=handles, frameon=False, loc="outside lower center", ncols=min(n_actions, 6))
    return figure


def plane_of_actions(
    axis: Axes, cells: Cells, table: TransitionTable, actions: np.ndarray, names: tuple[str, ...]
) -> list[Patch]:
    """Actions (S,) in one panel, NaN where nothing is known; returns what a legend says of the colours."""
    colours = [ACTIONS[a % len(ACTIONS)] for a in range(len(names))]
    _show(axis, cells, _plane(cells, table, actions), cmap=ListedColormap(colours), norm=Normalize(-0.5, len(names) - 0.5))
    return [Patch(color=colour, label=name) for colour, name in zip(colours, names, strict=True)]


def _plane(cells: Cells, table: TransitionTable, values: np.ndarray) -> np.ma.MaskedArray:
    """(first, second coordinate) of values (S,), without what no episode reaches or where nothing is known (NaN)."""
    n = cells.n_cells
    on_plane = np.asarray(values, dtype=float)[:n].reshape(cells.shape)
    return np.ma.masked_array(on_plane, ~table.reachable[:n].reshape(cells.shape) | np.isnan(on_plane))


def _show(axis: Axes, cells: Cells, shown: np.ma.MaskedArray, **colouring):
    where = cells.coordinates
    extent = (float(where.low[0]), float(where.high[0]), float(where.low[1]), float(where.high[1]))
    axis.set(xlabel=where.names[0].replace("_", " "), ylabel=where.names[1].replace("_", " "))
    return axis.imshow(shown.T, origin="lower", aspect="auto", extent=extent, interpolation="nearest", **colouring)
