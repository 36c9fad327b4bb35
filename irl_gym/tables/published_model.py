"""The table in the `model(state, action)` that the environments of the package gym-classics offer.

It is taken where enumeration would be endless: each step of Jack's car rental draws four numbers, 49,725 outcomes. It gives
successors, rewards, ends and probabilities by observation, an end under the observation before it: so where anything ends, the
model cannot tell an end from a step that stays, and enumeration tells.
"""

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from irl_gym.errors import NotTabular
from irl_gym.spaces.states import StateIndex
from irl_gym.tables.tabulation import Evidence, Lines, Tabulation, from_lines

NEARLY_ONE = 1e-5
"""Their rows add up to 1 within this; they are divided by their sums."""


def model_table(env: gym.Env, gamma: float) -> Tabulation | None:
    """The table of a gym-classics environment that never ends; None of others.

    Raises:
        NotTabular: rows that do not add up to 1.
    """
    base: Any = env.unwrapped
    if not type(base).__module__.startswith("gym_classics.") or not isinstance(base.observation_space, spaces.Discrete):
        return None
    S, A = int(base.observation_space.n), int(base.action_space.n)
    columns: list[list[np.ndarray]] = [[], [], [], []]
    totals: list[float] = []
    for s in range(S):
        for a in range(A):
            successors, rewards, ended, probabilities = (np.asarray(part) for part in base.model(s, a))
            if ended.any():
                return None
            totals.append(float(probabilities.sum()))
            parts = np.full(successors.size, s * A + a), successors, probabilities, rewards
            for column, part in zip(columns, parts, strict=True):
                column.append(part)
    off = np.abs(np.array(totals) - 1)
    wrong = np.flatnonzero(~(off <= NEARLY_ONE))  # NaN too
    if wrong.size:
        s, a = divmod(int(wrong[0]), A)
        raise NotTabular(f"the probabilities of model({s}, {a}) sum to {totals[wrong[0]]:.6g}: expected 1 within {NEARLY_ONE}.")
    worst = off.max()
    rows, successors, probabilities, rewards = (np.concatenate(column) for column in columns)
    probabilities = probabilities / np.array(totals)[rows]
    d0 = np.zeros(S)
    for start in base._starts:  # a tuple, from which reset draws uniformly
        d0[base.encode(start)] += 1 / len(base._starts)
    evidence = Evidence(
        method=f"The environment's own model(state, action); its rows add up to 1 within {worst:.1g} and were divided by their "
        "sums.",
        exact=True, merged=0, split=0, check=None,
    )  # fmt: skip
    lines = Lines(rows, successors.astype(np.int64), probabilities.astype(float), rewards.astype(float))
    return from_lines(lines, d0, A, StateIndex(base.observation_space), gamma=gamma, evidence=evidence)
