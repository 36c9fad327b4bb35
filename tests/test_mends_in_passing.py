"""Mends that are named in passing, after a colon, in a warning or as the status of a program, are executed, and serve."""

import cvxpy as cp
import gymnasium as gym
import numpy as np
import pytest
import scipy.sparse as sp
from enumeration_envs import Corridor
from gymnasium import spaces
from gymnasium.wrappers import TransformAction
from mended import GAMMA, told
from models import paper_grid

from irl_gym.agents.experts import Acting
from irl_gym.demonstrations.datasets import load_minari, minari_root, write_minari
from irl_gym.demonstrations.endings import in_table
from irl_gym.demonstrations.imports import from_arrays
from irl_gym.environments.learned_reward import LearnedReward
from irl_gym.environments.reveal import Reveal
from irl_gym.features.bases import RadialBasis
from irl_gym.features.feature_maps import OneHot
from irl_gym.features.linear_reward import LinearReward
from irl_gym.judging.distances import Transitions
from irl_gym.learners.linear_programs.feature import FeatureLP
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.mdp.episodes import collect
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.programs import solvers
from irl_gym.programs.deadline import Deadline
from irl_gym.programs.solvers import Solving, solve
from irl_gym.programs.warm_lp import WarmLP
from irl_gym.runs.named_parts import environment_of, features_named
from irl_gym.tables.counted.counting import Interaction
from irl_gym.tables.draws.exact_draws import Draws
from irl_gym.tables.enumeration.table import Enumeration
from irl_gym.tables.tabulate import tabulate

pytestmark = pytest.mark.usefixtures("unchecked")
LAKE = gym.make("FrozenLake-v1", is_slippery=False)
TABLE = tabulate(LAKE, gamma=GAMMA, check_steps=0)
DOWN = Acting.of(lambda seen: 1, LAKE)
GRID = paper_grid()
FORK = TabularMDP.from_dense(np.eye(4)[np.array([[1, 2, 3], [1, 1, 1], [2, 2, 2], [3, 3, 3]])], GAMMA, np.eye(4)[0])
RANDOM = np.random.default_rng(0).normal(size=(25, 2))


# --- environments that hide something ---


class Flipped(Corridor):
    """Each episode draws which way is right, and shows nothing of it."""

    flip = 0

    def reset(self, *, seed=None, options=None):
        result = super().reset(seed=seed)
        self.flip = int(self.np_random.integers(2))
        return result

    def step(self, action):
        return self.moved(int(action) ^ self.flip)


LINES = {s: {a: [(1.0, t, t == 6, t == 6)] for a, t in enumerate((max(0, s - 1), min(6, s + 1)))} for s in range(7)}


class Published(Flipped):
    """And publishes a table in which right is right."""

    initial_state_distrib, P = np.eye(7)[3], LINES


def counted(env):
    return "; ".join(tabulate(env, gamma=GAMMA, by=Interaction(800)).evidence.errors().values())


# --- datasets ---


class Two(Corridor):
    """Does every action twice."""

    def step(self, action):
        self.moved(int(action))
        return self.moved(int(action))


class Watched(gym.Wrapper, gym.utils.RecordConstructorArgs):
    """A wrapper that nobody knows."""

    def __init__(self, env):
        gym.utils.RecordConstructorArgs.__init__(self)
        super().__init__(env)


def register():
    if "Two-v0" not in gym.registry:
        gym.register("Two-v0", entry_point=Two, max_episode_steps=9)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A folder with a dataset of this environment, and one of it with that wrapper."""
    register()
    path = tmp_path_factory.mktemp("written")
    for name, wrap in (("two", lambda env: env), ("watched", Watched)):
        env = wrap(gym.make("Two-v0"))
        write_minari(collect(env, Acting.of(lambda seen: 1, env), 2), f"me/{name}-v0", env, root=path, algorithm="x")
    return path


@pytest.fixture
def root(written):
    """The same, in whose environment nobody is at home."""
    gym.registry.pop("Two-v0", None)
    yield written
    gym.registry.pop("Two-v0", None)


def recorded(root, name="two", **how):
    return environment_of(None, {}, f"me/{name}-v0", str(root), **how)


def recorded_here(root, *given, **how):
    register()
    return recorded(root, *given, **how)


def opened(root):
    with minari_root(root):  # which sets MINARI_DATASETS_PATH
        return load_minari("me/two-v0")


# --- others ---


def imported(last):
    """Steps to the goal, with a row in it."""
    made = from_arrays([0, 1, 2, 6, 10, 14, 15], [2, 2, 1, 1, 1, 2, 0], lengths=[7], env=LAKE, last=last)
    return list(in_table(made, TABLE.mdp, TABLE.states, "refuse"))


def dropping(**how):
    return from_arrays([0, 4, 0, 4], [1, 1, 1, 1], lengths=[2, 2], env=LAKE, **how)


def outcomes(call, most=20_000):
    draws = Draws(most)
    rng = draws.twin(np.random.default_rng())
    return sum(1 for _ in draws.outcomes(lambda: call(rng)))


class Drawing(Corridor):
    """Draws each step in a way that cannot be listed."""

    def step(self, action):
        return self.moved(int(action) if self.np_random.poisson() < 1 else 1 - int(action))


def scaled(by):
    x = cp.Variable(2, nonneg=True)
    weights = by * np.array([[2.0, 1.0], [1.0, 3.0]])
    return solve(cp.Problem(cp.Minimize(cp.sum(x)), [weights @ x >= by * np.array([4.0, 6.0])]), rows=2)


def twice(solving):
    """A program that the first solver gives up, and whose second has no time of its own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(solvers._SOLVERS["clarabel"].options, "max_iter", 1)
        for name in ("SECOND_SECONDS", "SECOND_SHARE"):
            patch.setattr(solvers, name, 1e-9)
        x = cp.Variable(2, nonneg=True)
        return solve(cp.Problem(cp.Minimize(cp.sum(x)), [cp.sum(x) >= 1]), rows=2, solving=solving)


def warm(seconds, n=30):
    A = sp.csr_array(np.random.default_rng(0).normal(size=(n, n)))
    bounds = np.full(n, -1.0), np.full(n, 1.0)
    return WarmLP(A, *bounds, *bounds, deadline=Deadline.after(seconds)).minimise(np.ones(n))


def stepped(first):
    env = LearnedReward(LAKE, np.zeros(16))
    first(env)
    return env.step(0)


def linear(path):
    LinearReward(np.ones(1), OneHot(1)).save(path / "linear.npz")
    return path / "linear.npz"


def kept(path):
    TabularReward(np.zeros(3)).save(path / "reward.npz")
    return TabularReward.load(path / "reward.npz")


def worded():
    """An environment whose actions are words."""
    env = Corridor()
    env.action_space, env.step = spaces.Text(5), lambda word: env.moved(int(word == "right"))
    return env


WORDS = ["left", "right"]
CASES = [
    # environments
    ("show it with `irl_gym.environments.reveal.Reveal`.", lambda _: tabulate(Published(), gamma=GAMMA, check_steps=300),
     lambda _: tabulate(Reveal(Published(), {"flip": 2}), gamma=GAMMA, check_steps=300)),
    ("Turn a number into such an action with a function of yours, in `gymnasium.wrappers.TransformAction`.",
     lambda _: tabulate(worded(), gamma=GAMMA),
     lambda _: tabulate(TransformAction(worded(), WORDS.__getitem__, spaces.Discrete(2)), gamma=GAMMA, check_steps=0)),
    ("Raise the limit, or count samples.",
     lambda _: outcomes(lambda rng: rng.integers(9), most=5), lambda _: outcomes(lambda rng: rng.integers(9), most=9),
     lambda _: Enumeration(runs=50).table(Drawing(), GAMMA)),
    ("have more than 5 outcomes: expected at most 5. Raise the limit, or count samples.",
     lambda _: outcomes(lambda rng: (rng.integers(3), rng.integers(3)), most=5),
     lambda _: outcomes(lambda rng: (rng.integers(3), rng.integers(3)), most=9)),
    ("Have the environment draw these, or count samples.",
     lambda _: outcomes(lambda rng: rng.poisson()), lambda _: outcomes(lambda rng: rng.random() < 0.5),
     lambda _: Enumeration(runs=50).table(Drawing(), GAMMA)),
    ("count samples instead.",
     lambda _: outcomes(lambda rng: rng.permuted(np.eye(2), axis=0)), lambda _: Enumeration(runs=50).table(Drawing(), GAMMA)),
    ("Have the environment draw with integers() or choice(), or count samples.",
     lambda _: outcomes(lambda rng: np.sin(rng.random())), lambda _: outcomes(lambda rng: np.sin(rng.integers(3))),
     lambda _: outcomes(lambda rng: np.sin(rng.choice([0.1, 0.2])))),
    # datasets
    ("There is none: name the root folder that it is under, or set MINARI_DATASETS_PATH to that.",
     lambda root: (root / "other").mkdir() or load_minari("me/two-v0", root=root / "other"),
     lambda root: load_minari("me/two-v0", root=root), opened),
    ("Import the package that registers it, or name an environment with --env-id, as module:id;", recorded, recorded_here),
    ("Record it without that wrapper; or, if you trust who made the dataset, add --trust-dataset (trust_dataset=True).",
     lambda root: recorded_here(root, "watched"), recorded_here,
     lambda root: recorded_here(root, "watched", trust_dataset=True)),
    ("If it is the row of a last observation, import it with last='row'.",
     lambda _: imported("keep"), lambda _: imported("row")),
    ("give Episodes, such as those of `collect`.",
     lambda _: Transitions.from_episodes([1]), lambda _: Transitions.from_episodes(collect(LAKE, DOWN, 2))),
    # rewards, features and programs
    ("Save one there, or name another file.", lambda path: TabularReward.load(path / "none.npz"), kept),
    ("Read it with LinearReward.load, or name another file.",
     lambda path: TabularReward.load(linear(path)), lambda path: LinearReward.load(linear(path)), kept),
    ("call reset first.", lambda _: stepped(lambda env: None), lambda _: stepped(lambda env: env.reset(seed=0))),
    ("choose radial.", lambda _: features_named("one-hot", gym.make("CartPole-v1")),
     lambda _: features_named("radial", gym.make("CartPole-v1"))),
    ("give `coordinates` that makes (N, d) of them",
     lambda _: RadialBasis.grid([0], [1], 3)(np.array(WORDS)),
     lambda _: RadialBasis.grid([0], [1], 3, coordinates=lambda seen: 1.0 * (seen == "left")[:, None])(np.array(WORDS))),
    ("rescale the problem, or report it with its table.", lambda _: scaled(1e100), lambda _: scaled(1.0)),
    ("Give time_limit, for the second to have longer.",
     lambda _: twice(Solving("clarabel")), lambda _: twice(Solving.begun("clarabel", 600.0))),
    ("raise time_limit, or give a smaller problem.", lambda _: warm(1e-9), lambda _: warm(60.0), lambda _: warm(60.0, n=3)),
]  # fmt: skip


@pytest.mark.parametrize(
    ("says", "breaks", "mended"), [(one[0], one[1], one[2:]) for one in CASES], ids=[one[0] for one in CASES]
)
def test_a_mend_that_an_error_names_in_passing_serves(root, says, breaks, mended):
    assert says in told(breaks, root) and all(each(root) is not None for each in mended)


STATUSES = [
    ("Lower l1 below lambda_0, or make it auto.", GRID.mdp, FiniteLP(l1=5.0), FiniteLP(l1=0.9), FiniteLP(l1="auto")),
    ("Lower l1, or give", GRID.mdp, FeatureLP(np.eye(25), l1=1e3), FeatureLP(np.eye(25), l1=0.1)),
    ("or give features that tell the expert's successors from other actions'.",
     FORK, FeatureLP(np.eye(4)[:, 3:]), FeatureLP(np.eye(4))),
    ("Give more or other features.", GRID.mdp, FeatureLP(RANDOM), FeatureLP(np.eye(25))),
]  # fmt: skip
ELSEWHERE = ["Read the proof's duality gap; if it is too large, choose the other solver."]
"""diagnoses/test_solving.py: test_the_other_solver_mends_an_answer_that_was_short"""


@pytest.mark.parametrize(("says", "mdp", "ill", "mended"), [(*one[:3], one[3:]) for one in STATUSES])
def test_a_mend_that_a_status_names_serves(says, mdp, ill, mended):
    expert = GRID.expert if mdp is GRID.mdp else np.zeros(4, dtype=int)
    assert says in ill.fit(mdp, expert).status.sentence
    assert all(each.fit(mdp, expert).status is solvers.Status.OPTIMAL for each in mended)


def test_a_table_whose_counts_show_that_states_are_hidden_is_sent_to_reveal():
    says = "not bounded, since observations hide state: show it with `irl_gym.environments.reveal.Reveal`"
    assert says in counted(Flipped()) and says not in counted(Reveal(Flipped(), {"flip": 2}))


def test_last_actions_that_are_dropped_are_kept_by_what_the_warning_says():
    with pytest.warns(UserWarning, match=r"give next observations, or last='keep', the default, which keeps it\."):
        dropping(last="drop")
    assert dropping() and dropping(last="drop", next_observations=[4, 8, 4, 8])  # else a warning, which is an error


def test_a_table_that_cannot_be_changed_is_made_anew():
    with pytest.raises(AttributeError, match=r"Make a new one\."):
        TABLE.mdp.gamma = 0.5
    assert TabularMDP(TABLE.mdp.P, 0.5, TABLE.mdp.d0).gamma == 0.5
