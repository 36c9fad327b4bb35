"""A finding of the doctor may have several mends, one for each reason: each is said, executed, and serves."""

from dataclasses import replace
from functools import cache

import gymnasium
import numpy as np
import pytest
from chain_world import Chain
from enumeration_envs import Slippery
from models import paper_grid, ring
from patients import check_mends, contradicted, corridor, judged, partly_contradicted

from irl_gym.features.feature_maps import OneHot, Table
from irl_gym.judging.diagnoses import case
from irl_gym.judging.diagnoses.case import Case
from irl_gym.judging.diagnoses.doctor import diagnose, doctor
from irl_gym.learners.linear_programs.feature import FeatureLP
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.learners.linear_programs.trajectory import TrajectoryLP
from irl_gym.mdp.planning.dynamic_programming import optimum, policy_iteration
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.tables.counted.counting import Interaction
from irl_gym.tables.tabulate import tabulate

LAKE = tabulate(gymnasium.make("FrozenLake-v1", desc=["SFF", "HFG"]), gamma=0.99, check_steps=0)
LAKE_EXPERT = policy_iteration(LAKE.mdp, LAKE.reward).policy
GRID = paper_grid()
GRID_SET = optimum(GRID.mdp, TabularReward(GRID.R)).tied()
PARTLY, AGAINST, FIRST = partly_contradicted(), contradicted(), np.zeros(5, dtype=int)
BOTH = np.array([[1, 1], [1, 0], [1, 0], [1, 1], [1, 0]], dtype=bool)
FORK = TabularMDP.from_dense(np.eye(4)[np.array([[1, 2, 3], [1, 1, 1], [2, 2, 2], [3, 3, 3]])], 0.9, np.eye(4)[0])
RANDOM = np.random.default_rng(0).normal(size=(25, 5))


def lake(learner, expert=LAKE_EXPERT, reward=None):
    """What is said of what is learned on a lake of six cells; or of a reward that another learner found."""
    found = learner.fit(LAKE.mdp, expert)
    return doctor(found if reward is None else reward_of(found, reward), LAKE.mdp, expert, true=LAKE.reward)


def reward_of(found, learner):
    return replace(found, reward=learner.fit(LAKE.mdp, LAKE_EXPERT).reward)


def grid(learner, expert=GRID.expert, **known):
    found = None if learner is None else learner.fit(GRID.mdp, expert)
    return doctor(found, GRID.mdp, expert, **known)


def of(mdp, learner, expert=FIRST, visits=None, **known):
    expert = expert[: mdp.n_states]
    found = learner.fit(mdp, expert) if visits is None else learner.fit(mdp, expert, visits=np.array(visits, float))
    return doctor(found, mdp, expert, **known)


def by_hand(mdp, R, expert=FIRST, **known):
    return doctor(judged(mdp, expert[: mdp.n_states], R), mdp, expert[: mdp.n_states], **known)


def unsolved(say):
    """What is said where no program is solved again, as of a table that is too large."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(case, "SMALL", 0)
        return say()


def seen(unknown=(), wrong=None):
    """(S, A) what episodes on the lake showed of its expert: nothing in some states, and a wrong action in one."""
    policy = np.eye(4)[LAKE_EXPERT]
    policy[list(unknown)] = np.nan
    if wrong is not None:
        policy[wrong] = np.eye(4)[0]
    return policy


@cache
def sampled(features):
    """What is said of a reward on these features that trajectories taught, with the table that they were drawn from."""
    world = Chain(1)
    expert = world.policy(world.model.R).probabilities.argmax(axis=1)
    found = TrajectoryLP(features, trajectories=200, max_rounds=12).fit(world, world.expert(100))
    return doctor(found, world.model.mdp, expert, true=world.model.R, states=world.states)


def counted(learner, steps):
    table = tabulate(Slippery(), gamma=0.9, by=Interaction(steps), check_steps=0)
    expert = policy_iteration(table.mdp, table.reward).policy
    return doctor(learner.fit(table.mdp, expert), table.mdp, expert, true=table.reward)


def shown(episodes, half):
    """What is said of an expert whose value is the mean of so many episodes."""
    known = {"episodes": episodes, "low": 1 - half, "high": 1 + half}
    rows = {"expert": {"value": 1.0}, "random": {"value": 0.0}}
    return diagnose(Case(judged={"expert_value": known, "policies": rows}, claims={"gaps": []}))


POOR = Table(np.random.default_rng(2).normal(size=(8, 2)))
SAME, PAID = ring([[1, 1, 0], [2, 2, 1], [2, 2, 0]]), np.eye(3)[[0, 0, 0]]
MIXING = np.eye(5)[np.array([[1, 2], [3, 4], [3, 4], [3, 3], [4, 4]])]
MIXING[3:] = 0
MIXING, MIXED = TabularMDP.from_dense(MIXING, 0.9, np.eye(5)[0]), np.eye(2)[[0, 0, 0, 0, 0]]
MIXED[0] = [0.98, 0.02]
RIGHT, FREE = np.ones(12, dtype=int), FiniteLP(unvisited="free")
ON_STEPS, PAPER, OWN = FiniteLP(reward_on="state-action"), FiniteLP(margin_cap=None), FiniteLP()
CASES = [
    ("avoidable-ties", 'margin_cap="auto"; if it stays, more or other features, or FiniteLP.',
     lambda: lake(FeatureLP(np.eye(6), margin_cap=None)), lambda: lake(FeatureLP(np.eye(6), margin_cap="auto"))),
    ("avoidable-ties", "More or other features, or FiniteLP, where the table is small enough.",
     lambda: of(FORK, FeatureLP(np.eye(4)[:, 3:], margin_cap="auto")),
     lambda: of(FORK, FeatureLP(np.eye(4), margin_cap="auto")), lambda: of(FORK, OWN)),
    ("avoidable-ties",
     "Learn it again: solved here with the same settings, the expert has a margin over some of these actions.",
     lambda: lake(OWN, reward=PAPER), lambda: lake(OWN)),
    ("avoidable-ties", 'margin_cap="auto" with l1=0.0; reward_on="state-action" where that leaves ties.',
     lambda: unsolved(lambda: lake(PAPER)), lambda: lake(OWN)),
    ("unbreakable-ties", "or give the expert as the (S, A) set of its optimal actions, if both are as good.",
     lambda: of(PARTLY, OWN), lambda: of(PARTLY, OWN, BOTH)),
    ("expert-not-optimal", "If they are not, a larger slack, such as 100, or more episodes there.",
     lambda: of(PARTLY, FiniteLP(slack=10.0), visits=[99, 99, 99, 1, 99]),
     lambda: of(PARTLY, FiniteLP(slack=100.0), visits=[99, 99, 99, 1, 99]),
     lambda: of(PARTLY, FiniteLP(slack=10.0), visits=[99, 99, 99, 99, 99])),
    ("expert-not-optimal", 'reward_on="state-action"; or slack=10.0, if the expert errs.',
     lambda: by_hand(AGAINST, [0, 0.1, 0.2, 0.3]), lambda: of(AGAINST, ON_STEPS)),
    ("expert-not-optimal", 'margin_cap="auto"; if it stays, more or other features, a larger S_0, or FiniteLP.',
     lambda: grid(FeatureLP(np.eye(25))), lambda: grid(FeatureLP(np.eye(25), margin_cap="auto")), lambda: grid(OWN)),
    ("expert-not-optimal", "More or other features; a larger S_0; or FiniteLP, where the table is small enough.",
     lambda: grid(FeatureLP(RANDOM, S_0=3, margin_cap="auto")),
     lambda: grid(FeatureLP(np.eye(25), S_0=25, margin_cap="auto")), lambda: grid(OWN)),
    ("zero-weights", "Give features that differ between what follows the expert's actions and what follows others.",
     lambda: grid(FeatureLP(RANDOM[:, :1])), lambda: grid(FeatureLP(np.eye(25)))),
    ("zero-weights", "l1=0.0 first; then raise it slowly.",
     lambda: grid(FeatureLP(np.eye(25), l1=1e3)),
     lambda: grid(FeatureLP(np.eye(25), l1=0.0)), lambda: grid(FeatureLP(np.eye(25), l1=0.1))),
    ("inexpressible", "More or other features, one a state (OneHot) where the table is small; or FiniteLP, which needs none.",
     lambda: grid(FeatureLP(RANDOM[:, :2])), lambda: grid(FeatureLP(np.eye(25))), lambda: grid(OWN)),
    ("lambda-above-lambda-0", 'Or l1="auto", just below lambda_0, or a number below',
     lambda: grid(FiniteLP(l1=5.0)), lambda: grid(FiniteLP(l1="auto")), lambda: grid(FiniteLP(l1=0.9))),
    ("nothing-to-compare", "A world in which to choose.",
     lambda: doctor(None, ring([[1], [0]]), np.array([0, 0])), lambda: grid(OWN)),
    ("nothing-to-compare", "Give the actions that it prefers: `most_frequent(empirical_policy(...))` for an expert that errs, "
     "or the (S, A) set of optimal actions.",
     lambda: grid(None, np.ones((25, 4), bool)), lambda: grid(OWN), lambda: grid(OWN, GRID_SET)),
    ("no-reward", "Run the learner; if it stopped, read its error: a time_limit, or rows that contradict each other.",
     lambda: grid(None), lambda: grid(OWN)),
    ("zero-reward", "Learn it again.",
     lambda: unsolved(lambda: by_hand(GRID.mdp, np.zeros(25), GRID.expert)), lambda: grid(OWN)),
    ("worst-tie", 'reward_on="state-action": a reward on states does not prefer the expert\'s actions there.',
     lambda: of(PARTLY, OWN, true=np.eye(5)[1]), lambda: of(PARTLY, ON_STEPS, true=np.eye(5)[1])),
    ("worst-tie", 'reward_on="state-action": some of these actions have the successors of the expert\'s own.',
     lambda: of(SAME, OWN, true=PAID), lambda: of(SAME, ON_STEPS, true=PAID)),
    ("worst-tie", "More episodes: in some of these states nothing is known of the expert.",
     lambda: lake(OWN, seen(unknown=[0])), lambda: lake(OWN, seen())),
    ("worst-tie", "More rounds or features, so that these actions lead to other features than the expert's.",
     lambda: sampled(POOR), lambda: sampled(OneHot(8))),
    ("strays", "More rounds, or features that tell these states from those that the expert visits.",
     lambda: sampled(POOR), lambda: sampled(OneHot(8))),
    ("expert-beaten", "or richer features; if the expert errs, nothing.", lambda: sampled(POOR), lambda: sampled(OneHot(8))),
    ("strays", 'unvisited="avoid", and more episodes of the expert.',
     lambda: lake(FREE, seen(unknown=[0, 1])), lambda: lake(OWN, seen(unknown=[1]))),
    ("strays", "More episodes of the expert.", lambda: lake(OWN, seen(unknown=[0, 1])), lambda: lake(OWN, seen())),
    ("unvisited-states", "More episodes; more start_seeds, or starts elsewhere; or an expert with some noise (epsilon), that "
     "strays.", lambda: lake(OWN, seen(unknown=[1])), lambda: lake(OWN, seen())),
    ("expert-suboptimal", "Give the actions that it prefers: `most_frequent(empirical_policy(...))` for an expert that errs.",
     lambda: by_hand(MIXING, [0, 0.5, 0.5, 1, 0], MIXED, true=np.eye(5)[1]),
     lambda: by_hand(MIXING, [0, 0.5, 0.5, 1, 0], MIXED.argmax(axis=1), true=np.eye(5)[1])),
    ("expert-suboptimal", "More episodes, in which its own actions are the most frequent; less noise (epsilon); or leave out "
     "its bad episodes.", lambda: lake(FiniteLP(slack=1.0), seen(unknown=[4], wrong=1)),
     lambda: lake(FiniteLP(slack=1.0), seen(unknown=[4]))),
    ("expert-worse-than-random", "A better expert: plan for the true reward, train longer, or drop its bad episodes.",
     lambda: grid(OWN, policy_iteration(GRID.mdp, -GRID.step_reward).policy, true=GRID.R),
     lambda: grid(OWN, true=GRID.R)),
    ("few-episodes", "More episodes of the expert: about 26, if more are like these.",
     lambda: shown(2, 0.9), lambda: shown(26, 0.2)),
    ("gamma-near-one", "A smaller gamma, or larger margins.",
     lambda: by_hand(corridor(12, 0.999999), np.eye(12)[11], RIGHT), lambda: by_hand(corridor(12, 0.9), np.eye(12)[11], RIGHT),
     lambda: by_hand(corridor(12, 0.999999), np.eye(12)[11] - 1, RIGHT)),
    ("same-successors", 'reward_on="state-action"; more steps to count, where they do lead elsewhere.',
     lambda: counted(OWN, 200), lambda: counted(ON_STEPS, 200), lambda: counted(OWN, 1_000)),
]  # fmt: skip
ELSEWHERE = [
    "Give the statistics of its observations, the file that VecNormalize's `save` wrote; or an expert of this environment.",
    # ../test_normalised_experts.py: test_an_export_shows_its_expert_what_its_training_showed
    "Import them again with last='keep', the default; or with next observations, where the log has them.",
    # ../test_last_actions.py: test_a_log_of_taxi_without_next_observations_teaches_the_drop_off
    "If the task ends, let the environment say `terminated` there. If it goes on, ",
    "Retrain on ExpectedAdvantage(clip=",  # both in test_values.py
]


@pytest.mark.parametrize(
    ("name", "says", "ill", "mended"), [(*one[:3], one[3:]) for one in CASES], ids=[one[1] for one in CASES]
)
def test_a_mend_that_a_finding_names_serves(name, says, ill, mended):
    check_mends(name, says, ill, mended)
