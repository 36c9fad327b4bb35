"""`irl_gym.plot` draws whatever it is given on the environment's map, its plane of cells, or as bars."""

import gymnasium as gym
import numpy as np
import pytest
from matplotlib.figure import Figure

import irl_gym
from irl_gym.errors import InvalidParameter, InvalidPolicy, InvalidReward
from irl_gym.features.feature_maps import OneHot
from irl_gym.mdp.planning.dynamic_programming import occupancy
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.shaping import ShapedReward

LAKE = gym.make("FrozenLake-v1", is_slippery=False)
TABLE = irl_gym.tabulate(LAKE, gamma=0.9)
SOLUTION = irl_gym.policy_iteration(TABLE.mdp, TABLE.reward)
LEARNED = TabularReward(np.linspace(-1, 2, 16))
TAXI = gym.make("Taxi-v4")
RIDES = irl_gym.tabulate(TAXI, gamma=0.9)
MOUNTAIN = gym.make("MountainCar-v0")
CELLS = irl_gym.discretize(MOUNTAIN, gamma=0.99, bins=6)
VISITS = occupancy(TABLE.mdp, SOLUTION.policy)


def only(figure):
    """The panel of a figure that is no colour bar."""
    (axis, *_) = figure.axes
    return axis


@pytest.mark.parametrize(
    ("what", "kind", "title", "bars"),
    [
        (LEARNED, None, "Reward, paid on arrival in a cell", 1),
        (ShapedReward.of(TABLE.reward, TABLE.mdp), None, "Reward, one triangle for each move", 1),
        (irl_gym.LinearReward(np.arange(16.0), OneHot(16)), None, "Reward, paid on arrival in a cell", 1),
        (SOLUTION, None, "Policy", 0),
        (SOLUTION.policy, None, "Policy", 0),
        (np.full((16, 4), 0.25), None, "Policy", 0),
        (SOLUTION.V, None, "Values", 1),
        (SOLUTION.V - 0.7, None, "Values", 1),
        (VISITS, "occupancy", "Occupancy", 1),
        (VISITS, "reward", "Reward, one triangle for each move", 1),
        (np.arange(16), "values", "Values", 1),
    ],
)
def test_a_map_shows(what, kind, title, bars):
    figure = irl_gym.plot(what, LAKE, kind=kind)
    assert only(figure).get_title() == title and len(figure.axes) == 1 + bars


def test_a_learner_of_policies_has_its_policy_drawn():
    outcome = irl_gym.FiniteLP().fit(TABLE.mdp, SOLUTION)
    assert only(irl_gym.plot(outcome, LAKE)).get_title().startswith("Reward")


@pytest.mark.parametrize(("V", "middle"), [(SOLUTION.V - 0.7, 0.0), (SOLUTION.V, None)])
def test_the_colours_of_values_have_zero_in_the_middle_where_these_have_signs(V, middle):
    low, high = irl_gym.plot(V, LAKE).axes[1].get_ylim()
    assert ((low + high) / 2 == pytest.approx(0.0)) == (middle is not None)


def test_arrows_stand_in_the_states_that_act():
    quivers = [one for one in only(irl_gym.plot(SOLUTION, LAKE)).collections if hasattr(one, "U")]
    acting = TABLE.mdp.reachable & ~TABLE.mdp.terminal
    assert sum(one.N for one in quivers) == acting.sum()


def test_a_policy_of_nan_is_known_in_some_states():
    half = np.where(np.arange(16)[:, None] < 4, np.nan, np.eye(4)[SOLUTION.policy])
    assert only(irl_gym.plot(half, LAKE)).get_title() == "Policy, known in 7 of 11 states"


@pytest.mark.parametrize(
    ("what", "title"),
    [(RIDES.reward, "Reward: highest and lowest 10"), (np.arange(RIDES.mdp.n_states) * 1.0, "Values: highest and lowest 10"),
     (np.ones(RIDES.mdp.n_states, int), "Policy")],
)  # fmt: skip
def test_where_there_is_no_map_there_are_bars(what, title):
    axis = only(irl_gym.plot(what, TAXI, table=RIDES))
    assert axis.get_title().startswith(title) and axis.patches


@pytest.mark.parametrize("what", [CELLS.reward, np.ones(CELLS.mdp.n_states, int), np.arange(CELLS.mdp.n_states) * 1.0])
def test_cells_are_drawn_over_their_coordinates(what):
    axis = only(irl_gym.plot(what, MOUNTAIN, table=CELLS))
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("position", "velocity") and axis.images


def test_a_given_panel_is_drawn_into():
    figure = Figure()
    axes = figure.subplots(1, 2)
    assert irl_gym.plot(SOLUTION, LAKE, ax=axes[1], title="mine") is figure
    assert axes[1].get_title() == "mine" and not axes[0].has_data()


def test_numbers_that_a_small_panel_has_no_room_for_are_left_out():
    figure = Figure(figsize=(1, 1))
    irl_gym.plot(LEARNED, LAKE, ax=figure.subplots())
    assert not any(text.get_visible() for text in only(figure).texts)


def test_a_notebook_shows_the_figure():
    assert irl_gym.plot(SOLUTION, LAKE)._repr_png_().startswith(b"\x89PNG")


def test_the_environment_is_left_as_it_is():
    env = gym.make("FrozenLake-v1", is_slippery=False)
    env.reset(seed=0)
    at = env.unwrapped.s
    irl_gym.plot(LEARNED, env)
    assert env.unwrapped.s == at


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("what", "kind", "error", "says"),
    [
        (VISITS, None, InvalidParameter, "may be a reward or an occupancy"),
        (VISITS, "picture", InvalidParameter, "kind is 'picture'"),
        (np.zeros(5), None, InvalidParameter, "of 16 states"),
        (np.zeros(5), "reward", InvalidReward, r"shape \(5,\)"),
        (np.zeros(5, int), None, InvalidPolicy, r"shape \(5,\)"),
        (np.full(16, np.nan), None, InvalidParameter, "no state that acts"),
    ],
)
def test_what_cannot_be_drawn_is_refused(what, kind, error, says):
    with pytest.raises(error, match=says):
        irl_gym.plot(what, LAKE, kind=kind)
