"""The rows of equation (10) of Ng & Russell (2000), feature by feature.

    d(s, a)_i = E_{s' ~ P_s,pi(s)} V_i(s') - E_{s' ~ P_sa} V_i(s')        V_i the value of the expert's policy under phi_i
From a table: V_i = (I - gamma P_pi)^-1 phi_i by one sparse factorisation, a block of features at a time, and the expectations
exactly; what is kept is n x K numbers, whatever the number of states. From a generative model: means over rollouts that share
their random numbers between the actions. Axes: S states, A actions, K features, n rows.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from irl_gym.checks import checked_number
from irl_gym.environments.generative import GenerativeModel
from irl_gym.errors import DegenerateExpert, InvalidParameter
from irl_gym.features.feature_maps import FeatureMap, over_rows
from irl_gym.learners.linear_programs.weights import Rows
from irl_gym.mdp.optimality_rows import Comparisons, compare
from irl_gym.mdp.planning.discounted import Discounted
from irl_gym.mdp.policies import Policy
from irl_gym.mdp.tabular_mdp import TabularMDP

BLOCK = 1 << 24
"""Numbers of V_i held at a time: 128 MB, and as much again for phi."""
BATCHES = 5
"""Parts into which the rollouts are divided, for standard errors."""


@dataclass(frozen=True, eq=False)
class FeatureRows:
    """The rows, and where they come from."""

    rows: Rows
    """d, grouped by state."""
    states: np.ndarray
    """(G,) state of each group: its row in the table, or its number in S_0."""
    actions: np.ndarray
    """(n,) action of each row."""
    equal: np.ndarray
    """(n,) the expert takes this action too: the row is one of a pair d and -d."""
    idle: np.ndarray
    """(n,) rows of actions with the expert's successors, which the program as printed keeps: 0 whatever the reward."""
    trivial: int
    """States of S_0 without a row, or with none that a reward on states can move: not counted."""
    batches: np.ndarray | None = None
    """(b, n, K) d by parts of the rollouts; None where exact or with one rollout."""

    @property
    def row_states(self) -> np.ndarray:
        """(n,) state of each row."""
        return self.states[self.rows.groups]

    def pairs(self, which: np.ndarray) -> np.ndarray:
        """(k, 2) state and action of some rows (n,)."""
        return np.stack([self.row_states[which], self.actions[which]], axis=1).astype(np.int64)

    def apart(self, ties: np.ndarray) -> Rows:
        """The rows of the program that leaves some (n,) out of margins, one by one.

        Those of a state are a group of their own, with a row of 0: it earns nothing, and what violates it costs as before.
        """
        if not ties.any():
            return self.rows
        d, groups = self.rows.d, self.rows.groups
        others, first = np.unique(groups[~ties], return_inverse=True)
        theirs, second = np.unique(groups[ties], return_inverse=True)
        second = others.size + second
        numbers = np.concatenate([first, second, others.size + np.arange(theirs.size)])
        order = np.argsort(numbers, kind="stable")
        zeros = np.zeros((theirs.size, d.shape[1]))
        return Rows(np.concatenate([d[~ties], d[ties], zeros])[order], numbers[order])


def chosen_states(
    mdp: TabularMDP,
    expert: Any,
    S_0: int | Sequence[int] | np.ndarray | None,
    rng: np.random.Generator,
    known: np.ndarray | None = None,
) -> np.ndarray:
    """(m,) increasing states of S_0: those given, a uniform sample of those that have a row, or all.

    Only states of `known` (S,) are taken, in which something is known of the expert.

    Raises:
        InvalidParameter: S_0 empty, or with a state outside the table.
    """
    known = np.ones(mdp.n_states, dtype=bool) if known is None else known
    acting = np.flatnonzero(mdp.reachable & ~mdp.terminal & known)
    if S_0 is None:
        return acting
    if np.ndim(S_0) == 0:
        wanted = int(
            checked_number("S_0", S_0, "a number of states of at least 1, states, or None for all", least=1, whole=True)
        )
        return np.sort(_sample(mdp, expert, rng.permutation(acting), wanted))
    states = np.asarray(S_0)
    if states.ndim != 1 or not states.size or states.dtype.kind not in "iu":
        raise InvalidParameter(
            f"S_0 has shape {states.shape} and dtype {states.dtype}: expected at least one state, as integers."
        )
    wrong = states[(states < 0) | (states >= mdp.n_states)]
    if wrong.size:
        raise InvalidParameter(f"S_0 holds state {wrong[0]}: expected 0 to {mdp.n_states - 1}, the states of the table.")
    return np.unique(states[known[states]]).astype(np.int64)


def _sample(mdp: TabularMDP, expert: Any, order: np.ndarray, wanted: int) -> np.ndarray:
    """The first `wanted` states in this order that have a row which is not trivial."""
    found: list[np.ndarray] = []
    missing = wanted
    while missing > 0 and order.size:
        part, order = order[: 2 * missing], order[2 * missing :]
        comparisons = compare(mdp, expert, np.sort(part))
        good = part[np.isin(part, comparisons.states[~comparisons.trivial])]  # in the order drawn, or low numbers win
        found.append(good)
        missing -= good.size
    chosen = np.concatenate(found) if found else np.zeros(0, dtype=np.int64)
    return chosen[:wanted]


def rows_of_table(
    mdp: TabularMDP,
    expert: Any,
    features: FeatureMap,
    decode: Callable[[np.ndarray], Any],
    S_0: np.ndarray,
    discounted: Discounted,
    *,
    printed: bool = False,
) -> FeatureRows:
    """The rows of a table, exactly.

    Args:
        mdp: P and gamma.
        expert: (S,) actions, (S, A) probabilities or (S, A) set; an action that it takes too has to be as good: two rows,
            each a group, d and -d.
        features: phi.
        decode: turns rows of the table into what the features are of.
        S_0: (m,) increasing states.
        discounted: I - gamma P_pi.
        printed: keep the rows that are 0 whatever the reward, as the paper's program does.

    Raises:
        DegenerateExpert: no row that a reward on states can move.
        InvalidFeatures: what the features give is not (N, K) finite numbers.
    """
    comparisons = compare(mdp, expert, S_0)
    kept = ~comparisons.trivial
    if not kept.any():
        raise DegenerateExpert(
            f"none of the {S_0.size} states of S_0 compares the expert with an action of other successors: every reward on "
            f"states makes it optimal there. Choose a larger S_0.{comparisons.caveat}"
        )
    kept = kept | (printed & ~comparisons.equal)
    d = np.empty((int(kept.sum()), features.n_features))
    differences = comparisons.rows[kept]
    width = max(1, BLOCK // mdp.n_states)
    everything = np.arange(mdp.n_states)
    for begin in range(0, features.n_features, width):
        columns = slice(begin, min(begin + width, features.n_features))
        V = discounted.solve(over_rows(features, decode, everything, columns))
        d[:, columns] = differences @ V
    d[comparisons.trivial[kept]] = 0.0
    return _grouped(comparisons, kept, d, S_0)


def _grouped(comparisons: Comparisons, kept: np.ndarray, d: np.ndarray, S_0: np.ndarray) -> FeatureRows:
    """Rows by state; those that are equalities twice, in groups of their own."""
    states, equal = comparisons.states[kept], comparisons.equal[kept]
    order = np.concatenate([np.flatnonzero(~equal), np.repeat(np.flatnonzero(equal), 2)])
    named, groups = np.unique(states[~equal], return_inverse=True)
    counted = np.unique(states).size
    both = np.repeat(states[equal], 2)
    mirrored = np.repeat(d[equal], 2, axis=0)
    mirrored[1::2] *= -1
    groups = np.concatenate([groups, named.size + np.arange(both.size)])
    d = np.concatenate([d[~equal], mirrored]) if both.size else d
    return FeatureRows(
        Rows(d, groups),
        np.concatenate([named, both]),
        comparisons.actions[kept][order],
        equal[order],
        comparisons.trivial[kept][order],
        int(S_0.size - counted),
    )


def rows_of_model(
    model: GenerativeModel,
    expert: Policy,
    features: FeatureMap,
    S_0: np.ndarray,
    *,
    samples: int,
    horizon: int,
    seed: int,
    printed: bool = False,
) -> FeatureRows:
    """The rows of a world that can only be set to a state and run, by Monte Carlo.

    Each action's rollouts have the same random numbers, so that what the actions share cancels.

    Args:
        model: the world.
        expert: the policy, deterministic.
        features: phi of observations.
        S_0: (m, d) states.
        samples: rollouts for each state and action.
        horizon: steps after which a rollout is cut.
        seed: of the random numbers.
        printed: keep the rows that are 0 in every rollout, as the paper's program does.

    Raises:
        DegenerateExpert: no action leads the expert's states elsewhere.
    """
    physics = model.physics
    taken = model.actions(expert, S_0)
    parts = min(BATCHES, samples) if samples > 1 else 1
    sizes = np.diff(np.linspace(0, samples, parts + 1).astype(int))
    means = np.zeros((parts, physics.n_actions, len(S_0), features.n_features))
    for part, size in enumerate(sizes.tolist()):
        for a in range(physics.n_actions):
            rng = np.random.default_rng([seed, part])  # the same for every action
            means[part, a] = model.continuations(expert, features, S_0, a, n=size, horizon=horizon, rng=rng)
    everyone = np.arange(len(S_0))
    differences = means[:, taken, everyone][:, None] - means  # (b, A, m, K)
    pairs = [(s, a) for s in everyone for a in range(physics.n_actions) if a != taken[s]]
    s, a = np.array(pairs).T
    batches = differences[:, a, s]
    moved = np.abs(batches).max(axis=(0, 2)) > 0
    if not moved.any():
        raise DegenerateExpert(
            f"no other action leads from the {len(S_0)} states of S_0 to other features than the expert's: nothing can be "
            "learned from them. Choose a larger S_0 or other features."
        )
    kept = moved | printed
    named, groups = np.unique(s[kept], return_inverse=True)
    d = np.average(batches[:, kept], axis=0, weights=sizes)
    rows = Rows(d, groups)
    never, parted = np.zeros(len(d), dtype=bool), batches[:, kept] if parts > 1 else None
    return FeatureRows(rows, named, a[kept], never, ~moved[kept], len(S_0) - named.size, parted)
