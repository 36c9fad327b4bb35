"""The path of rewards as the price of ||R||_1 rises: its pieces against programs solved one price at a time."""

import json

import hypothesis
import numpy as np
import pytest
from models import Model, episodic_model, models, paper_grid, random_model, ring

from irl_gym.errors import (
    DegenerateExpert,
    InvalidMDP,
    InvalidParameter,
    InvalidPolicy,
    InvalidReward,
    SolverTimeout,
)
from irl_gym.judging.ambiguity.lambda_path import ARRAYS, LambdaPath, lambda_path
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.mdp.optimality import certify
from irl_gym.mdp.rewards import write_archive

GRID = paper_grid()


@pytest.fixture(scope="module")
def grid() -> LambdaPath:
    """The path of Ng & Russell's 5x5 grid."""
    return lambda_path(GRID.mdp, GRID.expert)


def objectives(model, expert, prices, cap=None, **settings):
    """FiniteLP's optimum at each price, solved afresh; at price 0 without the capped program's limit."""
    return np.array([
        FiniteLP(l1=max(price, 1e-12), margin_cap=cap, solver="highs", **settings).fit(model.mdp, expert).proof.objective
        for price in prices
    ])  # fmt: skip


def assert_falls(path: LambdaPath) -> None:
    """Prices rise; norms and margins fall; the pieces that meet are worth the same."""
    assert (np.diff(path.breakpoints) > 0).all()
    assert (np.diff(path.l1_norms) < 0).all()
    assert (np.diff(path.total_margins) < 0).all()
    inner = path.breakpoints[1:]
    before = path.total_margins - inner * path.l1_norms
    after = np.append(path.total_margins[1:] - inner[:-1] * path.l1_norms[1:], 0.0)
    np.testing.assert_allclose(before, after, atol=1e-9 * path.total_margins[0])


def test_path_of_the_paper_s_grid_has_every_piece(grid):
    assert grid.n_pieces == 28 and grid.exact


def test_path_ends_at_lambda_0(grid):
    assert grid.lambda_0 == pytest.approx(FiniteLP(margin_cap=None).critical_l1(GRID.mdp, GRID.expert), rel=1e-9)
    assert grid.lambda_0 == pytest.approx(1.05505, abs=5e-6)


def test_path_agrees_with_programs_solved_at_fifty_prices(grid):
    prices = np.linspace(0, 1.02 * grid.lambda_0, 50)
    found = objectives(GRID, GRID.expert, prices)
    np.testing.assert_allclose([grid.objective(price) for price in prices], found, atol=1e-6)


def test_path_shows_the_reward_that_is_the_only_optimum(grid):
    for price in (0.005, 0.32, 0.45, 0.73, 1.05):
        alone = FiniteLP(l1=price, margin_cap=None, solver="highs").fit(GRID.mdp, GRID.expert).reward.values
        np.testing.assert_allclose(grid.at(price).values, alone, atol=1e-6)


def test_path_falls_and_its_pieces_meet(grid):
    assert_falls(grid)


def test_path_is_proved_at_each_breakpoint(grid):
    assert grid.gaps.shape == grid.breakpoints.shape
    assert grid.gap <= 1e-9 * grid.total_margins[0] and grid.gaps.max() <= grid.gap


def test_rewards_are_what_their_certificates_say(grid):
    for R, margins, norm, total in zip(grid.rewards, grid.margins, grid.l1_norms, grid.total_margins, strict=True):
        proof = certify(GRID.mdp, GRID.expert, R)
        assert proof.expert_optimal
        assert np.abs(R).max() <= 1
        np.testing.assert_allclose(proof.margin, margins, atol=1e-12)
        assert (np.abs(R).sum(), np.nansum(margins)) == pytest.approx((norm, total))


def test_breakpoints_are_where_no_price_between_changes_the_norm(grid):
    for low, high, norm in zip(grid.breakpoints, grid.breakpoints[1:], grid.l1_norms, strict=False):
        inside = low + 0.9 * (high - low)
        found = FiniteLP(l1=inside, margin_cap=None, solver="highs").fit(GRID.mdp, GRID.expert)
        assert found.proof.l1_norm == pytest.approx(norm, abs=1e-5)


def test_at_takes_the_larger_norm_at_a_breakpoint_and_zero_beyond_the_last(grid):
    third = grid.breakpoints[3]
    assert np.array_equal(grid.at(third).values, grid.rewards[2])
    assert np.array_equal(grid.at(0).values, grid.rewards[0])
    assert np.array_equal(grid.at(grid.lambda_0).values, grid.rewards[-1])
    assert not grid.at(grid.lambda_0 + 1e-9).values.any() and grid.objective(2.0) == 0


def test_same_input_gives_the_same_bytes(grid):
    again = lambda_path(GRID.mdp, GRID.expert)
    assert again.rewards.tobytes() == grid.rewards.tobytes()
    assert again.breakpoints.tobytes() == grid.breakpoints.tobytes()


def test_bound_scales_rewards_and_leaves_breakpoints(grid):
    scaled = lambda_path(GRID.mdp, GRID.expert, r_max=50.0)
    np.testing.assert_allclose(scaled.breakpoints, grid.breakpoints, rtol=1e-8)
    np.testing.assert_allclose(scaled.l1_norms, 50 * grid.l1_norms, rtol=1e-8)


@hypothesis.settings(max_examples=8)
@hypothesis.given(models())
def test_path_agrees_with_single_programs_on_random_models(model: Model):
    try:
        path = lambda_path(model.mdp, model.expert)
    except DegenerateExpert:
        with pytest.raises(DegenerateExpert):
            FiniteLP(margin_cap=None).critical_l1(model.mdp, model.expert)
        return
    assert_falls(path)
    assert path.gap <= 1e-8 * path.total_margins[0]
    prices = np.linspace(0.01, 1.05, 5) * path.lambda_0
    found = objectives(model, model.expert, prices)
    np.testing.assert_allclose([path.objective(price) for price in prices], found, atol=1e-6 * path.total_margins[0])


@pytest.mark.parametrize("cap", [0.05, "auto"])
def test_capped_path_agrees_with_capped_programs(cap):
    path = lambda_path(GRID.mdp, GRID.expert, margin_cap=cap)
    assert_falls(path)
    prices = np.linspace(0.01, 1.01, 10) * path.lambda_0
    found = objectives(GRID, GRID.expert, prices, cap)
    np.testing.assert_allclose([path.objective(price) for price in prices], found, atol=1e-6 * path.total_margins[0])


def test_auto_cap_is_finite_lp_s_own():
    cap = FiniteLP(margin_cap="auto").fit(GRID.mdp, GRID.expert).proof.margin_cap
    assert lambda_path(GRID.mdp, GRID.expert, margin_cap="auto").margin_cap == cap


@pytest.mark.parametrize("cap", [None, 0.1])
def test_path_of_rewards_on_steps_agrees_with_single_programs(cap):
    model = episodic_model(3, 6, 3)
    path = lambda_path(model.mdp, model.expert, margin_cap=cap, reward_on="state-action")
    assert_falls(path)
    assert path.rewards.shape == (path.n_pieces, 6, 3) and not path.rewards[:, model.mdp.terminal].any()
    prices = np.linspace(0.01, 1.01, 10) * path.lambda_0
    found = objectives(model, model.expert, prices, cap, reward_on="state-action")
    np.testing.assert_allclose([path.objective(price) for price in prices], found, atol=1e-6 * path.total_margins[0])


@pytest.mark.parametrize("reward_on", ["state", "state-action"])
def test_expert_of_several_actions_ties_them_along_the_path(reward_on):
    model = random_model(5, S=6, A=4)
    expert = np.zeros((6, 4))
    expert[np.arange(6), model.expert] = 1.0
    expert[0] = [0.25, 0.75, 0, 0]
    path = lambda_path(model.mdp, expert, reward_on=reward_on)
    assert_falls(path)
    assert path.gap <= 1e-8 * path.total_margins[0]
    for R in path.rewards:
        assert certify(model.mdp, expert, R).expert_optimal
    prices = np.linspace(0.01, 1.01, 10) * path.lambda_0
    found = objectives(model, expert, prices, reward_on=reward_on)
    np.testing.assert_allclose([path.objective(price) for price in prices], found, atol=1e-6 * path.total_margins[0])


def test_most_pieces_leaves_a_path_that_is_off_by_no_more_than_it_says(grid):
    some = lambda_path(GRID.mdp, GRID.expert, most_pieces=6)
    off = max(grid.objective(price) - some.objective(price) for price in np.linspace(0, grid.lambda_0, 500))
    assert not some.exact and some.n_pieces <= 6
    assert 1e-3 < off <= some.gap
    assert some.lambda_0 == pytest.approx(grid.lambda_0, rel=1e-9) and some.solves < grid.solves


def test_most_pieces_above_their_number_gives_the_same_path(grid):
    some = lambda_path(GRID.mdp, GRID.expert, most_pieces=100)
    assert some.exact
    np.testing.assert_allclose(some.breakpoints, grid.breakpoints, atol=1e-9)


def test_unreached_states_get_nothing():
    model = episodic_model(1, 8, 3)
    P = np.zeros((9, 3, 9))
    P[:8, :, :8] = model.P
    P[8, :, 0] = 1.0
    mdp = type(model.mdp).from_dense(P, 0.9, np.eye(9)[0])
    path = lambda_path(mdp, np.append(model.expert, 0))
    assert not path.rewards[:, 8].any() and np.isnan(path.margins[:, 8]).all()


def test_path_refuses_an_expert_that_no_reward_prefers():
    tied = ring([[1, 1], [2, 2], [0, 0]])
    with pytest.raises(DegenerateExpert, match="other successors"):
        lambda_path(tied, np.zeros(3, dtype=int))


def test_path_refuses_an_expert_that_is_worst_either_way():
    model = random_model(0, S=4, A=2)
    with pytest.raises(DegenerateExpert, match="takes every action"):
        lambda_path(model.mdp, np.full((4, 2), 0.5))


def test_path_refuses_an_expert_known_in_some_states():
    expert = np.eye(4)[GRID.expert]
    expert[[7, 9]] = np.nan
    with pytest.raises(InvalidPolicy, match=r"expert\[s=7\] is NaN, as in 2 of 24 states .* use FiniteLP"):
        lambda_path(GRID.mdp, expert)


def test_path_takes_an_expert_unknown_only_where_nothing_is_done(grid):
    expert = np.eye(4)[GRID.expert]
    expert[4] = np.nan
    np.testing.assert_allclose(lambda_path(GRID.mdp, expert).breakpoints, grid.breakpoints, rtol=1e-9)


def test_time_limit_says_what_to_do():
    with pytest.raises(SolverTimeout, match="raise time_limit, or give most_pieces"):
        lambda_path(GRID.mdp, GRID.expert, time_limit=1e-9)


@pytest.mark.parametrize("settings", [{"r_max": 0}, {"margin_cap": -1.0}, {"most_pieces": 1}, {"time_limit": 0}])
def test_path_refuses_numbers_outside_their_range(settings):
    with pytest.raises(InvalidParameter, match=next(iter(settings))):
        lambda_path(GRID.mdp, GRID.expert, **settings)


def test_path_refuses_something_else_than_an_mdp(unchecked):
    with pytest.raises(InvalidMDP, match="expected a TabularMDP"):
        lambda_path(GRID.P, GRID.expert)  # type: ignore[arg-type]


def test_price_below_zero_is_refused(grid):
    with pytest.raises(InvalidParameter, match="lam is -1"):
        grid.at(-1)


def test_saved_path_is_read_back(grid, tmp_path):
    grid.save(tmp_path / "path.npz")
    assert LambdaPath.load(tmp_path / "path.npz").to_json() == grid.to_json()


def test_a_file_from_before_violations_were_noted_proves_nothing(grid, tmp_path):
    arrays = {name: getattr(grid, name) for name in ARRAYS}
    numbers = {name: getattr(grid, name) for name in ("gap", "exact", "r_max", "margin_cap", "solves")}
    write_archive(tmp_path / "path.npz", {"format": LambdaPath.FORMATS[0], **numbers}, arrays)
    old = LambdaPath.load(tmp_path / "path.npz")
    assert grid.exact and np.isnan(old.violation) and not old.exact
    assert "not certified" in str(old) and old.to_json()["violation"] is None


def test_load_names_both_kinds_when_the_file_holds_a_reward(grid, tmp_path):
    grid.at(0).save(tmp_path / "reward.npz")
    with pytest.raises(InvalidReward, match=r"holds a TabularReward: expected a LambdaPath\. Read it with TabularReward\.load"):
        LambdaPath.load(tmp_path / "reward.npz")


def test_load_asks_for_a_path_when_the_file_is_text(tmp_path):
    (tmp_path / "README.md").write_text("a letter")
    with pytest.raises(InvalidReward, match=r"holds no LambdaPath \(it is no npz archive\).*LambdaPath\.save wrote"):
        LambdaPath.load(tmp_path / "README.md")


def test_load_says_when_there_is_no_file(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"nope\.npz does not exist: expected a file that LambdaPath\.save wrote"):
        LambdaPath.load(tmp_path / "nope.npz")


def test_json_holds_no_nan(grid):
    told = json.loads(json.dumps(grid.to_json(), allow_nan=False))
    assert told["margins"][0][4] is None and len(told["changes"]) == 29 and told["lambda_0"] == grid.lambda_0


def test_path_is_told_in_three_lines(grid):
    assert str(grid).splitlines()[0].startswith("lambda path     all 28 pieces from 0 to lambda_0 = 1.05505")
    assert len(str(grid).splitlines()) == 3 and str(grid).splitlines()[0].endswith(" below the optimum")
