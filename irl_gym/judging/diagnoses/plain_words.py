"""What the doctor says, for who does not write Python: states and actions by their names, and the flags that a run can take.

Findings name states by their rows, `s=13 a=2`. A reader of the command line knows "row 1, column 5; right".
"""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence

RECORDING = ("--expert", "--episodes", "--epsilon")
"""Flags that choose an expert and record its episodes: they say nothing to a run that was given a dataset."""
_STATE = re.compile(r"\bs=(\d{1,9})(?: a=(\d{1,9}))?")


def usable_flags(flags: Iterable[str], *, given: bool = False) -> tuple[str, ...]:
    """The flags of a finding that a run can take.

    Args:
        flags: of a finding; see `Finding.flags`.
        given: the run was given a dataset, so that no flag records other episodes.
    """
    return tuple(one for one in flags if not (given and one.split()[0] in RECORDING))


def named_in(sentence: str) -> Iterator[tuple[int, int | None]]:
    """The rows that a sentence names, each with its action, if it has one."""
    for found in _STATE.finditer(sentence):
        yield int(found[1]), None if found[2] is None else int(found[2])


def with_names(sentence: str, state_name: Callable[[int], str], actions: Sequence[str]) -> str:
    """A sentence in which every row and action has its name behind it.

    Args:
        sentence: of a finding.
        state_name: the name of a row of the table, such as `Run.state_name`.
        actions: (A,) names of the actions.
    """

    def told(match: re.Match[str]) -> str:
        state, action = int(match[1]), match[2]
        name = state_name(state)
        words = [] if name in (str(state), f"state {state}") else [name]
        words += [actions[int(action)]] if action is not None and int(action) < len(actions) else []
        return f"{match[0]} ({'; '.join(words)})" if words else match[0]

    return _STATE.sub(told, sentence)
