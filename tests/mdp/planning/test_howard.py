"""Planning against rational arithmetic: every bound holds, and is close."""

from fractions import Fraction

import numpy as np
import pytest
from exact import ExactMDP
from hard_cases import hard_case

from irl_gym.mdp.planning.discounted import Discounted
from irl_gym.mdp.planning.dynamic_programming import optimum, policy_iteration, value_iteration
from irl_gym.mdp.planning.precise import row_defects
from irl_gym.mdp.tabular_mdp import TabularMDP

SEEDS = range(24)
MANY = range(24, 1000)
seeds = pytest.mark.parametrize("seeds", [SEEDS, pytest.param(MANY, marks=pytest.mark.slow)], ids=["few", "many"])


def exactly(split):
    """(S,) constant + differences as fractions."""
    halves = [(float(h), float(h - np.longdouble(float(h)))) for h in split.differences]
    return [Fraction(split.constant) + Fraction(one) + Fraction(other) for one, other in halves]


def off(solution, V, earned):
    """The largest of |V - V*| and V* - V_policy."""
    return max(
        *(abs(Fraction(float(v)) - best) for v, best in zip(solution.V, V, strict=True)),
        *(best - value for best, value in zip(V, earned, strict=True)),
    )


@seeds
@pytest.mark.parametrize("plan", [policy_iteration, value_iteration])
def test_error_bounds_values_and_policy_with_all_rounding(plan, seeds):
    for seed in seeds:
        mdp, reward, _ = hard_case(seed)
        if plan is value_iteration and mdp.gamma > 0.99:
            continue  # a million sweeps
        solution = plan(mdp, reward)
        exact = ExactMDP(mdp, reward.values)
        V, _ = exact.optimum(solution.policy)
        assert off(solution, V, exact.evaluate(np.eye(mdp.n_actions)[solution.policy])) <= Fraction(solution.error), seed


@seeds
def test_policy_iteration_is_exact_to_a_few_bits(seeds):
    for seed in seeds:
        mdp, reward, _ = hard_case(seed)
        solution = policy_iteration(mdp, reward)
        assert solution.error <= 1e-6 * np.abs(solution.V).max() + 1e-300, seed


@seeds
def test_bounds_of_an_optimum_hold(seeds):
    for seed in seeds:
        mdp, reward, rng = hard_case(seed)
        found, exact = optimum(mdp, reward), ExactMDP(mdp, reward.values)
        V, Q = exact.optimum(found.policy)
        W, (gap, wide) = exactly(found.W), found.gaps
        policy = rng.dirichlet(np.ones(mdp.n_actions), size=mdp.n_states)
        behind, unsure = found.behind(policy)
        for s, value in enumerate(exact.evaluate(policy)):
            assert abs(V[s] - W[s]) <= Fraction(found.error[s]), seed
            assert abs(W[s] - value - Fraction(behind[s])) <= Fraction(unsure[s]), seed
            assert all(abs(V[s] - Q[s][a] - Fraction(gap[s, a])) <= Fraction(wide[s, a]) for a in range(mdp.n_actions)), seed


@seeds
def test_the_shortfall_covers_all_that_is_done_where_nothing_is_known(seeds):
    for seed in seeds:
        mdp, reward, rng = hard_case(seed)
        found, exact = optimum(mdp, reward), ExactMDP(mdp, reward.values)
        free, told = rng.random(mdp.n_states) < 0.4, np.eye(mdp.n_actions)[rng.integers(mdp.n_actions, size=mdp.n_states)]
        low, high = found.shortfall(told, free)
        for _ in range(3):
            done = np.where(free[:, None], np.eye(mdp.n_actions)[rng.integers(mdp.n_actions, size=mdp.n_states)], told)
            for s, value in enumerate(exact.evaluate(done)):
                lost = exactly(found.W)[s] - value
                assert low[s] == -np.inf or Fraction(low[s]) <= lost, seed
                assert high[s] == np.inf or lost <= Fraction(high[s]), seed


def test_a_small_cost_of_each_step_is_no_tie_at_a_discount_near_one():
    loop = TabularMDP(np.ones((2, 1)), 0.999999, [1.0])
    solution = policy_iteration(loop, np.array([[1.0, 1.0 - 1.3e-5]]), preference=[1, 0])
    assert solution.policy.tolist() == [0] and abs(solution.V[0] - 1e6) < 1e-3 and solution.error < 1e-6


def test_an_outlier_that_nobody_wants_widens_no_tolerance():
    P = np.zeros((3, 3, 3))
    P[0, 0, 0] = P[0, 1, 0] = P[0, 2, 2] = P[1, :, 1] = P[2, :, 2] = 1
    R = np.array([[1.0, 1.0 - 1e-9, 0], [0, 0, 0], [-1e12] * 3])
    solution = policy_iteration(TabularMDP.from_dense(P, 0.99, np.eye(3)[0]), R, preference=[1, 0, 2])
    assert solution.policy[0] == 0 and solution.V[0] == pytest.approx(100, abs=1e-9)


def test_rows_that_do_not_quite_sum_to_one_are_found_exactly():
    rows = np.array([[1 / 3, 1 / 3, 1 / 3], [0.1, 0.2, 0.7], [1e-20, 1 - 2**-53, 0]])
    found = row_defects(TabularMDP(rows, 0.9, np.eye(3)[0]).P)
    for defect, row in zip(found, rows.tolist(), strict=True):
        exactly = sum(map(Fraction, row)) - 1
        assert abs(Fraction(float(defect)) - exactly) <= abs(exactly) * Fraction(2) ** -52


@pytest.mark.parametrize("gamma", [0.5, 0.99, 0.999999])
def test_discounted_sums_are_bounded_closely_from_both_sides(gamma):
    rng = np.random.default_rng(0)
    P, right = rng.dirichlet(np.full(6, 0.3), size=6), rng.exponential(size=6) * (rng.random(6) < 0.5)
    mdp = TabularMDP(P, gamma, np.eye(6)[0])
    exact = ExactMDP(mdp, right[:, None]).evaluate(np.ones((6, 1)))
    discounted = Discounted(mdp.P, gamma)
    below, above = discounted.below(right), discounted.above(right)
    assert all(Fraction(b) <= x <= Fraction(a) for b, x, a in zip(below, exact, above, strict=True))
    assert (above <= 1.003 * below).all()


def test_a_bound_that_cannot_be_checked_is_not_claimed():
    broken = Discounted(TabularMDP(np.eye(2), 0.9, [1.0, 0.0]).P, 0.9)
    broken._factor = Discounted(TabularMDP(np.eye(2), 0.5, [1.0, 0.0]).P, 0.5)._factor  # factors of another matrix
    assert np.isinf(broken.above(np.ones(2))).all() and (broken.below(np.full(2, -0.0)) == 0).all()
