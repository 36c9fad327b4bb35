"""Rows of (4) that no reward makes strict are left out one by one: the other rows of their states keep their margins."""

import gymnasium as gym
import models
import numpy as np
import pytest
import soft_reference
from certified import both, certified
from scipy.optimize import linprog

from irl_gym.judging.diagnoses.doctor import doctor
from irl_gym.judging.metrics import worst_tie
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.mdp.margins import row_margins
from irl_gym.mdp.optimality_rows import compare
from irl_gym.mdp.planning.dynamic_programming import policy_iteration
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.tables.tabulate import tabulate


def swapping() -> TabularMDP:
    """States A, B, T; actions: swap A and B (the expert's), stay, fall to T for ever."""
    P = np.zeros((3, 3, 3))
    P[0], P[1], P[2] = np.eye(3)[[1, 0, 2]], np.eye(3)[[0, 1, 2]], np.eye(3)[[2, 2, 2]]
    return TabularMDP.from_dense(P, 0.9, [1.0, 0, 0])


def five_states() -> TabularMDP:
    """The same behind a start C, from which every action but the first leads to D for ever."""
    P = np.zeros((5, 3, 5))
    A, B, T, C, D = range(5)
    for state, successors in ((A, (B, A, T)), (B, (A, B, T)), (T, (T, T, T)), (C, (A, D, D)), (D, (D, D, D))):
        P[state] = np.eye(5)[list(successors)]
    return TabularMDP.from_dense(P, 0.9, np.eye(5)[C])


def breakable(mdp: TabularMDP, expert: np.ndarray) -> np.ndarray:
    """(n,) rows of (4) that can be strict, by a linear program each, dense and in R."""
    c = compare(mdp, expert)
    inverse = np.linalg.inv(np.eye(mdp.n_states) - mdp.gamma * mdp.P_pi(expert).toarray())
    rows = c.rows.toarray() @ inverse
    solved = [linprog(-row, A_ub=-rows, b_ub=np.zeros(len(rows)), bounds=(-1, 1)) for row in rows]
    return np.array([-one.fun > 1e-7 for one in solved])


def ties_left(mdp: TabularMDP, expert: np.ndarray, found) -> int:
    """How many rows that can be strict have less than the margin promised."""
    margins = row_margins(mdp, compare(mdp, expert), TabularReward(found.reward.values))
    return int((margins[breakable(mdp, expert)] < found.proof.margin_cap * (1 - 1e-6)).sum())


def test_falling_has_a_margin_where_staying_can_have_none():
    found = certified(FiniteLP(), swapping(), np.zeros(3, dtype=int))
    assert found.unbreakable_rows.tolist() == [[0, 1], [1, 1]]
    assert found.margin[:2] == pytest.approx([found.margin_cap] * 2, rel=1e-6)
    assert found.expert_optimal and found.marginless.size == 0
    assert found.least_l1_norm == pytest.approx(found.l1_norm, rel=1e-6)
    assert "2 actions in 2 states: no reward of this kind" in found.told


@pytest.mark.parametrize("fields", [{"margin_cap": 0.5}, {"margin_cap": 0.5, "l1": 0.01}, {"l1": "auto"}, {"slack": 10.0}])
def test_every_capped_program_leaves_out_rows_and_not_states(fields):
    mdp, expert = swapping(), np.zeros(3, dtype=int)
    found = certified(FiniteLP(**fields), mdp, expert)
    assert (found.margin[:2] > 0.1).all()
    assert found.duality_gap < 1e-6


def test_the_price_at_which_the_reward_vanishes_is_that_of_the_rows_that_can_be_strict():
    assert FiniteLP().critical_l1(swapping(), np.zeros(3, dtype=int)) > 1.0


def test_the_worst_tie_of_the_five_states_loses_nothing():
    mdp, expert = five_states(), np.zeros(5, dtype=int)
    found = FiniteLP().fit(mdp, expert)
    true = TabularReward(np.array([0, 0, -1.0, 0, -1]))
    assert worst_tie(mdp, found.reward, true).value == pytest.approx(0.0, abs=1e-9)


def test_the_doctor_speaks_of_the_one_action_that_always_ties():
    mdp, expert = swapping(), np.zeros(3, dtype=int)
    said = str(doctor(FiniteLP().fit(mdp, expert), mdp, expert))
    assert "in 2 states no reward on states" in said.lower()
    assert "only a constant" not in said and "No state reward explains" not in said


def test_an_expert_unknown_in_a_state_loses_only_the_row_that_none_makes_strict():
    mdp, expert = five_states(), np.eye(3)[np.zeros(5, dtype=int)]
    expert[4] = np.nan
    found = certified(FiniteLP(), mdp, expert)
    assert found.unbreakable_rows.tolist() == [[0, 1], [1, 1]]
    assert (found.margin[[0, 1, 3]] >= found.margin_cap * (1 - 1e-6)).all()


def left_over(seeds: range) -> tuple[int, int, int]:
    """Experts, breakable ties left and unbreakable rows, over random deterministic tables and policies with a breakable row."""
    experts, left, unbreakable = 0, 0, 0
    for seed in seeds:
        rng = np.random.default_rng(seed)
        S, A = int(rng.integers(4, 8)), int(rng.integers(2, 5))
        mdp = models.random_model(seed, S, A, "deterministic").mdp
        expert = rng.integers(A, size=S)  # optimal for no strict reward, mostly
        c, can = compare(mdp, expert), breakable(mdp, expert)
        if can.any():
            found = FiniteLP().fit(mdp, expert)
            assert len(found.proof.unbreakable_rows) == int((~can & ~c.trivial).sum()), seed
            experts, left = experts + 1, left + ties_left(mdp, expert, found)
            unbreakable += len(found.proof.unbreakable_rows)
    return experts, left, unbreakable


def test_no_breakable_tie_is_left_on_random_deterministic_tables():
    experts, left, unbreakable = left_over(range(25))
    assert left == 0 and experts > 5 and unbreakable > 20


@pytest.mark.slow
def test_no_breakable_tie_is_left_on_many_random_deterministic_tables():
    experts, left, unbreakable = left_over(range(420))
    print(f"{experts} experts, {unbreakable} unbreakable rows, {left} breakable ties left")
    assert left == 0 and experts >= 400


def restarting_lake() -> tuple[TabularMDP, np.ndarray]:
    """FrozenLake 4x4 without ends: what entered a hole or the goal enters the start. Its MDP and true (S, A) reward."""
    table = tabulate(gym.make("FrozenLake-v1"), gamma=0.99)
    mdp, dense = table.mdp, table.mdp.P.toarray()
    dense[:, 0] += dense[:, mdp.terminal].sum(axis=1)
    dense[:, mdp.terminal] = 0.0
    dense[np.repeat(mdp.terminal, mdp.n_actions), 0] = 1.0
    return TabularMDP(dense, 0.99, mdp.d0), table.reward.expected(mdp)


def test_no_breakable_tie_is_left_on_the_lake_that_restarts():
    mdp, R = restarting_lake()
    expert = policy_iteration(mdp, R).policy
    rows = np.flatnonzero(mdp.reachable)
    part = mdp.restrict(rows)
    assert ties_left(part, expert[rows], FiniteLP().fit(part, expert[rows])) == 0


# --- experts known in part, and experts that err ---


def partly_known(seed: int) -> tuple[np.ndarray, TabularMDP, np.ndarray]:
    """A random deterministic table, and a policy that is mostly optimal for nothing, unknown in one state."""
    rng = np.random.default_rng([3, seed])
    S, A = int(rng.integers(4, 8)), int(rng.integers(2, 5))
    P = np.eye(S)[rng.integers(S, size=(S, A))]
    expert = np.eye(A)[rng.integers(A, size=S)]
    expert[rng.integers(S)] = np.nan
    return P, TabularMDP.from_dense(P, 0.9, np.full(S, 1 / S)), expert


@pytest.mark.parametrize(
    "fields", [{}, {"margin_cap": 1e-4}, {"margin_cap": 1e-4, "l1": 1e-9}, {"margin_cap": 1e-4, "slack": 1e4}]
)
def test_an_expert_known_in_part_loses_the_rows_that_none_makes_strict_and_no_others(fields):
    compared = unbreakable = 0
    for seed in range(25):
        P, mdp, expert = partly_known(seed)
        can = soft_reference.breakable(P, 0.9, expert)
        if not can.any():
            continue
        certificate = certified(FiniteLP(**fields), mdp, expert)
        if certificate.violated.size:
            continue  # slack gave states up
        known = ~np.isnan(expert).any(axis=1)
        moved = np.abs(np.einsum("sa,sat->st", np.nan_to_num(expert), P)[:, None] - P).max(axis=2) > 1e-12
        never = known[:, None] & (expert != 1) & moved & ~can
        assert certificate.unbreakable_rows.tolist() == np.argwhere(never).tolist(), seed
        assert (certificate.margin[can.any(axis=1)] >= certificate.margin_cap * (1 - 1e-6)).all(), seed
        compared, unbreakable = compared + 1, unbreakable + len(certificate.unbreakable_rows)
    assert compared > 10 and unbreakable > 20


def erring() -> tuple[TabularMDP, np.ndarray]:
    """The five states, and a sixth and seventh between which the expert contradicts itself: each goes to the worse."""
    P = np.zeros((7, 3, 7))
    P[:5, :, :5] = five_states().P.toarray().reshape(5, 3, 5)
    P[5] = np.eye(7)[[0, 2, 2]]
    P[6] = np.eye(7)[[2, 0, 0]]
    return TabularMDP.from_dense(P, 0.9, np.eye(7)[[3, 5, 6]].mean(axis=0)), np.zeros(7, dtype=int)


@pytest.mark.parametrize("cap", ["auto", 0.1])
def test_slack_that_gives_a_state_up_leaves_rows_out_and_not_states(cap):
    mdp, expert = erring()
    found = FiniteLP(slack=5.0, margin_cap=cap).fit(mdp, expert, visits=np.array([9.0, 9, 9, 9, 9, 9, 1]))
    certificate = both(found, mdp, expert)
    assert certificate.violated.tolist() == [6] and found.stats["states_given_up"] == 1
    assert [0, 1] in certificate.unbreakable_rows.tolist() and [1, 1] in certificate.unbreakable_rows.tolist()
    assert (certificate.margin[[0, 1, 3, 5]] >= certificate.margin_cap * (1 - 1e-6)).all()
    assert certificate.duality_gap < 1e-6


def test_the_price_at_which_the_reward_vanishes_leaves_those_rows_out_with_slack_too():
    mdp, expert = swapping(), np.zeros(3, dtype=int)
    assert FiniteLP(slack=1e4).critical_l1(mdp, expert) == pytest.approx(FiniteLP().critical_l1(mdp, expert), rel=1e-6)
