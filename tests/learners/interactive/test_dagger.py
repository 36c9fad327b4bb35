"""DAgger, against what it is by definition."""

from dataclasses import replace
from itertools import count
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from models import random_model
from stable_baselines3 import PPO

from irl_gym.agents.planners import ValueIteration
from irl_gym.agents.simulator import Simulator
from irl_gym.environments.generative import GenerativeModel
from irl_gym.errors import InvalidParameter, InvalidPolicy, SolverTimeout
from irl_gym.learners.cloning.clone import Clone
from irl_gym.learners.cloning.softmax import SoftmaxClone
from irl_gym.learners.interactive.dagger import DAgger
from irl_gym.learners.problem import Oracle, Problem, Spaces
from irl_gym.mdp.planning.dynamic_programming import backup, occupancy, policy_evaluation
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.programs import deadline

COARSE = Clone(cells=[0, 0, 0, 1, 1, 2, 2])
"""A class that does not tell all of 7 states apart."""


def rng():
    return np.random.default_rng(0)


def problem(model, **parts):
    """Of a random model, whose expert can be asked."""
    return Problem.of(model.mdp, oracle=Oracle(lambda row, info: int(model.expert[row])), **parts)


def from_first(model):
    """The same model, whose episodes begin in the first state."""
    S = model.mdp.n_states
    return replace(model, mdp=TabularMDP(model.mdp.P, model.mdp.gamma, np.eye(S)[0]))


@pytest.mark.parametrize(
    ("options", "shares"),
    [
        ({}, [1, 0, 0, 0, 0]),
        ({"beta": "linear"}, [1, 0.75, 0.5, 0.25, 0]),
        ({"beta": "exponential", "decay": 0.1}, [1, 0.1, 0.01, 0.001, 0.0001]),
        ({"beta": "linear", "rounds": 1}, [1]),
    ],
)
def test_a_schedule_says_how_often_the_expert_acts(options, shares):
    given: dict[str, Any] = {"rounds": 5, **options}
    learner = DAgger(**given)
    assert [learner.share(i + 1) for i in range(len(shares))] == pytest.approx(shares)


@given(st.integers(0, 50), st.sampled_from(["indicator", "linear", "exponential"]))
@settings(max_examples=15)
def test_exact_visits_are_those_of_the_mixture(seed, beta):
    model = from_first(random_model(seed))
    before = np.full((7, 3), 1 / 3)
    for one in DAgger(rounds=3, beta=beta, learner=COARSE).iterate(problem(model), rng()):
        mixed = one.beta * np.eye(3)[model.expert] + (1 - one.beta) * before
        found = np.zeros(7)
        found[one.visits.states] = one.visits.weights
        np.testing.assert_allclose(found, occupancy(model.mdp, mixed).sum(axis=1), atol=1e-12)
        assert (one.visits.labels == model.expert[one.visits.states]).all() and one.visits.executed is None
        before = one.policy


@given(st.integers(0, 50), st.sampled_from([None, 5]))
@settings(max_examples=20)
def test_what_a_policy_loses_is_at_most_its_odds_times_what_one_other_action_costs(seed, episodes):
    model = from_first(random_model(seed))
    R = np.asarray(model.mdp.P @ model.R).reshape(7, 3)
    found = DAgger(rounds=3, learner=COARSE, episodes=episodes, max_episode_steps=20).learn(problem(model), rng())
    V = policy_evaluation(model.mdp, R, model.expert)
    cost = (V[:, None] - backup(model.mdp, R, V)).max()
    lost = model.mdp.d0 @ (V - policy_evaluation(model.mdp, R, found.policy))
    assert lost <= found.proof.odds * cost + 1e-9


@pytest.mark.parametrize("seed", range(3))
def test_clean_labels_are_the_experts_own_where_it_goes_under_noise(seed):
    model, learner = from_first(random_model(seed)), DAgger(rounds=2, learner=COARSE, labels="clean", noise=0.3)
    shaken = 0.7 * np.eye(3)[model.expert] + 0.3 / 3
    for one in learner.iterate(problem(model), rng()):
        found = np.zeros(7)
        found[one.visits.states] = one.visits.weights
        np.testing.assert_allclose(found, occupancy(model.mdp, shaken).sum(axis=1), atol=1e-12)
        np.testing.assert_array_equal(one.visits.labels, model.expert[one.visits.states])


def test_noise_moves_what_is_executed_and_not_the_labels():
    learner = DAgger(rounds=1, labels="clean", noise=0.3, episodes=200, max_episode_steps=10)
    (only,) = learner.iterate(problem(random_model(2)), rng())
    assert (only.visits.executed != only.visits.labels).mean() == pytest.approx(0.3 * 2 / 3, abs=0.03)
    assert "under noise (DART)" in learner.how and "itself (DAgger)" in DAgger().how


def test_a_table_needs_one_round_and_one_answer_a_state_and_ends_where_nothing_is_left_to_learn():
    model = random_model(3)
    found = DAgger(ask="unseen").learn(problem(model), rng())
    np.testing.assert_array_equal(found.policy.argmax(axis=1), model.expert)
    assert (found.proof.rounds, found.proof.queries, found.proof.odds) == (1, 7, 0)
    assert found.facts()[-1].mood == "good" and "worth the same, under any reward" in found.facts()[-1].sentence


@pytest.mark.parametrize("episodes", [None, 4])
def test_each_visit_is_a_query_or_only_the_first_of_a_state(episodes):
    options: dict[str, Any] = {"rounds": 4, "learner": COARSE, "episodes": episodes, "max_episode_steps": 10}
    model = random_model(1)
    asked, known = (Oracle(lambda row, info: int(model.expert[row])) for _ in range(2))
    always = [*DAgger(**options).iterate(Problem.of(model.mdp, oracle=asked), rng())]
    unseen = [*DAgger(**options, ask="unseen").iterate(Problem.of(model.mdp, oracle=known), rng())]
    assert asked.queries == always[-1].queries == sum(one.visits.states.size for one in always)
    assert known.queries == unseen[-1].queries == unseen[-1].labelled == sum(one.visits.asked.sum() for one in unseen)
    for one, other in zip(always, unseen, strict=True):  # of an oracle that always answers the same
        np.testing.assert_array_equal(one.policy, other.policy)


def test_queries_of_an_oracle_that_was_asked_before_are_not_counted_twice():
    oracle, mdp = Oracle(lambda row, info: 1), random_model(1).mdp
    first, second = (DAgger(rounds=2).learn(Problem.of(mdp, oracle=oracle), rng()).proof.queries for _ in range(2))
    assert first == second == 14 and oracle.queries == 28


def test_what_was_done_and_what_the_oracle_says_are_two_things():
    model, learner = random_model(2), DAgger(rounds=2, learner=Clone(smoothing=5.0), episodes=30, max_episode_steps=10)
    first, second = learner.iterate(problem(model), rng())
    np.testing.assert_array_equal(first.visits.executed, first.visits.labels)  # beta is 1
    assert 0.2 < (second.visits.executed != second.visits.labels).mean() < 0.6
    for one in (first, second):
        np.testing.assert_array_equal(one.visits.labels, model.expert[one.visits.states])


def test_the_share_of_steps_in_which_the_expert_acts_is_beta():
    model, wrong = random_model(2), Clone(smoothing=1e9)  # any action
    *_, last = DAgger(3, wrong, "exponential", 0.7, episodes=200, max_episode_steps=10).iterate(problem(model), rng())
    same = (last.visits.executed == last.visits.labels).mean()
    assert last.visits.states.size == 2000 and same == pytest.approx(0.49 + 0.51 / 3, abs=0.04)


def test_the_round_that_is_kept_is_of_the_highest_value():
    model = from_first(random_model(5))
    told = problem(model, reward=TabularReward(model.R))
    learner = DAgger(rounds=6, learner=Clone(majority=True, cells=[0, 0, 0, 0, 1, 1, 1]))
    found, each = learner.learn(told, rng()), [*learner.iterate(told, rng())]
    R = np.asarray(model.mdp.P @ model.R).reshape(7, 3)
    values = [float(model.mdp.d0 @ policy_evaluation(model.mdp, R, one.policy)) for one in each]
    assert [one.value for one in each] == pytest.approx(values)
    assert found.proof.value == pytest.approx(max(values)) and found.proof.chosen_by == "value"
    np.testing.assert_array_equal(found.policy, each[found.proof.kept - 1].policy)


def test_the_round_that_is_kept_is_of_the_fewest_odds_where_no_reward_is_known():
    learner, told = DAgger(rounds=6, learner=COARSE), problem(from_first(random_model(5)))
    found, each = learner.learn(told, rng()), [*learner.iterate(told, rng())]
    assert found.proof.odds == min(one.odds for one in each if one.odds is not None) and found.proof.chosen_by == "odds"


def test_an_oracle_that_contradicts_itself_is_told():
    drawn = rng()
    told = Problem.of(random_model(1).mdp, oracle=Oracle(lambda row, info: int(drawn.integers(3))))
    found = DAgger(rounds=5).learn(told, rng())
    facts = {one.label: one for one in found.facts()}
    assert (
        facts["contradictions"].mood == "open"
        and "what one other action costs" not in facts["at odds with the oracle"].sentence
    )


# --- in an environment ---


@pytest.fixture(scope="module")
def lake():
    return gym.make("FrozenLake-v1", is_slippery=False, max_episode_steps=30)


def right_or_down(seen, info):
    """What leads over FrozenLake 4x4 without slips."""
    return {0: 1, 4: 1, 8: 2, 9: 1, 13: 2, 14: 2}.get(int(seen), 0)


def in_an_environment(lake, oracle, **parts):
    world: dict[str, Any] = {"environment": Simulator(lake, ValueIteration(), 0.9)} if not parts else parts
    return Problem(Spaces(lake.observation_space, lake.action_space), oracle=oracle, **world)


@pytest.mark.parametrize("dynamics", [False, True], ids=["environment", "generative model"])
def test_an_environment_without_a_table_is_stepped(lake, dynamics):
    parts = {"dynamics": GenerativeModel(lake, 0.9)} if dynamics else {}
    found = DAgger(rounds=3, episodes=2).learn(in_an_environment(lake, Oracle(right_or_down), **parts), rng())
    assert [int(found.policy[row].argmax()) for row in (0, 4, 8, 9, 13, 14)] == [1, 1, 2, 1, 2, 2]
    assert found.proof.steps == found.proof.queries == 3 * 2 * 6  # none is labelled after the end
    assert found.proof.chosen_by == "last" and found.proof.odds is None and found.proof.mistakes == 0


def test_an_oracle_sees_what_the_environment_tells_besides(lake):
    told = []
    DAgger(rounds=1, episodes=1).learn(in_an_environment(lake, Oracle(lambda seen, info: told.append(info) or 1)), rng())
    assert told[0].keys() == {"prob"}


def test_an_agent_of_sb3_is_an_oracle(lake):
    model = PPO("MlpPolicy", lake, n_steps=8, batch_size=8, seed=0, device="cpu")
    found = DAgger(rounds=2, episodes=3).learn(in_an_environment(lake, Oracle(model)), rng())
    assert found.policy[0].argmax() == model.predict(np.array(0), deterministic=True)[0]


def test_a_bad_answer_in_an_environment_is_told_with_the_query(lake):
    with pytest.raises(InvalidPolicy, match=r"answer to query 3, observation 8, is 4: expected an action, .* 0 to 3"):
        wrong = Oracle(lambda seen, info: 4 if seen == 8 else 1)
        DAgger(rounds=1, episodes=1).learn(in_an_environment(lake, wrong), rng())


def test_a_world_that_cannot_be_stepped_is_refused(lake):
    class Dream:
        gamma = 0.9

        def plan(self, reward, *, seed=0): ...

        def sums(self, policy, features, n, *, horizon, seed): ...

    with pytest.raises(InvalidParameter, match="is a Dream without `env`"):
        DAgger(episodes=1).learn(in_an_environment(lake, Oracle(right_or_down), environment=Dream()), rng())


# --- time ---


@pytest.mark.parametrize(
    ("options", "in_table"),
    [({}, True), ({"episodes": 3}, True), ({"ask": "unseen", "episodes": 9}, True), ({"episodes": 3}, False),
     ({"learner": SoftmaxClone(np.eye(7))}, True)],
)  # fmt: skip
def test_a_limit_of_time_is_of_all_rounds_together(lake, monkeypatch, options, in_table):
    model, asked = random_model(0, S=7, A=3), []
    answers = Oracle(lambda row, info: asked.append(row) or (int(model.expert[row]) if in_table else right_or_down(row, info)))
    known = Problem.of(model.mdp, oracle=answers) if in_table else in_an_environment(lake, answers)
    monkeypatch.setattr(deadline.time, "monotonic", map(float, count()).__next__)  # a second passes whenever it is asked
    with pytest.raises(SolverTimeout, match=r"no answer in 40\.0 s"):
        [*DAgger(rounds=10_000, time_limit=40.0, **options).iterate(known, rng())]
    assert 0 < len(asked) <= 40


# --- refusals ---


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"rounds": 0}, "rounds is 0"),
        ({"decay": 1.0}, "decay is 1.0"),
        ({"episodes": 0}, "episodes is 0"),
        ({"max_episode_steps": 0}, "max_episode_steps is 0"),
        ({"beta": "sudden"}, "beta is 'sudden': expected one of indicator, linear, exponential"),
        ({"noise": 1.0}, "noise is 1.0"),
        ({"labels": "all"}, "labels is 'all': expected one of own, clean, gated"),
        ({"ask": "never"}, "ask is 'never': expected one of always, unseen"),
        ({"time_limit": 0}, "time_limit is 0: expected seconds above 0, or None"),
        ({"learner": DAgger()}, "expected one that clones labels"),
        ({"learner": "finite-lp"}, "expected one that clones labels"),
        ({"learner": "neural-clone"}, "episodes is None and the learner a NeuralClone"),
        ({"learner": "neural-clone", "episodes": 2, "cost": "advantage"}, "expected one with `fit_costs`"),
        ({"cost": "high"}, "cost is 'high': expected one of mistakes, advantage"),
    ],
)
def test_a_field_outside_its_range_is_refused(options, told, unchecked):
    with pytest.raises(InvalidParameter, match=told):
        DAgger(**options)


def test_a_learner_can_be_named():
    assert isinstance(DAgger(learner="softmax-clone").learner, SoftmaxClone)
