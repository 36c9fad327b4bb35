"""The parts of the path: the envelope of lines, and what is said of a change."""

from dataclasses import replace

import numpy as np
import pytest
from models import paper_grid

from irl_gym.errors import SolverFailed
from irl_gym.judging.ambiguity.envelope import Line, envelope
from irl_gym.judging.ambiguity.lambda_path import lambda_path
from irl_gym.judging.ambiguity.path_changes import changes
from irl_gym.judging.ambiguity.priced import PricedProgram

NOTHING = np.zeros(0)


def solver(points, asked=None):
    """The best of given (total, norm), of several the last, with its own worth as bound."""
    lines = [Line(float(total), float(norm), NOTHING, NOTHING) for total, norm in [(0, 0), *points]]

    def solve(price):
        if asked is not None:
            asked.append(price)
        worth = [line.at(price) for line in lines]
        best = max(i for i, value in enumerate(worth) if value >= max(worth) - 1e-12)
        return lines[best], max(worth)

    return solve


def test_envelope_finds_every_line():
    found = envelope(solver([(10, 8), (9, 5), (7, 3), (3, 1)]))
    assert [line.total for line in found.lines] == [10, 9, 7, 3]
    np.testing.assert_allclose(found.breakpoints, [0, 1 / 3, 1, 2, 3])
    assert found.exact and found.gap == 0


def test_envelope_leaves_out_lines_that_are_nowhere_best():
    found = envelope(solver([(10, 8), (8, 6), (7, 3)]))
    assert [line.total for line in found.lines] == [10, 7]


def test_envelope_drops_a_line_that_is_best_in_one_point_only():
    found = envelope(solver([(10, 8), (4, 2), (7, 5)]))  # the last is on the edge between the others
    assert [line.total for line in found.lines] == [10, 4]
    np.testing.assert_allclose(found.breakpoints, [0, 1, 2])


def test_envelope_begins_with_the_least_norm_of_the_largest_total():
    found = envelope(solver([(10, 4), (5, 1), (10, 8)]))
    assert [line.norm for line in found.lines] == [4, 1]
    assert found.breakpoints[0] == 0


def test_envelope_of_lines_that_all_end_together_is_the_first():
    found = envelope(solver([(2, 1), (4, 2), (6, 3)]))
    assert [line.norm for line in found.lines] == [3]
    np.testing.assert_allclose(found.breakpoints, [0, 2])


def test_envelope_of_nothing_is_none():
    assert envelope(solver([])) is None


def test_envelope_needs_two_solves_a_line():
    rng, asked = np.random.default_rng(0), []
    norms = np.sort(rng.uniform(0.1, 10, 60))
    points = list(zip(4 * np.sqrt(norms), norms, strict=True))
    found = envelope(solver(points, asked))
    assert len(found.lines) == 60
    assert len(asked) == found.solves <= 2 * 60 + 5


def test_envelope_stopped_early_says_how_far_it_can_be_off():
    norms = np.linspace(0.1, 10, 40)
    points = list(zip(4 * np.sqrt(norms), norms, strict=True))
    every, some = envelope(solver(points)), envelope(solver(points), most=5)
    prices = np.linspace(0, every.breakpoints[-1], 400)
    off = [max(line.at(x) for line in every.lines) - max(0, *(line.at(x) for line in some.lines)) for x in prices]
    assert len(some.lines) <= 5 and not some.exact
    assert 0 < max(off) <= some.gap


def test_envelope_counts_loose_bounds_as_gap():
    tight = solver([(10, 8), (4, 2)])
    found = envelope(lambda price: (tight(price)[0], tight(price)[1] + 0.5))
    assert found.gap == pytest.approx(0.5)


def test_program_is_solved_afresh_when_the_last_basis_leads_nowhere(monkeypatch):
    model = paper_grid()
    program = PricedProgram(model.mdp, model.expert, r_max=1.0, cap=None, on_states=True)
    whole, calls = program.at(0.3), []
    real = program.lp.minimise

    def failing(cost):
        calls.append(1)
        if len(calls) == 1:
            raise SolverFailed("HiGHS ended with 'Unknown': expected an optimum.")
        return real(cost)

    monkeypatch.setattr(program.lp, "minimise", failing)
    again = program.at(0.3)
    assert calls and again[0].at(0.3) == pytest.approx(whole[0].at(0.3))


def test_program_is_solved_afresh_when_its_answer_is_short_of_the_bound(monkeypatch):
    model = paper_grid()
    program = PricedProgram(model.mdp, model.expert, r_max=1.0, cap=None, on_states=True)
    real, calls = program.lp.minimise, []

    def inexact(cost):
        calls.append(1)
        vertex = real(cost)
        return replace(vertex, x=vertex.x * 0.5) if len(calls) == 1 else vertex

    monkeypatch.setattr(program.lp, "minimise", inexact)
    line, bound = program.at(0.3)
    assert calls and line.at(0.3) == pytest.approx(bound, abs=1e-9)


def described(before, after, margins=((1.0, 1.0, 1.0), (1.0, 1.0, 1.0))):
    """The change from one reward to another, of norms 2 and 1, totals 5 and 4."""
    numbers = np.array([before, after], dtype=float)
    points, total, norm = np.array([0.0, 1.0, 4.0]), np.array([5.0, 4.0]), np.array([2.0, 1.0])
    return changes(points, numbers, np.array(margins, dtype=float), total, norm, r_max=1.0, margin_cap=None)[1]


def test_change_tells_which_rewards_reach_and_leave_zero_and_bounds():
    found = described([1, 0.5, 0, -1, 0.2, 1], [0.5, 0, -1, -1, 0.3, -1], [[1.0] * 6] * 2)
    assert found.from_bound.tolist() == [0, 5] and found.to_zero.tolist() == [1]
    assert found.from_zero.tolist() == [2] and found.to_bound.tolist() == [2, 5] and found.moved.tolist() == [4]


def test_change_tells_which_margins_are_lost_and_gained():
    found = described([0, 0, 0, 0], [0, 0, 0, 0], [[1, 0, 1, 2], [0, 1, 2, 1]])
    assert (found.tied.tolist(), found.untied.tolist()) == ([0], [1])
    assert (found.raised.tolist(), found.lowered.tolist()) == ([2], [3])


def test_change_is_told_in_a_sentence():
    found = described([1, 0.5, 0], [1, 0, 0], [[1, 1, np.nan], [0, 1, np.nan]])
    assert str(found) == (
        "At price 1 the reward of state 1 becomes 0; the margin of state 0 falls to 0; ||R||_1 falls by 1 to 1, "
        "the total margin by 1 to 4."
    )


def test_change_is_told_with_names():
    found = described([1, 0.5, 0], [0, 0, 0], [[1, 1, np.nan], [0, 1, np.nan]])
    told = found.sentence("cell {}".format)
    assert "the reward of (cell 0) and (cell 1) becomes 0; " in told and "the margin of (cell 0) falls to 0; " in told


def test_changes_add_up_to_the_whole_path():
    model = paper_grid()
    path = lambda_path(model.mdp, model.expert)
    assert len(path.changes) == path.n_pieces + 1
    assert sum(one.l1_norm_change for one in path.changes) == pytest.approx(-path.l1_norms[0])
    assert sum(one.total_margin_change for one in path.changes) == pytest.approx(-path.total_margins[0])
    assert path.changes[0].moved.size == 0 and "begins" in str(path.changes[0])
    assert path.changes[-1].l1_norm == 0 and path.changes[-1].to_zero.size == np.count_nonzero(path.rewards[-1])


def test_change_of_rewards_on_steps_names_states_and_actions():
    model = paper_grid()
    path = lambda_path(model.mdp, model.expert, reward_on="state-action", most_pieces=4)
    last = path.changes[-1].to_zero
    assert last.shape[1] == 2 and (path.rewards[-1][tuple(last.T)] != 0).all()
    assert "(0 by 3) and (1 by 2) becomes 0" in replace(path.changes[-1], to_zero=np.array([[0, 3], [1, 2]])).sentence(
        "{} by {}".format
    )
