"""What errors say of natural mistakes with the facade is executed, and serves."""

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest
from mended import told
from own_learners import Copycat

import irl_gym
from irl_gym.agents.planners import tabular_actions
from irl_gym.demonstrations.demonstrated import most_frequent
from irl_gym.learners.problem import Problem
from irl_gym.mdp.policies import as_distribution

pytestmark = pytest.mark.usefixtures("unchecked")
LAKE = gym.make("FrozenLake-v1", is_slippery=False, max_episode_steps=50)
TABLE = irl_gym.tabulate(LAKE, gamma=0.9)
SOLUTION = irl_gym.policy_iteration(TABLE.mdp, TABLE.reward)
ACTOR = irl_gym.TabularPolicy(as_distribution(SOLUTION.policy, 16, 4), TABLE.states)
EPISODES = list(irl_gym.collect(LAKE, ACTOR, 3))
SEEN = irl_gym.empirical_policy(EPISODES, TABLE.states, 4)
RESULT = irl_gym.FiniteLP().fit(TABLE.mdp, SOLUTION.policy)
COPIED = Copycat().learn(Problem.of(TABLE, demonstrations=EPISODES), np.random.default_rng(0))
CLIFF = gym.make("CliffWalking-v1")
AGENT = SimpleNamespace(predict=ACTOR.predict)


def fit(expert, mdp=TABLE.mdp):
    return irl_gym.FiniteLP().fit(mdp, expert)


def on_features(world, expert):
    return irl_gym.FeatureLP(np.eye(16)).fit(world, expert)


def learned(reward, env=LAKE, **how):
    return irl_gym.LearnedReward(env, reward, **how)


def seen(states=TABLE.states, n_actions=4):
    return irl_gym.empirical_policy(EPISODES, states, n_actions)


def acting(policy, env=LAKE):
    return list(irl_gym.collect(env, policy, 1))


CASES: list[tuple[str, Callable, Callable]] = [
    ("Count what episodes show, with `irl_gym.demonstrations.demonstrated.most_frequent(irl_gym.empirical_policy(episodes, "
     "table.states, table.mdp.n_actions))`.", lambda: fit(EPISODES),
     lambda: fit(most_frequent(irl_gym.empirical_policy(EPISODES, TABLE.states, TABLE.mdp.n_actions)))),
    ("Count what episodes show", lambda: fit(iter(EPISODES)), lambda: fit(most_frequent(SEEN))),
    ("Count what episodes show", lambda: on_features(TABLE.mdp, EPISODES), lambda: on_features(TABLE.mdp, most_frequent(SEEN))),
    ("Take what it does most, with `irl_gym.demonstrations.demonstrated.most_frequent(policy)`.",
     lambda: fit(SEEN), lambda: fit(most_frequent(SEEN))),
    ("Ask it in each state, with `irl_gym.agents.planners.tabular_actions(policy, table.states)`.",
     lambda: fit(AGENT), lambda: fit(tabular_actions(AGENT, TABLE.states))),
    ("The mdp comes first, then the expert.", lambda: fit(TABLE.mdp, mdp=SOLUTION.policy), lambda: fit(SOLUTION.policy)),
    ("The mdp comes first, then the expert.", lambda: fit(TABLE.mdp), lambda: fit(SOLUTION.policy)),
    ("first, and then the expert.", lambda: on_features(SOLUTION.policy, TABLE.mdp),
     lambda: on_features(TABLE.mdp, SOLUTION.policy)),
    ("Give its `mdp`.", lambda: fit(SOLUTION.policy, mdp=TABLE), lambda: fit(SOLUTION.policy, mdp=TABLE.mdp)),
    ("Give its `mdp`.", lambda: irl_gym.policy_iteration(TABLE, TABLE.reward),
     lambda: irl_gym.policy_iteration(TABLE.mdp, TABLE.reward)),
    ("Give its `mdp`.", lambda: irl_gym.TabularEnv(TABLE, TABLE.reward), lambda: irl_gym.TabularEnv(TABLE.mdp, TABLE.reward)),
    ("Give its `reward`.", lambda: irl_gym.certify(TABLE.mdp, SOLUTION, RESULT),
     lambda: irl_gym.certify(TABLE.mdp, SOLUTION, RESULT.reward)),
    ("Give its `reward`.", lambda: irl_gym.value_iteration(TABLE.mdp, TABLE),
     lambda: irl_gym.value_iteration(TABLE.mdp, TABLE.reward)),
    ("Make one of a table, with `irl_gym.TabularPolicy(irl_gym.mdp.policies.as_distribution(policy, n_states, n_actions), "
     "table.states)`.", lambda: acting(SOLUTION),
     lambda: acting(irl_gym.TabularPolicy(as_distribution(SOLUTION, 16, 4), TABLE.states))),
    ("It comes first, then the policy.", lambda: acting(LAKE, env=ACTOR), lambda: acting(ACTOR)),
    ("Give a table's, `table.states`.", lambda: seen(states=TABLE), seen),
    ("such as `table.mdp.n_actions`.", lambda: seen(n_actions=LAKE.action_space), lambda: seen(n_actions=TABLE.mdp.n_actions)),
    ("Give `kind='reward'` or `kind='occupancy'`.", lambda: irl_gym.plot(np.ones((16, 4)), LAKE),
     lambda: [irl_gym.plot(np.ones((16, 4)), LAKE, kind=one) for one in ("reward", "occupancy")]),
    ("Give a table besides, as `table`.", lambda: irl_gym.plot(RESULT, TABLE), lambda: irl_gym.plot(RESULT, LAKE, table=TABLE)),
    ("Learn one, such as with `FiniteLP().fit(mdp, expert)`.", lambda: learned(COPIED), lambda: learned(RESULT)),
    ("Make one, such as `irl_gym.Experiment('FrozenLake-v1', gamma=0.99)`.",
     lambda: irl_gym.recover_and_retrain("FrozenLake-v1", "nowhere"),
     lambda: irl_gym.Experiment("FrozenLake-v1", gamma=0.99)),
    ("Give the Tabulation of this environment.", lambda: learned(RESULT, env=CLIFF, shaping=TABLE),
     lambda: learned(RESULT, shaping=TABLE)),
]  # fmt: skip


@pytest.mark.parametrize(("says", "breaks", "mended"), CASES)
def test_a_mend_of_a_natural_mistake_serves(says, breaks, mended):
    assert says in told(breaks) and mended() is not None


@pytest.mark.parametrize("call", [fit, lambda one: on_features(TABLE.mdp, one)])
def test_a_solution_and_an_outcome_of_a_policy_stand_for_their_policy(call):
    for one in (SOLUTION, replace(COPIED, policy=SOLUTION.policy)):
        found, expected = call(one).reward, call(one.policy).reward
        assert np.array_equal(found.values, expected.values) if call is fit else np.array_equal(found.alpha, expected.alpha)


@pytest.mark.parametrize(("wrong", "right"), [("FeatureLp", "FeatureLP"), ("tabularmdp", "TabularMDP"), ("Doctor", "doctor")])
def test_a_name_that_is_not_there_is_told_with_the_closest(wrong, right):
    with pytest.raises(AttributeError, match=rf"irl_gym has no {wrong}: expected one of its names\. Use irl_gym\.{right}\."):
        getattr(irl_gym, wrong)


def imported(what):
    """What a program without the tests' checks says that imports something of the facade."""
    code = f"from irl_gym import *; from irl_gym import {what}; print(FeatureLP.__name__, {what})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    return (done.stdout + done.stderr).splitlines()[-1]


def test_an_import_of_a_name_that_is_not_there_is_told_with_the_closest():
    said = imported("FeatureLp")
    assert said == "ImportError: irl_gym has no FeatureLp: expected one of its names. Use irl_gym.FeatureLP."
    assert not hasattr(irl_gym, "FeatureLp")


def test_a_module_is_imported_from_the_library_though_a_name_is_close_to_it():
    assert imported("facts").startswith("FeatureLP <module 'irl_gym.facts'")


def test_a_name_that_nothing_is_close_to_is_told_where_the_names_are():
    with pytest.raises(AttributeError, match=r"`help\(irl_gym\)` lists them\."):
        irl_gym.zzzzzz  # noqa: B018
    assert all(name in (irl_gym.__doc__ or "") for name in ("FiniteLP", "tabulate"))
