import models
import numpy as np
import pytest

from irl_gym.errors import DegenerateExpert, InvalidParameter, InvalidPolicy, SolverTimeout
from irl_gym.learners.linear_programs.finite import FiniteLP

PAPER = FiniteLP(margin_cap=None)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        *[("r_max", bad) for bad in (0.0, -1.0, np.inf, np.nan)],
        *[("l1", bad) for bad in (-0.5, np.inf, np.nan, "most")],
        *[("margin_cap", bad) for bad in (0.0, -0.25, np.inf, np.nan, "none")],
        ("reward_on", "action"),
    ],
)
def test_finite_lp_refuses_a_field_outside_its_range(field, value, unchecked):
    with pytest.raises(InvalidParameter, match=rf"{field} is '?{value}'?:"):
        FiniteLP(**{field: value})


@pytest.mark.parametrize(("field", "value"), [("solver", "simplex"), ("time_limit", 0.0)])
def test_finite_lp_refuses_what_its_solver_refuses(field, value, unchecked):
    model = models.random_model(0)
    with pytest.raises(InvalidParameter, match=f"{field} is '?{value}'?:"):
        FiniteLP(**{field: value}).fit(model.mdp, model.expert)


@pytest.mark.parametrize("learner", [PAPER, FiniteLP(margin_cap=0.1), FiniteLP(), FiniteLP(l1=0.1), FiniteLP(l1="auto")])
def test_finite_lp_refuses_an_expert_that_only_a_constant_reward_explains(learner):
    swapping = models.ring([[1, 0], [0, 1]])  # it leaves each state for the other: both would have to be the better one
    with pytest.raises(DegenerateExpert, match=r"2 reachable states.*state-action"):
        learner.fit(swapping, np.array([0, 0]))


def test_critical_l1_refuses_an_expert_that_only_a_constant_reward_explains():
    with pytest.raises(DegenerateExpert, match="2 reachable states"):
        PAPER.critical_l1(models.ring([[1, 0], [0, 1]]), np.array([0, 0]))


@pytest.mark.parametrize(
    ("learner", "successors", "expert", "message"),
    [
        (FiniteLP(), [[1, 1], [0, 0]], np.array([0, 1]), r"none of the 2 reachable states.*state-action"),
        (PAPER, [[1, 1, 0], [1, 1, 0]], np.array([0, 0]), r"each of the 2 reachable states.*margin_cap="),
        (FiniteLP(reward_on="state-action"), [[1, 0], [0, 1]], np.full((2, 2), 0.5), "takes every action in each of the 2"),
    ],
    ids=["equal successors", "walls everywhere", "indifferent"],
)
def test_finite_lp_refuses_an_expert_without_anything_to_compare(learner, successors, expert, message):
    with pytest.raises(DegenerateExpert, match=message):
        learner.fit(models.ring(successors), expert)


@pytest.mark.parametrize(
    ("expert", "message"),
    [
        (np.array([0, 3, 0, 0, 0, 0, 0]), r"policy\[s=1\] is action 3"),
        (np.zeros(6, dtype=int), r"shape \(6,\)"),
        (np.full((7, 3), 0.25), r"policy\[s=0\] sums to 0.75"),
    ],
)
def test_finite_lp_refuses_an_expert_that_is_no_policy(expert, message):
    with pytest.raises(InvalidPolicy, match=message):
        FiniteLP().fit(models.random_model(0).mdp, expert)


@pytest.mark.parametrize("learner", [PAPER, FiniteLP(), FiniteLP(l1="auto")])
def test_finite_lp_stops_when_its_time_is_up(learner):
    model = models.random_model(0, S=100, A=4, kind="sparse")
    hurried = FiniteLP(learner.r_max, learner.l1, learner.margin_cap, solver="clarabel", time_limit=1e-9)
    with pytest.raises(SolverTimeout, match="1e-09 s"):
        hurried.fit(model.mdp, model.expert)
