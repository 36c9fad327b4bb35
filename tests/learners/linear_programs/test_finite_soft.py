"""FiniteLP with slack and with experts known in part: the dense program, and what must hold of every answer."""

import models
import numpy as np
import pytest
import reference
import soft_reference
from certified import both, certified

from irl_gym.errors import DegenerateExpert
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.mdp.tabular_mdp import TabularMDP

PAPER = {"margin_cap": None, "l1": 0.0}
CAPPED = {"margin_cap": 0.05, "l1": 0.0}
PRICED = {"margin_cap": 0.05, "l1": 0.02}


def seen(seed, kind="sparse", share=0.6, wrong=0.0, S=9, A=3):
    """A model, its expert (S, A) known in a share of the states and wrong in some, and visits."""
    model = models.random_model(seed, S=S, A=A, kind=kind)
    rng = np.random.default_rng([seed, 1])
    actions = np.where(rng.random(S) < wrong, rng.integers(A, size=S), model.expert)
    known = rng.random(S) < share
    known[rng.integers(S - 2)] = True
    expert = np.where(known[:, None], np.eye(A)[actions], np.nan)
    return model, expert, np.where(known, rng.integers(1, 30, size=S), 0.0)


def relative(model, expert, visits):
    """Weights of the program: visits over their mean where the expert is known."""
    known = ~np.isnan(expert).any(axis=1) & (model.P.sum(axis=(1, 2)) > 0)
    return visits / visits[known].mean()


def avoided_states(model, expert):
    """States to avoid, by their definition: never seen; terminal and not entered (all states of these models are starts)."""
    ended = model.P.sum(axis=(1, 2)) == 0
    return np.flatnonzero(np.isnan(expert).any(axis=1) & ~ended)


def fitted(model, expert, visits=None, **fields):
    """The result, or None where no reward prefers the expert's actions."""
    try:
        return FiniteLP(**fields).fit(model.mdp, expert, visits=visits)
    except DegenerateExpert:
        return None


def true_margins(model, expert, R):
    """(S, A) Q(s, pi) - Q(s, a) of the best continuation under R (S,), by dense value iteration; NaN where not known."""
    step = model.P @ R
    Q = reference.action_values(model.P, model.mdp.gamma, step, reference.values(model.P, model.mdp.gamma, step))
    return np.nansum(expert * Q, axis=1, keepdims=True) - Q + 0 * expert


# --- oracle: the program as printed ---


@pytest.mark.parametrize("fields", [PAPER, CAPPED, PRICED], ids=["paper", "capped", "priced"])
@pytest.mark.parametrize("slack", [None, 1.0, 3.0])
@pytest.mark.parametrize("unvisited", ["avoid", "free"])
def test_objective_equals_the_dense_program(fields, slack, unvisited):
    compared = 0
    first = 100 * ([None, 1.0, 3.0].index(slack) + 3 * (unvisited == "free"))  # other models in each case
    for seed in range(first, first + 12):
        kind = ("sparse", "dense", "terminal", "deterministic")[seed % 4]
        model, expert, visits = seen(seed, kind, wrong=0.3)
        if not np.isnan(expert[model.P.sum(axis=(1, 2)) > 0]).any():
            continue  # the expert is known: `programs`
        result = fitted(model, expert, visits, slack=slack, unvisited=unvisited, **fields)
        low = avoided_states(model, expert) if unvisited == "avoid" else ()
        weights = relative(model, expert, visits)
        if fields is PAPER and kind == "deterministic":
            continue  # rows of equal successors take margins there, which the dense program does not know
        ties = () if result is None else result.proof.unbreakable_rows.tolist()
        expected = soft_reference.soft_lp(
            model.P,
            0.9,
            expert,
            weights=weights,
            slack=slack,
            cap=fields["margin_cap"],
            l1=fields["l1"],
            avoided=low,
            ties=ties,
        )
        if result is None:
            assert expected <= 1e-7
            continue
        assert result.proof.objective == pytest.approx(expected, rel=1e-6, abs=1e-6)
        assert -1e-7 <= result.proof.duality_gap <= 1e-6 * max(1.0, abs(expected))
        compared += 1
    assert compared >= 6


@pytest.mark.parametrize("r_max", [1e-3, 50.0])
def test_objective_scales_with_r_max_and_slack_does_not(r_max):
    for seed in range(5):
        model, expert, visits = seen(seed, wrong=0.4)
        one, scaled = (fitted(model, expert, visits, slack=1.5, r_max=r, margin_cap=None) for r in (1.0, r_max))
        assert (one is None) == (scaled is None)
        if one is not None and scaled is not None:
            assert scaled.proof.objective == pytest.approx(r_max * one.proof.objective, rel=1e-5)


# --- what must hold of every answer ---


@pytest.mark.parametrize("fields", [{}, CAPPED, PRICED, PAPER, {"slack": 1.0}, {"slack": 2.0, **PRICED}, {"unvisited": "free"}])
def test_violations_are_those_of_the_best_continuation(fields):
    listed = 0
    for seed in range(20):
        model, expert, visits = seen(seed, ("sparse", "deterministic")[seed % 2], wrong=0.4, share=0.9)
        result = fitted(model, expert, visits, **fields)
        if result is None or not np.isnan(expert).any():
            continue
        margins = true_margins(model, expert, result.reward.values)
        certificate = both(result, model.mdp, expert)
        for (s, a), amount in zip(certificate.violated_rows, certificate.violations, strict=True):
            assert amount == pytest.approx(-margins[s, a], abs=1e-9)
        assert certificate.violations.size == (margins < -1.1 * 2e-8).sum()
        assert certificate.worst_violation == pytest.approx(np.nanmax(-margins.clip(max=0)), abs=1e-9)
        assert np.abs(result.reward.values).max() <= 1.0
        listed += certificate.violations.size
    assert (listed > 0) == ("slack" in fields)


def test_margins_are_those_of_the_best_continuation():
    for seed in range(20):
        model, expert, _ = seen(seed)
        result = FiniteLP().fit(model.mdp, expert)
        margins = true_margins(model, expert, result.reward.values)
        margins[expert > 0] = np.inf
        found = both(result, model.mdp, expert).margin
        np.testing.assert_allclose(found, np.where(np.isnan(expert[:, 0]), np.nan, margins.min(axis=1)))


def test_expert_is_optimal_where_it_is_known_whatever_is_done_elsewhere():
    for seed in range(20):
        model, expert, _ = seen(seed)
        result = FiniteLP().fit(model.mdp, expert)
        known = ~np.isnan(expert).any(axis=1)
        best = reference.optimal_actions(model.P, 0.9, model.P @ result.reward.values)
        found = both(result, model.mdp, expert)
        assert not found.violated.size and (best == model.expert)[known].all()
        assert found.expert_optimal is not False  # by what it does where it was not seen


def test_states_not_visited_have_no_rows():
    model, expert, _ = seen(3)
    certificate = certified(FiniteLP(slack=1.0), model.mdp, expert)
    unknown = np.flatnonzero(np.isnan(expert).any(axis=1))
    assert certificate.unknown.tolist() == unknown.tolist() and np.isnan(certificate.margin[unknown]).all()
    assert not np.isin(unknown, certificate.unconstrained).any() and not np.isin(unknown, certificate.marginless).any()


def test_a_large_slack_gives_the_hard_program():
    for seed in range(8):
        model, expert, visits = seen(seed)
        for fields in (CAPPED, PRICED, {}):
            hard, soft = (FiniteLP(slack=C, **fields).fit(model.mdp, expert, visits=visits) for C in (None, 1e4))
            assert soft.proof.objective == pytest.approx(hard.proof.objective, rel=1e-6, abs=1e-8)
            found = both(soft, model.mdp, expert)
            assert found.expert_optimal is not False and not found.violated.size


def test_a_large_slack_gives_the_hard_program_where_the_expert_is_known_everywhere():
    for seed in range(8):
        model = models.random_model(seed, kind="walls")
        for fields in (CAPPED, PRICED, {}, PAPER):
            hard, soft = (FiniteLP(slack=C, **fields).fit(model.mdp, model.expert) for C in (None, 1e4))
            assert soft.proof.objective == pytest.approx(hard.proof.objective, rel=1e-6, abs=1e-8)


def test_slack_makes_something_of_an_expert_that_no_reward_explains():
    swapping = models.ring([[1, 0], [0, 1]])  # it leaves each state for the other: both would have to be the better one
    with pytest.raises(DegenerateExpert):
        FiniteLP().fit(swapping, np.array([0, 0]))
    found = certified(FiniteLP(slack=1.0), swapping, np.array([0, 0]), visits=np.array([10.0, 1.0]))
    assert found.margin[0] > 0 and found.violated.tolist() == [1]


def test_a_set_of_actions_is_asked_to_be_equally_good():
    model = models.random_model(2, S=8)
    both = np.eye(3)[model.expert] / 2 + np.eye(3)[(model.expert + 1) % 3] / 2
    both[:6] = np.nan
    R = FiniteLP().fit(model.mdp, both).reward.values
    np.testing.assert_allclose(np.nan_to_num(true_margins(model, both, R))[both > 0], 0.0, atol=1e-7)


def test_steps_pay_for_an_expert_that_is_known_in_part():
    for seed in range(10):
        model, expert, _ = seen(seed, "walls")
        result = FiniteLP(reward_on="state-action").fit(model.mdp, expert)
        Q = reference.action_values(model.P, 0.9, result.reward.values, reference.values(model.P, 0.9, result.reward.values))
        known = ~np.isnan(expert).any(axis=1) & ~model.mdp.terminal
        assert (Q.argmax(axis=1) == model.expert)[known].all() and not both(result, model.mdp, expert).violated.size
        assert result.proof.duality_gap == pytest.approx(0, abs=1e-7)


@pytest.mark.parametrize("fields", [PAPER, PRICED, {"margin_cap": "auto", "l1": 0.01}])
def test_steps_have_no_duality_gap(fields):
    for seed in range(10):
        model, expert, _ = seen(seed, "terminal")
        certificate = certified(FiniteLP(reward_on="state-action", **fields), model.mdp, expert)
        assert certificate.duality_gap == pytest.approx(0, abs=1e-6)


def test_unknown_states_have_the_lowest_reward_when_they_are_avoided():
    avoid, free = (FiniteLP(unvisited=how).fit(*strayed()).reward.values for how in ("avoid", "free"))
    assert avoid[3] == pytest.approx(-1.0) and free[3] == pytest.approx(0.0, abs=1e-9)


def test_an_end_that_the_expert_never_comes_to_is_avoided_and_one_that_it_does_is_not():
    values = FiniteLP().fit(*strayed()).reward.values
    assert values[4] == pytest.approx(-1.0) and values[1] > -0.99


def strayed():
    """From 0 the expert goes to 1, which ends, and not to 2, which ends too; it may stray to 3 and then to 4, an end."""
    P = np.zeros((5, 2, 5))
    P[0, 0, [1, 3]] = P[0, 1, [2, 3]] = 0.5
    P[3, 0, 0] = P[3, 1, 4] = 1
    expert = np.full((5, 2), np.nan)
    expert[0] = [1.0, 0.0]
    return TabularMDP.from_dense(P, 0.9, np.eye(5)[0]), expert
