"""Breadth-first search over the states of an environment that can be copied.

A state is an observation. From a copy of the environment in that state each action is tried, in every outcome of its draws
(`irl_gym.enumeration.trials`). An observation that is met again in another inner state is tried again: where it then behaves
differently, it hides something, and `HiddenState` names the pair that proves it. Axes: A actions.
"""

import time
from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import numpy as np

from irl_gym.enumeration.explored import Explored
from irl_gym.enumeration.hidden_state import Behaviour, behaviour_of_lines, proof, shown, unlike
from irl_gym.enumeration.limits import Limits
from irl_gym.enumeration.trials import Outcomes, Trials
from irl_gym.errors import EnumerationLimit, HiddenState, NotTabular, RunConflict
from irl_gym.integer_spaces import key_of

CERTAIN = 1_000
"""Of the first states found, every one is tried again in other inner states; of later ones, each tenth."""
MANY_STARTS = 100
"""First observations, counted, above which most have to come more than once: else they could not all be listed."""


class Explorer:
    """One search. `explored` holds what was found.

    Args:
        env: its own copy, without watchers, reset once.
        limits: when to stop, and how to count.
        explored: where an earlier search stopped; None to begin.
        always: names of attributes that belong to the inner state however large they are.
        counting: count every random step, since draws do not tell all.
    """

    def __init__(self, env: gym.Env, limits: Limits, explored: Explored | None, always: frozenset[str], counting: bool):
        space: Any = env.action_space
        self.limits, self.n_actions = limits, int(space.n)
        self.space = env.observation_space
        self.key = key_of(self.space)
        self.trials = Trials(env, limits, always, counting)
        self.compared = 0
        self._waiting: dict[int, Any] = {}
        self._marks: dict[int, int] = {}
        self._tries: dict[int, int] = {}
        self._newcomers: dict[int, list[tuple[Any, list[int]]]] = {}
        self._held = 0
        self.explored = explored or Explored(self.n_actions)
        if explored is None:
            self._begin()
        else:
            self._continue()

    def expand(self) -> Iterator[None]:
        """Expand one state after the other, until none waits or a limit is reached.

        Raises:
            EnumerationLimit: more states, bytes or seconds than allowed.
            HiddenState: one observation behaves in two ways.
            NotTabular: the environment raised an error.
        """
        explored, began = self.explored, time.monotonic()
        while explored.n_expanded < len(explored.keys):
            number = explored.n_expanded
            state = self._waiting.pop(number)
            self._held -= _size(state)
            explored.expand(number, [line for action in range(self.n_actions) for line in self._row(number, state, action)])
            for newcomer, way in self._newcomers.pop(number, ()):
                self._compare(number, newcomer, way, state)
            self._check_limits(time.monotonic() - began)
            yield

    def _begin(self) -> None:
        seen = self.trials.outcomes(self.trials.reset(), -1, self._keep, runs=self.limits.start_runs)
        self._count(seen)
        different = len({one.made[0] for one in seen.all})
        if seen.runs and different > max(MANY_STARTS, seen.runs / 2):
            raise NotTabular(
                f"{seen.runs} resets gave {different} different observations: expected few enough to list. Fix what reset "
                "draws, as with `irl_gym.seeded_starts.SeededStarts(env, seeds=(0,))`."
            )
        for one in seen.all:
            key, state = one.made
            number = self._arrive(key, state, one.script, -1, -1)
            self.explored.starts[number] = self.explored.starts.get(number, 0.0) + one.probability

    def _row(self, number: int, state: Any, action: int) -> list[tuple[int, int, float, float]]:
        """The lines of one pair; new states are numbered."""
        found: dict[tuple[int, float], float] = {}
        row = number * self.n_actions + action
        seen = self.trials.outcomes(self.trials.step(state, action), row, self._keep, runs=self.limits.runs)
        self._count(seen)
        for one in seen.all:
            (_, reward, terminated), (key, reached) = one.result, one.made
            successor = self.explored.end(key) if terminated else self._arrive(key, reached, one.script, number, action)
            found[successor, reward] = found.get((successor, reward), 0.0) + one.probability
        return [(action, successor, probability, reward) for (successor, reward), probability in found.items()]

    def _count(self, seen: Outcomes) -> None:
        successors = {(one.made[0], one.result[2]) for one in seen.all}
        if seen.runs and len(successors) > 1:
            counted = self.explored.counted
            counted["rows"] += 1
            counted["runs"] += seen.runs
            counted["lines"] += len(successors)

    def _keep(self, result: tuple[Any, float, bool]) -> tuple[Any, Any]:
        """Key of an outcome, and its inner state where the observation is new or is doubted; None elsewhere."""
        observation, _, terminated = result
        key = self.key(observation)
        number = self.explored.ids.get(key)
        wanted = not terminated and (number is None or self._doubted(number))
        return key, self.trials.snapshots.take() if wanted else None

    def _doubted(self, number: int) -> bool:
        allowed = self.limits.revisits if number < CERTAIN or number % 10 == 0 else 0
        return self._tries.get(number, 0) < 4 * allowed

    def _arrive(self, key: Any, state: Any, script: tuple[int, ...], parent: int, action: int) -> int:
        """The number of a state that was seen, new or known."""
        number = self.explored.ids.get(key)
        if number is None:
            number = self.explored.add(key, parent, action, script)
            self._waiting[number], self._marks[number] = state, _mark(state)
            self._held += _size(state)
        elif state is not None:
            self._tries[number] = self._tries.get(number, 0) + 1
            if _mark(state) != self._marks.get(number, 0):
                way = [*self.explored.way(parent), action] if parent >= 0 else []
                if number < self.explored.n_expanded:
                    self._compare(number, state, way, None)
                elif len(self._newcomers.setdefault(number, [])) < self.limits.revisits:
                    self._newcomers[number].append((state, way))
        return number

    def _compare(self, number: int, newcomer: Any, way: list[int], state: Any) -> None:
        """Does a state behave the same in another inner state? Counts, which differ by chance, are not compared."""
        if self.explored.counted["rows"]:
            return
        self.compared += 1
        self._tries[number] = self._tries.get(number, 0) + 3
        first, second = behaviour_of_lines(self.explored.lines_of(number)), self._behaviour(newcomer)
        action = unlike(first, second)
        if action is not None:
            state = self._replayed(number) if state is None else state
            differ = self.trials.snapshots.differences(state, newcomer)
            raise HiddenState(proof(self.explored, self.space, number, action, first, second, way, differ))

    def _behaviour(self, state: Any) -> Behaviour:
        found: Behaviour = {}
        for action in range(self.n_actions):
            seen = self.trials.outcomes(self.trials.step(state, action), -1, lambda _: None, runs=1)
            for one in seen.all:
                observation, reward, terminated = one.result
                key = self.key(observation)
                known = self.explored.ends.get(key) if terminated else self.explored.ids.get(key)
                successor = (key, terminated) if known is None else -1 - known if terminated else known
                place = action, successor, round(reward, 9)
                found[place] = found.get(place, 0.0) + one.probability
        return found

    def _check_limits(self, seconds: float) -> None:
        limits, explored = self.limits, self.explored
        size = explored.size + self._held
        expected = None
        if len(explored.keys) > limits.max_states:
            expected = f"max_states={limits.max_states:,}"
        elif limits.max_seconds is not None and seconds > limits.max_seconds:
            expected = f"max_seconds={limits.max_seconds:g}"
        elif size > limits.max_bytes:
            expected = f"max_bytes={limits.max_bytes:.3g}"
        if expected is not None:
            raise EnumerationLimit(
                f"the enumeration stopped at {len(explored.keys):,} states found, {explored.n_expanded:,} of them tried, after "
                f"{seconds:.0f} s, at {size / 1e9:.2f} GB: expected at most {expected}. Raise it, as in `tabulate(env, "
                f"gamma=..., by=Enumeration({expected.split('=')[0]}=...))`; with a `checkpoint` file it continues where "
                "it stopped."
            )

    # An earlier search is continued by playing its paths again: no copy of an environment is ever written to a file.

    def _continue(self) -> None:
        explored = self.explored
        wanted = [False] * len(explored.keys)
        for waiting in range(explored.n_expanded, len(explored.keys)):
            number = waiting
            while number >= 0 and not wanted[number]:
                wanted[number] = True
                number = explored.parents[number]
        states: dict[int, Any] = {}
        for number in np.flatnonzero(wanted).tolist():  # parents before children
            states[number] = self._again(number, states.get(explored.parents[number]))
        self._waiting = {number: states[number] for number in range(explored.n_expanded, len(explored.keys))}
        self._marks = {number: _mark(state) for number, state in states.items()}
        self._held = sum(map(_size, self._waiting.values()))

    def _replayed(self, number: int) -> Any:
        """The inner state in which a state was found first."""
        state = None
        for one in self.explored.path(number):
            state = self._again(one, state)
        return state

    def _again(self, number: int, before: Any) -> Any:
        """The inner state of a state, from its parent's."""
        explored, trials = self.explored, self.trials
        parent, action, script = explored.parents[number], explored.actions[number], explored.scripts[number]
        call = trials.reset() if parent < 0 else trials.step(before, action)
        observation, _, _ = trials.again(call, -1 if parent < 0 else parent * self.n_actions + action, script)
        if self.key(observation) != explored.keys[number]:
            raise RunConflict(
                f"the enumeration that was kept led to {shown(self.space, explored.keys[number])} where the environment now "
                f"leads to {shown(self.space, self.key(observation))}: expected the same environment. Remove the file to begin "
                "anew."
            )
        return trials.snapshots.take()


def _mark(state: Any) -> int:
    return hash(state) if isinstance(state, bytes) else id(state)


def _size(state: Any) -> int:
    return len(state) if isinstance(state, bytes) else 2_000
