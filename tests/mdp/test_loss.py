"""Is an expert optimal: against rational arithmetic, and by the values of the issue that asked for it."""

from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from exact import ExactMDP
from hard_cases import hard_case, some_expert

from irl_gym.mdp.loss import OPTIMAL_SHARE, Loss, loss_of, told_loss
from irl_gym.mdp.optimality import certify
from irl_gym.mdp.planning.dynamic_programming import optimum
from irl_gym.mdp.tabular_mdp import TabularMDP


def visited(exact, does):
    """States that are reached, given which actions (S, A) a policy takes."""
    seen = {s for s in range(exact.S) if exact.d0[s] > 0}
    todo = list(seen)
    while todo:
        s = todo.pop()
        new = {t for a in range(exact.A) if does[s][a] for t in range(exact.S) if exact.P[s][a][t] > 0} - seen
        seen |= new
        todo += new
    return seen


def truth(exact, V, Q, expert, policy):
    """The loss and the scale, in fractions."""
    loss, gain = (
        sum(d * (best - value) for d, best, value in zip(exact.d0, V, exact.evaluate(one), strict=True))
        for one in (expert, np.full(expert.shape, 1 / exact.A))
    )
    like = [all(Q[s][a] == max(Q[s]) for a in range(exact.A) if expert[s, a] > 0) for s in range(exact.S)]
    best = [expert[s] > 0 if like[s] else np.arange(exact.A) == policy[s] for s in range(exact.S)]
    where = visited(exact, expert > 0) | visited(exact, best)
    span, largest = max(V[s] for s in where) - min(V[s] for s in where), max(abs(V[s]) for s in where)
    if span > Fraction(1e-12) * largest:
        return loss, min(gain, span)
    return loss, min(gain, largest) if largest else loss  # flat: nothing to compare a loss with but 0


def verdicts(seeds):
    """How often each verdict met each truth; the bounds of the loss are checked on the way."""
    found = Counter()
    for seed in seeds:
        mdp, reward, rng = hard_case(seed)
        best, exact = optimum(mdp, reward), ExactMDP(mdp, reward.values)
        V, Q = exact.optimum(best.policy)
        expert = some_expert(exact, Q, rng)
        told = loss_of(best, expert)
        loss, scale = truth(exact, V, Q, expert, best.policy)
        assert Fraction(told.low) <= loss <= Fraction(told.high), seed
        found[told.optimal, loss == 0 or loss <= Fraction(OPTIMAL_SHARE) * scale] += 1
    return found


@pytest.mark.parametrize("seeds", [range(60), pytest.param(range(60, 2060), marks=pytest.mark.slow)], ids=["few", "many"])
def test_no_verdict_is_false_and_hardly_one_undecided(seeds):
    found = verdicts(seeds)
    assert not found[True, False] and not found[False, True] and found[True, True] and found[False, False], found
    assert found[None, True] + found[None, False] <= 0.01 * len(seeds), found


def corridor(gamma, cost, length=500):
    """States in a row, the last terminal and paying 1; action 0 goes on for `cost`, action 1 for nothing."""
    P = np.zeros((length + 1, 2, length + 1))
    P[np.arange(length), :, np.arange(length) + 1] = 1
    R = np.zeros((length + 1, 2))
    R[:length, 0] = -cost
    R[length - 1] += 1
    return TabularMDP.from_dense(P, gamma, np.eye(length + 1)[0]), R


def test_an_expert_who_pays_at_each_step_is_not_optimal_at_a_discount_near_one():
    mdp, R = corridor(0.999999, 0.0009)
    found = certify(mdp, np.zeros(501, dtype=np.int64), R)
    assert found.expert_optimal is False and found.loss_bound == pytest.approx(0.45, rel=1e-3)
    assert found.violated.size == 500 and found.worst_violation == pytest.approx(0.0009)


def test_an_outlier_that_bad_actions_reach_does_not_dilute_the_loss():
    P = np.zeros((4, 3, 4))
    P[0, [0, 1, 2], [1, 2, 3]] = 1
    mdp = TabularMDP.from_dense(P, 0.9, np.eye(4)[0])
    found = certify(mdp, np.zeros(4, dtype=np.int64), np.array([0.0, 0.0, 1.0, -1e8]))
    assert found.expert_optimal is False and found.loss_low == pytest.approx(1.0) and found.loss_share == pytest.approx(1.0)
    assert certify(mdp, np.ones(4, dtype=np.int64), np.array([0.0, 0.0, 1.0, -1e8])).expert_optimal is True


def test_a_reward_that_says_nothing_ties_everything():
    P = np.full((2, 2, 2), 0.5)
    told = certify(TabularMDP.from_dense(P, 0.9, [1.0, 0.0]), np.zeros(2, dtype=np.int64), np.ones(2))
    assert told.expert_optimal and told.degenerate and np.isnan(told.loss_share) and "all actions are tied" in str(told)


def test_a_reward_that_only_punishes_is_not_called_a_tie():
    P = np.zeros((3, 3, 3))
    P[0, [0, 1, 2], [1, 0, 2]] = P[1, [0, 1, 2], [0, 1, 2]] = P[2, :, 2] = 1
    found = certify(TabularMDP.from_dense(P, 0.9, np.eye(3)[0]), np.zeros(3, dtype=np.int64), np.array([0.0, 0.0, -1.0]))
    assert found.expert_optimal is True and found.loss_share == 0 and "tied" not in str(found).splitlines()[0]


@pytest.mark.parametrize("c", [0.1, 0.3, 1 / 7, 1e6])
@pytest.mark.parametrize("gamma", [0.9, 0.99, 1 - 2**-20])
def test_payments_that_cancel_are_no_reason_for_doubt(c, gamma):
    P = np.zeros((3, 2, 3))
    P[0, [0, 1], [1, 2]] = P[1, :, 0] = P[2, :, 2] = 1
    R = np.array([[c, 0.0], [-c / gamma, -c / gamma], [-c, -c]])  # a step of c, and one that takes it back
    expert = np.zeros(3, dtype=np.int64)
    found = certify(TabularMDP.from_dense(P, gamma, np.eye(3)[0]), expert, R)
    assert found.expert_optimal is True
    assert certify(TabularMDP.from_dense(P, gamma, np.eye(3)[0]), np.ones(3, dtype=np.int64), R).expert_optimal is False


def test_actions_that_counts_do_not_tell_apart_leave_a_loss_undecided():
    P = np.zeros((4, 2, 4))
    P[0, 0, [1, 2]], P[0, 1, [1, 2]] = [0.5, 0.5], [0.56, 0.44]
    P[1, :, 1] = P[2, :, 2] = P[3, :, 3] = 1
    counted = TabularMDP(P.reshape(8, 4), 0.9, np.eye(4)[0], visits=np.full((4, 2), 200))
    exact, R = TabularMDP(counted.P, 0.9, counted.d0), np.array([0.0, 1.0, 0.0, 0.0])
    assert certify(exact, np.zeros(4, dtype=np.int64), R).expert_optimal is False
    found = certify(counted, np.zeros(4, dtype=np.int64), R)
    assert found.expert_optimal is None and found.loss_low == 0 and found.loss_bound == pytest.approx(0.6, rel=1e-3)


def test_an_expert_known_in_part_is_judged_over_all_that_it_may_do():
    mdp, R = corridor(0.9, 0.5, length=3)
    found, expert = optimum(mdp, R), np.eye(2)[[1, 1, 1, 1]]
    for unknown, optimal, most in (([], True, 0.0), ([0], None, 0.5), ([0, 1], None, 0.95), ([3], True, 0.0)):
        free = np.isin(np.arange(4), unknown)
        loss = loss_of(found, expert, free)
        assert loss.optimal is optimal and loss.high == pytest.approx(most, rel=2e-3, abs=1e-12) and loss.low == 0
    errs = loss_of(found, np.eye(2)[[1, 0, 1, 1]], np.array([True, False, False, False]))
    assert errs.optimal is False and 0.44 < errs.low <= 0.45 and 0.95 <= errs.high < 0.96


def test_unknown_states_that_the_expert_cannot_reach_do_not_matter():
    P = np.zeros((4, 2, 4))
    P[0, [0, 1], [1, 2]] = 1
    P[2, :, 3] = 1
    mdp = TabularMDP.from_dense(P, 0.9, np.eye(4)[0])
    found = optimum(mdp, np.array([[1.0, 0.0], [0, 0], [0.0, 0.5], [0, 0]]))
    assert loss_of(found, np.eye(2)[[0, 0, 0, 0]], np.array([False, False, True, False])).optimal is True


@pytest.mark.parametrize(
    ("bounds", "optimal", "told"),
    [
        ((0.0, 1e-9, 1.0, 1.1), True, "yes: the best policy earns at most 1.0e-09 more, 1.0e-09 of what is at stake"),
        ((0.5, 0.6, 1.0, 1.1), False, "no: the best policy earns at least 0.5 more"),
        ((0.0, 0.6, 1.0, 1.1), None, "undecided: the best policy earns 0 to 0.6 more"),
        ((0.0, np.inf, 1.0, 1.1), None, "undecided: the best policy earns at least 0 more, how much is not known"),
    ],
)
def test_a_loss_is_told_in_a_sentence(bounds, optimal, told):
    loss = Loss(*bounds, tied=False)
    assert loss.optimal is optimal and told_loss(optimal, loss.low, loss.high, loss.share) == told
