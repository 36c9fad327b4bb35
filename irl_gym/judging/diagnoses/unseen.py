"""Where nothing is known of the expert, and where an agent may go that it never went."""

import numpy as np
import scipy.sparse as sp

from irl_gym._typing import ActionSets, StateMask
from irl_gym.judging.diagnoses.case import Case
from irl_gym.judging.diagnoses.findings import WHERE, Finding, counted
from irl_gym.mdp.tabular_mdp import TabularMDP


def unvisited(case: Case) -> Finding | None:
    """A policy read from data says nothing of states never visited: they have no row of (4)."""
    if case.mdp is None or not case.has_expert or case.fully_known:
        return None
    unknown = np.flatnonzero(case.acting & ~case.known)
    share = unknown.size / int(case.acting.sum())
    kept = "" if case.reward is None else str(case.reward.note.get("unvisited", ""))
    chosen = {"avoid": " They were given a low reward, by choice.", "free": " Their reward is whatever the others made of it."}
    return Finding(
        "unvisited-states",
        f"Nothing is known of the expert in {counted(unknown.size)}, {share:.0%} of those in which it can act: "
        f"{WHERE}.{chosen.get(kept, '')}",
        "More episodes; more start_seeds, or starts elsewhere; or an expert with some noise (epsilon), that strays.",
        unknown,
        flags=("--episodes", "--epsilon"),
    )


def entered(mdp: TabularMDP, taken: ActionSets) -> StateMask:
    """(S,) states entered from d0 by actions of a set (S, A) with positive probability; an empty set leads nowhere."""
    steps, successors = (mdp.P[np.flatnonzero(taken)] > 0).nonzero()
    states = np.flatnonzero(taken)[steps] // mdp.n_actions
    follows = sp.csr_array((np.ones(states.size), (successors, states)), shape=(mdp.n_states, mdp.n_states))
    seen = new = mdp.d0 > 0
    while new.any():
        new = (follows @ new.astype(np.float64) > 0) & ~seen
        seen = seen | new
    return seen


def strays(case: Case) -> Finding | None:
    """What is greedy under R may leave the states that the expert visits, where its demonstrations say least.

    Sets of states, from the actions tied under R and the expert's own: no sample is drawn.
    """
    if case.mdp is None or not (case.speaks and case.has_expert):
        return None
    taken = (case.distribution > 0) & case.known[:, None]
    visited = entered(case.mdp, taken)
    beyond = np.flatnonzero(entered(case.mdp, case.ties) & ~visited)
    unknown = int((~case.known & case.acting)[beyond].sum())
    if not beyond.size or (case.judges_states and not unknown):  # else ties, which have sentences of their own
        return None
    of = f", in {unknown:,} of which nothing is known of it" if unknown else ""
    avoided = case.reward is not None and case.reward.note.get("unvisited") == "avoid"
    mend = "More episodes of the expert." if avoided else 'unvisited="avoid", and more episodes of the expert.'
    flags = ("--episodes",)
    if not case.judges_states:
        mend = "More rounds, or features that tell these states from those that the expert visits."
        flags = ("--rounds",)
    return Finding(
        "strays",
        f"An agent that is greedy under the reward can reach {counted(beyond.size)} that the expert never enters{of}: {WHERE}.",
        mend,
        beyond,
        flags=flags,
    )


def dropped_actions(case: Case) -> Finding | None:
    """A log without its last observations may have lost its last actions on the way: a goal's, and what it paid."""
    told = case.judged.get("demonstrations", {})
    if not told.get("dropped"):
        return None
    return Finding(
        "dropped-actions",
        f"The last action of {told['dropped']:,} of {counted(told['episodes'], 'episode')} was dropped when they were "
        "imported, with what it paid: what the expert does there was not learned, and its value is that of the episodes "
        "without it.",
        "Import them again with last='keep', the default; or with next observations, where the log has them.",
    )


def unseen_ends(case: Case) -> Finding | None:
    """Sums of features along an episode need every state; where the last was not recorded, they end with the one before."""
    told = case.judged.get("demonstrations", {})
    if not told.get("unseen") or case.judges_states:
        return None
    return Finding(
        "unseen-ends",
        f"{told['unseen']:,} of {told['episodes']:,} episodes do not say what their last action led to: the values of the "
        "expert that this learner compares end with the state before.",
        "Give the next observations when they are imported, or a last row without an action (last='row').",
    )
