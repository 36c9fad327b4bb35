import re
import time
from functools import partial

import cvxpy as cp
import gymnasium as gym
import models
import numpy as np
import pytest

from irl_gym.errors import InvalidParameter, SolverFailed, SolverInfeasible, SolverTimeout
from irl_gym.features.feature_maps import OneHot
from irl_gym.learners.linear_programs.feature import FeatureLP
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.mdp.planning.dynamic_programming import policy_iteration, value_iteration
from irl_gym.programs import deadline, solvers
from irl_gym.programs.solvers import Solving, Status, solve

both = pytest.mark.parametrize("solver", ["clarabel", "highs"])


def diet():
    """Minimise x + y subject to 2x + y >= 4 and x + 3y >= 6, x, y >= 0: 2.8 at (1.2, 1.6)."""
    x = cp.Variable(2, nonneg=True)
    return cp.Problem(cp.Minimize(cp.sum(x)), [2 * x[0] + x[1] >= 4, x[0] + 3 * x[1] >= 6])


def infeasible():
    x = cp.Variable()
    return cp.Problem(cp.Minimize(x), [x >= 1, x <= 0])


def unbounded():
    x = cp.Variable()
    return cp.Problem(cp.Minimize(x), [x <= 0])


@both
def test_solve_finds_the_optimum(solver):
    answer = solve(diet(), rows=2, solving=Solving(solver))
    assert (answer.solver, answer.status, answer.attempts) == (solver, Status.OPTIMAL, 1)
    assert answer.objective == pytest.approx(2.8, abs=1e-7)


@both
def test_solve_leaves_values_in_the_variables(solver):
    problem = diet()
    solve(problem, rows=2, solving=Solving(solver))
    np.testing.assert_allclose(problem.variables()[0].value, [1.2, 1.6], atol=1e-6)


@pytest.mark.parametrize(("rows", "chosen"), [(solvers.SMALL, "highs"), (solvers.SMALL + 1, "clarabel")])
def test_solve_chooses_by_size(rows, chosen):
    assert solve(diet(), rows=rows).solver == chosen


def test_solve_answers_with_a_vertex_when_small():
    x = cp.Variable(2, nonneg=True)
    problem = cp.Problem(cp.Minimize(cp.sum(x)), [cp.sum(x) >= 1])
    solve(problem, rows=1)
    assert sorted(x.value.tolist()) == [0, 1]


@both
def test_solve_tries_the_other_solver_when_the_first_gives_up(solver, monkeypatch):
    hobbled = {"clarabel": {"max_iter": 1}, "highs": {"simplex_iteration_limit": 0, "presolve": "off"}}[solver]
    for name, value in hobbled.items():
        monkeypatch.setitem(solvers._SOLVERS[solver].options, name, value)
    answer = solve(diet(), rows=2, solving=Solving(solver))
    assert (answer.solver != solver, answer.attempts) == (True, 2)


@both
def test_solve_says_that_a_program_is_unbounded(solver):
    with pytest.raises(SolverFailed, match=f"{solver}: unbounded"):
        solve(unbounded(), rows=2, solving=Solving(solver))


@both
def test_solve_takes_infeasible_for_an_answer(solver):
    with pytest.raises(SolverInfeasible, match=f"{solver} finds that the constraints contradict each other"):
        solve(infeasible(), rows=2, solving=Solving(solver))


@both
def test_solve_stops_when_its_time_is_up(solver):
    model = models.random_model(0, S=400, A=4, kind="sparse", gamma=0.99)
    hurried = FiniteLP(margin_cap=None, solver=solver, time_limit=1e-9)
    with pytest.raises(SolverTimeout, match=rf"no answer in 1e-09 s.*{solver}: time limit of 1e-09 s.*raise time_limit"):
        hurried.fit(model.mdp, model.expert)


def test_solve_does_not_call_an_infeasible_program_slow():
    with pytest.raises(SolverInfeasible, match="contradict"):
        solve(infeasible(), rows=2, solving=Solving.begun("auto", 60.0))


@both
def test_solve_answers_within_a_generous_time_limit(solver):
    assert solve(diet(), rows=2, solving=Solving.begun(solver, 60.0)).objective == pytest.approx(2.8)


@pytest.fixture
def clock(monkeypatch):
    """A clock on which a second passes whenever a solver is asked, and never else."""
    now, attempt = [0.0], solvers._attempt

    def asked(*args):
        now[0] += 1
        return attempt(*args)

    monkeypatch.setattr(deadline.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(solvers, "_attempt", asked)
    return now


@pytest.mark.parametrize("learner", [FiniteLP, partial(FiniteLP, slack=5.0), partial(FeatureLP, OneHot(30), margin_cap="auto")])
def test_programs_of_a_fit_share_its_time(learner, clock):
    model = models.random_model(1, S=30, A=3)
    start = clock[0]
    learner().fit(model.mdp, model.expert)
    needed = clock[0] - start
    assert needed >= 2
    learner(time_limit=needed + 0.5).fit(model.mdp, model.expert)
    with pytest.raises(SolverTimeout, match="which all steps of a fit have together"):
        learner(time_limit=needed - 0.5).fit(model.mdp, model.expert)


@both
def test_a_second_attempt_is_never_without_a_limit(solver, monkeypatch):
    hobbled = {"clarabel": {"max_iter": 1}, "highs": {"simplex_iteration_limit": 0, "presolve": "off"}}[solver]
    for name, value in hobbled.items():
        monkeypatch.setitem(solvers._SOLVERS[solver].options, name, value)
    monkeypatch.setattr(solvers, "SECOND_SECONDS", 1e-9)
    monkeypatch.setattr(solvers, "SECOND_SHARE", 1e-9)
    with pytest.raises(SolverFailed, match="Give time_limit, for the second to have longer"):
        solve(diet(), rows=2, solving=Solving(solver))
    assert solve(diet(), rows=2, solving=Solving.begun(solver, 600.0)).attempts == 2  # the mend that it names


@both
def test_a_solver_is_given_what_cvxpy_gives_it(solver):
    chosen, told = solvers._SOLVERS[solver], []
    for ours in (True, False):
        x = cp.Variable(3, nonneg=True)
        problem = cp.Problem(cp.Minimize(cp.sum(x) - 2 * x[1]), [x[0] + x[2] == 3, x[1] + x[2] <= 4, x <= 2])
        if ours:
            solve(problem, rows=3, solving=Solving(solver))
        else:
            problem.solve(solver=chosen.cvxpy_name, **chosen.options)
        told.append([x.value.tobytes(), *(np.asarray(one.dual_value).tobytes() for one in problem.constraints)])
    assert told[0] == told[1]


limited = pytest.mark.parametrize(
    "learner", [FiniteLP, partial(FiniteLP, slack=5.0), partial(FiniteLP, reward_on="state-action")]
)


@pytest.mark.slow
@limited
@pytest.mark.parametrize(("size", "limit"), [(100, 2.0), (200, 10.0)])
def test_a_time_limit_is_kept_within_a_fifth_on_a_grid(learner, size, limit):
    """10,000 and 40,000 states, limits that are reached; wall time, so it is a bar."""
    env = gym.make("irl_gym_envs:irl_gym/GridWorld-v0", size=size).unwrapped
    mdp = env.mdp(0.99)
    expert = policy_iteration(mdp, env.reward.expected(mdp)).policy
    start = time.perf_counter()
    with pytest.raises(SolverTimeout):
        learner(time_limit=limit).fit(mdp, expert)
    assert time.perf_counter() - start < 1.2 * limit


@pytest.mark.slow
@limited
@pytest.mark.parametrize("successors", [3, 5])
@pytest.mark.parametrize(("states", "limit"), [(2_000, 2.0), (10_000, 3.0), (40_000, 10.0)])
def test_a_time_limit_is_kept_within_a_fifth_where_factors_fill_up(learner, states, limit, successors):
    """Successors drawn at random: one iteration can take minutes. Wall time, so it is a bar."""
    mdp, reward = models.scattered(states, successors)
    expert = value_iteration(mdp, reward, sweeps=20, tolerance=1e-3).policy
    start = time.perf_counter()
    with pytest.raises(SolverTimeout):
        learner(time_limit=limit).fit(mdp, expert)
    assert time.perf_counter() - start < 1.2 * limit


@pytest.mark.parametrize("limit", [0.0, -1.0, float("nan")])
def test_solve_refuses_a_time_limit_that_is_not_positive(limit):
    with pytest.raises(InvalidParameter, match=f"time_limit is {limit}"):
        Solving.begun("auto", limit)


def test_solve_refuses_an_unknown_solver(unchecked):
    with pytest.raises(InvalidParameter, match="solver is 'simplex'"):
        Solving.begun("simplex", None)


@pytest.mark.parametrize("status", Status)
def test_status_is_a_name_with_a_sentence(status):
    assert Status(status.value) is status and re.fullmatch("[a-z-]+", status.value)
    assert status.sentence[0].isupper() and status.sentence.endswith(".")


def test_status_says_that_a_reward_of_zero_is_of_no_use():
    assert {one for one in Status if not one.usable} == {Status.ZERO, Status.ZERO_WEIGHTS}


def test_a_program_without_an_answer_before_is_late_where_its_time_is_up_now():
    problem = infeasible()
    with pytest.raises(SolverInfeasible):
        solve(problem, rows=2)
    with pytest.raises(SolverTimeout):
        solve(problem, rows=2, solving=Solving("auto", deadline.Deadline(1.0, 0.0)))
