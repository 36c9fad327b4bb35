"""The mends that errors about tables, rewards and policies name are executed, and serve."""

import threading
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pandas as pd
import pytest
from enumeration_envs import Corridor
from gymnasium import spaces
from gymnasium.envs.toy_text import FrozenLakeEnv
from gymnasium.wrappers import TransformReward
from mended import GAMMA, done, mends, told, unsaid
from stable_baselines3.common.env_util import make_vec_env

from irl_gym.commands.demonstrating.keyboard import controls_of
from irl_gym.demonstrations.imports import from_frame
from irl_gym.environments.generative import GenerativeModel
from irl_gym.environments.learned_reward import LearnedReward
from irl_gym.environments.rewarded_vec_env import check_steppable
from irl_gym.environments.rollouts import moments_of
from irl_gym.environments.tabular_env import TabularEnv
from irl_gym.environments.tabular_vec_env import TabularVecEnv
from irl_gym.features.bases import Fourier, Polynomial, RadialBasis
from irl_gym.features.feature_maps import Functions, OneHot, Unravel, checked_features
from irl_gym.features.linear_reward import LinearReward
from irl_gym.learners.linear_programs.feature import FeatureLP
from irl_gym.mdp.episodes import Episode
from irl_gym.mdp.planning.dynamic_programming import value_iteration
from irl_gym.mdp.policies import TabularPolicy, as_distribution
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.sampling import Successors
from irl_gym.mdp.tabular_mdp import TabularMDP, TransitionTable
from irl_gym.mdp.time_expanded import time_expanded
from irl_gym.spaces.states import StateIndex
from irl_gym.tables.counted.counting import Counting
from irl_gym.tables.discretize import discretize
from irl_gym.tables.table_files import load_table, save_table
from irl_gym.tables.tabulate import make, tabulate

pytestmark = pytest.mark.usefixtures("unchecked")
SIXTEEN = spaces.Discrete(16)


def lake(**more):
    return gym.make("FrozenLake-v1", **({"is_slippery": False} | more))


def table(env, **how):
    return tabulate(env, gamma=GAMMA, **({"check_steps": 300} | how))


LAKE = table(lake())
MDP = LAKE.mdp
P = MDP.P.toarray()
GREEDY = value_iteration(MDP, LAKE.reward.values).policy


class Elsewhere(FrozenLakeEnv):
    """Publishes another start than its own."""

    def reset(self, *, seed=None, options=None):
        _, info = super().reset(seed=seed)
        self.s = 4
        return 4, info


def elsewhere(start):
    env = Elsewhere(is_slippery=False)
    env.initial_state_distrib = np.eye(16)[start]
    return table(env)


class Locked(FrozenLakeEnv):
    """Publishes its table, and cannot be copied."""

    def __init__(self):
        super().__init__(is_slippery=False)
        self.lock = threading.Lock()


def corridor():
    """A corridor in whose space are three observations that never come."""
    env = Corridor()
    env.observation_space = spaces.Discrete(10)
    return env


def own_states():
    return replace(LAKE, states=object())


def folder_for_table(path):
    (path / "table.npz").mkdir()
    return load_table(path / "table.npz", SIXTEEN)


def asked_again(path):
    (path / "table.npz").rmdir()
    return kept(LAKE, path)


def kept(made, path):
    save_table(made, path / "table.npz")
    return load_table(path / "table.npz", SIXTEEN)


def one(actions, rewards=0.0, n=16):
    return Episode(np.arange(len(actions) + 1) % n, np.array(actions), np.full(len(actions), rewards), False, True)


def counted(*episodes, space=SIXTEEN, n_actions=1, **how):
    return Counting(**how).table(episodes, space, n_actions, gamma=GAMMA)


ENDED = replace(one([0]), terminated=True, truncated=False)
LONG, WIDE = one([0] * 8200, n=8201), spaces.Discrete(8201)
LOG = pd.DataFrame({"episode": [0, 1], "step": 0, "observation": [0, 4], "action": 0, "then": [4, 8]})
LINEAR = LinearReward(np.ones(1), Functions(lambda seen: np.ones((len(seen), 1)), 1))


def mapped(function):
    return checked_features(Functions(lambda seen: function(seen)[:, None], 1), np.arange(3.0))


def coded(breaks, env):
    return done(mends(told(breaks, env))[0], env)


class Shifted(Corridor):
    """Its actions are 5 and 6."""

    def __init__(self):
        super().__init__()
        self.action_space = spaces.Discrete(2, start=5)

    def step(self, action):
        return self.moved(int(action) - 5)


def trainable(env):
    check_steppable(env)
    return make_vec_env(lambda: env).reset() is not None


BLACKJACK = gym.make("Blackjack-v1", sab=True)
TUPLE = gym.wrappers.TransformObservation(Corridor(), lambda o: (o, o), spaces.Tuple([spaces.Discrete(7)] * 2))


PAIRS, ONE = StateIndex(spaces.Tuple([spaces.Discrete(4)] * 2)), np.ones((1, 1))


def vectorised(**more):
    return TabularVecEnv(MDP, LAKE.reward, num_envs=2, **more)


def sampled(S_0):
    return FeatureLP(OneHot(16), S_0=S_0).fit(GenerativeModel(lake(), GAMMA), TabularPolicy(POLICY, LAKE.states))


POLICY = as_distribution(GREEDY, 16, 4)
CASES = [
    # features
    ("Give it features, or `learn` a problem that has some.",
     lambda _: FeatureLP().fit(MDP, GREEDY), lambda _: FeatureLP(OneHot(16)).fit(MDP, GREEDY)),
    # tabulate
    ("Put it inside.",
     lambda _: table(TransformReward(LearnedReward(lake(), np.arange(16.0)), lambda paid: 2 * paid)),
     lambda _: table(LearnedReward(TransformReward(lake(), lambda paid: 2 * paid), np.arange(16.0)), check_steps=0)),
    ("Give LearnedReward the `states` of this table.",
     lambda _: table(LearnedReward(corridor(), np.zeros(10))),
     lambda _: table(LearnedReward(corridor(), np.zeros(7), table(corridor()).states))),
    ("Run irl-gym in the folder that has it, or install it.", lambda _: make("no_such_package:Lake-v0"),
     lambda _: make("irl_gym_envs:irl_gym/GridWorld-v0")),
    ("Wrap it, as in `irl_gym.environments.reveal.Reveal(env)`.", lambda _: table(BLACKJACK),
     lambda _: table(coded(table, BLACKJACK), check_steps=0)),
    ("Correct the start that is published, where one is. Something acts outside the table.",
     lambda _: elsewhere(0), lambda _: elsewhere(4)),
    ("Or pass check_steps=0 to go without the check.", lambda _: table(Locked()), lambda _: table(Locked(), check_steps=0)),
    # files
    ("Make such a table again instead.",
     lambda path: save_table(own_states(), path / "table.npz"), lambda path: kept(table(lake()), path)),
    ("Ask again when it can.", folder_for_table, asked_again),
    # cells
    ("Use `tabulate(env, gamma=...)`.",
     lambda _: discretize(TabularEnv(MDP, LAKE.reward), gamma=GAMMA, bins=3), lambda _: table(TabularEnv(MDP, LAKE.reward))),
    ("Give bins=16, or use `tabulate(env, gamma=...)`, which needs none.",
     lambda _: discretize(lake(), gamma=GAMMA, bins=3),
     lambda _: discretize(lake(), gamma=GAMMA, bins=16), lambda _: table(lake())),
    ("Take fewer bins or samples, or raise memory_limit.",
     lambda _: discretize(lake(), gamma=GAMMA, bins=16, samples=9, memory_limit=12_000),
     lambda _: discretize(lake(), gamma=GAMMA, bins=16, samples=1, memory_limit=12_000),
     lambda _: discretize(lake(), gamma=GAMMA, bins=16, samples=9)),
    # learned rewards
    ("Give the `states` of the Tabulation that the reward was learned on.",
     lambda _: LearnedReward(corridor(), np.zeros(7)),
     lambda _: LearnedReward(corridor(), np.zeros(7), table(corridor()).states)),
    ("Save `reward.tabular(states)`, the same reward in a table.",
     lambda path: LINEAR.save(path / "r.npz"),
     lambda path: LINEAR.tabular(LAKE.states).save(path / "r.npz") or TabularReward.load(path / "r.npz")),
    ("Turn a reward on arrival into one with `TabularReward.expected(mdp)`.",
     lambda _: value_iteration(MDP, np.arange(16.0)),
     lambda _: value_iteration(MDP, TabularReward(np.arange(16.0)).expected(MDP))),
    # counts
    ("Give more episodes, or choose what follows such a pair: unvisited='self-loop' or 'uniform'.",
     lambda _: counted(ENDED, n_actions=2, unvisited="refuse"),
     lambda _: counted(ENDED, replace(ENDED, actions=np.array([1])), n_actions=2, unvisited="refuse"),
     lambda _: counted(ENDED, n_actions=2, unvisited="self-loop"),
     lambda _: counted(ENDED, n_actions=2, unvisited="uniform")),
    ("Choose 'self-loop'.",
     lambda _: counted(LONG, space=WIDE, n_actions=2, unvisited="uniform"),
     lambda _: counted(LONG, space=WIDE, n_actions=2, unvisited="self-loop")),
    ("Give the next observations when they are imported.",
     lambda _: counted(*from_frame(LOG, space=SIXTEEN, n_actions=1)),
     lambda _: counted(*from_frame(LOG, space=SIXTEEN, n_actions=1, next_observation="then"))),
    ("Mend or leave out the episode.",
     lambda _: counted(one([0]), one([0], np.nan)), lambda _: counted(one([0]), one([0], 1.0)), lambda _: counted(one([0]))),
    # transitions
    ("For an (S, A, S) array use `from_dense`.",
     lambda _: TabularMDP(P.reshape(16, 4, 16), GAMMA, MDP.d0),
     lambda _: TabularMDP.from_dense(P.reshape(16, 4, 16), GAMMA, MDP.d0)),
    ("Divide it by its sum.",
     lambda _: TabularMDP(P * 1.0001, GAMMA, MDP.d0),
     lambda _: TabularMDP(P * 1.0001 / np.maximum(P.sum(1, keepdims=True) * 1.0001, 1e-9), GAMMA, MDP.d0)),
    ("Divide it by that.",
     lambda _: TabularMDP(P, GAMMA, MDP.d0 * 2), lambda _: TabularMDP(P, GAMMA, MDP.d0 * 2 / (MDP.d0 * 2).sum())),
    ("Give an action that is not available the rows of one that is.",
     lambda _: TabularMDP(P * (np.arange(64) != 1)[:, None], GAMMA, MDP.d0),
     lambda _: TabularMDP(P[np.where(np.arange(64) == 1, 0, np.arange(64))], GAMMA, MDP.d0)),
    ("Give the probability to states that act.",
     lambda _: Successors(TabularMDP(P, GAMMA, np.eye(16)[15])), lambda _: Successors(TabularMDP(P, GAMMA, np.eye(16)[14]))),
    ("Normalise the rows.", lambda _: TabularMDP(ONE * (1 + 5e-10), 1 - 1e-10, [1.0]),
     lambda _: TabularMDP(ONE, 1 - 1e-10, [1.0])),
    ("Put the time in the states, with `irl_gym.mdp.time_expanded.time_expanded(TransitionTable(P, d0), horizon)`.",
     lambda _: TabularMDP(P, 1.0, MDP.d0, horizon=6), lambda _: time_expanded(TransitionTable(P, MDP.d0), 6).horizon),
    ("Raise it, or `tolerance`.",
     lambda _: value_iteration(MDP, LAKE.reward, max_iterations=1, sweeps=0),
     lambda _: value_iteration(MDP, LAKE.reward, sweeps=0),
     lambda _: value_iteration(MDP, LAKE.reward, max_iterations=1, sweeps=0, tolerance=99.0)),
    # policies
    ("Give one entry for each state.", lambda _: as_distribution(GREEDY[:9], 16, 4), lambda _: as_distribution(GREEDY, 16, 4)),
    ("Turn (S,) actions into them with `irl_gym.mdp.policies.as_distribution(actions, S, A)`.",
     lambda _: TabularPolicy(GREEDY, LAKE.states), lambda _: TabularPolicy(as_distribution(GREEDY, 16, 4), LAKE.states)),
    ("Convert it, for example with `policy.astype(bool)`.",
     lambda _: as_distribution(POLICY.astype(int), 16, 4), lambda _: as_distribution(POLICY.astype(int).astype(bool), 16, 4)),
    ("Normalise it.", lambda _: as_distribution(POLICY * 2, 16, 4),
     lambda _: as_distribution(POLICY * 2 / (POLICY * 2).sum(axis=1, keepdims=True), 16, 4)),
    ("Give `most`.", lambda _: moments_of(Corridor(), TabularPolicy(np.eye(2)[[1] * 7], StateIndex(spaces.Discrete(7))), 2),
     lambda _: [*moments_of(Corridor(), TabularPolicy(np.eye(2)[[1] * 7], StateIndex(spaces.Discrete(7))), 2, most=9)]),
    # environments of tables, and Stable-Baselines3
    ("Call reset first.", lambda _: TabularEnv(MDP, LAKE.reward).step(0),
     lambda _: (env := TabularEnv(MDP, LAKE.reward)).reset(seed=0) and env.step(0)),
    ("Make a new env.", lambda _: vectorised().set_attr("max_episode_steps", 9), lambda _: vectorised(max_episode_steps=9)),
    ("Use show_rows=True.", lambda _: vectorised(states=PAIRS), lambda _: vectorised(states=PAIRS, show_rows=True)),
    ("Shift them, with `gymnasium.wrappers.TransformAction(env, lambda a: a + 5, gymnasium.spaces.Discrete(2))`.",
     lambda _: check_steppable(Shifted()), lambda _: trainable(coded(check_steppable, Shifted()))),
    ("Flatten them, with `gymnasium.wrappers.FlattenObservation(env)`.",
     lambda _: check_steppable(TUPLE), lambda _: trainable(coded(check_steppable, TUPLE))),
    # features
    ("Give `coordinates` that chooses or makes them, such as Unravel((8, 8)) for the cells of an 8x8 map.",
     lambda _: RadialBasis.grid([0, 0], [7, 7], 3)(np.arange(64)),
     lambda _: RadialBasis.grid([0, 0], [7, 7], 3, coordinates=Unravel((8, 8)))(np.arange(64)).size),
    ("Lower the order, or choose fewer coordinates.",
     lambda _: Fourier([0] * 9, [1] * 9, 9), lambda _: Fourier([0] * 9, [1] * 9, 1), lambda _: Fourier([0], [1], 9)),
    ("Lower the degree, or choose fewer coordinates.",
     lambda _: Polynomial([0] * 30, [1] * 30, 9),
     lambda _: Polynomial([0] * 30, [1] * 30, 1), lambda _: Polynomial([0], [1], 9)),
    ("Lower the counts, or choose fewer coordinates.",
     lambda _: RadialBasis.grid([0] * 9, [1] * 9, 9),
     lambda _: RadialBasis.grid([0] * 9, [1] * 9, 2), lambda _: RadialBasis.grid([0], [1], 9)),
    ("Use features of coordinates, such as RadialBasis, or number the observations with a StateIndex.",
     lambda _: OneHot(16)(np.array([[0, 1]])), lambda _: RadialBasis.grid([0, 0], [3, 3], 4)(np.array([[0, 1]])),
     lambda _: OneHot(16)(StateIndex(spaces.MultiDiscrete([4, 4])).encode_batch(np.array([[0, 1]])))),
    ("Look at what the map does with that observation.",
     lambda _: mapped(lambda seen: np.where(seen > 0, seen, np.nan)), lambda _: mapped(np.sqrt).size),
    ("Or use a table.", lambda _: sampled(3), lambda _: sampled(np.array([[0.0], [4.0], [8.0]])),
     lambda _: FeatureLP(OneHot(16), S_0=3).fit(MDP, GREEDY)),
    # keys
    ('For example "w=3,a=0,space=2".', lambda _: controls_of(lake(), "up"), lambda _: controls_of(lake(), "w=3,a=0,space=2")),
    ("Use another key.", lambda _: controls_of(lake(), "q=3"), lambda _: controls_of(lake(), "w=3")),
]  # fmt: skip
FILES = [f"{name}.py" for name in (
    "tables/tabulate tabulation blackjack selfcheck table_files discretize learned_reward linear_reward dynamic_programming "
    "counting step_counts counted_rows tabular_mdp policies sampling shaping rewards rollouts tabular_env tabular_vec_env "
    "rewarded_vec_env bases feature_maps feature_sums generative keyboard published_table published_model "
    "watching_wrappers layouts names space_json"
).split()]  # fmt: skip
ELSEWHERE = ("Give its `mdp`.", "Give its `reward`.", "Learn one, such as with `FiniteLP().fit(mdp, expert)`.",
             "Give the Tabulation of this environment.")  # fmt: skip  # test_mends_of_the_facade


@pytest.mark.parametrize(("says", "breaks", "mended"), [(says, breaks, rest) for says, breaks, *rest in CASES],
                         ids=[one[0] for one in CASES])  # fmt: skip
def test_a_mend_that_an_error_about_tables_names_serves(tmp_path, says, breaks, mended):
    assert says in told(breaks, tmp_path) and all(each(tmp_path) is not None for each in mended)


def test_every_mend_that_an_error_about_tables_names_is_executed():
    assert not unsaid([*CASES, *((one,) for one in ELSEWHERE)], *FILES)
