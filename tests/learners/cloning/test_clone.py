"""Behaviour cloning by counting, against what it is by definition."""

import json
import time
from dataclasses import replace

import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from models import random_model, ring

from irl_gym.demonstrations.demonstrated import counted_pairs, maximum_likelihood, smoothed
from irl_gym.errors import InvalidDemonstrations, InvalidParameter, MissingPart, NotDiscrete
from irl_gym.learners.cloning.clone import Clone
from irl_gym.learners.problem import Problem, Spaces
from irl_gym.mdp.episodes import EmpiricalPolicy, Episode

SEEN = EmpiricalPolicy(np.array([[3, 1], [0, 0], [0, 2], [1, 1]]))
TABLES = arrays(np.int64, (5, 3), elements=st.integers(0, 4)).filter(lambda table: table.any())


@given(TABLES)
def test_a_clone_is_the_shares_of_the_counts_and_random_elsewhere(counts):
    seen = EmpiricalPolicy(counts)
    np.testing.assert_allclose(Clone().fit(seen).policy, np.nan_to_num(maximum_likelihood(seen), nan=1 / 3))
    np.testing.assert_allclose(Clone(smoothing=0.5).fit(seen).policy, np.nan_to_num(smoothed(seen, 0.5), nan=1 / 3))


@given(TABLES, arrays(np.int64, 5, elements=st.integers(0, 2)))
def test_cells_have_one_distribution_that_of_their_steps_together(counts, cells):
    together = np.array([counts[cells == cell].sum(axis=0) for cell in cells])
    wanted = np.nan_to_num(maximum_likelihood(EmpiricalPolicy(together)), nan=1 / 3)
    np.testing.assert_allclose(Clone(cells=cells).fit(EmpiricalPolicy(counts)).policy, wanted)


def test_a_majority_is_the_most_frequent_action_of_the_cell():
    found = Clone(majority=True, cells=[0, 0, 1, 1]).fit(SEEN).policy
    np.testing.assert_array_equal(found, np.eye(2)[[0, 0, 1, 1]])


def test_a_clone_of_weights_is_one_of_counts_whatever_their_scale():
    np.testing.assert_allclose(Clone().fit(SEEN.counts * 0.37).policy, Clone().fit(SEEN).policy)


@given(TABLES, st.sampled_from([Clone(), Clone(smoothing=0.3), Clone(majority=True), Clone(cells=[0, 0, 1, 1, 1])]))
def test_a_proof_tells_the_steps_that_are_not_imitated(counts, learner):
    found = learner.fit(EmpiricalPolicy(counts))
    steps = [(s, a) for s, a in np.ndindex(counts.shape) for _ in range(counts[s, a])]
    taken = np.array([found.policy[s, a] for s, a in steps])
    assert found.proof.mistakes == pytest.approx(1 - taken.mean(), abs=1e-12)
    with np.errstate(divide="ignore"):
        assert found.proof.log_loss == pytest.approx(-np.log(taken).mean(), abs=1e-12)
    assert found.proof.steps == len(steps) and found.proof.shown == len({s for s, _ in steps})


@given(TABLES, arrays(np.float64, (5, 3), elements=st.floats(0.01, 1)))
def test_no_policy_imitates_the_steps_better_than_a_proof_says(counts, weights):
    told, policy = Clone().fit(EmpiricalPolicy(counts)).proof, weights / weights.sum(axis=1, keepdims=True)
    assert (counts * (1 - policy)).sum() / counts.sum() >= told.least_mistakes - 1e-12
    assert -(counts * np.log(policy)).sum() / counts.sum() >= told.least_log_loss - 1e-12
    assert told.log_loss == pytest.approx(told.least_log_loss, abs=1e-12)


def test_a_mistake_without_end_is_not_told_as_a_number():
    found = Clone(majority=True).fit(SEEN)
    assert found.proof.log_loss == np.inf and "log loss" not in {one.label for one in found.facts()}
    assert json.loads(json.dumps(found.proof.to_json(), allow_nan=False))["log_loss"] is None


def test_states_without_demonstrations_are_counted_where_a_policy_can_come_to_act():
    mdp = random_model(0, S=6, kind="terminal").mdp  # the last two states end
    counts = np.zeros((6, 3), dtype=int)
    counts[[0, 2], 1] = 1
    told = [Clone().fit(counts, *table).proof for table in ((mdp,), ())]
    assert [(one.unshown, one.acting) for one in told] == [(2, 4), (4, 6)]
    assert "2 of the 4 states to act in that can be reached: random actions there" in told[0].facts()[1].sentence


def test_nothing_is_open_where_every_state_was_demonstrated():
    assert Clone().fit(np.ones((3, 2))).facts()[2].mood == "good"


def test_a_refusal_names_the_first_state_that_can_be_reached_without_demonstrations():
    with pytest.raises(InvalidDemonstrations, match=r"1 state, state 1 first, can be reached and has no demonstrations"):
        Clone(unseen="refuse").fit(SEEN)
    assert Clone(unseen="refuse").fit(SEEN.counts[[0, 2, 3]]).proof.unshown == 0


def test_the_nearest_state_is_copied():
    circle = ring([[1, 3], [2, 0], [3, 1], [0, 2]])
    counts = np.zeros((4, 2))
    counts[0], counts[1] = [3, 1], [0, 1]
    found = Clone(unseen="nearest").fit(counts, circle)
    np.testing.assert_array_equal(found.policy, [[0.75, 0.25], [0, 1], [0, 1], [0.75, 0.25]])
    assert "at most 1 transition apart" in found.facts()[2].sentence


def test_the_nearest_state_needs_a_table():
    with pytest.raises(MissingPart, match=r"unseen is 'nearest', and there is no table"):
        Clone(unseen="nearest").fit(SEEN)


def test_flat_arrays_are_counted_as_episodes_are():
    rng = np.random.default_rng(0)
    states, actions = rng.integers(7, size=999), rng.integers(3, size=999).astype(np.int8)
    counts = np.zeros((7, 3), dtype=int)
    for s, a in zip(states, actions, strict=True):
        counts[s, a] += 1
    np.testing.assert_array_equal(counted_pairs(states, actions, 7, 3).counts, counts)


@pytest.mark.parametrize(
    ("states", "actions", "told"),
    [
        ([0, 7], [0, 0], r"states\[1\] is 7: expected 0 to 6"),
        ([0, 1], [0, -1], r"actions\[1\] is -1: expected 0 to 2"),
        ([0, 1], [0], r"actions have shape \(1,\)"),
        ([], [], r"states have shape \(0,\)"),
        ([0.5], [0], r"states have shape \(1,\) and dtype float64"),
    ],
)
def test_flat_arrays_that_are_no_steps_are_refused(states, actions, told, unchecked):
    with pytest.raises(InvalidDemonstrations, match=told):
        counted_pairs(states, actions, 7, 3)


@pytest.mark.parametrize(
    ("made", "error", "told"),
    [
        (lambda: Clone(smoothing=-1), InvalidParameter, "smoothing is -1: expected a number of at least 0"),
        (lambda: Clone(unseen="near"), InvalidParameter, "unseen is 'near': expected 'uniform', 'nearest' or 'refuse'"),
        (lambda: Clone(1.0, majority=True), InvalidParameter, "majority is True and smoothing 1: expected"),
        (lambda: Clone(cells=[0, 1]).fit(SEEN), InvalidParameter, r"cells has shape \(2,\)"),
        (lambda: Clone(cells=[0, 1, -1, 0]).fit(SEEN), InvalidParameter, r"whole numbers of at least 0"),
        (lambda: Clone().fit(np.zeros((3, 2))), InvalidDemonstrations, r"from 0 to 0: expected \(S, A\) finite weights"),
        (lambda: Clone().fit(np.full((3, 2), np.nan)), InvalidDemonstrations, r"expected \(S, A\) finite weights"),
        (lambda: Clone().fit(np.empty((0, 2))), InvalidDemonstrations, r"expected \(S, A\) finite weights"),
        (lambda: Clone().fit(SEEN, random_model(0).mdp), InvalidDemonstrations, r"expected \(7, 3\), the table's"),
    ],
)  # fmt: skip
def test_what_cannot_be_cloned_is_refused(made, error, told, unchecked):
    with pytest.raises(error, match=told):
        made()


def test_a_problem_without_numbered_actions_is_refused():
    episode = Episode(np.array([0, 1]), np.array([0]), np.zeros(1), False, True)
    problem = Problem(Spaces(spaces.Discrete(2), spaces.Box(-1, 1, (1,))), demonstrations=[episode])
    with pytest.raises(NotDiscrete, match=r"the action space is Box"):
        Clone().learn(problem)
    assert Clone().learn(replace(problem, spaces=Spaces(spaces.Discrete(2), spaces.Discrete(3)))).policy[0, 0] == 1


@pytest.mark.slow
def test_ten_million_steps_are_cloned_in_less_than_a_second():
    rng = np.random.default_rng(0)
    states, actions, seconds = rng.integers(500, size=10**7), rng.integers(6, size=10**7), []
    for _ in range(3):
        begun = time.perf_counter()
        Clone().fit(counted_pairs(states, actions, 500, 6))
        seconds.append(time.perf_counter() - begun)
    print(f"10,000,000 steps cloned in {min(seconds):.2f} s")
    assert min(seconds) < 1
