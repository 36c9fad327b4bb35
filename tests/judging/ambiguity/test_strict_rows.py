"""Rows of (4) that no reward makes strict are left out of faces, paths and widths as FiniteLP leaves them out: one by one."""

import numpy as np
import pytest

from irl_gym.errors import DegenerateExpert
from irl_gym.judging.ambiguity.lambda_path import lambda_path
from irl_gym.judging.ambiguity.uniqueness import optimal_face
from irl_gym.judging.ambiguity.widths import feasible_widths
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.mdp.tabular_mdp import TabularMDP


def swapping() -> TabularMDP:
    """States A, B, T; actions: swap A and B (the expert's), stay, which is a tie under any reward, fall to T for ever."""
    P = np.zeros((3, 3, 3))
    P[0], P[1], P[2] = np.eye(3)[[1, 0, 2]], np.eye(3)[[0, 1, 2]], np.eye(3)[[2, 2, 2]]
    return TabularMDP.from_dense(P, 0.9, [1.0, 0, 0])


def with_such_rows(seeds):
    """Random deterministic tables and experts with a row that can be strict and one that cannot, and what is learned."""
    for seed in seeds:
        rng = np.random.default_rng([5, seed])
        S, A = int(rng.integers(4, 8)), int(rng.integers(2, 5))
        mdp = TabularMDP.from_dense(np.eye(S)[rng.integers(S, size=(S, A))], 0.9, np.full(S, 1 / S))
        expert = rng.integers(A, size=S)
        try:
            found = FiniteLP().fit(mdp, expert)
        except DegenerateExpert:
            continue
        if len(found.proof.unbreakable_rows):
            yield mdp, expert, found


@pytest.mark.parametrize("fields", [{}, {"l1": "auto"}, {"margin_cap": 0.01}, {"margin_cap": 0.01, "l1": 0.1}], ids=str)
def test_the_learned_reward_lies_on_the_face(fields):
    count = 0
    for mdp, expert, _ in with_such_rows(range(5)):
        learner = FiniteLP(**fields)
        R, face = learner.fit(mdp, expert).reward.values, optimal_face(mdp, expert, learner)
        assert (face.low - 1e-6 <= R).all() and (face.high + 1e-6 >= R).all()
        count += 1
    assert count >= 2


@pytest.mark.parametrize("cap", ["auto", 0.01])
def test_a_path_is_that_of_the_rows_that_can_be_strict(cap):
    count = 0
    for mdp, expert, _ in with_such_rows(range(5)):
        path = lambda_path(mdp, expert, margin_cap=cap)
        assert path.exact and path.lambda_0 == pytest.approx(FiniteLP(margin_cap=cap).critical_l1(mdp, expert), rel=1e-6)
        for price in (0.3 * path.lambda_0, 0.8 * path.lambda_0):
            best = FiniteLP(margin_cap=path.margin_cap, l1=price).fit(mdp, expert).proof.objective
            assert path.objective(price) == pytest.approx(best, abs=1e-6)
        count += 1
    assert count >= 2


def test_widths_ask_for_margins_over_the_actions_that_can_be_worse():
    widths = feasible_widths(swapping(), np.zeros(3, dtype=int))
    assert widths.with_margin.tolist() == [0, 1] and widths.margin > 0.1
    assert widths.high[2] < widths.low[:2].min() + 2 and np.isfinite(widths.width).all()


def test_a_learned_reward_is_within_the_widths():
    count = 0
    for mdp, expert, found in with_such_rows(range(5)):
        widths = feasible_widths(mdp, expert)
        R = found.reward.values
        assert (widths.low - 1e-6 <= R).all() and (widths.high + 1e-6 >= R).all() and widths.with_margin.size
        count += 1
    assert count >= 2
