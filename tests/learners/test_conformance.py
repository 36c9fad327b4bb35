"""What every learner keeps to, the built-in ones and those of a user."""

import json
import pickle
from dataclasses import replace

import models
import numpy as np
import own_learners
import pytest
from gymnasium import spaces
from gymnasium.wrappers import TimeLimit

from irl_gym.agents.planners import ValueIteration
from irl_gym.agents.simulator import Simulator
from irl_gym.environments.tabular_env import TabularEnv
from irl_gym.errors import InvalidParameter, MissingPart, UnknownLearner
from irl_gym.features.feature_maps import OneHot
from irl_gym.learners.base import Outcome
from irl_gym.learners.needs import PARTS, Needs
from irl_gym.learners.problem import Oracle, Problem
from irl_gym.learners.registry import BUILT_IN, learner_class, learner_of
from irl_gym.mdp.episodes import collect_from_table
from irl_gym.mdp.policies import TabularPolicy
from irl_gym.mdp.rewards import TabularReward
from irl_gym.spaces.states import StateIndex
from irl_gym.tables.tabulate import tabulate

OPTIONS = {"trajectory-lp": {"max_rounds": 2, "trajectories": 20, "horizon": 10}, "neural-clone": {"epochs": 2}}
"""Of learners that would take long."""
COLUMNS = {"finite-lp": "active", "feature-lp": "active", "trajectory-lp": "active", "clone": "passive",
           "softmax-clone": "passive", "neural-clone": "passive", "dagger": "interactive", "own_learners:Dice": "active",
           "own_learners:Copycat": "passive"}  # fmt: skip
every = pytest.mark.parametrize("name", [*BUILT_IN, "own_learners:Dice", "own_learners:Copycat"])


def learner(name):
    return learner_of(name, OPTIONS.get(name, {}))


@pytest.fixture(scope="module")
def whole():
    """A problem of which everything is known."""
    grid = models.paper_grid()
    env = TimeLimit(TabularEnv(grid.mdp, TabularReward(grid.R)), 20)
    table = tabulate(env, gamma=grid.mdp.gamma, check_steps=0)
    states = StateIndex(spaces.Discrete(grid.mdp.n_states))
    episodes = list(
        collect_from_table(table.mdp, table.payments.entries, states, grid.expert, 30, seed=0, max_episode_steps=20)
    )
    policy = TabularPolicy(np.eye(grid.mdp.n_actions)[grid.expert], states)
    return Problem.of(
        grid.mdp, demonstrations=episodes, expert=grid.expert, oracle=Oracle(policy), reward=TabularReward(grid.R),
        environment=Simulator(env, ValueIteration(), grid.mdp.gamma, table), features=OneHot(grid.mdp.n_states), horizon=7,
        gamma=grid.mdp.gamma, also=(Problem.of(grid.mdp),),
    )  # fmt: skip


def learned(name, problem, seed=0):
    return learner(name).learn(problem, np.random.default_rng(seed))


def same(one, other):
    """Have two outcomes the same reward, policy and proof?"""
    assert (one.reward is None) == (other.reward is None) and (one.policy is None) == (other.policy is None)
    if one.reward is not None:
        parts = [getattr(x, "values", getattr(x, "alpha", None)) for x in (one.reward, other.reward)]
        np.testing.assert_array_equal(*parts)
    if isinstance(one.policy, np.ndarray):
        np.testing.assert_array_equal(one.policy, other.policy)
    assert json.dumps(one.proof.to_json()) == json.dumps(other.proof.to_json())


@every
def test_a_learner_is_a_record_that_can_be_pickled_and_compared(name):
    assert repr(pickle.loads(pickle.dumps(learner(name)))) == repr(learner(name))


@every
def test_a_learner_stands_in_the_column_that_its_needs_say(name):
    assert learner_class(name).needs.column == COLUMNS[name]


@every
def test_a_learner_gives_the_same_for_the_same_seed(name, whole):
    same(learned(name, whole), learned(name, whole))


@every
def test_an_outcome_is_told_in_facts_and_json(name, whole):
    found = learned(name, whole)
    assert found.facts()[0].label.startswith("status") and len(found.facts()) > 1
    assert json.loads(json.dumps(found.record())) and json.loads(json.dumps(found.proof.to_json()))


@every
def test_a_learner_reads_no_more_than_it_declares(name, whole):
    unused = {part: () if part == "also" else None for part in learner_class(name).needs.unused}
    same(learned(name, whole), learned(name, replace(whole, **unused)))


@pytest.mark.parametrize("part", PARTS)
def test_of_all_that_is_known_a_learner_sees_only_what_it_declares(whole, part):
    seen = Needs((part,)).of(whole, None)
    assert own_learners.parts_of(seen) == [part]


@every
def test_a_part_that_is_required_and_missing_is_one_error(name, whole):
    for required in learner_class(name).needs.required:
        without = dict.fromkeys(required.split(" or "))
        with pytest.raises(MissingPart, match=f"needs {required}, and the problem has .*: expected"):
            learned(name, replace(whole, **without))


@pytest.mark.parametrize("name", ["feature-lp", "softmax-clone"])
def test_features_of_the_problem_serve_where_the_learner_has_none_and_are_asked_for(name, whole):
    with pytest.raises(MissingPart, match=f"{learner_class(name).__name__} needs features"):
        learned(name, replace(whole, features=None))


@every
def test_an_option_of_another_learner_is_refused(name):
    with pytest.raises(InvalidParameter, match="unexpected keyword argument 'colour': expected of its options"):
        learner_of(name, {"colour": "red"})


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("finite-l", "Did you mean 'finite-lp'"),
        ("no_such_module:Dice", "no module 'no_such_module'"),
        ("own_learners:Thrown", "own_learners has no 'Thrown'"),
        ("own_learners:Told", "expected a class with `needs` and `learn`"),
    ],
)
def test_a_name_of_no_learner_is_refused(name, told):
    with pytest.raises(UnknownLearner, match=told):
        learner_of(name, {})


def test_an_outcome_of_nothing_is_refused():
    with pytest.raises(InvalidParameter, match="at least one of the two"):
        Outcome(None, own_learners.Status.OPTIMAL, own_learners.Told(0))


def test_needs_of_built_in_learners_are_parts_of_a_problem():
    assert all({*learner_class(name).needs.parts} <= {*PARTS} for name in BUILT_IN)
