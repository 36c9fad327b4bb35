"""What the doctor says, for who does not write Python: states and actions by their names, and the flags that a run can take.

A finding has its states and actions by number, `s=13 a=2`. A reader of the command line knows "row 1, column 5; right".
"""

from collections.abc import Callable, Iterable, Sequence

from irl_gym.judging.diagnoses.findings import row_of

RECORDING = ("--expert", "--episodes", "--epsilon")
"""Flags that choose an expert and record its episodes: they say nothing to a run that was given a dataset."""


def usable_flags(flags: Iterable[str], *, given: bool = False) -> tuple[str, ...]:
    """The flags of a finding that a run can take.

    Args:
        flags: of a finding; see `Finding.flags`.
        given: the run was given a dataset, so that no flag records other episodes.
    """
    return tuple(one for one in flags if not (given and one.split()[0] in RECORDING))


def with_names(state: int, action: int | None, state_name: Callable[[int], str], actions: Sequence[str]) -> str:
    """A state, or a state and an action, by number, with their names behind.

    Args:
        state: a row of the table.
        action: the number of an action; None for the state alone.
        state_name: the name of a row of the table, such as `Run.state_name`.
        actions: (A,) names of the actions.
    """
    name = state_name(state)
    words = [] if name in (str(state), f"state {state}") else [name]
    words += [] if action is None else [actions[action]]
    return f"{row_of(state, action)} ({'; '.join(words)})" if words else row_of(state, action)
