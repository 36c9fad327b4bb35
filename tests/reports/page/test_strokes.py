"""How several curves of one figure are told apart: by colours that are far apart, then by dash and shape."""

import re
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from reports.page.made_runs import table_run

from irl_gym.reports.comparison.compared_runs import lettered
from irl_gym.reports.comparison.comparison_page import MOST_RUNS
from irl_gym.reports.comparison.ranked import learning
from irl_gym.reports.page.sections import training
from irl_gym.runs.supply import supplied

CSS = (Path(training.__file__).parents[1] / "assets" / "page.css").read_text()
TO_CONES = np.array([[0.4122, 0.5363, 0.0514], [0.2119, 0.6807, 0.1074], [0.0883, 0.2817, 0.6300]])
TO_OKLAB = np.array([[0.2105, 0.7936, -0.0041], [1.9780, -2.4286, 0.4506], [0.0259, 0.7828, -0.8087]])
SEEN = {
    "all colours": np.eye(3),
    "no red": np.array([[0.1523, 1.0526, -0.2049], [0.1145, 0.7863, 0.0992], [-0.0039, -0.0481, 1.0520]]),
    "no green": np.array([[0.3673, 0.8606, -0.2280], [0.2801, 0.6725, 0.0474], [-0.0118, 0.0429, 0.9689]]),
}
"""What who sees like that sees of a linear colour (Machado et al. 2009)."""


def colours(name):
    """Linear colours of a variable, by theme; the sheet has the dark ones twice, where the system and the button ask."""
    found = re.findall(rf"--{name}: (#[0-9a-f]{{6}});", CSS)
    light, dark = found[0], found[1]
    assert found[1:] == [dark, dark]
    coded = np.array([[int(one[i : i + 2], 16) / 255 for i in (1, 3, 5)] for one in (light, dark)])
    return dict(
        zip(("light", "dark"), np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4), strict=True)
    )


def apart(one, other, seen):
    """Distance in Oklab, where black and white are 1 apart (Ottosson 2020)."""
    ends = (TO_OKLAB @ np.cbrt(TO_CONES @ np.clip(SEEN[seen] @ colour, 0, 1)) for colour in (one, other))
    return float(np.linalg.norm(np.subtract(*ends)))


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize(("seen", "least"), [("all colours", 0.12), ("no red", 0.07), ("no green", 0.07)])
def test_colours_of_runs_and_levels_are_far_apart(theme, seen, least):
    shown = {name: colours(name)[theme] for name in (*training.COLOURS, "ink", "muted")}
    close = {pair: apart(*(shown[name] for name in pair), seen) for pair in combinations(shown, 2)}
    assert min(close.values()) > least, min(close, key=close.__getitem__)


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_colours_of_runs_stand_out_from_the_page(theme):
    weights = np.array([0.2126, 0.7152, 0.0722])
    page = float(colours("card")[theme] @ weights) if theme == "dark" else 1.0
    for name in training.COLOURS:
        lighter, darker = sorted((float(colours(name)[theme] @ weights), page), reverse=True)
        assert (lighter + 0.05) / (darker + 0.05) >= 3, name


def test_every_run_of_a_comparison_is_drawn_differently():
    drawn = {(one.colour, one.dash, one.marker["symbol"]) for one in map(training.stroke, range(MOST_RUNS))}
    assert len(drawn) == MOST_RUNS


def test_levels_have_colours_and_dashes_that_no_run_has():
    strokes = [training.stroke(i) for i in range(MOST_RUNS)]
    for level in training.usual_levels(1.0, 0.0):
        assert level.colour not in training.COLOURS and level.dash not in {one.dash for one in strokes}


def test_curves_whose_colours_come_again_differ_in_dash_and_shape(tmp_path):
    run = table_run(tmp_path, films=False)
    (panel,) = supplied(learning, lettered([run] * 7)).panels
    first, again = panel.figure.data[0], panel.figure.data[6]
    assert first.line.color == again.line.color and (first.line.dash, again.line.dash) == ("solid", "9px,3px")
    assert (first.marker.symbol, again.marker.symbol) == ("circle", "square")
