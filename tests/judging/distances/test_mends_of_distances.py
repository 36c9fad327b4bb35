"""The mends that errors of distances name are executed, and serve."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from enumeration_envs import Shows
from gymnasium import spaces
from gymnasium.wrappers import FlattenObservation
from judging.distances.samples import CONTINUING, ENDING, drawn, function, rewards_of
from mended import SHOWN, mends, told, unsaid
from models import random_model

import irl_gym
from irl_gym.agents.experts import Acting
from irl_gym.features.feature_maps import OneHot
from irl_gym.features.linear_reward import LinearReward
from irl_gym.judging.distances import TableModel, Transitions, epic, sampled_dard, sampled_pearson, sampled_starc, starc
from irl_gym.judging.distances.bounds import epic_bound
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.mdp.episodes import collect
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.mdp.time_expanded import time_expanded
from irl_gym.spaces.states import StateIndex

pytestmark = pytest.mark.usefixtures("unchecked")
MODEL = random_model(1, S=5)
R, S = rewards_of(CONTINUING)
LATER = time_expanded(MODEL.mdp, 4)
R_LATER = np.random.default_rng(0).normal(size=LATER.n_states)
LEARNED = FiniteLP().fit(MODEL.mdp, MODEL.expert)


def dard(first=R, second=S, n=1000, replicates=8, transitions=None, model=None):
    transitions, rng = transitions or drawn(CONTINUING, 0, n)[0], np.random.default_rng(0)
    return sampled_dard(function(first), function(second), transitions, gamma=0.9, model=model or TableModel(CONTINUING.mdp),
                        actions=np.arange(3), replicates=replicates, rng=rng)  # fmt: skip


def played(policy):
    transitions, _, rng = drawn(CONTINUING, 0, 50)
    return sampled_starc(function(R), function(S), transitions, gamma=0.9, model=TableModel(CONTINUING.mdp), policy=policy,
                         horizon=3, rng=rng)  # fmt: skip


def of_parts(wrapper=lambda env: env):
    """DARD of an environment whose observations have parts."""
    env = wrapper(Shows(*SHOWN["a tuple with a float"]))
    transitions = Transitions.from_episodes(
        collect(env, Acting.of(lambda seen: int(np.sum(seen[0])) % 2, env), 3, max_episode_steps=9)
    )

    def pays(observations, actions, following):
        return following[:, 0] + actions

    return sampled_dard(pays, lambda *step: pays(*step) ** 2, transitions, gamma=0.9, actions=np.arange(2),
                        model=lambda here, *_: (here, np.zeros(len(here), bool)), rng=np.random.default_rng(0))  # fmt: skip


def coverage(make, model=ENDING):
    weights = np.ones((8, 3))
    return epic(model.mdp, *rewards_of(model), coverage=None if make is None else make(weights))


def first_parts(batch, actions=2, **more):
    return Transitions(batch, np.zeros(actions, int), np.arange(actions), **more)


def within_four_steps(states):
    D_S = None if states is None else states / states.sum()
    return epic(LATER, R_LATER, 2 * R_LATER, states=D_S)


def following_itself(model):
    P = model.P.copy()
    P[model.mdp.terminal] = np.eye(8)[model.mdp.terminal][:, None]
    return TabularMDP.from_dense(P, 0.9, model.mdp.d0)


def pearson(groups):
    return sampled_pearson(function(R), function(S), first_parts(np.arange(8), 8, groups=groups), None)


AGENT = SimpleNamespace(predict=lambda observations: (np.zeros(len(observations), int), None))
ACTING = ~ENDING.mdp.terminal[:, None]
EVEN = ACTING / (ACTING.sum() * 3) * np.ones((8, 3))
CASES = [
    ("Let it follow itself.",
     lambda: epic_bound(ENDING.mdp, *rewards_of(ENDING)),
     lambda: epic_bound(following_itself(ENDING), *rewards_of(ENDING))),
    ("The reward is zero, constant or only a potential, or the coverage too narrow. Of rewards in a table, `starc` has a place "
     "for it.",
     lambda: epic(CONTINUING.mdp, R, 0 * R), lambda: starc(CONTINUING.mdp, R, 0 * R) > 0),
    ("Pass states=None for uniform over all.",
     lambda: within_four_steps(LATER.terminal == 0), lambda: within_four_steps(None) < 1e-7),
    ("Give weight to states that act,", lambda: coverage(np.zeros_like), lambda: coverage(lambda weights: EVEN) > 0),
    ("or pass None for all of them.", lambda: coverage(np.zeros_like), lambda: coverage(None) > 0),
    ("Pass None for uniform over the others.", lambda: coverage(lambda weights: weights / 24), lambda: coverage(None) > 0),
    ("Divide by the sum.",
     lambda: coverage(lambda weights: weights, CONTINUING),
     lambda: coverage(lambda weights: weights / weights.sum(), CONTINUING) > 0),
    ("The reward is constant or only a potential, or drowned in the noise of the draws. Raise `replicates`,",
     lambda: dard(R, S, 2, 2), lambda: dard(R, S, 2, 300)),
    ("or the number of transitions.", lambda: dard(R, S, 2, 2), lambda: dard(R, S, 1000, 2)),
    ("Give more episodes;", lambda: pearson(np.zeros(8)), lambda: pearson(np.arange(8) // 4)),
    ("or, without it, groups=None for transitions in order.", lambda: pearson(np.zeros(8)), lambda: pearson(None)),
    ("pass its `.reward`.",
     lambda: epic(MODEL.mdp, LEARNED, LEARNED), lambda: epic(MODEL.mdp, LEARNED.reward, LEARNED.reward) < 1e-6),
    ("Pass `reward.tabular(states)`.",
     lambda: epic(MODEL.mdp, LinearReward(np.arange(5), OneHot(5)), MODEL.R),
     lambda: epic(MODEL.mdp, LinearReward(np.arange(5), OneHot(5)).tabular(StateIndex(spaces.Discrete(5))), MODEL.R) > 0),
    ("Of SB3's predict take the first part: `lambda observations, rng: agent.predict(observations)[0]`.",
     lambda: played(lambda observations, rng: AGENT.predict(observations)),
     lambda: played(eval(mends(told(played, lambda observations, rng: AGENT.predict(observations)))[0], {"agent": AGENT}))),
    ("Flatten them, for example with `gymnasium.wrappers.FlattenObservation`.", of_parts, lambda: of_parts(FlattenObservation)),
    ("Of shape (2, 1) it is `terminated.ravel()`.",
     lambda: first_parts(np.zeros(2), terminated=np.zeros((2, 1))),
     lambda: first_parts(np.zeros(2), terminated=np.zeros((2, 1)).ravel())),
    ("Stack a list with `np.array`.", lambda: first_parts([0, 1]), lambda: first_parts(np.array([0, 1]))),
]  # fmt: skip


@pytest.mark.parametrize(("says", "breaks", "mended"), CASES, ids=[one[0] for one in CASES])
def test_a_mend_that_an_error_about_distances_names_serves(says, breaks, mended):
    assert says in told(breaks) and mended()


def test_every_mend_that_an_error_about_distances_names_is_executed():
    root = Path(irl_gym.__file__).parent
    assert not unsaid(CASES, *[one.relative_to(root) for one in (root / "judging/distances").rglob("*.py")])
