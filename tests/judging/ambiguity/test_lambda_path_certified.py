"""`exact` is a proof: on tables with tiny probabilities a path is exact only as far as its recomputed gap says."""

from dataclasses import replace

import numpy as np
import pytest
import reference

from irl_gym.errors import DegenerateExpert
from irl_gym.judging.ambiguity.lambda_path import CERTIFIED, LambdaPath, lambda_path
from irl_gym.mdp.tabular_mdp import TabularMDP


def faint(seed, tiny, gamma=0.9):
    """A table that is deterministic but for probabilities of about `tiny`, and an expert that some reward explains."""
    rng = np.random.default_rng(seed)
    S, A = int(rng.integers(3, 9)), 2 + seed % 2
    P = np.eye(S)[rng.integers(S, size=(S, A))]
    P = P + tiny * rng.random(P.shape) * (rng.random(P.shape) < 0.5)
    P /= P.sum(axis=2, keepdims=True)
    expert = reference.optimal_actions(P, gamma, np.broadcast_to(P @ rng.normal(size=S), (S, A)))
    return P, TabularMDP.from_dense(P, gamma, np.ones(S) / S), expert


def paths(tiny):
    for seed in range(24):
        P, mdp, expert = faint(seed, tiny)
        try:
            yield P, expert, lambda_path(mdp, expert)
        except DegenerateExpert:
            continue


@pytest.mark.parametrize("tiny", [1e-15, 1e-9])
def test_an_exact_path_is_as_good_as_its_gap_and_no_other_is_called_exact(tiny):
    found = list(paths(tiny))
    assert len(found) >= 16
    for _, _, path in found:
        gap = path.gap / path.total_margins[0]
        assert path.exact == (gap <= CERTIFIED and path.violation <= CERTIFIED)
        assert ("not certified" in str(path)) != path.exact


def test_probabilities_of_1e_15_leave_a_path_exact_and_the_paper_s_program_agrees():
    agreed = 0
    for P, expert, path in paths(1e-15):
        same = np.abs(P - P[np.arange(len(P)), expert][:, None]).max(axis=2) < 1e-12
        if not path.exact or same.sum() > len(P):  # the program as printed has no margin where successors are the same
            continue
        agreed += 1
        for price in np.linspace(0, path.lambda_0, 5):
            assert path.objective(price) == pytest.approx(reference.paper_lp(P, 0.9, expert, l1=price)[0], abs=1e-6)
    assert agreed


def test_probabilities_of_1e_9_leave_gaps_and_they_are_told():
    worst = max((path for *_, path in paths(1e-9)), key=lambda path: path.gap)
    assert worst.gap > 1e-3 * worst.total_margins[0]
    assert worst.whole and not worst.exact and "not certified" in str(worst)


@pytest.mark.parametrize("change", [{"gap": 0.3}, {"gap": np.nan}, {"violation": 1e-3}, {"whole": False}])
def test_a_path_with_a_gap_or_a_violation_is_not_exact_nor_is_it_when_read_again(tmp_path, change):
    path = next(path for *_, path in paths(1e-15) if path.exact)
    spoiled = replace(path, **change)
    assert path.exact and not spoiled.exact
    spoiled.save(tmp_path / "path.npz")
    again = LambdaPath.load(tmp_path / "path.npz")
    assert not again.exact and again.whole == spoiled.whole
