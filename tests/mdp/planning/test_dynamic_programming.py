import models
import numpy as np
import pytest
import reference
from hypothesis import given
from hypothesis import strategies as st

from irl_gym.errors import InvalidParameter, InvalidPolicy, InvalidReward
from irl_gym.mdp.planning.discounted import Discounted
from irl_gym.mdp.planning.dynamic_programming import (
    backup,
    greedy,
    occupancy,
    policy_evaluation,
    policy_iteration,
    tied,
    value_iteration,
)
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP

planners = pytest.mark.parametrize("plan", [value_iteration, policy_iteration])
policies = st.sampled_from(["actions", "probabilities", "set"])


def some_policy(model, kind):
    """A random policy of one of the three kinds, and the same as a distribution."""
    S, A = model.mdp.n_states, model.mdp.n_actions
    rng = np.random.default_rng(S * A)
    if kind == "actions":
        actions = rng.integers(A, size=S)
        return actions, np.eye(A)[actions]
    if kind == "probabilities":
        probabilities = rng.dirichlet(np.ones(A), size=S)
        return probabilities, probabilities
    chosen = rng.integers(0, 2, size=(S, A)).astype(bool) | np.eye(A, dtype=bool)[rng.integers(A, size=S)]
    return chosen, chosen / chosen.sum(axis=1, keepdims=True)


def step_rewards(model, seed=0):
    """A reward on steps, with something in terminal states too, where it must not count."""
    return np.random.default_rng(seed).normal(size=(model.mdp.n_states, model.mdp.n_actions))


@given(model=models.models())
def test_backup_is_one_step_and_then_the_values(model):
    R, V = step_rewards(model), np.arange(float(model.mdp.n_states))
    np.testing.assert_allclose(backup(model.mdp, R, V), R + model.mdp.gamma * model.P @ V)


@planners
@given(model=models.models())
def test_planner_finds_the_values_of_brute_force(plan, model):
    R = step_rewards(model)
    np.testing.assert_allclose(plan(model.mdp, R).V, reference.values(model.P, model.mdp.gamma, R), atol=1e-7)


@given(model=models.models(), tolerance=st.sampled_from([1e-1, 1e-3, 1e-6]), sweeps=st.sampled_from([0, 5, 40]))
def test_value_iteration_error_bounds_the_distance_from_the_optimum(model, tolerance, sweeps):
    R = step_rewards(model)
    solution = value_iteration(model.mdp, R, tolerance=tolerance, sweeps=sweeps)
    distance = np.abs(solution.V - reference.values(model.P, model.mdp.gamma, R)).max()
    assert distance <= solution.error + 1e-10 and solution.error <= tolerance


@given(model=models.models())
def test_policy_iteration_error_bounds_the_distance_from_the_optimum(model):
    R = step_rewards(model)
    solution = policy_iteration(model.mdp, R)
    distance = np.abs(solution.V - reference.values(model.P, model.mdp.gamma, R)).max()
    assert distance <= solution.error + 1e-10


@planners
@given(model=models.models())
def test_planner_policy_earns_the_optimal_values(plan, model):
    R = step_rewards(model)
    earned = policy_evaluation(model.mdp, R, plan(model.mdp, R).policy)
    np.testing.assert_allclose(earned, reference.values(model.P, model.mdp.gamma, R), atol=1e-6)


@planners
@given(model=models.models())
def test_planner_q_is_the_backup_of_its_values(plan, model):
    solution = plan(model.mdp, step_rewards(model))
    np.testing.assert_allclose(solution.Q.max(axis=1), solution.V, atol=1e-7)


@planners
@given(model=models.models(kinds=("terminal", "walls")))
def test_planner_gives_terminal_states_no_value(plan, model):
    assert (plan(model.mdp, step_rewards(model)).V[model.mdp.terminal] == 0).all()


@given(model=models.models(kinds=("deterministic",)), levels=st.sampled_from([1, 2, 3]))
def test_policy_iteration_ends_soon_when_everything_ties(model, levels):
    R = np.round(step_rewards(model) * (levels - 1))  # few different rewards: many policies of equal value
    assert policy_iteration(model.mdp, R).iterations <= 50


@planners
@pytest.mark.parametrize("preference", [[0, 1, 2, 3], [3, 2, 1, 0], [2, 0, 3, 1]])
def test_planner_breaks_ties_by_preference(plan, preference):
    grid = models.paper_grid()
    solution = plan(grid.mdp, np.zeros((25, 4)), preference=preference)
    assert (solution.policy == preference[0]).all()


def test_value_iteration_with_sweeps_needs_fewer_improvements():
    model = models.random_model(0, S=30, kind="sparse", gamma=0.99)
    R = step_rewards(model)
    assert value_iteration(model.mdp, R, sweeps=50).iterations < value_iteration(model.mdp, R).iterations / 5


@given(model=models.models())
def test_policy_iteration_keeps_to_the_allowed_actions(model):
    allowed, _ = some_policy(model, "set")
    solution = policy_iteration(model.mdp, step_rewards(model), allowed=allowed)
    assert allowed[np.arange(model.mdp.n_states), solution.policy].all()


@given(model=models.models())
def test_policy_iteration_is_best_among_the_allowed_actions(model):
    allowed, _ = some_policy(model, "set")
    solution = policy_iteration(model.mdp, step_rewards(model), allowed=allowed)
    values = np.zeros(model.mdp.n_states)
    R = np.where(allowed, step_rewards(model), -1e12)
    for _ in range(3000):
        values = reference.action_values(model.P, model.mdp.gamma, R, values).max(axis=1)
    np.testing.assert_allclose(solution.V, values, atol=1e-7)


@given(model=models.models(), kind=policies)
def test_evaluate_policy_equals_the_explicit_inverse(model, kind):
    policy, distribution = some_policy(model, kind)
    R = step_rewards(model)
    P_pi = np.einsum("sa,sat->st", distribution, model.P)
    R_pi = np.where(model.mdp.terminal, 0, (distribution * R).sum(axis=1))
    expected = np.linalg.inv(np.eye(model.mdp.n_states) - model.mdp.gamma * P_pi) @ R_pi
    np.testing.assert_allclose(policy_evaluation(model.mdp, R, policy), expected, atol=1e-9)


@given(model=models.models(), kind=policies)
def test_occupancy_times_reward_is_the_value_from_the_start(model, kind):
    policy, _ = some_policy(model, kind)
    R = step_rewards(model)
    expected = model.mdp.d0 @ policy_evaluation(model.mdp, R, policy)
    assert (occupancy(model.mdp, policy) * R).sum() == pytest.approx(expected)


@given(model=models.models(kinds=("dense", "sparse", "deterministic")), kind=policies)
def test_occupancy_sums_to_the_horizon_when_nothing_ends(model, kind):
    policy, _ = some_policy(model, kind)
    assert occupancy(model.mdp, policy).sum() == pytest.approx(1 / (1 - model.mdp.gamma))


@given(model=models.models(), kind=policies)
def test_occupancy_keeps_the_flow(model, kind):
    policy, _ = some_policy(model, kind)
    visits = occupancy(model.mdp, policy)
    arriving = model.mdp.d0 + model.mdp.gamma * np.einsum("sa,sat->t", visits, model.P)
    acting = ~model.mdp.terminal
    np.testing.assert_allclose(visits.sum(axis=1)[acting], arriving[acting], atol=1e-9)


def test_occupancy_is_zero_in_terminal_states():
    model = models.random_model(0, kind="terminal")
    assert (occupancy(model.mdp, model.expert)[model.mdp.terminal] == 0).all()


def test_discounted_solves_the_transposed_system():
    model = models.random_model(0)
    x = Discounted(model.mdp.P_pi(model.expert), 0.9).solve_transposed(model.R)
    P_pi = model.P[np.arange(7), model.expert]
    np.testing.assert_allclose((np.eye(7) - 0.9 * P_pi).T @ x, model.R)


def test_greedy_takes_the_first_action_within_the_tolerance():
    Q = np.array([[1.0, 1.0 + 1e-10, 0], [0, 1, 1]])
    assert greedy(Q).tolist() == [0, 1]


def test_greedy_takes_the_best_when_the_difference_is_above_the_tolerance():
    assert greedy(np.array([[1.0, 1.1]]), tie_tolerance=0.05).tolist() == [1]


def test_tied_marks_every_action_within_the_tolerance_of_the_best():
    Q = np.array([[1.0, 0.95, 0.5], [0.0, 0.0, -1.0]])
    assert tied(Q, 0.1).tolist() == [[True, True, False], [True, True, False]]


@pytest.mark.parametrize("preference", [[0, 1], [0, 1, 1], [1, 2, 3], [0, 1, 2, 3]])
def test_greedy_refuses_a_preference_that_is_no_permutation(preference):
    with pytest.raises(InvalidParameter, match=r"preference is .*every action from 0 to 2 once"):
        greedy(np.zeros((2, 3)), preference=preference)


@planners
@pytest.mark.parametrize("shape", [(7,), (7, 2), (6, 3)])
def test_planner_refuses_a_reward_of_another_shape(plan, shape, unchecked):
    with pytest.raises(InvalidReward, match=rf"shape \({shape[0]},.*expected \(7, 3\)"):
        plan(models.random_model(0).mdp, np.zeros(shape))


@planners
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_planner_names_the_first_reward_that_is_not_finite(plan, value):
    R = np.zeros((7, 3))
    R[4, 1] = R[5, 2] = value
    with pytest.raises(InvalidReward, match=rf"R\[s=4, a=1\] is {value}"):
        plan(models.random_model(0).mdp, R)


def test_value_iteration_refuses_a_tolerance_below_rounding():
    with pytest.raises(InvalidParameter, match="tolerance is 1e-16"):
        value_iteration(models.random_model(0).mdp, np.ones((7, 3)), tolerance=1e-16)


@planners
def test_planner_says_when_its_iterations_are_spent(plan):
    grid = models.paper_grid()
    with pytest.raises(InvalidParameter, match="max_iterations is 1:"):
        plan(grid.mdp, grid.step_reward, max_iterations=1)


def test_policy_iteration_refuses_a_state_without_allowed_actions():
    allowed = np.ones((7, 3), dtype=bool)
    allowed[3] = False
    with pytest.raises(InvalidParameter, match=r"allowed\[s=3\] is empty"):
        policy_iteration(models.random_model(0).mdp, np.zeros((7, 3)), allowed=allowed)


@pytest.mark.parametrize("policy", [np.zeros(6, dtype=int), np.full(7, 3)])
def test_evaluate_policy_refuses_what_is_no_policy(policy, unchecked):
    with pytest.raises(InvalidPolicy, match="expected"):
        policy_evaluation(models.random_model(0).mdp, np.zeros((7, 3)), policy)


def test_planning_takes_a_tabular_reward_as_it_is():
    model = models.random_model(0, kind="terminal")
    reward = TabularReward(model.R)
    assert np.array_equal(value_iteration(model.mdp, reward).V, value_iteration(model.mdp, reward.expected(model.mdp)).V)


@pytest.mark.parametrize("gamma", [0.9, 0.999, 0.9999])
def test_value_iteration_bounds_its_error_rounding_included(gamma):
    loop = TabularMDP(np.ones((1, 1)), gamma, [1.0])
    solution = value_iteration(loop, np.ones((1, 1)), sweeps=50)
    assert 0 < abs(solution.V[0] - 1 / (1 - gamma)) <= solution.error or solution.V[0] == 1 / (1 - gamma)


@pytest.mark.parametrize("factor", [1e-12, 1e12])
def test_policy_iteration_does_not_depend_on_the_scale_of_the_reward(factor):
    model = models.random_model(1)
    R = model.step_reward
    assert np.array_equal(policy_iteration(model.mdp, R).policy, policy_iteration(model.mdp, factor * R).policy)


@pytest.mark.parametrize("wrong", [{"allowed": np.ones((3, 4), dtype=bool)}, {"max_iterations": 0}])
def test_policy_iteration_refuses(wrong, unchecked):
    model = models.random_model(0)
    with pytest.raises(InvalidParameter, match=next(iter(wrong))):
        policy_iteration(model.mdp, model.step_reward, **wrong)
