"""FiniteLP for sums of H steps, against the program written densely over all states and times."""

import gymnasium as gym
import models
import numpy as np
import pytest
from scipy.optimize import linprog

from irl_gym.errors import DegenerateExpert, InvalidParameter
from irl_gym.judging.ambiguity.uniqueness import optimal_face
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.learners.problem import Problem
from irl_gym.mdp.optimality import certify
from irl_gym.mdp.planning.finite_horizon import backward_induction, evaluation_within
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TransitionTable
from irl_gym.mdp.time_expanded import expanded_policy, time_expanded
from irl_gym.tables.tabulate import tabulate

H = 3


def posed(seed, kind="dense", S=4, A=2):
    """A model in which every state can be the first, and its best policy of H steps (H, S)."""
    model = models.random_model(seed, S, A, kind)
    return model, backward_induction(model.mdp, model.R, horizon=H).policy


def dense_program(P, policy, *, l1, stationary):
    """The paper's program of H steps with gamma 1: maximise sum of least margins - l1 ||R||_1; the objective alone.

    Values are sums along the expert's way, W_h = P_pi (R_h+1 + W_h+1), written out as a matrix over all R_h(s).
    """
    S, A, _ = P.shape
    n = S if stationary else (H + 1) * S

    def paid(h):
        block = np.zeros((S, n))
        block[:, (0 if stationary else h * S) : (0 if stationary else h * S) + S] = np.eye(S)
        return block

    W = np.zeros((S, n))
    upper, states = [], H * S
    for h in range(H - 1, -1, -1):
        arriving = paid(h + 1) + W
        for s in range(S):
            for a in range(A):
                if a != policy[h, s]:
                    margin = (P[s, policy[h, s]] - P[s, a]) @ arriving
                    upper.append(np.concatenate([np.eye(states)[h * S + s], -margin, margin]))
                    upper.append(np.concatenate([np.zeros(states), -margin, margin]))
        W = P[np.arange(S), policy[h]] @ arriving
    for sign in (1, -1):
        upper.extend(np.hstack([np.zeros((n, states)), sign * np.eye(n), -sign * np.eye(n)]))
    right = np.concatenate([np.zeros(len(upper) - 2 * n), np.ones(2 * n)])
    cost = np.concatenate([-np.ones(states), np.full(2 * n, l1)])
    found = linprog(cost, A_ub=np.array(upper), b_ub=right, bounds=[(None, None)] * states + [(0, 1)] * (2 * n))
    assert found.success
    return -found.fun


@pytest.mark.parametrize("stationary", [True, False])
@pytest.mark.parametrize("seed", range(3))
def test_the_objective_is_that_of_the_program_written_densely(seed, stationary):
    model, policy = posed(seed)
    learner = FiniteLP(horizon=H, stationary=stationary, margin_cap=None, l1=0.05)
    found = learner.fit(model.mdp, policy)
    expected = dense_program(model.P, policy, l1=0.05, stationary=stationary)
    assert found.proof.objective == pytest.approx(expected, abs=1e-6)
    assert -1e-7 <= found.proof.duality_gap < 1e-6
    assert found.reward.values.shape == ((4,) if stationary else (4 * (H + 1),))


@pytest.mark.parametrize("reward_on", ["state", "state-action"])
@pytest.mark.parametrize("seed", range(3))
def test_the_expert_is_the_best_at_each_time_under_the_one_reward_that_is_learned(seed, reward_on):
    """Recomputed by backward induction alone: in every state at every time the expert's action is the best."""
    model, policy = posed(seed)
    found = FiniteLP(horizon=H, reward_on=reward_on).fit(TransitionTable(model.mdp.P, model.mdp.d0), policy)
    best = backward_induction(model.mdp, found.reward, horizon=H)
    assert np.abs(best.V - evaluation_within(model.mdp, found.reward, policy, horizon=H)).max() < 1e-6
    assert found.proof.optimal_within and found.proof.horizon == H and found.proof.loss_within < 1e-6
    assert f"within {H} steps" in str(found.proof) and "optimal at each time" in str(found.proof)


def test_a_reward_of_each_time_makes_an_expert_optimal_that_no_single_reward_does():
    """To and fro between two states, to stay at last: what is liked at one time is not at the next."""
    P = np.array([[[1.0, 0.0], [0.0, 1.0]], [[0.0, 1.0], [1.0, 0.0]]])  # stay, move
    table, expert = TransitionTable(P.reshape(4, 2), [0.5, 0.5]), np.array([[0, 1], [1, 0], [0, 1]])
    with pytest.raises(DegenerateExpert, match=r"no state reward .* Use stationary=False\."):
        FiniteLP(horizon=3).fit(table, expert)
    found = FiniteLP(horizon=3, stationary=False).fit(table, expert)
    assert certify(time_expanded(table, 3), expanded_policy(expert, table, 3), found.reward).expert_optimal
    assert np.sign(found.reward.values.reshape(4, 2)[1:] @ [1, -1]).tolist() == [1.0, -1.0, 1.0]


def test_the_reward_of_the_start_is_none_and_that_of_the_horizon_is_paid():
    model, policy = posed(0)
    found = FiniteLP(horizon=H, stationary=False).fit(model.mdp, policy).reward.values
    assert np.abs(found[:4]).max() < 1e-12 and np.abs(found[-4:]).max() > 0.01


@pytest.mark.parametrize("limit", [6, 8])
def test_the_lake_within_its_limit(limit):
    """The best policy of the true reward at each time; the agent that plans for the learned one within it reaches the goal."""
    table = tabulate(gym.make("FrozenLake-v1", is_slippery=False), gamma=0.99, check_steps=0)
    expert = backward_induction(table.mdp, table.reward, horizon=limit).policy
    found = FiniteLP(horizon=limit, stationary=False).fit(table.mdp, expert)
    expanded = time_expanded(table.mdp, limit)
    assert certify(expanded, expanded_policy(expert, table.mdp, limit), found.reward).expert_optimal
    again = backward_induction(table.mdp, found.reward.values.reshape(limit + 1, -1), horizon=limit)
    assert evaluation_within(table.mdp, table.reward, again.policy, horizon=limit)[0, 0] == 1.0


def test_an_expert_that_is_known_in_part_has_a_reward_of_each_time_alone():
    model, _ = posed(0)
    part = np.eye(2)[model.expert]
    part[1] = np.nan
    with pytest.raises(InvalidParameter, match="expected its whole policy, without slack"):
        FiniteLP(horizon=H).fit(model.mdp, part)
    assert not FiniteLP(horizon=H, stationary=False).fit(model.mdp, part).proof.zero


def test_lambda_0_of_h_steps_is_where_the_reward_becomes_0():
    model, policy = posed(1)
    learner = FiniteLP(horizon=H, margin_cap=None)
    lambda_0 = learner.critical_l1(model.mdp, policy)
    assert dense_program(model.P, policy, l1=1.001 * lambda_0, stationary=True) == pytest.approx(0, abs=1e-9)
    assert dense_program(model.P, policy, l1=0.999 * lambda_0, stationary=True) > 1e-6


def test_a_learner_of_h_steps_is_refused_where_another_program_is_asked_of():
    model, _ = posed(0)
    with pytest.raises(InvalidParameter, match="learner has the horizon 3: expected None"):
        optimal_face(model.mdp, model.expert, learner=FiniteLP(horizon=3))
    with pytest.raises(InvalidParameter, match="stationary is False, and the reward would have another number of states"):
        FiniteLP(horizon=3, stationary=False).learn(Problem.of(model.mdp, expert=model.expert))
    with pytest.raises(InvalidParameter, match="horizon is 0: expected a whole number of steps"):
        FiniteLP(horizon=0)


def test_a_proof_speaks_of_a_horizon_only_where_there_is_one():
    model, policy = posed(0)
    within = FiniteLP(horizon=H).fit(model.mdp, policy).proof.to_json()
    assert (within["horizon"], within["optimal_within"]) == (H, True) and within["loss_within"] < 1e-6
    assert not {"horizon", "optimal_within", "loss_within"} & FiniteLP().fit(model.mdp, model.expert).proof.to_json().keys()


def test_the_reward_of_a_problem_is_one_of_its_table():
    model, _ = posed(2)
    found = FiniteLP(horizon=H).learn(Problem.of(model.mdp, expert=model.expert, reward=TabularReward(model.R)))
    assert found.reward.values.shape == (4,)
