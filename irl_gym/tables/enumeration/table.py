"""The table of any environment that can be copied, by enumeration of its states.

The published `P` is not needed: the environment itself is stepped, from copies of it, through every outcome of its draws. What
is found is exact, unless some draws cannot be enumerated (a normal number, more outcomes than are allowed, a generator that is
not the environment's own): those steps are run many times and counted, and the evidence says how far the counts can be off.
"""

import json
import math
import os
import re
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from irl_gym import facts
from irl_gym.checks import checked_number
from irl_gym.errors import EnumerationLimit, HiddenState, InvalidParameter, UnknownObservation
from irl_gym.mdp.tabular_mdp import AS_GOOD_AS_EXACT, TabularMDP
from irl_gym.spaces.integer_spaces import checked_members, numbers_of_keys, ranges
from irl_gym.spaces.listed_states import ListedStates, in_order
from irl_gym.tables.copies.calls import called, seeded_globals
from irl_gym.tables.copies.snapshots import ConstantChanged
from irl_gym.tables.copies.stripped import without_watchers
from irl_gym.tables.copies.time_limits import Reader, limited, reader_of, with_limits
from irl_gym.tables.enumeration.deep_walks import walk_on
from irl_gym.tables.enumeration.explored import Explored, load_explored
from irl_gym.tables.enumeration.explorer import Explorer
from irl_gym.tables.enumeration.limits import Limits
from irl_gym.tables.enumeration.outside import OutsideRandomness
from irl_gym.tables.enumeration.recheck import check_kept
from irl_gym.tables.enumeration.told_times import check_times_told
from irl_gym.tables.tabulation import Evidence, Lines, Samples, Tabulation, from_lines
from irl_gym.tables.value_error import with_errors

OnStates = Callable[[int, int], None]
"""Called with the number of states tried and found, as the search goes on."""
_ADDRESS = re.compile(r" at 0x[0-9a-f]+")
"""In the words for an object that has none of its own: another one in every process."""


@dataclass(frozen=True)
class Enumeration(Limits):
    """How the states of an environment are enumerated.

    State that the observation hides is searched for, not excluded: observations are tried again in `revisits` other inner
    states, and where these were not enough to see all of them, random walks are compared with the table. What takes longer
    than these, or a rare order of actions, is not found.

    Raises:
        InvalidParameter: a field outside its range.
    """

    checkpoint: str | os.PathLike | None = None
    """A file (.npz) that the search is kept in, and continued from if it is there; None for none."""
    every: float = 20.0
    """Seconds between two writings of it."""
    known: bool = False
    """Ask first what is known of the environment, such as a published `P`; enumerate where nothing is. For `tabulate`."""

    def __post_init__(self) -> None:
        super().__post_init__()
        checked_number("every", self.every, "seconds, at least 0", least=0)
        if not isinstance(self.checkpoint, str | os.PathLike | None):
            raise InvalidParameter(f"checkpoint is {self.checkpoint!r}: expected the path of a file, or None.")

    def table(self, env: gym.Env, gamma: float, progress: OnStates | None = None, /) -> Tabulation:
        """Enumerate the states of an environment; it is copied, neither stepped nor reset.

        Args:
            env: with integer observations and Discrete actions. Wrappers belong to it, but for those that only watch or limit.
            gamma: discount.
            progress: told how far it is.

        Raises:
            NotDiscrete: an observation space that is not made of integers.
            NotTabular: it cannot be copied, or raises an error.
            HiddenState: one observation behaves in two ways.
            EnumerationLimit: more states, seconds or bytes than allowed.
            RunConflict: a checkpoint of something else.
        """
        reader = reader_of(env)
        ranges(env.observation_space)  # refuses floats
        with seeded_globals([self.seed]):
            try:
                explored = self._explore(env, reader, progress or (lambda tried, found: None))
            except HiddenState as error:
                if reader is None:
                    raise
                raise HiddenState(
                    f"{error} The wrapper {reader.wrapper} {reader.what}: the time may be what is hidden."
                ) from error
        if reader is not None:
            check_times_told(explored, env.observation_space, reader)
        return _assembled(explored, env, gamma, self, reader)

    def _explore(self, env: gym.Env, reader: Reader | None, on_states: OnStates) -> Explored:
        """Search; anew with more in the inner state, or with counts, where the search finds that it has to be so."""
        always: frozenset[str] = frozenset()
        outside, modules = "", False
        if self.checkpoint is not None and not Path(self.checkpoint).absolute().parent.is_dir():
            raise InvalidParameter(f"checkpoint is {str(self.checkpoint)!r}: expected a file in a folder that exists. Make it.")
        while True:
            explored = None
            if self.checkpoint is not None and Path(self.checkpoint).exists():
                space: Any = env.action_space
                explored = load_explored(Path(self.checkpoint), env.observation_space, int(space.n), self._identity(env))
                outside, modules = outside or explored.outside, modules or explored.modules
                always |= frozenset(explored.always)
            try:
                own = without_watchers(env) if reader is None else with_limits(env)
                called(lambda own=own: own.reset(seed=self.seed))
                explorer = Explorer(own, self, explored, always, bool(outside), modules, on_states)
                if explorer.continued:
                    check_kept(explorer)
                    explorer.resume()
                else:
                    explorer.begin()
                explorer.explored.outside, explorer.explored.modules = outside, modules
                explorer.explored.always = tuple(sorted(always))
                explorer.explored.settle()
                self._run(explorer, env, on_states)
                return explorer.explored
            except ConstantChanged as error:
                always |= frozenset({error.name})
                self._forget()
            except UnknownObservation as error:
                limit, wrappers = limited(env)
                if not wrappers or reader is not None:
                    raise
                names = ", ".join(type(one).__name__ for one in wrappers)
                raise UnknownObservation(
                    f"{error} Around a TimeLimit of {limit} steps, which a table does not have, are: {names}. Leave out what "
                    "counts on it."
                ) from error
            except OutsideRandomness as error:
                drive = error.of_modules and not (modules or outside)
                outside, modules = ("", True) if drive else (error.what, False)
                self._forget()

    def _run(self, explorer: Explorer, env: gym.Env, on_states: OnStates) -> None:
        written = told = time.monotonic()
        try:
            for _ in explorer.expand():
                now = time.monotonic()
                if now - told > 0.1:
                    on_states(explorer.explored.n_expanded, len(explorer.explored.keys))
                    told = now
                if self.checkpoint is not None and now - written > self.every:
                    _guard(explorer)
                    self._save(explorer, env)
                    written = time.monotonic()
            if explorer.open:
                walk_on(explorer, explorer.seconds)
        except KeyboardInterrupt:
            if not explorer.trials.snapshots.changed_constants():
                self._save(explorer, env)
            raise
        except EnumerationLimit:
            _guard(explorer)
            self._save(explorer, env)
            raise
        _guard(explorer)
        self._save(explorer, env)
        on_states(explorer.explored.n_expanded, len(explorer.explored.keys))

    def _save(self, explorer: Explorer, env: gym.Env) -> None:
        if self.checkpoint is not None:
            explorer.explored.save(Path(self.checkpoint), env.observation_space, self._identity(env))

    def _forget(self) -> None:
        if self.checkpoint is not None:
            Path(self.checkpoint).unlink(missing_ok=True)

    def _identity(self, env: gym.Env) -> dict[str, Any]:
        """What has to be the same for a search to be continued."""
        spec = env.spec
        layers, layer = [], env
        while isinstance(layer, gym.Wrapper):
            layers.append(type(layer).__qualname__)
            layer = layer.env
        kind = type(env.unwrapped)
        return {
            "environment": f"{kind.__module__}.{kind.__qualname__}",
            "wrappers": layers,
            "spec": None if spec is None else json.loads(_ADDRESS.sub("", json.dumps([spec.id, spec.kwargs], default=repr))),
            "observations": str(env.observation_space),
            "actions": str(env.action_space),
            "limit": None if not limited(env)[1] else limited(env)[0],
            "settings": [self.most_outcomes, self.runs, self.start_runs, self.seed],
        }


def _guard(explorer: Explorer) -> None:
    names = explorer.trials.snapshots.changed_constants()
    if names:
        raise ConstantChanged(names[0])


def _assembled(explored: Explored, env: gym.Env, gamma: float, limits: Limits, reader: Reader | None) -> Tabulation:
    """The table of what was found: rows in the order of the observations, ends that are states too as terminal copies."""
    space = env.observation_space
    only_ends = [key for key in explored.ends if key not in explored.ids]
    numbers = checked_members(space, numbers_of_keys(space, [*explored.keys, *only_ends]))
    order = in_order(numbers)
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order))
    end_rows = np.empty(len(explored.ends), dtype=np.int64)
    position = {key: len(explored.keys) + i for i, key in enumerate(only_ends)}
    both = [key for key in explored.ends if key in explored.ids]
    both.sort(key=lambda key: place[explored.ids[key]])
    copies = {int(place[explored.ids[key]]): len(order) + i for i, key in enumerate(both)}
    for key, number in explored.ends.items():
        end_rows[number] = copies[int(place[explored.ids[key]])] if key in explored.ids else place[position[key]]
    rows, successors = np.array(explored.rows), np.array(explored.successors)
    A = explored.n_actions
    towards = np.where(successors < 0, 0, place[np.maximum(successors, 0)])
    if end_rows.size:
        towards = np.where(successors < 0, end_rows[np.maximum(-1 - successors, 0)], towards)
    lines = Lines(place[rows // A] * A + rows % A, towards, np.array(explored.probabilities), np.array(explored.rewards))
    states = ListedStates(space, numbers[order], copies)
    d0 = np.zeros(states.n_states)
    for number, probability in explored.starts.items():
        d0[place[number]] += probability
    evidence = _evidence(explored, len(copies), limits.revisits > 0, reader)
    horizon = None if reader is None else reader.limit
    made = from_lines(lines, d0 / d0.sum(), A, states, gamma=gamma, evidence=evidence, horizon=horizon)
    if evidence.exact:
        return made
    sampled = np.array(sorted(explored.sampled), dtype=np.int64)
    if sampled.size:
        visits = np.full(states.n_states * A, AS_GOOD_AS_EXACT)
        visits[place[sampled // A] * A + sampled % A] = limits.runs
        visits = np.where(made.mdp.terminal[:, None], 0, visits.reshape(-1, A))
        made = replace(made, mdp=TabularMDP(made.mdp.P, gamma, made.mdp.d0, visits, horizon))
    starts = limits.start_runs if explored.starts_counted else math.inf
    paid = min(explored.rewards), max(explored.rewards)
    samples = Samples(made.mdp.P.data, starts, paid)
    return with_errors(replace(made, samples=samples))


def _evidence(explored: Explored, split: int, looked: bool, reader: Reader | None) -> Evidence:
    """How the table was obtained, in words that are the same where the search was interrupted and continued."""
    counted = explored.counted["rows"]
    method = f"Enumeration of {facts.counted(len(explored.keys))} from copies of the environment"
    if explored.outside:
        method = f"The environment draws from {explored.outside}, which is not its own. {method}"
    if not counted:
        method += f", with every outcome of its draws.{'' if looked else ' Hidden state was not looked for.'}"
        method += _left_out(explored, reader)
        return Evidence(method, exact=True, merged=0, split=split, check=None)
    mean_runs = explored.counted["runs"] / counted
    # Hoeffding's inequality, for all counted probabilities at once.
    error = math.sqrt(math.log(2 * explored.counted["lines"] / 0.05) / (2 * explored.counted["fewest"]))
    method += (
        f"; {counted:,} step(s) or reset(s) whose draws cannot be enumerated were run {mean_runs:,.0f} times each and counted: "
        f"sampling leaves probabilities within {error:.3f}, all at once, with 95 % confidence, if observations hide no state."
    )
    method += _looked_for(explored, looked)
    method += _left_out(explored, reader)
    return Evidence(method, exact=False, merged=0, split=split, check=None, error=error)


def _looked_for(explored: Explored, looked: bool) -> str:
    """How far hidden state was searched for, where something was counted."""
    if not looked:
        return " Hidden state was not looked for."
    told = " Hidden state was not looked for in counted steps." if explored.counted["uncompared"] else ""
    if explored.resets:
        rare = 1 - 0.05 ** (1 / explored.resets)
        told += (
            f" Of {explored.resets} further resets none led a random walk to a step that the table does not have: fewer than "
            f"{rare:.1%} do, with 95 % confidence."
        )
    return told


def _left_out(explored: Explored, reader: Reader | None) -> str:
    """What the environment did that a table cannot hold, and that of a time limit which this one holds."""
    within = ""
    if reader is not None:
        steps = facts.counted(reader.limit, "step")
        within = f" The limit of {steps} is part of it, as {reader.wrapper} reads it: episodes end there."
    if not explored.counted["truncated"]:
        return within
    return f"{within} The environment truncated steps itself; truncation is not part of a table."
