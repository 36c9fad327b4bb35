"""Behaviour cloning by a softmax of features, against the same convex program in cvxpy."""

from itertools import count

import cvxpy as cp
import numpy as np
import pytest

from irl_gym.errors import InvalidFeatures, InvalidParameter, SolverFailed, SolverTimeout
from irl_gym.learners.cloning.clone import Clone
from irl_gym.learners.cloning.softmax import SoftmaxClone
from irl_gym.programs import deadline
from irl_gym.programs.status import Status


def penalised(policy_log, counts, theta, l2):
    return -(counts * policy_log).sum() / counts.sum() + l2 * (theta**2).sum() / 2


@pytest.mark.parametrize("seed", range(3))
def test_the_log_loss_is_the_least_of_its_class(seed):
    rng = np.random.default_rng(seed)
    phi, counts, l2 = rng.normal(size=(9, 3)), rng.integers(0, 5, (9, 4)), 1e-2
    found = SoftmaxClone(phi, l2=l2).fit(counts)
    theta = np.array(found.stats["theta"])
    logits = phi @ theta
    log_pi = logits - np.log(np.exp(logits).sum(axis=1, keepdims=True))
    np.testing.assert_allclose(np.exp(log_pi), found.policy, rtol=1e-9)
    free = cp.Variable((3, 4))
    weights = counts / counts.sum()
    loss = weights.sum(axis=1) @ cp.log_sum_exp(phi @ free, axis=1) - cp.sum(cp.multiply(weights, phi @ free))
    least = cp.Problem(cp.Minimize(loss + l2 * cp.sum_squares(free) / 2)).solve(solver="CLARABEL")
    mine = penalised(log_pi, counts, theta, l2)
    assert mine - least <= found.proof.suboptimality + 1e-7 and mine == pytest.approx(least, abs=1e-6)
    assert found.status is Status.OPTIMAL


def test_one_hot_features_clone_as_counts_do():
    counts = np.array([[8, 2], [1, 1], [3, 9]])
    found = SoftmaxClone(np.eye(3), l2=1e-7).fit(counts).policy
    np.testing.assert_allclose(found, Clone().fit(counts).policy, atol=1e-5)


def test_features_decide_where_nothing_was_demonstrated():
    counts = np.array([[9, 0], [0, 9], [0, 0]])
    found = SoftmaxClone(np.array([[1.0, 0], [0, 1.0], [0, 2.0]]), l2=1e-3).fit(counts)
    assert found.policy[2, 1] > 0.9 and found.proof.unshown == 1
    assert "there the features decide" in found.facts()[2].sentence


def test_a_proof_is_no_better_than_the_gradient_says():
    proof = SoftmaxClone(np.eye(2), l2=0.1).fit(np.array([[3, 1], [1, 3]])).proof
    assert proof.suboptimality == proof.gradient_norm**2 / 0.2 and proof.to_json()["suboptimality"] == proof.suboptimality


def test_a_limit_of_time_ends_the_iterations(monkeypatch):
    monkeypatch.setattr(deadline.time, "monotonic", map(float, count()).__next__)  # a second passes whenever it is asked
    with pytest.raises(SolverTimeout, match=r"no answer in 3\.0 s"):
        SoftmaxClone(np.eye(2), time_limit=3.0).fit(np.array([[3, 1], [1, 9]]))
    assert SoftmaxClone(np.eye(2), time_limit=1e4).fit(np.array([[3, 1], [1, 9]])).proof.suboptimality < 1e-6


@pytest.mark.parametrize(
    ("made", "error", "told"),
    [
        (lambda: SoftmaxClone(time_limit=-1.0), InvalidParameter, "time_limit is -1.0: expected seconds above 0, or None"),
        (lambda: SoftmaxClone(l2=0.0), InvalidParameter, "l2 is 0.0: expected a number above 0"),
        (lambda: SoftmaxClone(max_iterations=0), InvalidParameter, "max_iterations is 0: expected"),
        (lambda: SoftmaxClone(np.eye(3)).fit(np.ones((2, 2))), InvalidFeatures, "the features are of 3 states: expected 2"),
        (lambda: SoftmaxClone().fit(np.ones((2, 2))), InvalidFeatures, "features is None: expected phi"),
        (lambda: SoftmaxClone(np.eye(2), max_iterations=1).fit(np.array([[3, 1], [1, 9]])), SolverFailed,
         "after 1 iterations the log loss may be"),
    ],
)  # fmt: skip
def test_what_cannot_be_fitted_is_refused(made, error, told):
    with pytest.raises(error, match=told):
        made()
