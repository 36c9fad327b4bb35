"""Does an environment still do what an earlier search found? Asked of its starts and of some states, before it is continued."""

from typing import Any

from irl_gym.tables.enumeration.explorer import Explorer
from irl_gym.tables.enumeration.hidden_state import SAME, Behaviour, behaviour_of_lines, shown, unlike
from irl_gym.tables.enumeration.replays import another
from irl_gym.tables.enumeration.trials import MOST_REFUSALS

CHECKED = 20
"""States of an earlier search that are tried again before it is continued."""


def check_kept(explorer: Explorer) -> None:
    """Does the environment still do what is kept, at a reset and in some states? Nothing is changed by asking.

    Raises:
        RunConflict: it does something else, as the same class with other arguments would.
    """
    explored, trials = explorer.explored, explorer.trials
    runs = explorer.limits.start_runs
    seen = trials.outcomes(trials.reset(), -1, lambda result: explorer.key(result[0]), runs=runs)
    starts: dict[int | None, float] = {}
    for one in seen.all:
        number = explored.ids.get(one.made)
        starts[number] = starts.get(number, 0.0) + one.probability
    if starts.keys() != explored.starts.keys() or any(abs(p - explored.starts[s or 0]) > SAME for s, p in starts.items()):
        raise another("begins otherwise than the environment does now")
    last = explored.n_expanded - 1
    for number in sorted({i * last // (CHECKED - 1) for i in range(CHECKED)}) if last >= 0 else ():
        state, kept = explorer.replays.state(number), behaviour_of_lines(explored.lines_of(number))
        if not any(_kept(explorer, number, state, kept, refusals) for refusals in (0, MOST_REFUSALS)):
            now = shown(explorer.space, explored.keys[number])
            raise another(f"goes on from {now} otherwise than the environment does now")
    trials.refusals = explored.counted["refusals"]


def _kept(explorer: Explorer, number: int, state: Any, kept: Behaviour, refusals: int) -> bool:
    explorer.trials.refusals = refusals
    again = explorer.behaviour(state, [], number)
    return again is not None and unlike(kept, again) is None
