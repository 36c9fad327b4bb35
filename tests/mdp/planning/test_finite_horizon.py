"""Planning for H steps, against trees of all that can happen."""

import itertools
import pickle

import models
import numpy as np
import pytest

from irl_gym.errors import InvalidDiscount, InvalidMDP, InvalidParameter, InvalidPolicy, InvalidReward
from irl_gym.mdp.optimality import certify
from irl_gym.mdp.planning.dynamic_programming import occupancy, policy_evaluation, policy_iteration, value_iteration
from irl_gym.mdp.planning.finite_horizon import backward_induction, evaluation_within, occupancy_within, value_within
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP, TransitionTable
from irl_gym.mdp.time_expanded import expanded_policy, expanded_reward, time_expanded

HORIZONS = range(3, 21)
KINDS = ("dense", "sparse", "terminal", "deterministic")


def drawn(seed, kind, H):
    """A model, a reward R_h(s) (H+1, S) and a policy (H, S, A)."""
    rng = np.random.default_rng([seed, H])
    model = models.random_model(seed, 5, 3, kind)
    return model, rng.normal(size=(H + 1, 5)), rng.dirichlet(np.ones(3), size=(H, 5))


def by_recursion(P, R, H, h=0, policy=None, gamma=1.0):
    """(S,) what is left from time h on, densely and with nothing shared: R_h(s) paid on arrival; the best without a policy."""
    S = len(P)
    if h == H:
        return np.zeros(S)
    later = by_recursion(P, R, H, h + 1, policy, gamma)
    Q = np.array([[sum(p * (R[h + 1, t] + gamma * later[t]) for t, p in enumerate(row)) for row in P[s]] for s in range(S)])
    return Q.max(axis=1) if policy is None else (policy[h] * Q).sum(axis=1)


@pytest.mark.parametrize("H", HORIZONS)
@pytest.mark.parametrize("kind", KINDS)
def test_backward_induction_finds_what_recursion_over_all_successors_does(kind, H):
    model, R, _ = drawn(0, kind, H)
    found = backward_induction(model.mdp, R, horizon=H)
    assert np.abs(found.V[0] - by_recursion(model.P, R, H)).max() < 1e-10
    earned = evaluation_within(model.mdp, R, found.policy, horizon=H)
    assert np.abs(earned - found.V).max() <= found.error < 1e-10


def test_backward_induction_is_the_best_of_all_policies_that_depend_on_the_time():
    """All 2^6 of them, each played out along every path."""
    rng = np.random.default_rng(4)
    P, R = rng.dirichlet(np.ones(2), size=(2, 2)), rng.normal(size=(4, 2))

    def earns(policy, s, h):
        if h == 3:
            return 0.0
        return sum(P[s, policy[h][s], t] * (R[h + 1, t] + earns(policy, t, h + 1)) for t in range(2))

    every = [np.array(one).reshape(3, 2) for one in itertools.product((0, 1), repeat=6)]
    found = backward_induction(TransitionTable(P.reshape(4, 2), [1.0, 0.0]), R, horizon=3)
    assert found.V[0, 0] == pytest.approx(max(earns(one, 0, 0) for one in every), abs=1e-12)
    assert found.V[0, 1] == pytest.approx(max(earns(one, 1, 0) for one in every), abs=1e-12)


@pytest.mark.parametrize("H", HORIZONS)
@pytest.mark.parametrize("kind", KINDS)
def test_policies_earn_what_recursion_over_all_successors_says(kind, H):
    model, R, policy = drawn(1, kind, H)
    expected = by_recursion(model.P, R, H, policy=policy, gamma=0.9)
    assert np.abs(evaluation_within(model.mdp, R, policy, horizon=H, gamma=0.9)[0] - expected).max() < 1e-10
    assert abs(value_within(model.mdp, R, policy, horizon=H, gamma=0.9) - model.mdp.d0 @ expected) < 1e-10


@pytest.mark.parametrize("kind", KINDS)
def test_occupancies_add_up_to_what_a_policy_earns(kind):
    model, _, policy = drawn(2, kind, 6)
    R = np.random.default_rng(0).normal(size=(5, 3))
    mu = occupancy_within(model.mdp, policy, horizon=6)
    assert (mu * R).sum() == pytest.approx(value_within(model.mdp, R, policy, horizon=6), abs=1e-12)
    assert mu[0].sum() == pytest.approx(1 - model.mdp.d0[model.mdp.terminal].sum())


def test_a_policy_that_does_not_depend_on_the_time_is_the_same_as_its_repetition():
    model, R, policy = drawn(3, "sparse", 4)
    for one, again in ((model.expert, np.tile(model.expert, (4, 1))), (policy[0], np.tile(policy[0], (4, 1, 1)))):
        assert value_within(model.mdp, R, one, horizon=4) == pytest.approx(value_within(model.mdp, R, again, horizon=4))


@pytest.mark.parametrize("on_states", [True, False])
@pytest.mark.parametrize("kind", KINDS)
def test_the_expanded_table_solves_the_same_problem_by_the_usual_planners(kind, on_states):
    model, _, policy = drawn(5, kind, 5)
    R = TabularReward(model.R if on_states else np.random.default_rng(1).normal(size=(5, 3)))
    expanded, paid = time_expanded(model.mdp, 5), expanded_reward(R, model.mdp, 5)
    best = backward_induction(model.mdp, R, horizon=5)
    for found in (policy_iteration(expanded, paid), value_iteration(expanded, paid)):
        assert np.abs(found.V - best.V.ravel()).max() < 1e-10 and found.error < 1e-9
    told = expanded_policy(policy, model.mdp, 5)
    V = policy_evaluation(expanded, paid, told)
    assert np.abs(V - evaluation_within(model.mdp, R, policy, horizon=5).ravel()).max() < 1e-10
    mu = occupancy(expanded, told).reshape(6, 5, 3)
    assert np.abs(mu[:5] - occupancy_within(model.mdp, policy, horizon=5)).max() < 1e-12


@pytest.mark.parametrize("seed", range(3))
def test_certify_judges_undiscounted_policies_at_each_time_of_the_expanded_table(seed):
    """Optimal where backward induction says so, and not where one action in one state that is reached is worse."""
    model, _, _ = drawn(seed, "sparse", 4)
    expanded, paid = time_expanded(model.mdp, 4), expanded_reward(model.R, model.mdp, 4)
    best = backward_induction(model.mdp, model.R, horizon=4)
    found = certify(expanded, expanded_policy(best.policy, model.mdp, 4), paid)
    assert found.expert_optimal and not found.violated.size and not found.undecided.size
    gaps = best.V[:4, :, None] - best.Q
    np.testing.assert_allclose(found.margin[:20], np.partition(gaps, 1, axis=2)[:, :, 1].ravel(), atol=1e-12)
    worse = best.policy.copy()
    worse[2, 3] = best.Q[2, 3].argmin()
    found = certify(expanded, expanded_policy(worse, model.mdp, 4), paid)
    assert found.expert_optimal is False and 2 * 5 + 3 in found.violated
    lost = best.V[0] - evaluation_within(model.mdp, model.R, worse, horizon=4)[0]
    assert found.loss_low <= model.mdp.d0 @ lost <= found.loss_bound < model.mdp.d0 @ lost + 1e-9


def test_a_table_with_a_horizon_is_pickled_restricted_and_copied_with_it():
    mdp = time_expanded(models.random_model(0, 5, 3, "terminal").mdp, 3)
    part = mdp.restrict(np.flatnonzero(mdp.reachable))
    assert [one.horizon for one in (mdp, part, pickle.loads(pickle.dumps(mdp)))] == [3, 3, 3]
    assert mdp.effective_horizon == 4.0


def test_a_reward_is_paid_on_arrival_so_that_of_the_horizon_counts_and_that_of_the_start_never():
    one_way = TransitionTable.from_dense(np.array([[[0.0, 1.0]], [[0.0, 1.0]]]), [1.0, 0.0])
    for h, worth in ((0, 0.0), (1, 1.0), (2, 1.0)):
        assert value_within(one_way, np.eye(3)[h][:, None] * np.ones(2), [0, 0], horizon=2) == worth


BAD = [
    (lambda table: backward_induction(table, np.zeros(2), horizon=0), InvalidParameter, "horizon is 0: expected a whole"),
    (lambda table: time_expanded(table, 0), InvalidParameter, "horizon is 0: expected a whole number"),
    (lambda table: TabularMDP(table.P, 1.0, table.d0), InvalidDiscount, "gamma is 1.0: .* or 1 with a horizon"),
    (lambda table: TabularMDP(table.P, 1.0, table.d0, horizon=3), InvalidMDP, "one can go on for ever: expected P"),
    (lambda table: TabularMDP(time_expanded(table, 4).P, 1.0, np.eye(10)[0], horizon=3), InvalidMDP, "the longest has 4 steps"),
    (lambda table: time_expanded(table, 2, gamma=1.1), InvalidDiscount, "gamma is 1.1: .* above 0, and at most 1"),
    (lambda table: backward_induction(table, np.zeros((3, 2)), horizon=3), InvalidReward, r"expected .* or \(4, 2\), paid"),
    (lambda table: value_within(table, np.zeros(2), np.zeros((2, 2), int), horizon=3), InvalidPolicy, "expected 3 times"),
    (lambda table: value_within(table, np.zeros(2), np.full((3, 2), 7), horizon=3), InvalidPolicy, "at time 0: .* action 7"),
    (lambda table: time_expanded(np.eye(2), 3), InvalidMDP, "expected a TransitionTable or a TabularMDP"),
]  # fmt: skip


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(("ask", "error", "told"), BAD)
def test_what_is_no_problem_of_h_steps_is_refused(ask, error, told):
    with pytest.raises(error, match=told):
        ask(TransitionTable(np.array([[0.0, 1.0], [1.0, 0.0]]), [1.0, 0.0]))
