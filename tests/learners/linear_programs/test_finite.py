import pickle

import models
import numpy as np
import pytest
import reference
from certified import both, certified
from hypothesis import given

from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.programs.solvers import Status

PAPER = FiniteLP(margin_cap=None)
FIGURE_2 = [
    [-1, -1, -1, 0.211, 1],
    [-0.992, -1, 0.138, -0.925, -1],
    [-0.225, -1, -0.996, -1, -1],
    [-0.945, -1, -1, -1, -1],
    [-1, -1, -0.912, -0.306, -1],
]
MODES = {
    "paper": PAPER,
    "paper, l1": FiniteLP(margin_cap=None, l1=0.2),
    "paper, l1 auto": FiniteLP(margin_cap=None, l1="auto"),
    "capped": FiniteLP(margin_cap=0.05),
    "capped, l1": FiniteLP(margin_cap=0.05, l1=0.01),
    "auto": FiniteLP(),
    "auto, l1": FiniteLP(l1=0.01),
    "auto, r_max": FiniteLP(r_max=30.0),
    "auto, clarabel": FiniteLP(solver="clarabel"),
    "steps, paper": FiniteLP(reward_on="state-action", margin_cap=None),
    "steps, l1": FiniteLP(reward_on="state-action", margin_cap=None, l1=0.2),
    "steps, auto": FiniteLP(reward_on="state-action"),
}
every_mode = pytest.mark.parametrize("learner", MODES.values(), ids=MODES.keys())


@pytest.fixture(scope="module")
def grid():
    return models.paper_grid()


# --- oracle: the paper ---


def test_finite_lp_gives_figure_2_of_the_paper(grid):
    learned = PAPER.fit(grid.mdp, grid.expert).reward.values.reshape(5, 5)
    np.testing.assert_allclose(learned, FIGURE_2, atol=0.0015)


def test_finite_lp_objective_is_12_6837_in_figure_2(grid):
    assert PAPER.fit(grid.mdp, grid.expert).proof.objective == pytest.approx(12.6837, abs=1e-4)


def test_critical_l1_is_1_0550_in_the_paper(grid):
    assert PAPER.critical_l1(grid.mdp, grid.expert) == pytest.approx(1.0550, abs=2e-4)


def test_finite_lp_says_zero_when_l1_is_above_lambda_0(grid):
    result = FiniteLP(margin_cap=None, l1=1.06).fit(grid.mdp, grid.expert)
    assert result.status is Status.ZERO and not result.reward.values.any()


def test_finite_lp_is_not_zero_when_l1_is_auto(grid):
    result = FiniteLP(margin_cap=None, l1="auto").fit(grid.mdp, grid.expert)
    assert result.status is Status.OPTIMAL and result.proof.objective > 0


@pytest.mark.parametrize("kind", models.KINDS)
@pytest.mark.parametrize("l1", [0.0, 0.5])
def test_finite_lp_objective_equals_the_dense_lp(kind, l1):
    for seed in range(20):
        model = models.random_model(seed, kind=kind)
        expected, _ = reference.paper_lp(model.P, 0.9, model.expert, l1=l1)
        assert FiniteLP(margin_cap=None, l1=l1).fit(model.mdp, model.expert).proof.objective == pytest.approx(
            expected, rel=1e-6, abs=1e-9
        )


@pytest.mark.parametrize("kind", models.KINDS)
def test_critical_l1_equals_bisection_on_the_dense_lp(kind):
    model = models.random_model(3, kind=kind)
    expected = reference.critical_l1_by_bisection(model.P, 0.9, model.expert)
    assert PAPER.critical_l1(model.mdp, model.expert) == pytest.approx(expected, rel=1e-6)


# --- property: what every result proves ---


@every_mode
@given(model=models.models())
def test_finite_lp_makes_the_expert_optimal(learner, model):
    assert certified(learner, model.mdp, model.expert).expert_optimal


@pytest.mark.parametrize("mode", ["paper", "paper, l1 auto", "capped, l1", "auto, l1", "steps, l1"])
@given(model=models.models())
def test_finite_lp_duals_close_the_gap(mode, model):
    certificate = certified(MODES[mode], model.mdp, model.expert)
    scale = 1 / (1 - model.mdp.gamma)
    assert -1e-7 * scale <= certificate.duality_gap <= 1e-5 * scale


@pytest.mark.parametrize("mode", ["paper, l1", "auto, r_max", "steps, auto"])
@given(model=models.models())
def test_finite_lp_keeps_the_bound_on_the_reward(mode, model):
    assert np.abs(MODES[mode].fit(model.mdp, model.expert).reward.values).max() <= MODES[mode].r_max * (1 + 1e-7)


@given(model=models.models())
def test_finite_lp_gives_each_state_the_cap_that_the_true_reward_separates(model):
    certificate = certified(FiniteLP(), model.mdp, model.expert)
    true_margins = reference.margins(model.P, model.mdp.gamma, model.expert, model.R, skip_equal=True)
    attainable = (true_margins > 1e-6) & np.isfinite(true_margins)
    assert (certificate.margin[attainable] >= certificate.margin_cap * (1 - 1e-6)).all()


@given(model=models.models())
def test_finite_lp_on_steps_leaves_no_state_without_a_margin(model):
    certificate = certified(FiniteLP(reward_on="state-action"), model.mdp, model.expert)
    assert (certificate.margin[~model.mdp.terminal] >= certificate.margin_cap * (1 - 1e-6)).all()


@given(model=models.models())
def test_finite_lp_auto_is_the_limit_of_the_capped_lp(model):
    auto = FiniteLP().fit(model.mdp, model.expert)
    cap, l1 = auto.proof.margin_cap, 0.5 * auto.stats["l1_limit"]
    margins = np.minimum(both(auto, model.mdp, model.expert).margin, cap)
    capped = FiniteLP(margin_cap=cap, l1=l1).fit(model.mdp, model.expert)
    assert np.nansum(margins) - l1 * auto.proof.l1_norm == pytest.approx(capped.proof.objective, rel=1e-5)


@given(model=models.models())
def test_finite_lp_scales_with_r_max(model):
    one, three = (FiniteLP(r_max=r, margin_cap=None).fit(model.mdp, model.expert).proof.objective for r in (1.0, 3.0))
    assert three == pytest.approx(3 * one, rel=1e-6)


@given(model=models.models(kinds=("dense", "walls")))
def test_finite_lp_pays_less_for_the_reward_when_l1_is_larger(model):
    lambda_0 = PAPER.critical_l1(model.mdp, model.expert)
    results = [FiniteLP(margin_cap=None, l1=share * lambda_0).fit(model.mdp, model.expert) for share in (0.1, 0.9)]
    low, high = (np.abs(result.reward.values).sum() for result in results)
    assert high <= low + 1e-6


# --- kinds of expert ---


@pytest.mark.parametrize("learner", [PAPER, FiniteLP(), FiniteLP(reward_on="state-action")])
def test_finite_lp_reads_actions_distribution_and_set_alike(learner):
    model = models.random_model(0, kind="walls")
    one_hot = np.eye(3)[model.expert]
    found = [learner.fit(model.mdp, expert).proof.objective for expert in (model.expert, one_hot, one_hot > 0)]
    assert found == pytest.approx([found[0]] * 3)


@pytest.fixture(scope="module")
def optimal_set(grid):
    """(S, A) every optimal action of the paper's grid: two in some cells."""
    return best_actions(grid, grid.step_reward, tolerance=1e-9)


def best_actions(model, R, *, tolerance):
    Q = reference.action_values(model.P, model.mdp.gamma, R, reference.values(model.P, model.mdp.gamma, R))
    return Q >= Q.max(axis=1, keepdims=True) - tolerance


@pytest.mark.parametrize("reward_on", ["state", "state-action"])
def test_finite_lp_makes_exactly_the_actions_of_a_set_optimal(grid, optimal_set, reward_on):
    learned = FiniteLP(reward_on=reward_on).fit(grid.mdp, optimal_set).reward.expected(grid.mdp)
    np.testing.assert_array_equal(best_actions(grid, learned, tolerance=1e-7), optimal_set)


def test_finite_lp_makes_a_stochastic_expert_optimal(grid, optimal_set):
    weights = optimal_set * np.array([0.1, 0.2, 0.3, 0.4])
    expert = weights / weights.sum(axis=1, keepdims=True)
    learned = FiniteLP().fit(grid.mdp, expert).reward.expected(grid.mdp)
    np.testing.assert_array_equal(best_actions(grid, learned, tolerance=1e-7), optimal_set)


# --- parts of the MDP ------------------------------------------------------------------------------------------------


def test_finite_lp_pays_nothing_in_states_that_no_episode_reaches():
    model = models.random_model(5, S=6, kind="dense")
    P = np.zeros((8, 3, 8))
    P[:6, :, :6], P[6:, :, 0] = model.P, 1
    mdp = TabularMDP.from_dense(P, 0.9, np.eye(8)[0])
    reward = FiniteLP().fit(mdp, np.append(model.expert, [0, 0])).reward
    assert (reward.values[6:] == 0).all() and reward.values[:6].any()


def test_finite_lp_does_not_depend_on_states_that_no_episode_reaches():
    model = models.random_model(5, S=6, kind="dense")
    P = np.zeros((8, 3, 8))
    P[:6, :, :6], P[6:, :, 0] = model.P, 1
    mdp = TabularMDP.from_dense(P, 0.9, np.eye(8)[0])
    with_more = PAPER.fit(mdp, np.append(model.expert, [0, 0])).proof.objective
    assert with_more == pytest.approx(PAPER.fit(model.mdp, model.expert).proof.objective)


def test_finite_lp_on_steps_pays_nothing_in_terminal_states():
    model = models.random_model(2, kind="terminal")
    reward = FiniteLP(reward_on="state-action", margin_cap=None).fit(model.mdp, model.expert).reward
    assert np.abs(reward.values[model.mdp.terminal]).max() < 1e-9


def test_finite_lp_result_survives_pickle():
    model = models.random_model(0)
    result = FiniteLP().fit(model.mdp, model.expert)
    again = pickle.loads(pickle.dumps(result))
    assert again.proof.to_json() == result.proof.to_json() and again.status is result.status


def test_finite_lp_stats_name_each_program():
    model = models.random_model(0)
    stats = FiniteLP(report_lambda_0=True).fit(model.mdp, model.expert).stats
    assert list(stats["programs"]) == ["uniform margin", "lambda_0", "reward"]


def test_finite_lp_leaves_walls_out_when_margins_are_capped():
    certificate = certified(FiniteLP(), models.ring([[1, 1, 0], [1, 1, 0]]), np.array([0, 0]))
    assert (certificate.margin >= certificate.margin_cap * (1 - 1e-6)).all()


def test_finite_lp_explains_a_degenerate_expert_by_a_reward_on_steps():
    certificate = certified(FiniteLP(reward_on="state-action"), models.ring([[1, 0], [0, 1]]), np.array([0, 0]))
    assert (certificate.margin > 0).all()
