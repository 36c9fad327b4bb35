"""What an enumeration has found so far: states, how each was reached, and what each action does there.

States are numbered as they are found. A state that is entered with `terminated` is an *end*, of its own numbering: the same
observation can be both. How a state was reached is kept as a path of draws, not as a copy of the environment, so a file of it
holds numbers only, and whoever continues from it plays those paths again.

Axes: n states, e ends, m lines; a line is a successor of a pair (state, action) with its probability and reward.
"""

import json
from array import array
from collections.abc import Hashable
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces

from irl_gym.checks import LARGEST
from irl_gym.errors import DamagedFile, EnumerationLimit, InvalidInput, RunConflict
from irl_gym.files.archives import json_in, read_arrays
from irl_gym.files.own_files import write_arrays
from irl_gym.spaces.integer_spaces import checked_members, keys_of_numbers, numbers_of_keys, ranges

ScriptKey = tuple[int, ...]
"""Outcomes of draws; (-1, i) is run i of a call whose draws could not be enumerated."""

COUNTED = {
    "rows": "pairs (and starts) whose draws could not be enumerated",
    "runs": "runs made of them in all",
    "fewest": "runs made of one of them at least",
    "lines": "lines that they gave",
    "refusals": "calls that refused to be enumerated",
    "uncompared": "inner states that were not compared, because their steps are counted",
    "truncated": "steps that the environment itself truncated",
}

PARTS = {
    "states": "iu", "ends": "iu", "parents": "i", "actions": "i", "script_lengths": "iu", "scripts": "i", "rows": "i",
    "successors": "i", "probabilities": "f", "rewards": "f", "first_line": "i", "start_numbers": "i", "start_values": "f",
    "sampled": "i", "outside": "U", "resets": "i",
}  # fmt: skip
"""The arrays of a file and the kinds of their dtype."""


class Explored:
    """States, ends and lines found so far; it grows.

    Args:
        n_actions: A.
    """

    def __init__(self, n_actions: int):
        self.n_actions = n_actions
        self.ids: dict[Hashable, int] = {}
        self.ends: dict[Hashable, int] = {}
        self.parents, self.actions = array("q"), array("q")
        self.scripts: list[ScriptKey] = []
        self.rows, self.successors = array("q"), array("q")
        self.probabilities, self.rewards = array("d"), array("d")
        self.first_line = array("q", [0])
        """Where the lines of each state begin, in the order of the numbers."""
        self.starts: dict[int, float] = {}
        self.counted: dict[str, int] = dict.fromkeys(COUNTED, 0)
        """How often what happened, by the names of COUNTED."""
        self.always: tuple[str, ...] = ()
        """Attributes that belong to the inner state however large they are."""
        self.outside = ""
        """What it draws from that is not its own, so that all is counted; empty for nothing."""
        self.modules = False
        """Were the functions of the modules random and numpy.random driven?"""
        self.sampled: set[int] = set()
        """Pairs, number of the state * A + action, whose lines are counts."""
        self.resets = 0
        """Resets whose walks were compared with the table, where resets are counted."""
        self.keys: list[Hashable] = []
        self._whole = (0, 0, 0, dict(self.counted))

    @property
    def n_expanded(self) -> int:
        """States whose actions have been tried."""
        return len(self.first_line) - 1

    @property
    def starts_counted(self) -> bool:
        """Was the reset counted, since its draws cannot be listed?"""
        return any(self.scripts[number][:1] == (-1,) for number in self.starts)

    def add(self, key: Hashable, parent: int, action: int, script: ScriptKey) -> int:
        """Number a new state; the parent of a start is -1."""
        number = self.ids[key] = len(self.keys)
        self.keys.append(key)
        self.parents.append(parent)
        self.actions.append(action)
        self.scripts.append(script)
        return number

    def end(self, key: Hashable) -> int:
        """The successor that stands for an end: -1 - its number."""
        return -1 - self.ends.setdefault(key, len(self.ends))

    def expand(self, number: int, lines: list[tuple[int, int, float, float]]) -> None:
        """Add the lines of the next state: action, successor, probability, reward."""
        for action, successor, probability, reward in lines:
            self.rows.append(number * self.n_actions + action)
            self.successors.append(successor)
            self.probabilities.append(probability)
            self.rewards.append(reward)
        self.first_line.append(len(self.rows))
        self.settle()

    def settle(self) -> None:
        """What has been found up to here is whole: a file holds no half of a state, whenever the search is interrupted."""
        self._whole = (len(self.keys), len(self.ends), self.n_expanded, dict(self.counted))

    def lines_of(self, number: int) -> list[tuple[int, int, float, float]]:
        """The lines of an expanded state: action, successor, probability, reward."""
        part = slice(self.first_line[number], self.first_line[number + 1])
        actions = [row - number * self.n_actions for row in self.rows[part]]
        return list(zip(actions, self.successors[part], self.probabilities[part], self.rewards[part], strict=True))

    def path(self, number: int) -> list[int]:
        """The states on the way to a state, a start first."""
        way = [number]
        while self.parents[way[-1]] >= 0:
            way.append(self.parents[way[-1]])
        return way[::-1]

    def way(self, number: int) -> list[int]:
        """The actions on the way to a state."""
        return [self.actions[one] for one in self.path(number)[1:]]

    @property
    def size(self) -> int:
        """Bytes held, about: keys and their places, ways and lines."""
        return 300 * len(self.keys) + 32 * len(self.rows) + 150 * len(self.ends)

    def save(self, path: Path, space: spaces.Space, identity: dict[str, Any]) -> None:
        """Write all that is whole; beside first, then renamed."""
        n, e, expanded, counted = self._whole
        m = self.first_line[expanded]
        scripts = self.scripts[:n]
        k = len(numbers_of_keys(space, self.keys[:1])[0])
        ends = numbers_of_keys(space, list(self.ends)[:e]) if e else np.zeros((0, k), dtype=np.int64)
        path.parent.mkdir(parents=True, exist_ok=True)
        arrays = dict(
            identity=np.array(json.dumps(identity, sort_keys=True)), counted=np.array(json.dumps(counted)),
            sampled=np.array(sorted(row for row in self.sampled if row < expanded * self.n_actions), dtype=np.int64),
            always=np.array(json.dumps(self.always)), outside=np.array(self.outside), resets=np.array(self.resets),
            modules=np.array(self.modules),
            states=numbers_of_keys(space, self.keys[:n]), ends=ends,
            parents=np.array(self.parents[:n]), actions=np.array(self.actions[:n]),
            script_lengths=np.array([len(script) for script in scripts], dtype=np.int64),
            scripts=np.array([one for script in scripts for one in script], dtype=np.int64),
            rows=np.array(self.rows[:m]), successors=np.array(self.successors[:m]),
            probabilities=np.array(self.probabilities[:m]), rewards=np.array(self.rewards[:m]),
            first_line=np.array(self.first_line[: expanded + 1]),
            start_numbers=np.array(list(self.starts), dtype=np.int64), start_values=np.array(list(self.starts.values())),
        )  # fmt: skip
        write_arrays(path, arrays)


def too_large(explored: Explored, seconds: float, size: float, expected: str) -> EnumerationLimit:
    """The error for a search that has met a limit, such as `max_states=10`."""
    return EnumerationLimit(
        f"the enumeration stopped at {len(explored.keys):,} states found, {explored.n_expanded:,} of them tried, after "
        f"{seconds:.0f} s, at {size / 1e9:.2f} GB: expected at most {expected}. Raise it, as in `tabulate(env, "
        f"gamma=..., by=Enumeration({expected.split('=')[0]}=...))`; with a `checkpoint` file it continues where "
        "it stopped."
    )


def load_explored(path: Path, space: spaces.Space, n_actions: int, identity: dict[str, Any]) -> Explored:
    """What `Explored.save` wrote.

    Raises:
        RunConflict: a file of another environment or of other settings, or none that can be read.
    """
    try:
        found = read_arrays(path)
        told = {name: json_in(found, name) for name in ("identity", "counted", "always")}
        asked = told["identity"]
        if not isinstance(asked, dict):
            raise DamagedFile(f"it is of {asked!r:.80}")
        if asked == json.loads(json.dumps(identity, sort_keys=True)):
            _check(found, told, space, n_actions)
            return _rebuilt(found, told, space, n_actions)
    except (InvalidInput, OSError) as error:
        raise RunConflict(
            f"{path} holds no enumeration ({error}): expected one to continue. Remove it to begin anew."
        ) from error
    different = sorted(name for name in {*asked, *identity} if asked.get(name) != identity.get(name))
    raise RunConflict(
        f"{path} holds the enumeration of something else (other: {', '.join(different)}): expected the same environment "
        "and settings. Name another file, or remove it to begin anew."
    )


def _check(found: dict[str, np.ndarray], told: dict[str, Any], space: spaces.Space, n_actions: int) -> None:
    """Are these the arrays of a search, each of its size, each number within what it numbers?

    Raises:
        DamagedFile: naming the first array that is not.
        UnknownObservation: a state that is no member of the space.
    """
    missing = [name for name in PARTS if name not in found]
    if missing:
        raise DamagedFile(f"it has no {missing[0]}: expected one beside {sorted(found)[:9]}.")
    sizes = {name: found[name].shape[:1] or (0,) for name in PARTS}
    n, e, k = sizes["states"], sizes["ends"], (len(ranges(space)),)
    shapes = {**sizes, "states": n + k, "ends": e + k, "parents": n, "actions": n, "script_lengths": n}
    shapes |= dict.fromkeys(("successors", "probabilities", "rewards"), sizes["rows"])
    shapes |= {"start_values": sizes["start_numbers"], "outside": (), "resets": ()}
    for name, kinds in PARTS.items():
        if found[name].dtype.kind not in kinds or found[name].shape != shapes[name]:
            there = f"shape {found[name].shape} and dtype {found[name].dtype}"
            raise DamagedFile(f"its {name} have {there}: expected shape {shapes[name]}.")
    first, N = found["first_line"], len(found["states"])
    pairs = (first.size - 1) * n_actions
    spans: dict[str, tuple[float, Any]] = {
        "parents": (-1, np.arange(N)), "actions": (-1, n_actions), "script_lengths": (0, found["scripts"].size + 1),
        "scripts": (-1, 2**62), "rows": (0, pairs), "successors": (-len(found["ends"]), N), "probabilities": (0, 1 + 1e-9),
        "rewards": (-LARGEST, LARGEST), "first_line": (0, found["rows"].size + 1), "start_numbers": (0, N),
        "start_values": (0, 1 + 1e-9), "sampled": (0, pairs), "resets": (0, 2**62),
    }  # fmt: skip
    for name, (low, high) in spans.items():
        wrong = ~((found[name] >= low) & (found[name] < high))
        if wrong.any():
            raise DamagedFile(f"its {name} hold {found[name][wrong][0]}: expected from {low} to below {np.max(high)}.")
    counts, always, m = told["counted"], told["always"], found["rows"].size
    fits = {
        "first_line": 0 < first.size <= N + 1 and first[0] == 0 and first[-1] == m and (np.diff(first) >= 0).all(),
        "scripts": N > 0 and found["script_lengths"].sum() == found["scripts"].size,
        "counted": isinstance(counts, dict) and all(type(one) is int for one in counts.values()),
        "always": isinstance(always, list) and all(type(one) is str for one in always),
    }  # fmt: skip
    for name, fine in fits.items():
        if not fine:
            raise DamagedFile(f"its {name} does not fit the rest: expected that of one search.")
    for name in ("states", "ends"):
        checked_members(space, found[name].astype(np.int64))


def _rebuilt(found: dict[str, np.ndarray], told: dict[str, Any], space: spaces.Space, n_actions: int) -> Explored:
    explored = Explored(n_actions)
    keys = keys_of_numbers(space, found["states"])
    stops = np.cumsum(found["script_lengths"])
    scripts = [tuple(part.tolist()) for part in np.split(found["scripts"], stops[:-1])]
    for one, parent, action, script in zip(keys, found["parents"].tolist(), found["actions"].tolist(), scripts, strict=True):
        explored.add(one, parent, action, script)
    for one in keys_of_numbers(space, found["ends"]):
        explored.end(one)
    for name in ("rows", "successors"):
        setattr(explored, name, array("q", found[name].astype(np.int64).tolist()))
    for name in ("probabilities", "rewards"):
        setattr(explored, name, array("d", found[name].astype(float).tolist()))
    explored.first_line = array("q", found["first_line"].tolist())
    explored.starts = dict(zip(found["start_numbers"].tolist(), found["start_values"].tolist(), strict=True))
    explored.counted |= told["counted"]
    explored.always = tuple(told["always"])
    explored.sampled = set(found["sampled"].tolist())
    explored.outside, explored.resets = str(found["outside"]), int(found["resets"])
    explored.modules = "modules" in found and bool(found["modules"].any())  # a file of an earlier version
    if len(explored.ids) < len(keys) or len(explored.ends) < len(found["ends"]):
        raise DamagedFile("a state stands in it twice: expected each once.")
    explored.settle()
    return explored
