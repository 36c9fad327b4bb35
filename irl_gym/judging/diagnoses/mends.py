"""Mends that another program makes, with their flags: none asks for the settings that a run has already.

Flags are those of `irl-gym run`. Those of one mend go together on one command line.
"""

import numpy as np

from irl_gym._typing import Indices
from irl_gym.judging.diagnoses.case import Case
from irl_gym.learners.base import Outcome

Mend = tuple[str, tuple[str, ...]]
"""What to do, in words, and its flags."""
DEFAULTS = ("--learner finite-lp", "--l1 0", "--margin-cap auto")
"""FiniteLP() with its defaults."""


def on_steps(case: Case) -> tuple[str, ...]:
    """The flags of reward_on="state-action": FiniteLP alone has it, and not with slack."""
    learner = ("--learner finite-lp",) if case.linear else ()
    hard = ("--slack none",) if case.claims.get("slack") is not None else ()
    return (*learner, "--reward-on state-action", *hard)


def capped(case: Case) -> Mend | None:
    """FiniteLP's default program, in what differs from the run's own; None where it is the run's own, or may be."""
    if isinstance(case.best, Outcome) and case.claims.get("slack") is not None:
        return 'slack=None, with margin_cap="auto" and l1=0.0', ("--slack none", "--margin-cap auto", "--l1 0")
    if "uniform_margin" in case.stats and not case.claims.get("l1"):  # of which "auto" makes the cap
        return None
    return 'margin_cap="auto" with l1=0.0', ("--margin-cap auto", "--l1 0")


def breaking(case: Case, states: Indices, actions: Indices) -> Mend:
    """What breaks ties with actions (k,) in states (k,) where the expert is known: another program, or another kind of reward.

    Whether a program breaks them is known where one was solved here; else what may break them is named, and what comes next.
    """
    possible, other = case.can_have_margin, capped(case)
    broken = np.ones(states.size, dtype=bool) if possible is None else possible[states, actions]
    if case.linear and broken.any():
        if case.claims.get("margin_cap") is None:
            return 'margin_cap="auto"; if it stays, more or other features, or FiniteLP.', ("--margin-cap auto",)
        return "More or other features, or FiniteLP, where the table is small enough.", ("--features",)
    if other is not None and broken.any():
        program, flags = other
        if possible is not None and broken.all():
            return f"{program}: solved here, it gives the expert a margin over each of these actions.", flags
        left = 'reward_on="state-action"' if case.on_states else "the (S, A) set of the expert's optimal actions"
        return f"{program}; {left} where that leaves ties.", flags
    if possible is not None and broken.any():
        return "Learn it again: solved here with the same settings, the expert has a margin over some of these actions.", ()
    if case.on_states:
        return 'reward_on="state-action": a reward on states does not prefer the expert\'s actions there.', on_steps(case)
    return "Give the expert as the (S, A) set of its optimal actions.", ()
