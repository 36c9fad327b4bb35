"""One picture of a reward, a policy, values or an occupancy: on the environment's map, on a plane of cells, or as bars.

The parts are those of a run's figures (`plotting`, `drawing`, `cell_maps`). Axes: S states, A actions.
"""

from typing import Any, Literal, get_args

import gymnasium as gym
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import CenteredNorm, Normalize
from matplotlib.figure import Figure

from irl_gym.checks import is_word
from irl_gym.errors import InvalidParameter, a_type
from irl_gym.features.linear_reward import LinearReward
from irl_gym.mdp.policies import as_distribution, completed, policy_array
from irl_gym.mdp.rewards import RewardFunction, as_reward
from irl_gym.reports import cell_maps, drawing, plotting
from irl_gym.spaces.names import Names
from irl_gym.tables.cells import Cells
from irl_gym.tables.layouts import GridLayout, map_of
from irl_gym.tables.tabulate import tabulate
from irl_gym.tables.tabulation import Tabulation

Kind = Literal["reward", "policy", "values", "occupancy"]
LEAST_POINTS = 3.5
"""Texts of a map that would be smaller are left out."""
ANY_GAMMA = 0.5
"""Of a table that is made for its P alone."""


def plot(
    what: Any, env: gym.Env, *, kind: Kind | None = None, table: Tabulation | None = None, ax: Axes | None = None,
    title: str | None = None,
) -> Figure:  # fmt: skip
    """Draw a reward, a policy, values or an occupancy of an environment.

    A grid environment is drawn as its map: colours with 0 in the middle where numbers have signs, arrows for actions; the two
    coordinates of a discretised environment as a plane; of any other the highest and the lowest are bars, with their names.

    Args:
        what: a reward, an Outcome (its reward, or else its policy), a Solution or a TabularPolicy (a policy), or an array:
            (S,) integers, (S, A) booleans or rows that sum to 1 are a policy, (S,) floats are values; of others say the kind.
        env: the environment. It is left as it is.
        kind: what it is, where it does not tell itself.
        table: the environment's, with the rows that `what` is of; None for `tabulate(env)`.
        ax: where to draw; None for a figure of its own.
        title: above it; None for one that says what it is.

    Returns:
        The figure, `figure.savefig("reward.png")` keeps it; notebooks show it.

    Raises:
        InvalidParameter: an array whose kind cannot be told, or of another size than the table.
        InvalidReward, InvalidPolicy: one that is not of the environment's table.
        NotTabular, NotDiscrete: no table can be made of the environment.
    """
    if not isinstance(env, gym.Env):
        raise InvalidParameter(
            f"env is {a_type(env)}: expected an environment, whose map is drawn. Give a table besides, as `table`."
        )
    table = tabulate(env, gamma=ANY_GAMMA, check_steps=0) if table is None else table
    found, values = _told(what, kind, table)
    layout = map_of(env, table)
    figure, axis = _panel(layout) if ax is None else (_figure_of(ax), ax)
    draw = {"reward": _reward, "policy": _policy, "values": _values, "occupancy": _occupancy}[found]
    said = draw(axis, values, table, layout, Names.of(env, table.states, None if env.spec is None else env.spec.id))
    axis.set_title(said if title is None else title, fontsize=10 if layout is None else None)
    if ax is None and layout is not None:
        drawing.footnote(figure, layout, policies=found == "policy")
    elif layout is not None:
        _fit_texts(axis, layout)
    return figure


def _panel(layout: GridLayout | None) -> tuple[Figure, Axes]:
    """One panel, as large as its map."""
    cell = 0.0 if layout is None else drawing.cell_inches(layout)
    size = (7.6, 4.6) if layout is None else (max(layout.shape[1] * cell + 1.8, 4.8), layout.shape[0] * cell + 1.3)
    figure = drawing.blank(*size)
    return figure, figure.subplots()


def _fit_texts(axis: Axes, layout: GridLayout) -> None:
    """Make the texts of a map as much smaller as its panel is than one of its own; none where they could not be read."""
    box, dots = axis.get_window_extent(), _figure_of(axis).dpi
    cell = min(box.height / layout.shape[0], box.width / layout.shape[1]) / dots
    share = min(1.0, cell / drawing.cell_inches(layout))
    for text in axis.texts:
        size = share * float(text.get_fontsize())
        text.set_fontsize(size)
        text.set_visible(size >= LEAST_POINTS)


def _figure_of(axis: Axes) -> Figure:
    figure: Any = axis.get_figure(root=True)
    return figure


def _told(what: Any, kind: Kind | None, table: Tabulation) -> tuple[Kind, np.ndarray]:
    """Of which kind it is, and its numbers: (S,) or (S, A)."""
    if kind is not None and not is_word(kind, *get_args(Kind)):
        raise InvalidParameter(f"kind is {kind!r}: expected one of {', '.join(get_args(Kind))}.")
    shape = table.mdp.n_states, table.mdp.n_actions
    held = getattr(what, "reward", None)
    reward = what if isinstance(what, RewardFunction) else held
    if kind == "reward" or (kind is None and reward is not None):
        reward = what if reward is None else reward
        known: Any = reward.tabular(table.states) if isinstance(reward, LinearReward) else getattr(reward, "paid", reward)
        known = as_reward(known)
        known.expected(table.mdp)  # refuses what is of another size
        return "reward", known.values
    array = policy_array(what)
    kind = _kind_of(array, table) if kind is None else kind
    if kind == "policy":
        filled, seen = completed(array, shape[0])
        return kind, np.where(seen[:, None], as_distribution(filled, *shape), np.nan)
    if array.shape not in ((shape[:1],) if kind == "values" else (shape[:1], shape)) or array.dtype.kind not in "biuf":
        raise InvalidParameter(f"{kind} of shape {array.shape}: expected numbers of {shape[0]} states. Is it another table's?")
    return kind, array.astype(np.float64)


def _kind_of(array: np.ndarray, table: Tabulation) -> Kind:
    if array.dtype.kind in "biu" and array.ndim in (1, 2):
        return "policy"
    if array.ndim == 1:
        return "values"
    sums = array.sum(axis=-1) if array.ndim == 2 else np.zeros(1)
    if (np.isnan(sums) | (np.abs(sums - 1) < 1e-8)).all():
        return "policy"
    raise InvalidParameter(
        f"an array of shape {array.shape} may be a reward or an occupancy: expected to be told. Give `kind='reward'` or "
        "`kind='occupancy'`."
    )


def _reward(axis: Axes, R: np.ndarray, table: Tabulation, layout: GridLayout | None, names: Names) -> str:
    if layout is not None:
        return f"Reward, {plotting.reward_map(axis, layout, R, table.mdp)}"
    if _on_plane(table):
        paid = R if R.ndim == 1 else R.max(axis=1)
        cell_maps.plane(axis, _cells(table), table.mdp, paid, label="reward", centred=True)
        return "Reward on arrival" if R.ndim == 1 else "Reward of a step, largest over actions"
    plotting.draw_sorted_reward(None, axis, "Reward", R, table.mdp, names)
    return axis.get_title()


def _values(axis: Axes, V: np.ndarray, table: Tabulation, layout: GridLayout | None, names: Names) -> str:
    return _numbers(axis, V, table, layout, names, "Values", "discounted value")


def _occupancy(axis: Axes, mu: np.ndarray, table: Tabulation, layout: GridLayout | None, names: Names) -> str:
    visits = mu if mu.ndim == 1 else mu.sum(axis=1)
    return _numbers(axis, visits, table, layout, names, "Occupancy", "discounted visits", least=0.0)


def _numbers(
    axis: Axes, V: np.ndarray, table: Tabulation, layout: GridLayout | None, names: Names, name: str, label: str,
    least: float | None = None,
) -> str:  # fmt: skip
    """Numbers of states that act; 0 is in the middle of the colours where they have both signs."""
    judged = table.mdp.reachable & ~table.mdp.terminal & np.isfinite(V)
    if not judged.any():
        raise InvalidParameter(f"{name.lower()} of no state that acts: expected finite numbers.")
    low, high = float(V[judged].min()), float(V[judged].max())
    signed = low < 0 < high
    if layout is not None:
        norm = CenteredNorm(0, halfrange=max(-low, high)) if signed else Normalize(low if least is None else least, high)
        drawing.cells(axis, layout, V, cmap="RdBu" if signed else "viridis", norm=norm, label=label, ends=False)
        return name
    if _on_plane(table):
        shown = np.where(judged, V, np.nan)
        cell_maps.plane(axis, _cells(table), table.mdp, shown, label=label, centred=signed)
        return name
    rows = np.flatnonzero(judged)
    entries = drawing.telling(V[judged], lambda i: names.state(int(rows[i])))
    drawing.named_bars(axis, entries)
    axis.set_xlabel(label)
    return plotting.of_all(name, len(entries), rows.size, "states")


def _policy(axis: Axes, policy: np.ndarray, table: Tabulation, layout: GridLayout | None, names: Names) -> str:
    acting = table.mdp.reachable & ~table.mdp.terminal
    judged = acting & ~np.isnan(policy).any(axis=1)
    known = np.nan_to_num(policy)
    told = "Policy" if (judged == acting).all() else f"Policy, known in {int(judged.sum())} of {int(acting.sum())} states"
    if layout is not None:
        drawing.arrows(axis, layout, known, judged, np.zeros_like(judged))
    elif _on_plane(table):
        likeliest = np.where(judged, known.argmax(axis=1), np.nan)
        handles = cell_maps.plane_of_actions(axis, _cells(table), table.mdp, likeliest, names.actions)
        axis.legend(handles=handles, frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.15), ncols=min(len(handles), 4))
    else:
        drawing.action_counts(axis, {"policy": (known * judged[:, None] > 0).sum(axis=0)}, names.actions)
    return told


def _on_plane(table: Tabulation) -> bool:
    return isinstance(table.states, Cells) and len(table.states.shape) == 2


def _cells(table: Tabulation) -> Cells:
    states: Any = table.states
    return states
