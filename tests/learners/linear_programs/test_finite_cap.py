"""The automatic cap: which states it serves, how far the sparsest reward is optimal, and what is certified of it."""

import models
import numpy as np
import pytest
from certified import both, certified
from hypothesis import given

from irl_gym.errors import DegenerateExpert, InvalidMDP, InvalidParameter
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.mdp.tabular_mdp import TabularMDP


def almost_the_same(delta, gamma=0.9):
    """Two actions in state 0: the second differs from the first by a probability delta. States 1 and 2 end."""
    P = np.zeros((3, 2, 3))
    P[0, 0], P[0, 1] = [0, 1, 0], [0, 1 - delta, delta]
    return TabularMDP.from_dense(P, gamma, [1.0, 0, 0])


@pytest.mark.parametrize("delta", [1e-2, 1e-5])
def test_the_cap_is_half_of_a_small_uniform_margin(delta):
    found = FiniteLP().fit(almost_the_same(delta), np.array([0, 0, 0]))
    assert found.proof.margin_cap == pytest.approx(delta, rel=1e-4)  # R(1) = 1, R(2) = -1: a margin of 2 delta


@pytest.mark.parametrize("delta", [2e-7, 1e-8])
def test_a_margin_below_the_solvers_reach_is_none(delta):
    with pytest.raises(DegenerateExpert, match="every margin 0"):
        FiniteLP().fit(almost_the_same(delta), np.array([0, 0, 0]))


def test_states_that_cannot_have_a_margin_are_left_out_and_counted():
    # State 0's expert action is the mean of its two others, so it ties with both; state 1 can have a margin.
    P = np.zeros((4, 3, 4))
    P[0] = [[0, 0.5, 0.5, 0], [0, 1, 0, 0], [0, 0, 1, 0]]
    P[1] = [[0, 0, 1, 0], [0, 0, 0, 1], [0, 0, 0, 1]]
    P[2] = [[0, 0, 0, 1]] * 3
    mdp, expert = TabularMDP.from_dense(P, 0.9, [1.0, 0, 0, 0]), np.zeros(4, dtype=int)
    result = FiniteLP().fit(mdp, expert)
    found = both(result, mdp, expert)
    assert result.stats["rows_without_margin"] == 2
    assert found.margin[1] >= found.margin_cap * (1 - 1e-6)
    assert found.unbreakable_rows.tolist() == [[0, 1], [0, 2]]
    assert found.unbreakable.tolist() == [0] and found.marginless.size == 0


@given(model=models.models())
def test_the_sparsest_reward_is_optimal_for_every_l1_below_the_limit(model):
    sparsest = FiniteLP().fit(model.mdp, model.expert)
    l1 = 0.99 * sparsest.stats["l1_limit"]
    if l1 > 1e6:
        return  # a reward of norm 0 is free at any price
    cap = sparsest.proof.margin_cap
    best = FiniteLP(margin_cap=cap, l1=l1).fit(model.mdp, model.expert).proof.objective
    margin = both(sparsest, model.mdp, model.expert).margin
    margins = np.minimum(margin[np.isfinite(margin)], cap)
    assert margins.sum() - l1 * sparsest.proof.l1_norm == pytest.approx(best, abs=1e-6 * max(1, abs(best)))


@given(model=models.models())
def test_the_norm_of_the_sparsest_reward_is_certified(model):
    found = certified(FiniteLP(), model.mdp, model.expert)
    assert found.least_l1_norm <= found.l1_norm + 1e-9
    assert found.least_l1_norm == pytest.approx(found.l1_norm, rel=1e-5, abs=1e-7)


@pytest.mark.parametrize("field", ["r_max", "l1", "margin_cap", "time_limit"])
@pytest.mark.parametrize("value", ["1.0", [1], np.int64(-1), np.float32(-1), float("nan"), True])
def test_a_field_that_is_no_number_in_its_range_is_refused(field, value, unchecked):
    with pytest.raises(InvalidParameter, match=f"{field} is"):
        FiniteLP(**{field: value})


def test_an_unknown_solver_is_refused_at_once(unchecked):
    with pytest.raises(InvalidParameter, match="solver is 'gurobi'"):
        FiniteLP(solver="gurobi")


def test_a_tabulation_in_place_of_its_mdp_is_refused(toy_text, unchecked):
    with pytest.raises(InvalidMDP, match="mdp is a Tabulation"):
        FiniteLP().fit(toy_text("FrozenLake 4x4"), np.zeros(16, dtype=int))


@pytest.mark.parametrize("solver", ["highs", "clarabel"])
@pytest.mark.parametrize("r_max", [1e-4, 1.0, 100.0])
@pytest.mark.parametrize("settings", [{"margin_cap": None}, {"margin_cap": None, "l1": "auto"}, {"reward_on": "state-action"}])
def test_the_expert_is_optimal_whatever_the_scale_and_the_discount(solver, r_max, settings):
    for seed in range(2):
        model = models.random_model(seed, S=8, kind="sparse", gamma=0.999)
        if "margin_cap" in settings:
            settings = {**settings, "reward_on": "state-action"}
        found = FiniteLP(r_max=r_max, solver=solver, **settings).fit(model.mdp, model.expert)
        told = both(found, model.mdp, model.expert)
        assert told.expert_optimal, told.worst_violation / r_max
        assert np.abs(found.reward.values).max() <= r_max * (1 + 1e-12)
