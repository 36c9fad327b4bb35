"""Finite horizons: a table whose states have the time in them (lecture notes, section 1.1; Puterman 1994, chapter 4).

An episode is over after H steps, wherever it is. With the time h in the state that is a table like any other, in which every
episode ends by itself:

    row h * S + s      state s after h steps, h = 0 .. H; those of h = H are terminal
    P, d0              a step leads from h to h + 1; episodes begin at h = 0

so whatever works on tables works here: sums are finite at gamma = 1, and a policy on these rows depends on the time. A reward
on states is paid *on arrival*: R_h(s) by the step that gets to s as the h-th one, h = 1 .. H; R_H on the arrival at the
horizon, and R_0 never.
Axes: S states, A actions, H steps.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from irl_gym._typing import Sparse
from irl_gym.checks import any_array
from irl_gym.errors import InvalidMDP, InvalidPolicy, InvalidReward, a_type
from irl_gym.mdp.policies import as_distribution, policy_array
from irl_gym.mdp.rewards import TabularReward, as_reward
from irl_gym.mdp.tabular_mdp import TabularMDP, TransitionTable, checked_horizon


def time_expanded(table: TransitionTable, horizon: int, gamma: float = 1.0) -> TabularMDP:
    """The MDP of H steps, with the time in its states.

    Args:
        table: what a step does; the discount of a TabularMDP is not taken, since H steps need none.
        horizon: H.
        gamma: discount, 1 for plain sums.

    Raises:
        InvalidMDP: no table.
        InvalidParameter: a horizon that is no whole number of at least 1.
        InvalidDiscount: gamma outside (0, 1].
    """
    table, H = checked_table(table), checked_horizon(horizon)
    later = sp.eye_array(H + 1, k=1, format="csr")
    d0 = np.concatenate([table.d0, np.zeros(H * table.n_states)])
    visits = None
    if table.visits is not None:
        visits = np.concatenate([np.tile(table.visits, (H, 1)), np.zeros_like(table.visits)])
    return TabularMDP(sp.kron(later, table.P, format="csr"), gamma, d0, visits, H)


def checked_table(table: Any) -> TransitionTable:
    """A table as it is, with or without a discount.

    Raises:
        InvalidMDP: anything else, such as an environment or a whole Tabulation.
    """
    if isinstance(table, TransitionTable):
        return table
    mend = " Give its `mdp`." if hasattr(table, "mdp") else ""
    raise InvalidMDP(f"table is {a_type(table)}: expected a TransitionTable or a TabularMDP.{mend}")


def depends_on_time(policy: np.ndarray) -> bool:
    """Is an array a policy for each time: (H, S) actions, or (H, S, A) probabilities or sets?"""
    return policy.ndim == (2 if policy.dtype.kind in "iu" else 3)


def policy_over_time(policy: Any, n_states: int, n_actions: int, horizon: int) -> np.ndarray:
    """(H, S, A) a policy as probabilities at each time.

    Args:
        policy: one that is the same at all times, (S,) actions, (S, A) probabilities or set; or (H, S) actions, (H, S, A)
            probabilities or sets.
        n_states: S.
        n_actions: A.
        horizon: H.

    Raises:
        InvalidPolicy: wrong shape or content; of a policy that depends on the time, the first time that is wrong.
    """
    array = policy_array(policy)
    if not depends_on_time(array):
        return np.tile(as_distribution(array, n_states, n_actions), (horizon, 1, 1))
    if len(array) != horizon:
        raise InvalidPolicy(f"policy has shape {array.shape}: expected {horizon} times, one for each step to the horizon.")
    made = []
    for h, one in enumerate(array):
        try:
            made.append(as_distribution(one, n_states, n_actions))
        except InvalidPolicy as error:
            raise InvalidPolicy(f"at time {h}: {error}") from error
    return np.array(made)


def expanded_policy(policy: Any, table: TransitionTable, horizon: int) -> np.ndarray:
    """((H+1)*S, A) a policy on the rows of `time_expanded`; what it does at the horizon, where nothing is done, is anything.

    Raises:
        InvalidPolicy: as `policy_over_time`.
    """
    each = policy_over_time(policy, table.n_states, table.n_actions, horizon)
    return np.concatenate([each, each[-1:]]).reshape(-1, table.n_actions)


def reward_over_time(reward: TabularReward | np.ndarray, table: TransitionTable, horizon: int) -> np.ndarray | None:
    """(H+1, S) R_h(s), of a reward that depends on the time; None of one that is the same at all times.

    Arguments and errors as `expanded_reward`.
    """
    shape, over_time = (table.n_states, table.n_actions), (horizon + 1, table.n_states)
    if not isinstance(reward, TabularReward) and not hasattr(reward, "reward"):
        array = any_array("the reward", reward, "(S,), (S, A) or (H+1, S) numbers", InvalidReward)
        if array.shape == over_time != shape:
            return TabularReward(array).values
    one = as_reward(reward).values
    if one.shape != shape[: one.ndim]:
        told = f"({shape[0]},) or {shape}, the same at all times, or {over_time}, paid on arrival at each"
        raise InvalidReward(f"the reward has shape {one.shape}: expected {told}.")
    return None


def expanded_reward(reward: TabularReward | np.ndarray, table: TransitionTable, horizon: int) -> TabularReward:
    """A reward on the rows of `time_expanded`.

    Args:
        reward: (S,) paid on arrival or (S, A) paid for the step, the same at all times, as a TabularReward or an array; or an
            array (H+1, S), R_h(s) paid on arrival after h steps. Where H+1 = S and S = A an array is one of steps.
        table: of S states and A actions.
        horizon: H.

    Raises:
        InvalidReward: another shape, or a number that is not finite.
    """
    over_time = reward_over_time(reward, table, horizon)
    if over_time is not None:
        return TabularReward(over_time.reshape(-1))
    one = as_reward(reward)
    tiled = np.tile(one.values, (horizon + 1, *([1] * (one.values.ndim - 1))))
    return TabularReward(tiled, one.note, one.tolerance)


@dataclass(frozen=True, eq=False)
class Repeated:
    """A reward that is the same in several rows of a table, as in a state at all its times."""

    at: Sparse
    """(R, k) which of the k numbers each of the R = S or S*A entries of the table's reward is; an empty row is 0."""
    shape: tuple[int, ...]
    """Of the reward itself: the K numbers that there are, of which the table's states can be paid k."""
    used: np.ndarray
    """(k,) which of them."""
    entries: tuple[int, ...]
    """(S,) or (S, A), the table's."""

    def among(self, rows: np.ndarray) -> "Repeated":
        """That of some of the states (S',), with the numbers that these can be paid."""
        A = self.entries[1] if len(self.entries) > 1 else 1
        at = self.at[(rows[:, None] * A + np.arange(A)).ravel()]
        kept = np.flatnonzero(np.asarray(at.sum(axis=0)).ravel())
        return Repeated(sp.csr_array(at[:, kept]), self.shape, self.used[kept], (rows.size, *self.entries[1:]))

    def spread(self, numbers: np.ndarray) -> np.ndarray:
        """The table's reward, of the k numbers."""
        return (self.at @ numbers).reshape(self.entries)

    def numbers(self, values: np.ndarray) -> np.ndarray:
        """(k,) the numbers, of the table's reward."""
        first = np.asarray(self.at.argmax(axis=0)).ravel()
        return values.ravel()[first]

    def whole(self, numbers: np.ndarray) -> np.ndarray:
        """The reward itself; what nobody is paid is 0."""
        values = np.zeros(int(np.prod(self.shape)))
        values[self.used] = numbers
        return values.reshape(self.shape)


def one_for_all_times(mdp: TabularMDP, n_states: int, *, on_states: bool) -> Repeated:
    """R(s) or R(s, a) on the rows of `time_expanded`; what would be paid for the first state, where nothing arrives, is 0.

    Args:
        mdp: the expanded table.
        n_states: S.
        on_states: is it one on states?
    """
    S, A = n_states, mdp.n_actions
    n, H = (S if on_states else S * A), mdp.n_states // S - 1
    paid = np.arange(H + 1) > 0 if on_states else np.arange(H + 1) < H
    at = sp.kron(paid.astype(float)[:, None], sp.eye_array(n), format="csr")
    if not on_states:
        at = sp.diags_array((~np.repeat(mdp.terminal, A)).astype(float)) @ at
    shape = (S,) if on_states else (S, A)
    return Repeated(sp.csr_array(at), shape, np.arange(n), (mdp.n_states, *shape[1:]))
