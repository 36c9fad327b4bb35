"""Everything that takes arrays, numbers or text from a caller, called with one argument that cannot be right."""

from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import scipy.sparse as sp
from gymnasium import spaces

from irl_gym.agents.expert_files import FromFile
from irl_gym.commands.arguments import parse_reveal
from irl_gym.commands.demonstrating.keyboard import controls_of, keys_of_line, keys_typed
from irl_gym.demonstrations.datasets import load_minari
from irl_gym.demonstrations.imports import from_arrays, from_d4rl, from_frame, from_imitation, from_pairs, from_rollouts
from irl_gym.features.bases import Fourier, Polynomial, RadialBasis
from irl_gym.features.feature_maps import OneHot, Table, Unravel
from irl_gym.features.linear_reward import LinearReward
from irl_gym.learners.linear_programs.feature import FeatureLP
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.mdp.policies import as_distribution
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.runs.choices import parse_keywords
from irl_gym.runs.experiment import Experiment
from irl_gym.spaces.listed_states import ListedStates
from irl_gym.spaces.states import StateIndex
from irl_gym.tables.tabulate import make

P = np.array([[0.5, 0.5], [1.0, 0.0]])
D0 = np.array([1.0, 0.0])
SPACE = spaces.Discrete(16)
LAKE = gym.make("FrozenLake-v1")
MORE = spaces.Dict(a=spaces.Tuple((spaces.Discrete(3), spaces.MultiBinary(2))), b=spaces.Box(-1, 1, (2,)))
LOG = {"observations": [0, 4, 8], "actions": [1, 1, 2], "terminals": [False, False, True]}
INTO = {"space": SPACE, "n_actions": 4}


def inside(one):
    """The array in lists and tuples, as a row, a batch and a pair."""
    return [one], (one, one), [[one]], {"a": one}, np.array([one, None], dtype=object)


PLAIN = [
    np.zeros(0), np.zeros((0, 3, 0)), np.zeros((3, 0)), np.array(0.5), np.array([1j, 2]), np.array([{}, []], dtype=object),
    np.array(["a", "b"]), np.array([10**400, 1], dtype=object), np.array([np.nan, 1]), np.array([np.inf, 0]),
    np.ones((2, 2, 2)), np.array([1.5, -0.5]), np.array([True, False]), np.zeros(2, dtype=[("a", int)]),
    np.array([2**64 - 1, 0], dtype=np.uint64), np.array(["2020"], dtype="M8[D]"), np.array([[1, 0], [0, 1]]),
    np.array([-1, 2**62]), [[1], [1, 2]], sp.csr_array((2, 2)), SimpleNamespace(shape=(2, 2)), {1: 2}, {1, 2}, {}, b"x", "x",
    "", "\ud800", None, True, 10**400, -(10**400), 2**63, 1e308, 0.5, -1, 0, 3, float("nan"), float("inf"), 1j, range(3),
    object(), dict,
]  # fmt: skip
VALUES = [*PLAIN, *(made for one in PLAIN for made in inside(one))]
TEXTS = [
    "", "=", "a", "a=", "=1", "a=1", "a b=1", "a=[", "a=" + "[" * 10_000, "a=" + "9" * 5_000, "a=1e999", "a=NaN", "{", "{}",
    "[]", "{" * 10_000, '{"a": 1, "a": 2}', "{1: 2}", "\ud800=1", "a=\x00", " {}", "{}x", '{"a": ' + "[" * 10_000, "é=1", "3",
    "a=[{[]: 1}]", "\x1b[", "\x1b[" + "1" * 5_000, "\x1b[A~", "left=1", "=" * 9, "a=³", "a=٣", "a=[1](2)", "a=" + "(" * 5_000,
    "a=[1e999, None]",
]  # fmt: skip


def changed(call, given, key, value):
    return call(**{**given, key: value})


def buffer(**other):
    held = {
        "observations": np.array([[0], [4]]), "actions": np.array([[[1]], [[1]]]), "rewards": np.zeros((2, 1)), "pos": 2,
        "dones": np.array([[0], [1]]), "buffer_size": 2, "next_observations": np.array([[4], [8]]), "full": True,
    }  # fmt: skip
    return from_rollouts(SimpleNamespace(**{**held, **other}), **INTO)


def frame(**columns):
    import pandas as pd

    held = {"episode": [0, 0], "step": [0, 1], "observation": [0, 4], "action": [1, 1], "reward": [0.0, 0.0]}
    try:
        made = pd.DataFrame({**held, **columns})
    except Exception:  # pandas takes no such column
        return None
    return from_frame(made, **INTO)


def policy(array):
    return as_distribution(array, 2, 2)


def trajectory(**fields):
    return from_imitation([{"obs": [0, 4, 8], "acts": [1, 1], "rews": [0.0, 0.0], "terminal": True, **fields}], **INTO)


def pairs(**parts):
    return list(from_pairs(**{"pairs": [(0, 1), (4, 1), (8, None)], **INTO, **parts}))


CALLS = {
    TabularMDP: {"P": P, "gamma": 0.9, "d0": D0, "visits": None},
    TabularMDP.from_dense: {"P": P[:, None], "gamma": 0.9, "d0": D0},
    TabularReward: {"values": D0, "tolerance": 0.0},
    policy: {"array": np.array([0, 1])},
    Table: {"values": P}, OneHot: {"n": 2}, Unravel: {"shape": (2, 2)}, FromFile: {"path": "x", "sha256": None},
    RadialBasis: {"centres": P, "sigma": 1.0}, RadialBasis.grid: {"low": [0], "high": [1], "counts": 2, "width": 1.0},
    Fourier: {"low": [0], "high": [1], "order": 2}, Polynomial: {"low": [0], "high": [1], "degree": 2},
    LinearReward: {"alpha": D0, "features": OneHot(2)}, ListedStates: {"space": SPACE, "numbers": np.array([[1], [2]])},
    StateIndex(SPACE).encode: {"observation": 1}, StateIndex(SPACE).encode_batch: {"observations": np.array([1])},
    StateIndex(SPACE).decode: {"row": 1}, StateIndex(SPACE).decode_batch: {"rows": np.array([1])},
    from_arrays: {**{key: LOG[key] for key in ("observations", "actions")}, "rewards": None,
                  "ends": LOG["terminals"], "episode": None, "lengths": None,
                  "terminated": None, "truncated": None, "next_observations": None, **INTO, "last": "drop"},
    from_d4rl: {"source": LOG, "last": "repeat", **INTO}, from_imitation: {"trajectories": [], **INTO},
    trajectory: dict.fromkeys(("obs", "acts", "rews", "terminal", "infos")),
    buffer: dict.fromkeys(("observations", "actions", "rewards", "pos", "dones", "buffer_size", "next_observations", "full")),
    frame: dict.fromkeys(("episode", "step", "observation", "action", "reward", "terminated")),
    pairs: dict.fromkeys(("pairs", "fields", "last")),
    Experiment: {"env_id": "x", "gamma": 0.9, "bins": None, "samples": 0, "epsilon": 0.0, "episodes": 1, "num_envs": 1,
                 "eval_episodes": 1, "seed": 0},
    load_minari: {"dataset_id": "x-v0", "root": None}, make: {"env_id": "x"},
    FiniteLP: {"l1": 0.0, "r_max": 1.0, "margin_cap": None, "time_limit": None},
    FeatureLP: {"features": None, "time_limit": None},
}  # fmt: skip
"""What is called -> arguments that are fine, or None where the call fills them in itself."""


def call(which, key, value):
    """Call one with an argument changed."""
    function, given = list(CALLS.items())[which % len(CALLS)]
    name = list(given)[key % len(given)]
    fine = {one: held for one, held in given.items() if function not in (trajectory, buffer, frame, pairs)}
    fine[name] = VALUES[value % len(VALUES)]
    if function is from_arrays and name in ("actions", "episode", "lengths"):
        fine["ends"] = None
    return function(**fine)


READ = [
    parse_keywords, parse_reveal, lambda parts: controls_of(LAKE, ",".join(parts)),
    lambda parts: [*keys_typed("".join(parts)), *keys_of_line("".join(parts))],
]  # fmt: skip
"""What reads text that somebody types."""


def texts(which, more):
    """Read what is typed: an environment's arguments, what is revealed, keys."""
    parts = [TEXTS[which % len(TEXTS)]]
    if more % 2:
        parts.append(TEXTS[more % len(TEXTS)])
    return READ[which // len(TEXTS) % len(READ)](parts)
