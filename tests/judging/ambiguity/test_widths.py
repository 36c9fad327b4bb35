"""Widths of the feasible set, against the linear programs written with the explicit inverse and solved by SciPy."""

import json
from itertools import product

import models
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from irl_gym.errors import DegenerateExpert, InvalidMDP, InvalidParameter, InvalidPolicy
from irl_gym.judging.ambiguity.feasible import sample_feasible
from irl_gym.judging.ambiguity.widths import feasible_widths
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.mdp.tabular_mdp import TabularMDP

seeds = st.integers(0, 2**32 - 1)


def rows_on_states(P, gamma, expert):
    """The state of each row, and (P_pi - P_a) (I - gamma P_pi)^-1 R as functions of R (S,); rows of same successors are out."""
    S, A, _ = P.shape
    P_pi = P[np.arange(S), expert]
    inverse = np.linalg.inv(np.eye(S) - gamma * P_pi)
    pairs = [(s, a) for s, a in product(range(S), range(A)) if a != expert[s] and np.abs(P_pi[s] - P[s, a]).max() > 1e-12]
    return np.array([s for s, _ in pairs]), np.array([(P_pi[s] - P[s, a]) @ inverse for s, a in pairs])


def rows_on_steps(P, gamma, expert):
    """The same of Q(s, pi) - Q(s, a) as functions of R (S*A,)."""
    S, A, _ = P.shape
    picks = np.eye(S * A)[np.arange(S) * A + expert]
    V = np.linalg.inv(np.eye(S) - gamma * P[np.arange(S), expert]) @ picks
    Q = np.eye(S * A) + gamma * P.reshape(S * A, S) @ V
    pairs = [(s, a) for s, a in product(range(S), range(A)) if a != expert[s] and P[s].sum() > 0]
    return np.array([s for s, _ in pairs]), np.array([V[s] - Q[s * A + a] for s, a in pairs])


def by_scipy(states, rows, margin, with_margin, size, pins=(), r_max=1.0):
    """(size,) least and largest value of each unknown; None where no reward is feasible."""
    needed = np.where(np.isin(states, with_margin), margin, 0.0)
    box = [(-r_max, r_max)] * size
    for where, value in pins:
        box[where] = (value, value)
    found = np.zeros((2, size))
    for i in range(size):
        for side, sign in enumerate((1, -1)):
            solved = linprog(sign * np.eye(size)[i], -rows, -needed, bounds=box, method="highs")
            if solved.status == 2:
                return None
            found[side, i] = sign * solved.fun
    return found


@given(models.models(), st.sampled_from(["auto", None]))
def test_widths_on_states_agree_with_the_paper_written_out(model, margin):
    found = feasible_widths(model.mdp, model.expert, margin=margin)
    states, rows = rows_on_states(model.P, model.mdp.gamma, model.expert)
    low, high = by_scipy(states, rows, found.margin, found.with_margin, model.mdp.n_states)
    assert np.allclose(found.low, low, atol=1e-6) and np.allclose(found.high, high, atol=1e-6)


@settings(max_examples=8)
@given(models.models(), st.sampled_from(["auto", None]))
def test_widths_on_steps_agree_with_the_programs_written_out(model, margin):
    S, A = model.mdp.n_states, model.mdp.n_actions
    found = feasible_widths(model.mdp, model.expert, margin=margin, reward_on="state-action")
    states, rows = rows_on_steps(model.P, model.mdp.gamma, model.expert)
    ended = [(s * A + a, 0.0) for s in np.flatnonzero(model.mdp.terminal) for a in range(A)]
    low, high = by_scipy(states, rows, found.margin, found.with_margin, S * A, ended).reshape(2, S, A)
    acting = ~model.mdp.terminal
    assert np.isnan(found.width[~acting]).all()
    assert np.allclose(found.low[acting], low[acting], atol=1e-6) and np.allclose(found.high[acting], high[acting], atol=1e-6)


@settings(max_examples=12)
@given(models.models(), seeds)
def test_pinned_widths_agree_with_the_paper_written_out(model, seed):
    learned = FiniteLP().fit(model.mdp, model.expert)
    states = np.random.default_rng(seed).choice(model.mdp.n_states, 2, replace=False)
    pins = {int(s): float(learned.reward.values[s]) for s in states}
    margin = learned.proof.margin_cap / 2
    found = feasible_widths(model.mdp, model.expert, margin=margin, pinned=pins)
    of, rows = rows_on_states(model.P, model.mdp.gamma, model.expert)
    low, high = by_scipy(of, rows, margin, found.with_margin, model.mdp.n_states, pins.items())
    assert np.allclose(found.low, low, atol=1e-6) and np.allclose(found.high, high, atol=1e-6)
    assert (found.width[states] == 0).all()


def test_pinned_step_agrees_with_the_programs_written_out():
    model = models.random_model(4, S=5)
    other = int((model.expert[1] + 1) % 3)
    pins = {(0, int(model.expert[0])): 0.25, (1, other): 0.5}
    found = feasible_widths(model.mdp, model.expert, margin=0.1, reward_on="state-action", pinned=pins)
    states, rows = rows_on_steps(model.P, 0.9, model.expert)
    flat = [(s * 3 + a, value) for (s, a), value in pins.items()]
    low, high = by_scipy(states, rows, 0.1, np.arange(5), 15, flat).reshape(2, 5, 3)
    assert np.allclose(found.low, low, atol=1e-6) and np.allclose(found.high, high, atol=1e-6)


@settings(max_examples=10)
@given(models.models(("dense", "sparse", "deterministic")), seeds)
def test_widths_hold_for_every_completion_of_a_partly_known_expert(model, seed):
    S, A = model.mdp.n_states, model.mdp.n_actions
    unknown = np.random.default_rng(seed).choice(S, 2, replace=False)
    seen = np.eye(A)[model.expert]
    seen[unknown] = np.nan
    found = feasible_widths(model.mdp, seen, margin=None)
    assert not found.attained
    for actions in product(range(A), repeat=2):
        expert = model.expert.copy()
        expert[unknown] = actions
        low, high = by_scipy(*rows_on_states(model.P, model.mdp.gamma, expert), 0.0, [], S)
        assert (found.low <= low + 1e-6).all() and (high <= found.high + 1e-6).all()


@given(models.models(), seeds)
def test_learned_reward_lies_between(model, seed):
    found, learned = feasible_widths(model.mdp, model.expert), FiniteLP().fit(model.mdp, model.expert).reward.values
    assert (found.low <= learned + 1e-6).all() and (learned <= found.high + 1e-6).all()


@pytest.mark.parametrize("reward_on", ["state", "state-action"])
def test_learned_reward_lies_between_when_the_expert_is_known_in_part(reward_on):
    model = models.paper_grid()
    seen = np.eye(4)[model.expert]
    seen[[3, 7, 11]] = np.nan
    found = feasible_widths(model.mdp, seen, reward_on=reward_on)
    learned = FiniteLP(reward_on=reward_on, unvisited="free").fit(model.mdp, seen).reward.values
    judged = np.isfinite(found.low)
    assert (found.low <= learned + 1e-6)[judged].all() and (learned <= found.high + 1e-6)[judged].all()


@given(models.models(), seeds)
def test_drawn_members_lie_between(model, seed):
    found = feasible_widths(model.mdp, model.expert, margin=None, reward_on="state-action")
    drawn = sample_feasible(model.mdp, model.expert, rng=np.random.default_rng(seed)).values
    judged = np.isfinite(found.low)
    assert (found.low <= drawn + 1e-7)[judged].all() and (drawn <= found.high + 1e-7)[judged].all()


def test_set_of_actions_makes_the_widths_narrower():
    model = models.paper_grid()
    one = feasible_widths(model.mdp, model.expert, margin=None)
    both = np.eye(4, dtype=bool)[model.expert]
    both[20] = [True, True, False, False]
    several = feasible_widths(model.mdp, both, margin=None)
    assert (several.high <= one.high + 1e-7).all() and several.width.sum() < one.width.sum() - 0.1


def test_widths_scale_with_r_max():
    model = models.random_model(2)
    one, ten = (feasible_widths(model.mdp, model.expert, r_max=r) for r in (1.0, 10.0))
    assert ten.margin == pytest.approx(10 * one.margin)
    assert np.allclose(ten.low, 10 * one.low, atol=1e-5) and np.allclose(ten.high, 10 * one.high, atol=1e-5)


def test_margin_makes_the_widths_narrower():
    model = models.paper_grid()
    bare, some, most = (feasible_widths(model.mdp, model.expert, margin=m) for m in (None, 0.1, "auto"))
    assert (some.width <= bare.width + 1e-7).all() and (most.width <= some.width + 1e-7).all()
    assert most.width.sum() < some.width.sum() < bare.width.sum()


def test_states_never_reached_have_no_width():
    model = models.paper_grid()
    P = np.zeros((26, 4, 26))
    P[:25, :, :25] = model.P
    P[25, :, 0] = 1
    mdp = TabularMDP.from_dense(P, 0.9, np.append(model.mdp.d0, 0.0))
    found = feasible_widths(mdp, np.append(model.expert, 0))
    assert np.isnan(found.width[25])
    assert np.array_equal(found.width[:25], feasible_widths(model.mdp, model.expert).width)


def test_processes_change_no_byte():
    model = models.random_model(1, S=60, kind="sparse")
    one, two = (feasible_widths(model.mdp, model.expert, workers=n) for n in (1, 2))
    assert one.low.tobytes() == two.low.tobytes() and one.high.tobytes() == two.high.tobytes()


def test_auto_margin_is_half_of_the_largest_with_the_pins():
    model = models.paper_grid()
    found = feasible_widths(model.mdp, model.expert, pinned={4: 0.1})
    feasible_widths(model.mdp, model.expert, pinned={4: 0.1}, margin=1.999 * found.margin)
    with pytest.raises(InvalidParameter, match=rf"expected at most {2 * found.margin:.6g}"):
        feasible_widths(model.mdp, model.expert, pinned={4: 0.1}, margin=2.001 * found.margin)


def test_ends_of_a_width_are_attained():
    model = models.paper_grid()
    found = feasible_widths(model.mdp, model.expert, margin=None)
    highest = feasible_widths(model.mdp, model.expert, margin=None, pinned={7: float(found.high[7]) - 1e-6})
    assert highest.width[7] == 0 and found.attained


def test_record_is_json_and_says_the_anchor():
    model = models.paper_grid()
    found = feasible_widths(model.mdp, model.expert, pinned={4: 1.0})
    record = json.loads(json.dumps(found.to_json(), allow_nan=False))
    assert record["pinned"] == [[[4], 1.0]] and len(record["low"]) == 25
    assert "each of the 24 states" in record["anchor"] and "50 linear programs" in record["program"]


def test_no_rows_leave_everything_open():
    mdp = models.ring([[1, 1], [0, 0]])
    assert feasible_widths(mdp, np.array([0, 0]), margin=None).width == pytest.approx([2.0, 2.0])
    with pytest.raises(DegenerateExpert):
        feasible_widths(mdp, np.array([0, 0]))


@pytest.mark.parametrize("options, message", [
    ({"pinned": {25: 1.0}}, r"key 25: expected a state of the table, which has shape \(25,\)"),
    ({"pinned": {"goal": 1.0}}, "key 'goal': expected a state"),
    ({"pinned": {(4, 0): 1.0}}, r"key \(4, 0\): expected a state"),
    ({"pinned": {4: 1.0}, "reward_on": "state-action"}, r"key 4: expected \(state, action\)"),
    ({"pinned": {(4, 0): 0.0}, "reward_on": "state-action"}, "state 4 is terminal"),
    ({"pinned": np.zeros(25)}, "pinned is an ndarray: expected a mapping"),
    ({"pinned": {(4, (2, 3)): 1.0}}, "expected a state"),
    ({"pinned": dict.fromkeys(range(25), 0.0)}, "and 20 more"),
    ({"pinned": {4: 2.0}}, r"pinned\[4\] is 2: expected at most r_max = 1"),
    ({"pinned": {4: np.nan}}, r"pinned\[4\] is nan"),
    ({"pinned": {4: -1.0, 3: 1.0}}, r"pinned is \{4: -1.0, 3: 1.0\}: no reward with these values .* Leave a pin out"),
    ({"pinned": {4: -1.0, 3: 1.0}, "margin": None}, "makes the expert optimal"),
    ({"margin": 5.0}, "margin is 5: expected at most 0.23"),
    ({"margin": -1.0}, "margin is -1"),
    ({"margin": "all"}, "margin is 'all'"),
    ({"r_max": 0.0}, "r_max is 0"),
    ({"reward_on": "steps"}, "reward_on is 'steps'"),
    ({"workers": 0}, "workers is 0"),
])  # fmt: skip
def test_bad_options_are_named_with_the_mend(unchecked, options, message):
    model = models.paper_grid()
    with pytest.raises(InvalidParameter, match=message):
        feasible_widths(model.mdp, model.expert, **options)


@pytest.mark.parametrize("mdp, expert, error", [("table", None, InvalidMDP), (None, np.zeros(3, dtype=int), InvalidPolicy)])
def test_bad_problem_is_named(unchecked, mdp, expert, error):
    model = models.paper_grid()
    with pytest.raises(error):
        feasible_widths(mdp or model.mdp, model.expert if expert is None else expert)


def test_record_is_json_when_given_numpy_s_numbers(unchecked):
    model = models.paper_grid()
    found = feasible_widths(model.mdp, model.expert, r_max=np.int64(2))
    assert json.loads(json.dumps(found.to_json()))["r_max"] == 2.0


def test_no_step_is_ever_taken_where_every_start_is_terminal():
    ended = TabularMDP.from_dense(np.zeros((2, 2, 2)), 0.9, [1.0, 0.0])
    found = feasible_widths(ended, np.zeros(2, dtype=int), margin=None, reward_on="state-action")
    assert str(found).startswith("No widths: every state that is reached is terminal")
    with pytest.raises(DegenerateExpert, match="every start is terminal"):
        feasible_widths(ended, np.zeros(2, dtype=int))
