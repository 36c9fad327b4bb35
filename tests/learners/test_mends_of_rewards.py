"""The mends that errors of learners and of sets of rewards name are executed, and serve."""

import os
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from mended import told, unsaid
from models import random_model, ring
from patients import partly_contradicted

import irl_gym
from irl_gym.agents.experts import Acting
from irl_gym.demonstrations.imports import from_arrays
from irl_gym.environments.generative import GenerativeModel
from irl_gym.errors import RunConflict
from irl_gym.features.bases import RadialBasis
from irl_gym.features.feature_maps import Functions, OneHot
from irl_gym.judging.ambiguity.lambda_path import lambda_path
from irl_gym.judging.ambiguity.uniqueness import optimal_face
from irl_gym.judging.ambiguity.widths import feasible_widths
from irl_gym.learners.cloning.clone import Clone
from irl_gym.learners.cloning.softmax import SoftmaxClone
from irl_gym.learners.interactive.dagger import DAgger
from irl_gym.learners.linear_programs.estimates import usable
from irl_gym.learners.linear_programs.feature import FeatureLP
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.learners.problem import Oracle, Problem, Spaces
from irl_gym.learners.registry import learner_class
from irl_gym.mdp.episodes import Episode
from irl_gym.mdp.optimality import certify
from irl_gym.mdp.planning.dynamic_programming import policy_iteration
from irl_gym.mdp.policies import TabularPolicy
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.programs.deadline import Deadline
from irl_gym.programs.killable import called, within
from irl_gym.spaces.states import StateIndex
from irl_gym.tables.tabulate import tabulate

pytestmark = pytest.mark.usefixtures("unchecked")
MODEL, SAME, SWAPPING = random_model(1, S=5), ring([[1, 1], [0, 0]]), ring([[1, 0], [0, 1]])
WALLS, FIRST = ring([[1, 1, 0], [1, 1, 0]]), np.array([0, 0])
PARTLY = np.where(np.arange(5)[:, None] > 2, np.nan, np.eye(3)[MODEL.expert])
HALF = np.array([[1.0, 0.0], [np.nan, np.nan]])
CONTRADICTED, NEAR = partly_contradicted(), Functions(lambda x: (x[:, :1] < 0.2).astype(float), 1)
UNKNOWN_LAST = np.array([[1.0, 0.0]] * 4 + [[np.nan] * 2])
STEPS = {"reward_on": "state-action"}
ONCE = np.outer(np.arange(5) < 2, np.arange(3.0))


def fit(mdp=MODEL.mdp, expert=MODEL.expert, visits=None, **how):
    return FiniteLP(**how).fit(mdp, expert, visits=visits)


def to_and_fro(**how):
    """Between two states, to stay at last."""
    return FiniteLP(horizon=3, **how).fit(ring([[0, 1], [1, 0]]), np.array([[0, 1], [1, 0], [0, 1]]))


def with_the_time_shown():
    table = tabulate(gymnasium.wrappers.TimeAwareObservation(gymnasium.make("FrozenLake-v1", max_episode_steps=7)), gamma=1.0)
    return FiniteLP(horizon=None).learn(Problem.of(table, expert=policy_iteration(table.mdp, table.reward).policy))


def on_features(features, S_0, mdp, expert):
    return FeatureLP(features, S_0=S_0).fit(mdp, expert)


def clone(counts, **how):
    return Clone(**how).fit(counts, MODEL.mdp)


def softmax(**how):
    return SoftmaxClone(np.eye(5), **how).fit(ONCE)


def interactive(**how):
    lake, oracle = gymnasium.make("FrozenLake-v1"), Oracle(lambda seen, info: 1)
    here = Spaces(lake.observation_space, lake.action_space)
    known = Problem(here, oracle=oracle, dynamics=GenerativeModel(lake, 0.9))
    return DAgger(rounds=2, **how).learn(known, np.random.default_rng(0))


def broken_off(asked):
    return usable([Episode(np.arange(4), np.zeros(3, int), np.zeros(3), False, True)] * 2, asked, 5)


def on_model(features, S_0=5):
    env = gymnasium.make("irl_gym_envs:irl_gym/ContinuousGridWorld-v0")
    upwards = Acting.of(lambda seen: int(seen[0] <= seen[1]), env)
    return FeatureLP(features, S_0=S_0, horizon=3, samples=4).fit(GenerativeModel(env, 0.9), upwards)


def one_step(**more):
    return usable(from_arrays([0, 4], [1, 1], lengths=[1, 1], space=spaces.Discrete(16), n_actions=4, **more), 5, None)


def widths(**how):
    return feasible_widths(MODEL.mdp, MODEL.expert, **how)


def path(expert=MODEL.expert, **how):
    return lambda_path(MODEL.mdp, expert, **how)


def hurried(limit):
    Deadline.after(limit).check()
    return True


def in_child(limit, code):
    with within(Deadline.after(limit)):
        return code is None or called(1e18, os._exit, code)


AGAINST = dict(enumerate(-MODEL.R))
AT_ONE, FEW = {3: 1.0}, {s: AGAINST[s] for s in range(3)}
HUGE = -1e308 * MODEL.R / np.abs(MODEL.R).max()
ASIDE = TabularMDP.from_dense(
    np.array([[[0, 0, 1], [1, 0, 0]], [[0, 0, 1], [1, 0, 0]], [[0, 0, 0], [0, 0, 0]]]) * 1.0, 0.9, np.eye(3)[0]
)
CASES = [
    # problems and names
    ("A table of actions is one as `TabularPolicy(actions, states)`.", lambda: Oracle(MODEL.expert),
     lambda: Oracle(TabularPolicy(np.eye(3)[MODEL.expert], StateIndex(spaces.Discrete(5))))),
    ("Make its parts with the same.",
     lambda: Problem.of(MODEL.mdp, gamma=MODEL.mdp.gamma / 2), lambda: Problem.of(MODEL.mdp, gamma=MODEL.mdp.gamma)),
    ("Run irl-gym in the folder that has it, or install it.",
     lambda: learner_class("nowhere_to_be_found:Dice"), lambda: learner_class("own_learners:Dice")),
    # learners
    ("Give the next observations when they are imported.",
     one_step, lambda: one_step(next_observations=[4, 8])),
    ("Ask for a shorter horizon, such as 3.", lambda: broken_off(asked=5), lambda: broken_off(asked=3)),
    ("Or use labels='own'.", lambda: interactive(episodes=2, labels="gated"),
     lambda: interactive(episodes=2, labels="own").proof.queries),
    ("Or use cost='mistakes'.", lambda: interactive(episodes=2, cost="advantage"),
     lambda: interactive(episodes=2, cost="mistakes").proof.queries),
    ("Give `episodes`, such as 20.", interactive, lambda: interactive(episodes=20).proof.queries),
    ("Choose a larger S_0.",
     lambda: on_features(OneHot(2), [1], ring([[1, 0], [0, 0]]), FIRST),
     lambda: on_features(OneHot(2), None, ring([[1, 0], [0, 0]]), FIRST)),
    ("Choose a larger S_0 or other features.",
     lambda: on_model(NEAR, [[0.9, 0.9]]),
     lambda: on_model(NEAR, 40) and on_model(RadialBasis.grid([0, 0], [1, 1], 2))),
    ("Where nothing is known, the expert's row is NaN.",
     lambda: fit(visits=[1, 1, 1, 0, 0]), lambda: fit(expert=PARTLY, visits=[1, 1, 1, 0, 0])),
    ('Use margin_cap="auto", which leaves such rows out.',
     lambda: fit(WALLS, FIRST, margin_cap=None), lambda: fit(WALLS, FIRST, margin_cap="auto")),
    ('every reward on states makes it optimal. Use reward_on="state-action".',
     lambda: fit(SAME, FIRST), lambda: fit(SAME, FIRST, **STEPS)),
    ('Is the policy optimal for any reward at all? Use reward_on="state-action".',
     lambda: fit(SWAPPING, FIRST), lambda: fit(SWAPPING, FIRST, **STEPS)),
    ('every reward makes it optimal. Use reward_on="state-action".',
     lambda: fit(SAME, HALF), lambda: fit(SAME, HALF, **STEPS)),
    ("Use stationary=False; or leave out the horizon.",
     lambda: fit(expert=PARTLY, horizon=3),
     lambda: fit(expert=PARTLY, horizon=3, stationary=False) and fit(expert=PARTLY)),
    ("Use stationary=False.", lambda: to_and_fro(), lambda: to_and_fro(stationary=False)),
    ("Call `FiniteLP.fit`; or have the time shown, with `gymnasium.wrappers.TimeAwareObservation(env)` and horizon=None.",
     lambda: FiniteLP(horizon=3, stationary=False).learn(Problem.of(MODEL.mdp, expert=MODEL.expert)),
     lambda: fit(horizon=3, stationary=False) and with_the_time_shown()),
    ("More demonstrations may tell.",
     lambda: fit(CONTRADICTED, UNKNOWN_LAST), lambda: fit(CONTRADICTED, np.zeros(5, int))),
    ('Use reward_on="state-action".',
     lambda: fit(CONTRADICTED, UNKNOWN_LAST), lambda: fit(CONTRADICTED, UNKNOWN_LAST, **STEPS)),
    ('expected unvisited="free", or l1 as a number.',
     lambda: fit(expert=PARTLY, l1="auto"),
     lambda: fit(expert=PARTLY, l1="auto", unvisited="free") and fit(expert=PARTLY, l1=0.01)),
    # clones
    ("Record more episodes, or use unseen='uniform' or unseen='nearest'.",
     lambda: clone(ONCE, unseen="refuse"),
     lambda: clone(np.ones((5, 3)), unseen="refuse") and clone(ONCE, unseen="uniform") and clone(ONCE, unseen="nearest")),
    ("Give `tabulate(env, gamma=...).mdp`, or use unseen='uniform'.",
     lambda: Clone(unseen="nearest").fit(ONCE), lambda: clone(ONCE, unseen="nearest") and Clone(unseen="uniform").fit(ONCE)),
    ("Raise l2, or raise max_iterations.",
     lambda: softmax(l2=1e-3, max_iterations=3),
     lambda: softmax(l2=10.0, max_iterations=3) and softmax(l2=1e-3, max_iterations=300)),
    # time
    ("raise time_limit, or choose the other solver, of a linear program.", lambda: hurried(1e-9), lambda: hurried(60.0)),
    ("raise time_limit, or give most_pieces.", lambda: path(time_limit=1e-9), lambda: path(time_limit=60.0, most_pieces=2)),
    ("Is there enough memory? Without time_limit the first solver works in this process, and is not ended.",
     lambda: in_child(60.0, 3), lambda: in_child(None, None)),
    # sets of rewards
    ("For one that is not the program is another, without a path here: use FiniteLP(l1=...) at a few prices.",
     lambda: path(PARTLY), lambda: [fit(expert=PARTLY, l1=l1) for l1 in (0.01, 0.1)]),
    ("`feasible_widths` takes such an expert.",
     lambda: optimal_face(MODEL.mdp, PARTLY), lambda: feasible_widths(MODEL.mdp, PARTLY)),
    ("Use margin=None,",
     lambda: widths(pinned=dict.fromkeys(range(5), 0.5)), lambda: widths(pinned=dict.fromkeys(range(5), 0.5), margin=None)),
    ("leave a pin out,", lambda: widths(pinned=dict.fromkeys(range(5), 0.5)), lambda: widths(pinned={0: 0.5})),
    ("or raise r_max.", lambda: widths(pinned=AT_ONE), lambda: widths(pinned=AT_ONE, r_max=100)),
    ("Leave a pin out,", lambda: widths(pinned=AGAINST, margin=None), lambda: widths(pinned={0: 1.0}, margin=None)),
    ("or raise r_max.", lambda: widths(pinned=FEW, margin=None), lambda: widths(pinned=FEW, margin=None, r_max=100)),
    ("Lower it,", lambda: widths(margin=0.9), lambda: widths(margin=1e-3)),
    ("or raise r_max.", lambda: widths(margin=0.9), lambda: widths(margin=0.9, r_max=1e3)),
    ("Raise r_max.", lambda: widths(pinned={0: 2.0}), lambda: widths(pinned={0: 2.0}, r_max=4.0, margin=None)),
    ("no policy reaches state 1, so its reward is free. Drop it.",
     lambda: feasible_widths(ASIDE, np.zeros(3, int), pinned={1: 0.5}), lambda: feasible_widths(ASIDE, np.zeros(3, int))),
    ("state 2 is terminal, no step is taken there. Drop it.",
     lambda: feasible_widths(ASIDE, np.zeros(3, int), pinned={(2, 0): 0.5}, **STEPS),
     lambda: feasible_widths(ASIDE, np.zeros(3, int), **STEPS)),
    ("values overflow. Scale it.", lambda: policy_iteration(MODEL.mdp, np.full((5, 3), 1e308)),
     lambda: policy_iteration(MODEL.mdp, np.ones((5, 3)))),
    ("`Problem.of(table, ...)` takes the table's own.",
     lambda: Problem(Spaces(spaces.Discrete(9), spaces.Discrete(3)), dynamics=MODEL.mdp), lambda: Problem.of(MODEL.mdp)),
    ("Divide it by its largest number: the answer is the same, in other units.",
     lambda: certify(MODEL.mdp, MODEL.expert, HUGE), lambda: certify(MODEL.mdp, MODEL.expert, HUGE / np.abs(HUGE).max())),
]  # fmt: skip


@pytest.mark.parametrize(("says", "breaks", "mended"), CASES, ids=[one[0] for one in CASES])
def test_a_mend_that_an_error_about_rewards_names_serves(says, breaks, mended):
    assert says in told(breaks) and mended()


def test_every_mend_that_an_error_about_rewards_names_is_executed():
    root = Path(irl_gym.__file__).parent
    files = [one.relative_to(root) for folder in ("learners", "judging/ambiguity") for one in (root / folder).rglob("*.py")]
    assert not unsaid(CASES, *files, "killable.py", "warm_lp.py", "linear_program.py", "solvers.py", "deadline.py", "howard.py")


def test_answers_to_other_questions_are_left_where_they_are_or_deleted(tmp_path):
    def asked(folder, seed=0):
        known = Problem.of(MODEL.mdp, oracle=Oracle(lambda row, info: 0))
        return DAgger(rounds=1, episodes=3, max_episode_steps=5).learn(known, np.random.default_rng(seed), tmp_path / folder)

    asked("one")
    (tmp_path / "one/answers.txt").write_text("ask 0123456789abcdef 0\n")
    with pytest.raises(RunConflict, match=r"Choose another folder, or delete it, and all is asked anew."):
        asked("one")
    found = asked("another").proof.queries
    (tmp_path / "one/answers.txt").unlink()
    assert asked("one").proof.queries == found
