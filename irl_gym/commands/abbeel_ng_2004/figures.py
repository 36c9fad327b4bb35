"""Figure 4 of Abbeel & Ng (2004), drawn from what the experiment gave."""

from pathlib import Path

import numpy as np

from irl_gym.commands.abbeel_ng_2004.figure_4 import CURVES, PUBLISHED, Outcome4
from irl_gym.reports.drawing import BLUE, GREEN, INK, ORANGE, blank, plain
from irl_gym.reports.plotting import save_figure


def draw(outcome: Outcome4, folder: Path) -> list[str]:
    """Write figure 4 as PNG into a folder; returns its name."""
    figure = blank(7.4, 4.6)
    axis = figure.add_subplot()
    for name, mean, error, colour in zip(CURVES, outcome.means, outcome.errors, (BLUE, ORANGE, GREEN), strict=True):
        axis.errorbar(outcome.settings.sizes, mean, 2 * error, color=colour, linewidth=1.6, capsize=2, label=name)
        read = np.array(sorted(PUBLISHED[name].items()))
        axis.plot(read[:, 0], read[:, 1], "o", color=colour, markerfacecolor="white", zorder=3)
    axis.plot([], [], "o", color=INK, markerfacecolor="white", label="read off the paper")
    axis.set(xscale="log", xlabel="trajectories shown", ylabel="value of the clone / of the expert", ylim=(0, 1.02))
    axis.legend(frameon=False, fontsize=8.5)
    plain(axis)
    save_figure(figure, folder / "figure_4.png")
    return ["figure_4.png"]
