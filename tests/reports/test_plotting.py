"""Layouts and figures. Figures are judged by what they hold: texts, arrows, colours, bytes."""

import sys
from subprocess import run

import gymnasium as gym
import matplotlib.image
import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.quiver import Quiver

from irl_gym.errors import InvalidParameter
from irl_gym.mdp.planning.dynamic_programming import tied, value_iteration
from irl_gym.reports import drawing
from irl_gym.reports.plotting import (
    DrawnCurve,
    draw_learning_curve,
    draw_policies,
    draw_returns,
    draw_rewards,
    draw_values,
    save_figure,
)
from irl_gym.tables.layouts import grid_layout
from irl_gym.tables.tabulate import tabulate

GRID_WORLD = "irl_gym_envs:irl_gym/GridWorld-v0"
UP, RIGHT, DOWN, LEFT = (-1, 0), (0, 1), (1, 0), (0, -1)


class Case:
    """An environment, its table, the true reward, and an expert."""

    def __init__(self, env_id, **kwargs):
        self.env = gym.make(env_id, **kwargs)
        made = tabulate(self.env, gamma=0.99, check_steps=0)
        self.mdp, self.R = made.mdp, made.reward.values
        self.layout = grid_layout(self.env, self.mdp)
        solution = value_iteration(self.mdp, self.R)
        self.V, self.optimal = solution.V, tied(solution.Q, 1e-6)
        self.agent = np.eye(self.mdp.n_actions)[solution.policy]


@pytest.fixture(scope="module")
def lake():
    return Case("FrozenLake-v1", map_name="4x4", is_slippery=True)


@pytest.fixture(scope="module")
def cliff():
    return Case("CliffWalking-v1")


@pytest.fixture(scope="module")
def taxi():
    return Case("Taxi-v4")


def texts(axis):
    return [text.get_text() for text in axis.texts]


def directions_of(env_id, **kwargs):
    case = Case(env_id, **kwargs)
    return [tuple(direction) for direction in case.layout.directions.tolist()]


@pytest.mark.parametrize(
    ("env_id", "kwargs", "wanted"),
    [
        ("FrozenLake-v1", {"is_slippery": True}, [LEFT, DOWN, RIGHT, UP]),
        ("FrozenLake-v1", {"is_slippery": False}, [LEFT, DOWN, RIGHT, UP]),
        ("CliffWalking-v1", {}, [UP, RIGHT, DOWN, LEFT]),
        ("CliffWalkingSlippery-v1", {}, [UP, RIGHT, DOWN, LEFT]),
        (GRID_WORLD, {"slip": 0.7}, [UP, RIGHT, DOWN, LEFT]),
        ("irl_gym_envs:irl_gym/FourRooms-v0", {}, [UP, RIGHT, DOWN, LEFT]),
    ],
)
def test_grid_layout_finds_where_actions_go(env_id, kwargs, wanted):
    assert directions_of(env_id, **kwargs) == wanted


def test_grid_layout_gives_no_direction_to_moves_across_a_corridor():
    assert directions_of(GRID_WORLD, size=(1, 6)) == [(0, 0), RIGHT, (0, 0), LEFT]


def test_grid_layout_is_none_when_the_states_are_no_cells(taxi):
    assert taxi.layout is None


def test_grid_layout_reads_frozen_lakes_map(lake):
    assert ["".join(letter or "." for letter in row) for row in lake.layout.letters] == ["S...", ".H.H", "...H", "H..G"]


def test_grid_layout_names_the_only_end_a_goal(cliff):
    assert cliff.layout.letters[3, 11] == "G"


def test_grid_layout_blocks_what_no_episode_visits(cliff):
    assert np.flatnonzero(cliff.layout.blocked).tolist() == list(range(37, 47))


def test_grid_layout_reads_goals_and_pits_of_a_grid_world():
    letters = Case(GRID_WORLD, size=(2, 3), pits=[1, 2]).layout.letters
    assert letters.tolist() == [["", "", "G"], ["S", "", "H"]]


def test_grid_layout_leaves_terminal_copies_off_the_map(lake):
    values = np.arange(18.0)  # 16 cells and two copies
    assert lake.layout.cells(values).tolist() == np.arange(16.0).reshape(4, 4).tolist()


def test_draw_rewards_writes_the_reward_of_each_cell(lake):
    learned = np.arange(16) / 10
    figure = draw_rewards(lake.layout, lake.R, learned, lake.mdp)
    numbers = [text for text in texts(figure.axes[1]) if "." in text]
    assert numbers == [f"{value:.2f}" for value in learned]


def test_draw_rewards_centres_colours_on_zero(lake):
    figure = draw_rewards(lake.layout, lake.R, np.linspace(-2, 0.5, 16), lake.mdp)
    bar = next(axis for axis in figure.axes[2:] if axis.get_ylim()[0] < -1.5)
    assert bar.get_ylim() == pytest.approx((-2, 2))


def test_draw_rewards_cuts_cells_into_triangles_when_the_move_matters(cliff):
    figure = draw_rewards(cliff.layout, cliff.R, cliff.R / 100, cliff.mdp)
    pieces = [len(part.get_paths()) for part in figure.axes[0].collections if isinstance(part, PolyCollection)]
    assert pieces == [37, 37, 37, 37]


def test_draw_rewards_leaves_numbers_out_when_the_map_is_large():
    case = Case(GRID_WORLD, size=13)
    figure = draw_rewards(case.layout, case.R, np.ones(169), case.mdp)
    assert sorted(texts(figure.axes[1])) == ["G", "S"]


def test_draw_rewards_sorts_states_when_there_is_no_map(taxi):
    learned = np.random.default_rng(0).normal(size=500)
    figure = draw_rewards(None, taxi.R, learned, taxi.mdp)
    drawn = figure.axes[1].lines[0].get_ydata()
    np.testing.assert_array_equal(drawn, np.sort(learned[taxi.mdp.reachable])[::-1])


def test_draw_values_leaves_the_ends_without_a_number(lake):
    figure = draw_values(lake.layout, lake.V, 3 * lake.V, lake.mdp)
    assert sum("." in text for text in texts(figure.axes[0])) == 11


def test_draw_values_compares_states_when_there_is_no_map(taxi):
    figure = draw_values(None, taxi.V, 2 * taxi.V + 1, taxi.mdp)
    judged = taxi.mdp.reachable & ~taxi.mdp.terminal
    points = figure.axes[1].collections[0].get_offsets()
    np.testing.assert_allclose(points, np.stack([taxi.V[judged], 2 * taxi.V[judged] + 1], axis=1))


def arrows_in(axis):
    """{cell (row, column) under the arrow's middle: set of directions (down, right)}."""
    found = {}
    for part in axis.collections:
        if isinstance(part, Quiver):
            for (x, y), u, v in zip(part.get_offsets(), part.U, part.V, strict=True):
                cell = (int(np.rint(y + v / 2)), int(np.rint(x + u / 2)))
                found.setdefault(cell, set()).add((int(np.sign(np.round(v, 6))), int(np.sign(np.round(u, 6)))))
    return found


def test_draw_policies_points_arrows_along_the_experts_actions(cliff):
    figure = draw_policies(cliff.layout, cliff.optimal, cliff.agent, cliff.optimal, cliff.mdp)
    sides = [UP, RIGHT, DOWN, LEFT]
    judged = cliff.mdp.reachable & ~cliff.mdp.terminal
    wanted = {divmod(int(s), 12): {sides[a] for a in np.flatnonzero(cliff.optimal[s])} for s in np.flatnonzero(judged)}
    assert arrows_in(figure.axes[0]) == wanted


def test_draw_policies_shades_states_whose_action_is_not_optimal(cliff):
    agent = cliff.agent.copy()
    agent[0] = [1, 0, 0, 0]  # up, from the upper left corner
    figure = draw_policies(cliff.layout, cliff.optimal, agent, cliff.optimal, cliff.mdp)
    image = figure.axes[1].images[0].get_array()
    shade = np.array(matplotlib.colors.to_rgb(drawing.WRONG))
    assert np.argwhere(np.abs(image - shade).max(axis=-1) < 1e-9).tolist() == [[0, 0]]


def test_draw_policies_counts_the_states_that_agree(cliff):
    agent = cliff.agent.copy()
    agent[0] = [1, 0, 0, 0]
    figure = draw_policies(cliff.layout, cliff.optimal, agent, cliff.optimal, cliff.mdp)
    assert "optimal in 36 of 37 states" in figure.axes[1].get_title()


def test_draw_policies_leaves_out_unlikely_actions(cliff):
    agent = 0.8 * cliff.agent + 0.2 / 4
    figure = draw_policies(cliff.layout, cliff.optimal, agent, cliff.optimal, cliff.mdp)
    assert all(len(directions) == 1 for directions in arrows_in(figure.axes[1]).values())


def test_draw_policies_thins_arrows_when_the_map_is_large():
    case = Case(GRID_WORLD, size=90, slip=0.0)
    figure = draw_policies(case.layout, case.optimal, case.agent, case.optimal, case.mdp)
    assert len(arrows_in(figure.axes[1])) <= drawing.MOST_ARROWS**2


def test_draw_policies_counts_actions_when_there_is_no_map(taxi):
    figure = draw_policies(None, taxi.optimal, taxi.agent, taxi.optimal, taxi.mdp)
    judged = taxi.mdp.reachable & ~taxi.mdp.terminal
    assert texts(figure.axes[0]) == [str(n) for n in taxi.optimal[judged].sum(axis=0)]


def test_draw_learning_curve_names_the_levels():
    figure = draw_learning_curve({"learned": DrawnCurve(np.arange(5), np.arange(5.0))}, expert=4.0, random=-1.0)
    assert texts(figure.axes[0]) == ["expert 4", "random -1"]


def test_draw_learning_curve_has_a_band_when_an_interval_is_given():
    y = np.arange(5.0)
    figure = draw_learning_curve({"learned": DrawnCurve(np.arange(5), y, y - 1, y + 1)}, expert=4.0, random=0.0)
    assert len(figure.axes[0].collections) == 1


def test_draw_learning_curve_refuses_curves_of_unequal_length():
    with pytest.raises(InvalidParameter, match="5 steps and 4 values"):
        draw_learning_curve({"learned": DrawnCurve(np.arange(5), np.arange(4.0))}, expert=1.0, random=0.0)


def test_draw_learning_curve_refuses_no_curve():
    with pytest.raises(InvalidParameter, match="at least one"):
        draw_learning_curve({}, expert=1.0, random=0.0)


def test_draw_returns_shows_every_episode_of_each_policy():
    points = {
        name: np.random.default_rng(i).normal(size=(n, 2)) for i, (name, n) in enumerate({"expert": 5, "random": 9}.items())
    }
    axis = draw_returns(points).axes[0]
    shown = {part.get_label(): part.get_offsets() for part in axis.collections}
    assert set(shown) == set(points) and all(np.array_equal(shown[name], points[name]) for name in points)


def test_draw_returns_names_the_policies():
    axis = draw_returns({"expert": np.ones((2, 2)), "random": np.zeros((1, 2))}).axes[0]
    assert [text.get_text() for text in axis.get_legend().get_texts()] == ["expert", "random"]
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("true return", "return under the recovered reward")


@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_save_figure_writes_the_same_bytes_twice(lake, tmp_path, suffix):
    for name in ("a", "b"):
        save_figure(draw_values(lake.layout, lake.V, lake.V, lake.mdp), tmp_path / f"{name}.{suffix}")
    assert (tmp_path / f"a.{suffix}").read_bytes() == (tmp_path / f"b.{suffix}").read_bytes()


def test_save_figure_leaves_nothing_beside(tmp_path):
    save_figure(Figure(), tmp_path / "a.png")
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]


def test_save_figure_writes_a_picture(lake, tmp_path):
    save_figure(draw_values(lake.layout, lake.V, lake.V, lake.mdp), tmp_path / "a.png")
    assert min(matplotlib.image.imread(tmp_path / "a.png").shape[:2]) > 300


def test_save_figure_refuses_an_unknown_suffix(tmp_path):
    with pytest.raises(InvalidParameter, match=r"\.bmp"):
        save_figure(Figure(), tmp_path / "a.bmp")


def test_plotting_never_imports_pyplot():
    code = "import irl_gym.reports.plotting, sys; sys.exit('matplotlib.pyplot' in sys.modules)"
    assert run([sys.executable, "-c", code]).returncode == 0
