"""One random call of plain Python to its exact distribution.

An environment's `step` is a function of its state, its action and what its random generator answers. Here the generator is a
stand-in whose answers are chosen: `Draws.outcomes` calls the step again and again, once for each way that its draws can fall.

    a script    the outcome taken at each draw, by number: (1, 0) is the second outcome of the first draw, then the first
    a run       the call, with a script to follow; a draw beyond the script takes its first outcome and notes the others
    the search  depth first: after each run the last draw with an outcome left takes the next one

The probability of a run is the product over its draws. Draws may depend on earlier ones, and there may be none.
Everything else in the call has to be a function of the state: what a clock or another generator adds is found out where it
changes the draws, and refused.
"""

import random
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from typing import Any, NoReturn, TypeVar

import numpy as np

from irl_gym.checks import checked_number
from irl_gym.errors import NotEnumerable, a_type
from irl_gym.tables.draws.draw_tree import Cut, Path, Script
from irl_gym.tables.draws.driven import RANDOM, Odd
from irl_gym.tables.draws.driven_modules import DrivenModules
from irl_gym.tables.draws.driven_numpy import GENERATOR, RANDOM_STATE

T = TypeVar("T")


class Draws:
    """Drives generators through every outcome of a call, or through one seeded run.

    Args:
        most: outcomes of one call at most.
        modules: drive the functions of the modules random and numpy.random too.
    """

    def __init__(self, most: int = 20_000, *, modules: bool = False):
        self.most = int(checked_number("most", most, "a whole number of at least 1", least=1, whole=True))
        self._path: Path | None = None
        self._real: _Real | None = None
        self._stand_ins = {base: stand_in(self) for base, stand_in in _STAND_INS.items()}
        self._driven = DrivenModules(self._stand_ins).driven if modules else nullcontext

    def twin(self, generator: Any) -> Any | None:
        """The driven stand-in of a generator that an environment holds; None for anything else.

        There is one for np.random.Generator, one for np.random.RandomState and one for random.Random, shared by all that the
        environment holds. A class of somebody else that derives from these is something else: its methods are not known here.
        """
        base = _BASES.get(type(generator))
        return None if base is None else self._stand_ins[base]

    def outcomes(self, run: Callable[[], T]) -> Iterator[tuple[float, tuple[int, ...], T]]:
        """Call `run` once for each outcome of its draws. It has to restore the environment before it acts.

        Yields:
            The probability, the script, and what `run` returned. The probabilities sum to 1; those below 1e-13 are left out.

        Raises:
            NotEnumerable: a draw with infinitely many outcomes, too many outcomes, or a call that is not a function of its
                draws.
        """
        path = Path(self.most)
        while True:
            result = self._follow(path, run)
            if not path.cut:
                yield path.probability, path.script, result
            if not path.advance():
                return

    def replay(self, script: tuple[int, ...], run: Callable[[], T]) -> T:
        """Call `run` with the outcomes of a script, as `outcomes` gave it.

        Raises:
            NotEnumerable: the call's draws are not those of the script.
        """
        return self._follow(Script(self.most, tuple(script)), run)

    def seeded(self, seed: Sequence[int] | int, run: Callable[[], T]) -> T:
        """Call `run` once with real random numbers; a NumPy generator gives those of `np.random.default_rng(seed)`."""
        before, self._real, path, self._path = self._real, _Real(seed), self._path, None
        try:
            with self._driven():
                return run()
        finally:
            self._real, self._path = before, path

    def _follow(self, path: Path, run: Callable[[], T]) -> T:
        """One run along a path. What a run returns that is cut short does not matter."""
        before, real = self._path, self._real
        self._path, self._real = path, None
        result: Any = None
        try:
            path.begin()
            with self._driven():
                result = run()
        except Cut:
            pass
        except Exception as error:
            if path.refusal not in (None, error):  # the environment made something else of it
                raise path.refusal from error
            raise
        finally:
            path.number, self._path, self._real = 0, before, real
        path.end()
        return result

    def answerer(self, base: type, method: str) -> tuple[Any, Path | None]:
        """Who answers a draw: a real generator, in a seeded run, or the path.

        Raises:
            NotEnumerable: neither, between runs.
        """
        if self._real is not None:
            return self._real.of(base), None
        if self._path is None:
            raise NotEnumerable(
                f"{method}() was drawn from a stand-in generator outside the calls that it is driven through: expected draws "
                "only within `Draws.outcomes`, `replay` and `seeded`. Give the environment its own generator back."
            )
        return None, self._path


class _Real:
    """Real generators of one seed, made when they are asked for."""

    def __init__(self, seed: Sequence[int] | int):
        self.seed = seed
        self.made: dict[type, Any] = {}

    def of(self, base: type) -> Any:
        """The generator of a kind. All three are independent of each other."""
        if base not in self.made:
            if base is np.random.Generator:
                self.made[base] = np.random.default_rng(self.seed)
            elif base is np.random.RandomState:
                self.made[base] = np.random.RandomState(np.random.MT19937(np.random.SeedSequence(self.seed, spawn_key=(1,))))
            else:
                words = np.random.SeedSequence(self.seed, spawn_key=(2,)).generate_state(8)
                self.made[base] = random.Random(int.from_bytes(words.tobytes(), "little"))
        return self.made[base]


class _StandIn:
    """What the three stand-ins share: they are copied as themselves, since all draws go through one tree."""

    _draws: Draws

    def __copy__(self) -> Any:
        return self

    def __deepcopy__(self, memo: Any) -> Any:
        return self

    def __reduce_ex__(self, protocol: Any) -> NoReturn:
        raise NotEnumerable(
            f"{a_type(self)} was pickled: expected copies by `copy.deepcopy`. It belongs to a search of this process; "
            "give the environment its own generator back first."
        )

    def __repr__(self) -> str:
        return f"{type(self).__name__}()"

    __str__ = __repr__


class DrivenGenerator(_StandIn, np.random.Generator):
    """The stand-in of a NumPy generator, which Gymnasium's environments and spaces hold."""

    def __init__(self, draws: Draws):
        super().__init__(np.random.PCG64(0))  # which is never asked
        self._draws = draws


class DrivenRandomState(_StandIn, np.random.RandomState):
    """The stand-in of NumPy's older generator."""

    def __init__(self, draws: Draws):
        super().__init__(0)
        self._draws = draws


class DrivenRandom(_StandIn, random.Random):
    """The stand-in of a generator of Python's random module."""

    def __init__(self, draws: Draws):
        self._draws = draws


def _driven(base: type, name: str) -> Callable[..., Any]:
    """A method of a stand-in: the real one in a seeded run, else the one that is driven, if there is any."""
    ours = METHODS[base].get(name)

    def method(self: _StandIn, /, *args: Any, **kwargs: Any) -> Any:
        real, path = self._draws.answerer(base, name)
        if path is None:
            found = getattr(real, name)
            return found(*args, **kwargs) if callable(found) else found
        if ours is None:
            path.refuse(
                f"{base.__name__}.{name}() has outcomes that cannot be listed one by one: expected integers, choices, "
                "permutations, or uniform numbers that are only compared. Have the environment draw these, or count samples."
            )
        try:
            return ours(path, *args, **kwargs)
        except Odd as odd:
            getattr(_Real(0).of(base), name)(*args, **kwargs)  # its own error, where the arguments are wrong
            path.refuse(f"{base.__name__}.{name}() is asked for {odd}, which is not driven here: count samples instead.")

    method.__name__ = method.__qualname__ = name
    return method


METHODS = {np.random.Generator: GENERATOR, np.random.RandomState: RANDOM_STATE, random.Random: RANDOM}
_STAND_INS = {
    np.random.Generator: DrivenGenerator,
    np.random.RandomState: DrivenRandomState,
    random.Random: DrivenRandom,
}
_BASES = {cls: base for base, driven in _STAND_INS.items() for cls in (base, driven)} | {random.SystemRandom: random.Random}

for _base, _cls in _STAND_INS.items():
    for _name in dir(_base):
        if not _name.startswith("_") and callable(getattr(_base, _name)):
            setattr(_cls, _name, _driven(_base, _name))
DrivenGenerator.bit_generator = property(_driven(np.random.Generator, "bit_generator"))  # pyright: ignore[reportAttributeAccessIssue]
