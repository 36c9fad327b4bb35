"""The oracle takes over from the learner, and only what it does then is learned (HG-DAgger)."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from models import random_model

from irl_gym.errors import InvalidParameter, InvalidPolicy
from irl_gym.learners.cloning.clone import Clone
from irl_gym.learners.interactive.answers import ANSWERS
from irl_gym.learners.interactive.dagger import DAgger
from irl_gym.learners.problem import Oracle, Problem
from irl_gym.mdp.planning.dynamic_programming import occupancy

SOFT = Clone(smoothing=4.0)
"""Errs now and then, so that there is something to take over."""


def watching(model, calls=None):
    """Takes over where the learner would err, in all states but the first two."""

    def gate(row, info, action):
        if calls is not None:
            calls.append((int(row), action))
        return bool(row > 1 and action != model.expert[row])

    return Problem.of(model.mdp, oracle=Oracle(lambda row, info: int(model.expert[row]), gate=gate))


@given(st.integers(0, 30))
@settings(max_examples=10)
def test_exact_visits_are_gated_with_the_probability_that_it_takes_over(seed):
    model = random_model(seed)
    first, second = DAgger(rounds=2, learner=SOFT, labels="gated").iterate(watching(model), np.random.default_rng(0))
    right = np.eye(3)[model.expert]
    assert first.beta == 1 and first.visits.weights == pytest.approx(
        occupancy(model.mdp, right).sum(axis=1)[first.visits.states]
    )
    errs = np.where(np.arange(7) > 1, 1 - first.policy[np.arange(7), model.expert], 0.0)
    kept = np.where(np.arange(7)[:, None] > 1, first.policy * right, first.policy)
    visits = occupancy(model.mdp, kept + errs[:, None] * right).sum(axis=1)
    found = np.zeros(7)
    found[second.visits.states] = second.visits.weights
    np.testing.assert_allclose(found, np.where(model.mdp.terminal, 0, visits * errs), atol=1e-12)


def test_only_what_the_oracle_does_after_it_took_over_is_labelled_and_asked():
    model = random_model(2)
    learner = DAgger(rounds=3, learner=SOFT, labels="gated", episodes=20, max_episode_steps=8)
    played = [*learner.iterate(watching(model), np.random.default_rng(0))]
    assert all(one.labelled.all() and (one.actions == one.labels).all() for one in played[0].visits.episodes)
    rows, done, labels = (
        np.concatenate([getattr(one, name)[: len(one)] for each in played[1:] for one in each.visits.episodes])
        for name in ("observations", "actions", "labels")
    )
    gated = labels >= 0
    assert 0.1 < gated.mean() < 0.9
    np.testing.assert_array_equal(done[gated], model.expert[rows[gated]])
    assert (rows[gated] > 1).all() and (done[~gated & (rows > 1)] == model.expert[rows[~gated & (rows > 1)]]).all()
    assert played[-1].queries == sum(one.visits.labels.size for one in played)
    assert "took over" in learner.how


def test_a_round_in_which_nobody_takes_over_teaches_nothing():
    model = random_model(2)
    never = Problem.of(model.mdp, oracle=Oracle(lambda row, info: int(model.expert[row]), gate=lambda *seen: False))
    for episodes in (None, 5):
        found = DAgger(rounds=3, learner=SOFT, labels="gated", episodes=episodes, max_episode_steps=8)
        first, *_, last = found.iterate(never, np.random.default_rng(0))
        np.testing.assert_array_equal(first.policy, last.policy)
        assert last.mistakes == 0 and last.visits.labels.size == 0 and last.queries == first.queries


def test_what_the_gate_said_is_not_asked_again(tmp_path):
    model, calls = random_model(2), []
    learner = DAgger(rounds=2, learner=SOFT, labels="gated", episodes=5, max_episode_steps=8)
    for _ in range(2):
        learner.learn(watching(model, calls), np.random.default_rng(0), tmp_path)
    lines = (tmp_path / ANSWERS).read_text().splitlines()
    assert len(calls) == sum(line.startswith("gate ") for line in lines) > 0


def test_an_oracle_that_watches_nobody_is_refused():
    known = Problem.of(random_model(1).mdp, oracle=Oracle(lambda row, info: 0))
    with pytest.raises(InvalidParameter, match="the oracle has no gate"):
        DAgger(labels="gated").learn(known, np.random.default_rng(0))


def test_a_gate_that_says_neither_yes_nor_no_is_told():
    known = Problem.of(random_model(1).mdp, oracle=Oracle(lambda row, info: 0, gate=lambda *seen: 1))
    with pytest.raises(InvalidPolicy, match=r"the gate's answer at observation \d is 1: expected True or False"):
        DAgger(labels="gated").learn(known, np.random.default_rng(0))
