"""Breadth-first search over the states of an environment that can be copied.

A state is an observation. From a copy of the environment in that state each action is tried, in every outcome of its draws
(`irl_gym.tables.enumeration.trials`). An observation that is met again in another inner state is tried again, and so are those
that follow it: where one then behaves differently, it hides something, and `HiddenState` names the pair that proves it. Axes: A
actions.
"""

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import gymnasium as gym

from irl_gym.errors import HiddenState, IrlGymError, NotTabular, UnknownObservation
from irl_gym.spaces.integer_spaces import as_batch, checked_members, key_of, to_numbers
from irl_gym.tables.enumeration.explored import Explored, too_large
from irl_gym.tables.enumeration.hidden_part import hidden_part
from irl_gym.tables.enumeration.hidden_state import Behaviour, behaviour_of_lines, proof, unlike
from irl_gym.tables.enumeration.limits import Limits
from irl_gym.tables.enumeration.replays import Replays
from irl_gym.tables.enumeration.trials import Call, Outcomes, Trials

CERTAIN = 1_000
"""Of the first states found, every one is tried again in other inner states; of later ones, each tenth."""
MANY_STARTS = 100
"""First observations, counted, above which most have to come more than once: else they could not all be listed."""

Way = int | tuple[Any, int]
"""How an inner state was reached: as a state was found, by its number (-1: reset); or by another way and one more action."""


class Explorer:
    """One search. `explored` holds what was found.

    Args:
        env: its own copy, without watchers, reset once.
        limits: when to stop, and how to count.
        explored: where an earlier search stopped; None to begin.
        always: names of attributes that belong to the inner state however large they are.
        counting: count every random step, since draws do not tell all.
        modules: drive the functions of the modules random and numpy.random too.
        on_states: told the states tried and found while one call takes long.
    """

    def __init__(
        self, env: gym.Env, limits: Limits, explored: Explored | None, always: frozenset[str], counting: bool,
        modules: bool = False, on_states: Callable[[int, int], None] = lambda tried, found: None,
    ):  # fmt: skip
        space: Any = env.action_space
        self.limits, self.n_actions = limits, int(space.n)
        self.space = env.observation_space
        self._key_of = key_of(self.space)
        self.trials = Trials(env, limits, always, counting, modules)
        self._waiting: dict[int, Any] = {}
        self._marks: dict[int, tuple[int, ...]] = {}
        self._arrivals: dict[int, int] = {}
        self._revisits: dict[int, int] = {}
        self._newcomers: dict[int, list[tuple[int, Any, Way]]] = {}
        self._doubts: deque[tuple[int, Any, Way]] = deque()
        self._held = 0
        self.explored = explored or Explored(self.n_actions)
        self.replays = Replays(self.explored, self.trials, self.space, self.key)
        self.continued = explored is not None
        self._on_states, self._began = on_states, time.monotonic()

    def expand(self) -> Iterator[None]:
        """Expand one state after the other, until none waits or a limit is reached.

        Raises:
            EnumerationLimit: more states, bytes or seconds than allowed.
            HiddenState: one observation behaves in two ways.
            NotTabular: the environment raised an error.
            OutsideRandomness: it draws from generators that are not its own.
        """
        explored = self.explored
        self.trials.look(self.trials.reset())
        while explored.n_expanded < len(explored.keys):
            number = explored.n_expanded
            state = self._waiting.pop(number)
            self._held -= _size(state)
            explored.expand(number, [line for action in range(self.n_actions) for line in self._row(number, state, action)])
            self.trials.look(*self._steps(state))
            self._doubts.extend(self._newcomers.pop(number, ()))
            while self._doubts:
                self._compare(*self._doubts.popleft())
            self._check_limits(self.seconds)
            yield

    @property
    def open(self) -> bool:
        """May the states in which an observation was tried again be too few to tell that it hides nothing?"""
        more = self.continued or any(times >= self.limits.revisits for times in self._revisits.values())
        return (more or self.explored.starts_counted) and bool(self.limits.revisits) and not self.trials.counting

    @property
    def seconds(self) -> float:
        """Since the search began."""
        return time.monotonic() - self._began

    def _steps(self, state: Any) -> list[Call]:
        return [self.trials.step(state, action) for action in range(self.n_actions)]

    def begin(self) -> None:
        """Find the states in which episodes begin; before `expand`, of a search that is new."""
        self.trials.pulse = self._pulse
        seen = self.trials.outcomes(self.trials.reset(), -1, self._keep, runs=self.limits.start_runs)
        self._count(seen)
        different = len({one.made[0] for one in seen.all})
        if seen.runs and different > max(MANY_STARTS, seen.runs / 2):
            raise NotTabular(
                f"{seen.runs} resets gave {different} different observations: expected few enough to list. Fix what reset "
                "draws, as with `irl_gym.environments.seeded_starts.SeededStarts(env, seeds=(0,))`."
            )
        for one in seen.all:
            key, state = one.made
            number = self._arrive(key, state, one.script, -1, -1)
            self.explored.starts[number] = self.explored.starts.get(number, 0.0) + one.probability
        self.explored.settle()

    def _row(self, number: int, state: Any, action: int) -> list[tuple[int, int, float, float]]:
        """The lines of one pair; new states are numbered."""
        found: dict[tuple[int, float], float] = {}
        row, truncated = number * self.n_actions + action, self.trials.truncated
        seen = self.trials.outcomes(self.trials.step(state, action), row, self._keep, runs=self.limits.runs)
        self._count(seen)
        if seen.runs:
            self.explored.sampled.add(row)
        self.explored.counted["truncated"] += self.trials.truncated > truncated
        for one in seen.all:
            (_, reward, terminated), (key, reached) = one.result, one.made
            successor = self.explored.end(key) if terminated else self._arrive(key, reached, one.script, number, action)
            found[successor, reward] = found.get((successor, reward), 0.0) + one.probability
        return [(action, successor, probability, reward) for (successor, reward), probability in found.items()]

    def _count(self, seen: Outcomes) -> None:
        counted = self.explored.counted
        counted["refusals"] = self.trials.refusals
        if seen.runs:
            counted["rows"] += 1
            counted["runs"] += seen.runs
            counted["fewest"] = min(counted["fewest"] or seen.runs, seen.runs)
            counted["lines"] += len({(one.made[0], one.result[2]) for one in seen.all})

    def _keep(self, result: tuple[Any, float, bool]) -> tuple[Any, Any]:
        """Key of an outcome, and its inner state where the observation is new or is doubted; None elsewhere."""
        observation, _, terminated = result
        key = self.key(observation)
        number = self.explored.ids.get(key)
        if number is None and key not in self.explored.ends:
            checked_members(self.space, to_numbers(self.space, as_batch(self.space, observation)))
        wanted = not terminated and (number is None or self._doubted(number))
        return key, self.trials.snapshots.take() if wanted else None

    def _doubted(self, number: int) -> bool:
        allowed = self.limits.revisits if number < CERTAIN or number % 10 == 0 else 0
        return self._arrivals.get(number, 0) < 4 * allowed and self._revisits.get(number, 0) < allowed

    def key(self, observation: Any) -> Any:
        """What an observation is known by."""
        try:
            return self._key_of(observation)
        except (IrlGymError, MemoryError):
            raise
        except Exception as error:  # whatever an observation of another kind brings about
            raise UnknownObservation(
                f"observation {' '.join(repr(observation).split())[:90]} cannot be read ({error}): expected a member of "
                f"{self.space}."
            ) from error

    def _arrive(self, key: Any, state: Any, script: tuple[int, ...], parent: int, action: int) -> int:
        """The number of a state that was seen, new or known."""
        number = self.explored.ids.get(key)
        if number is None:
            number = self.explored.add(key, parent, action, script)
            self._waiting[number], self._marks[number] = state, (_mark(state),)
            self._held += _size(state)
        elif state is not None:
            self._doubt(number, state, (parent, action) if parent >= 0 else -1)
        return number

    def _doubt(self, number: int, state: Any, way: Way) -> None:
        """Compare a state in another inner state, now or when it has been expanded."""
        self._arrivals[number] = self._arrivals.get(number, 0) + 1
        mark, marks = _mark(state), self._marks.get(number, ())
        if mark in marks:
            return
        self._marks[number] = (*marks, mark)
        if number < self.explored.n_expanded:
            self._doubts.append((number, state, way))
        elif len(self._newcomers.setdefault(number, [])) < self.limits.revisits:
            self._newcomers[number].append((number, state, way))

    def _compare(self, number: int, newcomer: Any, way: Way) -> None:
        """Does a state behave the same in another inner state? Counted steps, which differ by chance, are not compared."""
        if self._revisits.get(number, 0) >= self.limits.revisits:
            return
        self._revisits[number] = self._revisits.get(number, 0) + 1
        reached: list[tuple[int, int, Any]] = []
        if not self.tell_apart(number, newcomer, lambda: self._actions(way), reached):
            self.explored.counted["uncompared"] += 1
            return
        for after, taken, state in reached:
            self._doubt(after, state, (way, taken))

    def tell_apart(self, number: int, newcomer: Any, way: Callable[[], list[int]], reached: list[tuple[int, int, Any]]) -> bool:
        """Can a state be compared with another inner state? That it then does the same is made sure of.

        Raises:
            HiddenState: it does something else.
        """
        refusals = self.trials.refusals
        first, second = behaviour_of_lines(self.explored.lines_of(number)), self.behaviour(newcomer, reached)
        self.trials.refusals = refusals
        if second is None:
            return False
        action = unlike(first, second)
        if action is not None:
            found = self.replays.state(number)
            self.trials.look(*self._steps(found), *self._steps(newcomer))
            told = proof(self.explored, self.space, number, action, first, second, way())
            part = hidden_part(self.trials, self._does, found, newcomer, action, self.n_actions, self.limits.seed)
            raise HiddenState(f"{told} {part} {part.mend(self.trials.env)}")
        return True

    def _does(self, state: Any, action: int) -> Behaviour | None:
        """What one action does in an inner state."""
        return self.behaviour(state, [], actions=(action,))

    def behaviour(
        self, state: Any, reached: list[tuple[int, int, Any]], number: int | None = None, actions: Iterable[int] | None = None
    ) -> Behaviour | None:
        """What an inner state does; None where that has to be counted, and no `number` says with which seeds.

        The inner states that follow are added to `reached`: number, action, state. All actions are tried, or those given.
        """
        found: Behaviour = {}
        for action in range(self.n_actions) if actions is None else actions:
            row, runs = (-1, 1) if number is None else (number * self.n_actions + action, self.limits.runs)
            seen = self.trials.outcomes(self.trials.step(state, action), row, self._keep, runs=runs)
            if seen.runs and number is None:
                return None
            for one in seen.all:
                (_, reward, terminated), (key, follows) = one.result, one.made
                known = self.explored.ends.get(key) if terminated else self.explored.ids.get(key)
                successor = (key, terminated) if known is None else -1 - known if terminated else known
                place = action, successor, round(reward, 9)
                found[place] = found.get(place, 0.0) + one.probability
                if follows is not None and known is not None:
                    reached.append((known, action, follows))
        return found

    def _actions(self, way: Way) -> list[int]:
        last: list[int] = []
        while isinstance(way, tuple):
            way, action = way
            last.append(action)
        return [*(self.explored.way(way) if way >= 0 else []), *reversed(last)]

    def _check_limits(self, seconds: float) -> None:
        limits, explored = self.limits, self.explored
        if explored.n_expanded == len(explored.keys) <= limits.max_states:
            return
        expected = None
        if len(explored.keys) > limits.max_states:
            expected = f"max_states={limits.max_states:,}"
        elif limits.max_seconds is not None and seconds > limits.max_seconds:
            expected = f"max_seconds={limits.max_seconds:g}"
        elif explored.size + self._held > limits.max_bytes:
            expected = f"max_bytes={limits.max_bytes:.3g}"
        if expected is not None:
            raise too_large(explored, seconds, explored.size + self._held, expected)

    def _pulse(self) -> None:
        """Within a call that takes long: tell, and look at the clock."""
        explored, limits, seconds = self.explored, self.limits, self.seconds
        self._on_states(explored.n_expanded, len(explored.keys))
        if limits.max_seconds is not None and seconds > limits.max_seconds:
            raise too_large(explored, seconds, explored.size + self._held, f"max_seconds={limits.max_seconds:g}")

    def resume(self) -> None:
        """Go on with an earlier search, from the inner states that its paths lead to; before `expand`, once it was checked."""
        states = self.replays.waiting()
        self._waiting = {number: state for number, state in states.items() if number >= self.explored.n_expanded}
        self._marks = {number: (_mark(state),) for number, state in states.items()}
        self._held = sum(map(_size, self._waiting.values()))
        self._began, self.trials.pulse = time.monotonic(), self._pulse


def _mark(state: Any) -> int:
    return hash(state) if isinstance(state, bytes) else id(state)


def _size(state: Any) -> int:
    return len(state) if isinstance(state, bytes) else 2_000
