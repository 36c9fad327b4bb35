"""The figures of Ng & Russell (2000), drawn from what the experiments gave: surfaces of figures 1 and 2, curves of 4 and 5."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from irl_gym.commands.ng_russell_2000.experiment_1 import Outcome1
from irl_gym.commands.ng_russell_2000.experiment_2 import PARKING, PLATEAU, Fits, Outcome2
from irl_gym.commands.ng_russell_2000.experiment_3 import Outcome3
from irl_gym.files.own_files import whole
from irl_gym.reports.drawing import BLUE, GREEN, GREY, INK, ORANGE, SERIES, arrows, blank, footnote, plain
from irl_gym.reports.plotting import save_figure
from irl_gym.tables.layouts import grid_layout

ExperimentOutcome = Outcome1 | Outcome2 | Outcome3
"""What the figures are drawn from."""


def draw(outcome: ExperimentOutcome, folder: Path) -> list[str]:
    """Write the figures of one experiment as PNG into a folder; returns their names."""
    figures: dict[str, Figure] = {}
    if isinstance(outcome, Outcome1):
        figures = {"figure_1.png": figure_1(outcome), "figure_2.png": figure_2(outcome)}
    elif isinstance(outcome, Outcome2):
        figures = {"figure_4.png": figure_4(outcome)}
    else:
        figures = {"figure_5.png": figure_5(outcome)}
    for name, figure in figures.items():
        save_figure(figure, folder / name)
        _shrink(folder / name)
    return list(figures)


def _shrink(path: Path) -> None:
    """Write a picture with a palette of 128 colours, which is a third of its size; beside, then renamed."""
    with Image.open(path) as picture:
        smaller = picture.convert("RGB").quantize(128)
    with whole(path) as file:
        smaller.save(file, "png", optimize=True)


def figure_1(outcome: Outcome1) -> Figure:
    """The expert and the true reward."""
    figure = blank(9.4, 4.4)
    axis = figure.add_subplot(1, 2, 1)
    table = outcome.table.mdp
    layout: Any = grid_layout(outcome.env, table)
    chosen = np.eye(table.n_actions)[outcome.expert]
    arrows(axis, layout, chosen, ~table.terminal, np.zeros(table.n_states, dtype=bool))
    axis.set_title("The expert: ties up, right, down, left", fontsize=11)
    _surface(figure, (1, 2, 2), outcome.true, "True reward")
    footnote(figure, layout, policies=True)
    return figure


def figure_2(outcome: Outcome1) -> Figure:
    """The fitted rewards, without and with the price on ||R||_1."""
    figure = blank(9.4, 4.6)
    for place, (R, l1) in enumerate(zip(outcome.panels, (0, outcome.settings.l1), strict=True), start=1):
        _surface(figure, (1, 2, place), R, rf"Fitted reward, $\lambda$ = {l1}")
    figure.supxlabel(rf"above $\lambda_0$ = {outcome.lambda_0:.5f} the fitted reward is 0 everywhere", fontsize=9, color=GREY)
    return figure


def _surface(figure: Figure, place: tuple[int, int, int], R: np.ndarray, title: str) -> None:
    """A reward (rows, columns) as a surface over the cells' middles, seen from the lower left corner, where episodes begin."""
    axis: Any = figure.add_subplot(*place, projection="3d")
    rows, columns = R.shape
    x, y = np.meshgrid(np.arange(columns), -np.arange(rows))  # row 0 is the uppermost
    low, high = min(float(R.min()), 0.0), max(float(R.max()), 0.0)
    style = {"rstride": 1, "cstride": 1, "vmin": low, "vmax": high, "edgecolor": INK, "linewidth": 0.7}
    axis.plot_surface(x, y, R, cmap="viridis", **style)
    axis.view_init(elev=32, azim=-122)
    axis.set(xticks=np.arange(columns), yticks=-np.arange(rows), yticklabels=np.arange(rows), zlim=(low, high))
    axis.set_zticks(np.arange(-1, 1.01, 0.5) if low < -0.5 else np.arange(0, 1.01, 0.25))
    axis.set_xlabel("column", fontsize=9, labelpad=1)
    axis.set_ylabel("row", fontsize=9, labelpad=3)
    axis.set_zlabel("R", fontsize=9, labelpad=-2)
    axis.tick_params(labelsize=8, pad=0)
    axis.set_title(title, fontsize=11, y=1.0)
    axis.set_box_aspect((1, 1, 0.7), zoom=0.92)


def figure_4(outcome: Outcome2) -> Figure:
    """The rewards fitted to the mountain car."""
    figure = blank(10.4, 4.4)
    left, right = figure.subplots(1, 2)
    _along_the_road(left, outcome.reach)
    edge = float(np.abs(outcome.reach.R - PLATEAU).max())
    left.set_ylim(PLATEAU - max(1.5 * edge, 2e-4), PLATEAU + max(1.5 * edge, 2e-4))
    left.axhline(PLATEAU, color=GREY, linestyle=(0, (5, 3)), linewidth=1)
    left.ticklabel_format(axis="y", useOffset=False)
    left.annotate(
        r"$-\sqrt{2\pi}$", (-0.35, PLATEAU), xytext=(0, -14), textcoords="offset points", color=GREY, ha="center", va="center"
    )
    left.set_title("(a) true reward: -1 a step   (note the scale of R)", fontsize=11)
    right.axvspan(*PARKING, color=GREEN, alpha=0.14, linewidth=0)
    _along_the_road(right, outcome.park)
    right.axhline(0, color=GREY, linewidth=0.9)
    right.annotate(
        "true reward 1\nhere, else 0", (float(np.mean(PARKING)), right.get_ylim()[0]), xytext=(0, 14), ha="center", va="bottom",
        textcoords="offset points", fontsize=8.5, color=GREEN,
    )  # fmt: skip
    right.set_title("(b) true reward: 1 in the valley", fontsize=11)
    if len(outcome.park.R) > 1:
        handles, labels = right.get_legend_handles_labels()
        right.legend(handles[::-1], labels[::-1], frameon=False, fontsize=8.5, loc="upper left", bbox_to_anchor=(0.56, 1.0))
    return figure


def _along_the_road(axis: Axes, fits: Fits) -> None:
    """A line for each sample of states."""
    for run, R in reversed(list(enumerate(fits.R))):
        first = run == 0
        label = "one sample of states" if first else "others" if run == 1 else None
        axis.plot(
            fits.road, R, color=BLUE if first else GREY, linewidth=2 if first else 0.9, alpha=1 if first else 0.8, label=label
        )
    axis.set(xlabel="car's position x", ylabel="fitted reward R(x)")
    axis.margins(x=0.01)
    plain(axis)


def figure_5(outcome: Outcome3) -> Figure:
    """Disagreement and value, round by round."""
    figure = blank(10.4, 4.4)
    asked = outcome.settings
    panels = (
        ("differ", "share of states where the policies differ", asked.most_differ),
        ("value", "true value of the fitted policy", asked.least_value * outcome.optimum),
    )
    for axis, (name, told, bar) in zip(figure.subplots(1, 2), panels, strict=True):
        rounds = np.arange(1, outcome.of(name).shape[1] + 1)
        for run, curve in enumerate(outcome.of(name)):
            axis.plot(rounds, curve, color=SERIES[3], linewidth=0.8, label="each run" if run == 0 else None)
        axis.plot(rounds, outcome.of(name).mean(axis=0), color=BLUE, linewidth=2.2, label="mean of runs, newest policy")
        answers = outcome.of(name, answers=True).mean(axis=0)
        axis.plot(rounds, answers, color=ORANGE, linewidth=1.8, linestyle=(0, (4, 2)), label="mean of runs, answer so far")
        axis.hlines(bar, asked.judged_from, rounds[-1], color=INK, linewidth=1.2, linestyle=(0, (1, 1.5)), label="bar")
        axis.set(xlabel="round", ylabel=told)
        axis.set_xlim(1, rounds[-1])
        plain(axis)
    left, right = figure.axes
    right.axhline(outcome.optimum, color=GREEN, linewidth=1.2, label=f"optimum {outcome.optimum:.3f}")
    left.set_ylim(0, None)
    left.set_title("(a) disagreement with the optimal policy", fontsize=11)
    right.set_title("(b) value", fontsize=11)
    left.legend(frameon=False, fontsize=8.5)
    right.legend(*_only(right, "optimum", "bar"), frameon=False, fontsize=8.5, loc="lower right")
    return figure


def _only(axis: Axes, *words: str) -> tuple[list[Any], list[Any]]:
    """Handles and labels of those that begin with a word."""
    handles, labels = axis.get_legend_handles_labels()
    kept = [(handle, label) for handle, label in zip(handles, labels, strict=True) if str(label).startswith(words)]
    return [handle for handle, _ in kept], [label for _, label in kept]
