"""Which hidden part of an inner state makes the difference, and what mends it.

Two inner states of one observation may differ in much that never matters: counters, caches, the path so far. So each part that
differs is taken over by itself, from one state to the other, and the action is tried again: a part that changes what it does
is named first. Then episodes are begun anew: what each reset draws and no step changes, such as a goal or a layout, is mended
by fixing what resets draw; what steps change has to be shown.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from irl_gym.environments.physics import physics_of
from irl_gym.environments.reveal import can_be_shown, known_hidden
from irl_gym.errors import IrlGymError
from irl_gym.spaces.coordinates import IntegerCoordinate
from irl_gym.tables.copies.object_graphs import Difference, Steps
from irl_gym.tables.enumeration.hidden_state import Behaviour, unlike
from irl_gym.tables.enumeration.outside import OutsideRandomness
from irl_gym.tables.enumeration.trials import Trials

Does = Callable[[Any, int], Behaviour | None]
MOST_TRIED = 200
"""Parts taken over by themselves."""
MOST_TOLD = 6
RESETS, STEPS = 20, 10
"""Episodes begun, and steps made in each, to see what resets draw and steps change."""


@dataclass(frozen=True)
class HiddenPart:
    """What differs between two inner states."""

    causes: list[Difference]
    """Parts that change by themselves what the action does; all that differ where none does."""
    others: int
    """Parts that do not."""
    drawn: bool
    """Does each reset draw the causes, and no step change them?"""

    def __str__(self) -> str:
        told = "; ".join(map(str, self.causes[:MOST_TOLD])) or "nothing that can be told"
        more = f"; and {len(self.causes) - MOST_TOLD} more parts" if len(self.causes) > MOST_TOLD else ""
        harmless = f" ({self.others} other parts differ, which by themselves change nothing here)" if self.others else ""
        return f"Inside, the environment differs in {told}{more}{harmless}."

    def mend(self, env: Any) -> str:
        """What to do, the likeliest first."""
        known = known_hidden(env)
        if known:
            return (
                f"Show what is hidden ({', '.join(known)}) in the observation, with `irl_gym.environments.reveal.Reveal(env)`."
            )
        shown = self._shown()
        reveal = f"`irl_gym.environments.reveal.Reveal(env, {shown})`, with all the values that there are" if shown else ""
        if self.drawn:
            fixed = "`irl_gym.environments.seeded_starts.SeededStarts(env, (0,))`"
            fix = f"Resets draw it, and no step changes it: fix what they draw, with {fixed}"
            return f"{fix}; or show it in the observation, with {reveal}." if reveal else f"{fix}."
        count = (
            "count what happens on average, with `irl_gym.tabulate(env, gamma=gamma, "
            "by=irl_gym.tables.counted.counting.Interaction())`"
        )
        if reveal:
            return f"Show what is hidden in the observation, with {reveal}; or {count}."
        if _continuous(env):
            return f"Make cells of the state itself, with `discretize(env.unwrapped, gamma=gamma, bins=20)`; or {count}."
        return (
            "To show what is hidden in the observation, give the environment an integer attribute that says it, and name that, "
            f'as in `irl_gym.environments.reveal.Reveal(env, {{"name": 2}})` for two values; or {count}.'
        )

    def _shown(self) -> dict[str, Any]:
        """What `Reveal` is given; empty where it cannot show each cause."""
        shown = {one.name: _values(one) for one in self.causes}
        return shown if len(shown) <= MOST_TOLD and all(can_be_shown(name) and n for name, n in shown.items()) else {}


def _continuous(env: Any) -> bool:
    """Can the state of the environment inside be set, and is it of floats?"""
    try:
        return not isinstance(physics_of(env.unwrapped).coordinates, IntegerCoordinate)
    except (IrlGymError, LookupError, TypeError, ValueError, AttributeError):
        return False


def _values(part: Difference) -> int | list[Any] | None:
    """The number of its values as far as they were seen, or these; None where they cannot be listed."""
    seen = [one.item() if isinstance(one, np.generic) else one for one in (part.first, part.second)]
    if part.more or part.said or not all(isinstance(one, bool | int | str | None) for one in seen):
        return None
    if all(isinstance(one, int) and one >= 0 for one in seen):
        return max(int(one) for one in seen) + 1
    return sorted(seen, key=lambda one: (one is not None, isinstance(one, str), one))


def hidden_part(trials: Trials, does: Does, found: Any, newcomer: Any, action: int, n_actions: int, seed: int) -> HiddenPart:
    """What makes the difference between two inner states under an action; does(state, action) is what an action does."""
    differ = trials.snapshots.differences(found, newcomer)
    causes = [part for part in differ[:MOST_TRIED] if _matters(trials, does, found, newcomer, action, part)]
    parts = causes or differ
    return HiddenPart(parts, len(differ) - len(parts), bool(parts) and _drawn(trials, parts, n_actions, seed))


def _matters(trials: Trials, does: Does, found: Any, newcomer: Any, action: int, part: Difference) -> bool:
    """Does an action do something else where this part alone is another state's?"""
    crossed = trials.snapshots.crossed(found, newcomer, part)
    if crossed is None:
        return False
    try:
        before, now = (does(state, action) for state in (found, crossed))
    except (IrlGymError, OutsideRandomness):  # such a state may be none of the environment's
        return False
    return before is not None and now is not None and unlike(before, now) is not None


def _drawn(trials: Trials, parts: list[Difference], n_actions: int, seed: int) -> bool:
    first: Any = None
    varied: set[Steps] = set()
    moved: set[Steps] = set()
    for i in range(RESETS):

        def run(i: int = i) -> tuple[Any, Any]:
            rng = np.random.default_rng(i)
            trials.reset()()
            start = trials.snapshots.take()
            for _ in range(STEPS):
                _, _, ended, truncated = trials.move(int(rng.integers(n_actions)))
                if ended or truncated:
                    break
            return start, trials.snapshots.take()

        try:
            start, later = trials.seeded([seed, i, RESETS], run)
        except IrlGymError:
            return False
        first = start if first is None else first
        varied |= {one.steps for one in trials.snapshots.differences(first, start)}
        moved |= {one.steps for one in trials.snapshots.differences(start, later)}
    return all(_met(one.steps, varied) and not _met(one.steps, moved) for one in parts)


def _met(steps: Steps, others: set[Steps]) -> bool:
    """Is it one of these parts, inside one, or does it hold one?"""
    return any(steps[: len(other)] == other[: len(steps)] for other in others)
