"""Actions inferred from states: what is most likely, what cannot be told, and what is said of it."""

import models
import numpy as np
import pytest
from gymnasium import spaces

from irl_gym.demonstrations.demonstrated import most_frequent
from irl_gym.demonstrations.inferred import infer, without_actions
from irl_gym.demonstrations.mixtures import most_likely
from irl_gym.demonstrations.shown import shown
from irl_gym.errors import InvalidDemonstrations, UnknownObservation
from irl_gym.mdp.episodes import Episode, collect_from_table, empirical_policy
from irl_gym.mdp.planning.dynamic_programming import policy_iteration
from irl_gym.mdp.policies import as_distribution
from irl_gym.mdp.tabular_mdp import TransitionTable
from irl_gym.spaces.states import StateIndex

THREE = StateIndex(spaces.Discrete(3))
FORK = TransitionTable.from_dense(
    [[[0, 1, 0], [0, 1, 0], [0, 0, 1]], [[0.5, 0, 0.5], [0.5, 0.5, 0], [0, 0.5, 0.5]], [[1, 0, 0], [0, 0, 1], [0, 0, 1]]],
    [1, 0, 0],
)
"""In state 0 two actions lead to 1; in state 1 each successor is that of two actions; in state 2 the last two stay."""


def states_of(*rows):
    return [Episode(np.array(one), None, np.zeros(len(one) - 1), False, True) for one in rows]


def drawn(table, states, policy, n, seed=0, most=200):
    paid = np.zeros(table.P.nnz)
    return list(collect_from_table(table, paid, states, policy, n, seed=seed, max_episode_steps=most))


# --- the most likely mixture ---


@pytest.mark.parametrize("seed", range(5))
def test_a_mixture_is_as_likely_as_that_of_many_steps_of_em_and_says_how_near_it_is(seed):
    rng = np.random.default_rng(seed)
    L, q = rng.random((6, 4)) * (rng.random((6, 4)) < 0.7) + 1e-3, rng.dirichlet(np.ones(6))
    found, w = most_likely(L, q, np.array([0])), np.full(4, 0.25)
    for _ in range(20_000):
        w = w * ((q / (L @ w)) @ L)
    likely = [float(q @ np.log(L @ one)) for one in (found.weights[0], w)]
    assert likely[0] >= likely[1] - 1e-9 and found.short[0] < 1e-9
    assert (L.T @ (q / (L @ found.weights[0]))).max() <= 1 + 1e-9  # Lindsay's condition


@pytest.mark.parametrize("kind", ["dense", "sparse"])
def test_a_stochastic_policy_is_found_again_from_its_successors(kind):
    rng = np.random.default_rng(3)
    P, pi = models.random_table(rng, 8, 3, kind), rng.dirichlet(np.ones(3), 8)
    q = np.einsum("sa,sat->st", pi, P)
    here, there = np.nonzero(q)
    begins = np.unique(here, return_index=True)[1]
    found = most_likely(P[here, :, there], q[here, there], begins)
    settled = found.settled.all(axis=1)
    np.testing.assert_allclose(found.weights[settled], pi[settled], atol=1e-5)
    explained = np.einsum("sa,sat->st", found.weights, P)
    np.testing.assert_allclose(explained, q, atol=1e-6)  # whether the weights are settled or not
    assert settled.any()


def test_many_states_are_solved_as_one_is(monkeypatch):
    rng = np.random.default_rng(0)
    L, q = rng.random((40, 3)) + 0.01, np.tile(rng.dirichlet(np.ones(4)), 10)
    whole = most_likely(L, q, np.arange(0, 40, 4))
    monkeypatch.setattr("irl_gym.demonstrations.mixtures.BLOCK", 60)
    np.testing.assert_allclose(most_likely(L, q, np.arange(0, 40, 4)).weights, whole.weights, atol=1e-7)
    np.testing.assert_allclose(most_likely(L[4:8], q[4:8], np.array([0])).weights[0], whole.weights[1], atol=1e-7)


# --- what is inferred ---


@pytest.mark.parametrize("name", ["FrozenLake 8x8 slippery", "Taxi"])
def test_the_inferred_actions_are_those_that_were_taken(toy_text, name):
    table = toy_text(name)
    episodes = drawn(table.mdp, table.states, policy_iteration(table.mdp, table.reward).policy, 300)
    found, taken = infer(without_actions(episodes), table.states, table.mdp), most_frequent(
        empirical_policy(episodes, table.states, table.mdp.n_actions)
    )  # fmt: skip
    known = np.isfinite(found.policy[:, 0])
    assert (found.policy[known] * taken[known]).sum(axis=1).min() > 0
    assert known.sum() > 0.9 * (found.visits > 0).sum()


def test_actions_of_equal_rows_are_one():
    found = infer(states_of([0, 1, 0, 1]), THREE, FORK)
    assert found.policy[0].tolist() == [0.5, 0.5, 0] and found.alike.tolist() == [0]
    np.testing.assert_allclose(found.weights[0], [1, 1, 0], atol=1e-6)


def test_what_several_actions_explain_as_well_is_undecided_and_none_is_taken():
    found = infer(states_of([1, 0]), THREE, FORK)
    assert found.undecided.tolist() == [1] and np.isnan(found.policy[1]).all()
    np.testing.assert_allclose(found.weights[1], [0.5, 0.5, 0], atol=1e-6)


def test_what_further_steps_tell_is_decided():
    found = infer(states_of([1, 0], [1, 1, 0]), THREE, FORK)
    assert found.policy[1].tolist() == [0, 1, 0] and not found.undecided.size


def test_steps_that_one_action_only_makes_are_counted_apart():
    found = infer(states_of([0, 1, 0], [0, 2, 0]), THREE, FORK)
    assert (found.clear, found.ambiguous, found.unexplained) == (3, 1, 0)


def test_steps_that_no_action_makes_are_left_out_and_said():
    found = infer(states_of([0, 1, 0], [0, 1, 0, 0, 1]), THREE, FORK)
    assert (found.unexplained, found.visits.tolist()) == (1, [4, 2, 0])
    assert found.facts()[-1].sentence == "1 step that no action of the table makes, episode 1, step 2 first"


def test_a_step_whose_successor_was_not_recorded_tells_nothing():
    unseen = Episode(np.array([0, 2, 2]), None, np.zeros(2), False, True, None, "unseen")
    assert infer([unseen], THREE, FORK).visits.tolist() == [1, 0, 0]


def test_the_facts_say_how_much_was_inferred():
    found = infer(states_of([0, 1, 0], [0, 1]), THREE, FORK).facts()
    assert found[0].sentence.startswith(
        "from where 3 steps in 2 states led, since the episodes have none: 2 can be of one action only, 1 of several"
    )
    assert [one.label for one in found] == ["actions inferred", "actions undecided", "actions alike"]


@pytest.mark.parametrize(
    ("rows", "error", "said"),
    [
        ([[0, 0]], InvalidDemonstrations, "no action of the table makes any of the 1 steps, episode 0, step 0 first"),
        ([[0, 7]], UnknownObservation, "episode 0"),
        ([], InvalidDemonstrations, "no step whose successor was recorded"),
    ],
)
def test_states_that_tell_nothing_are_refused(rows, error, said):
    with pytest.raises(error, match=said):
        infer(states_of(*rows), THREE, FORK)


def test_recorded_actions_are_taken_as_they_are():
    episodes = drawn(FORK, THREE, as_distribution(np.array([1, 0, 1]), 3, 3), 5, most=10)
    found = shown(episodes, THREE, 3, FORK)
    assert found.inferred is None and found.weights[0].tolist()[0] == 0
    np.testing.assert_array_equal(found.weights, empirical_policy(episodes, THREE, 3).counts)


def test_shares_are_equal_where_nothing_is_known():
    assert shown(states_of([0, 2]), THREE, 3, FORK).shares.round(6).tolist()[1:] == [[0.333333] * 3] * 2
