"""FiniteLP from episodes: what the learned reward is worth on Gymnasium's tables, and what is refused."""

import json

import models
import numpy as np
import pytest
from certified import both

from irl_gym.demonstrations.demonstrated import most_frequent, visits
from irl_gym.errors import DegenerateExpert, InvalidParameter, InvalidPolicy
from irl_gym.facts import counted
from irl_gym.judging.metrics import normalised_score, policy_value, random_value, worst_tie
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.mdp.episodes import collect_from_table, empirical_policy
from irl_gym.mdp.optimality import certify
from irl_gym.mdp.planning.dynamic_programming import policy_iteration, value_iteration

LAKE, TAXI = "FrozenLake 8x8 slippery", "Taxi"


@pytest.fixture(scope="module")
def demonstrate(toy_text):
    """Counts of an expert's episodes: optimal, or noisy; and its optimal policy."""
    made = {}

    def get(name, episodes, noise, seed=0):
        key = (name, episodes, noise, seed)
        if key not in made:
            table = toy_text(name)
            best = value_iteration(table.mdp, table.reward.values, tolerance=1e-8, sweeps=50).policy
            policy = (1 - noise) * np.eye(table.mdp.n_actions)[best] + noise / table.mdp.n_actions
            drawn = collect_from_table(
                table.mdp, table.payments.entries, table.states, policy, episodes, seed=seed, max_episode_steps=200
            )
            made[key] = table, best, empirical_policy(drawn, table.states, table.mdp.n_actions)
        return made[key]

    return get


def scores(table, best, reward):
    """Where the greedy policy and the worst tie lie between a random policy and the best one."""
    ends = random_value(table.mdp, table.reward), policy_value(table.mdp, table.reward, best)
    greedy = policy_value(table.mdp, table.reward, policy_iteration(table.mdp, reward).policy)
    return [normalised_score(value, *ends) for value in (greedy, worst_tie(table.mdp, reward, table.reward).value)]


def learned(found, **fields):
    table, best, seen = found
    result = FiniteLP(**fields).fit(table.mdp, most_frequent(seen), visits=visits(seen))
    return result, scores(table, best, result.reward)


@pytest.mark.parametrize("name", [LAKE, TAXI])
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("slack", [None, 1.0])
def test_a_thousand_optimal_episodes_give_the_expert_back(demonstrate, name, seed, slack):
    _, found = learned(demonstrate(name, 1000, 0.0, seed), slack=slack)
    assert min(found) >= 0.999


@pytest.mark.parametrize(("name", "least"), [(LAKE, 0.94), (TAXI, 0.998)])
def test_ten_optimal_episodes_lead_an_agent_back_to_what_it_knows(demonstrate, name, least):
    _, found = learned(demonstrate(name, 10, 0.0))
    assert min(found) >= least


def test_states_left_free_lead_an_agent_astray_on_the_taxi(demonstrate):
    assert min(learned(demonstrate(TAXI, 10, 0.0), unvisited="free")[1]) < 0


def test_slack_gives_up_the_state_in_which_a_noisy_expert_erred(demonstrate):
    table, best, seen = demonstrate(TAXI, 1000, 0.1)
    hard, soft = (learned((table, best, seen), slack=slack) for slack in (None, 1.0))
    assert min(hard[1]) < 0.7 and min(soft[1]) >= 0.999
    found = both(soft[0], table.mdp, most_frequent(seen))
    assert found.violated.size == 1 and visits(seen)[found.violated].max() <= 3 and not found.expert_optimal


def test_facts_tell_how_many_rows_are_violated_and_where_nothing_is_known(demonstrate):
    table, best, seen = demonstrate(TAXI, 1000, 0.1)
    found = both(learned((table, best, seen), slack=1.0)[0], table.mdp, most_frequent(seen))
    most = f"{counted(len(found.violated_rows), 'row')} of (4), by at most {found.worst_violation:.3g}"
    assert f"in 1 state another action is better under it: {most}" in found.told
    assert f"in {found.unknown.size} states that can be reached nothing is known of it" in found.told


def test_what_is_kept_of_data_is_json_without_nan(demonstrate):
    table, best, seen = demonstrate(TAXI, 1000, 0.1)
    result, _ = learned((table, best, seen), slack=1.0)
    found = certify(table.mdp, most_frequent(seen), result.reward, errs=True)
    told = json.loads(json.dumps(result.proof.to_json() | found.to_json(), allow_nan=False))
    assert np.shape(told["violated_rows"]) == (len(told["violations"]), 2) and told["slack"] == 1.0


def test_nan_where_no_step_is_taken_is_an_expert_that_is_known(toy_text):
    table = toy_text("FrozenLake 4x4 slippery")
    best = policy_iteration(table.mdp, table.reward).policy
    rows = np.where(table.mdp.terminal[:, None], np.nan, np.eye(4)[best])
    found, same = (FiniteLP().fit(table.mdp, expert).reward.values for expert in (rows, np.eye(4)[best]))
    np.testing.assert_array_equal(found, same)


def partial(unknown=(5, 6)):
    model = models.random_model(0)
    expert = np.eye(3)[model.expert]
    expert[list(unknown)] = np.nan
    return model.mdp, expert


@pytest.mark.parametrize("bad", [0.5, 0.0, -1.0, np.inf, np.nan, "hard", True])
def test_a_slack_below_one_is_refused(bad, unchecked):
    with pytest.raises(InvalidParameter, match="slack is"):
        FiniteLP(slack=bad)


def test_slack_is_refused_for_rewards_on_steps():
    with pytest.raises(InvalidParameter, match="no row needs slack"):
        FiniteLP(slack=1.0, reward_on="state-action")


def test_an_unknown_treatment_of_unknown_states_is_refused(unchecked):
    with pytest.raises(InvalidParameter, match="unvisited is 'fill'"):
        FiniteLP(unvisited="fill")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (np.ones(6), r"shape \(6,\)"),
        (np.array([1.0, 1, 0, 1, 1, 0, 0]), r"visits\[s=2\] is 0"),
        (np.array([1.0, 1, 1, 1, 1, -1, 0]), r"visits\[s=5\] is -1"),
        (np.array([1.0, np.nan, 1, 1, 1, 0, 0]), r"visits\[s=1\] is nan"),
    ],
)
def test_visits_that_do_not_fit_are_refused(wrong, message):
    with pytest.raises(InvalidParameter, match=message):
        FiniteLP().fit(*partial(), visits=wrong)


def test_lambda_0_is_refused_where_states_are_avoided():
    with pytest.raises(InvalidParameter, match=r'2 reachable states are to be avoided.*unvisited="free"'):
        FiniteLP(l1="auto").fit(*partial())


def test_l1_below_lambda_0_is_worth_something_where_unknown_states_are_free():
    learner = FiniteLP(l1="auto", unvisited="free")
    result = learner.fit(*partial())
    assert result.proof.objective > 0 and result.proof.lambda_0 == pytest.approx(learner.critical_l1(*partial()))


def test_l1_above_lambda_0_makes_the_reward_zero_where_unknown_states_are_free():
    above = 1.01 * FiniteLP(unvisited="free").critical_l1(*partial())
    assert FiniteLP(l1=above, unvisited="free").fit(*partial()).proof.zero


def test_an_expert_of_which_nothing_is_known_is_refused():
    with pytest.raises(InvalidPolicy, match="nothing is known"):
        FiniteLP().fit(*partial(range(7)))


def test_an_expert_known_only_where_nothing_is_reachable_is_refused():
    P = np.zeros((3, 2, 3))
    P[0, :, 1] = P[2, 0, 0] = P[2, 1, 1] = P[1, :, 1] = 1
    expert = np.full((3, 2), np.nan)
    expert[2] = [1.0, 0.0]
    with pytest.raises(DegenerateExpert, match="none of the 0 reachable states where the expert is known"):
        FiniteLP().fit(models.TabularMDP.from_dense(P, 0.9, [1.0, 0, 0]), expert)


def test_a_state_known_by_half_is_refused():
    mdp, expert = partial()
    expert[1, 0] = np.nan
    with pytest.raises(InvalidPolicy, match=r"policy\[s=1, a=0\] is nan"):
        FiniteLP().fit(mdp, expert)
