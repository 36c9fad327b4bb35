"""What the doctor says, for who does not write Python: mends as flags, and states and actions by their names.

Findings name arguments as Python writes them, `l1="auto"`, and states by their rows, `s=13 a=2`. A reader of the command line
knows `--l1 auto`, and "row 1, column 5; right".
"""

import re
from collections.abc import Callable, Sequence

VALUED = {"l1": "--l1", "margin_cap": "--margin-cap", "reward_on": "--reward-on", "slack": "--slack"}
"""Arguments that a mend gives a value, and what scripts/recover_and_retrain.py calls them."""
WORDS = {
    r"FiniteLP\(\) with its defaults": "--learner finite-lp --l1 0 --margin-cap auto",
    r"FiniteLP\b": "--learner finite-lp",
    r"[Mm]ore episodes": "--episodes",
    r"[Mm]ore rounds": "--rounds",
    r"(?:larger|smaller) gamma|a gamma further": "--gamma",
    r"features\b": "--features",
    "start_seeds": "--start-seeds",
    "epsilon": "--epsilon",
    "total_timesteps": "--total-timesteps",
    "`inner`": "--inner",
    r"with shaping|shaping=True": "--shaping",
}
"""What else a mend says, as patterns, and the flags for it."""
_SAID = re.compile(rf'(?P<name>{"|".join(VALUED)})=(?P<quote>"?)(?P<value>[-\w.]+?)(?P=quote)(?![-\w"]|\.\d)|{"|".join(WORDS)}')
_STATE = re.compile(r"\bs=(\d+)(?: a=(\d+))?")


def flags_of(mend: str, *, given: bool = False) -> tuple[str, ...]:
    """The flags of scripts/recover_and_retrain.py that a mend speaks of, in its order, each once; none where it names none.

    Args:
        mend: of a finding.
        given: the run was given a dataset, so that no flag records other episodes.
    """
    found: dict[str, None] = {}
    for said in _SAID.finditer(mend):
        if said["name"] is not None:
            found[f"{VALUED[said['name']]} {said['value'].removesuffix('.0')}"] = None
            continue
        flag = next(flag for word, flag in WORDS.items() if re.fullmatch(word, said[0]))
        if not (given and flag in ("--episodes", "--epsilon", "--start-seeds")):
            found[flag] = None
    return tuple(found)


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
