"""What a draw can give, and how probably; and the methods of Python's `random.Random`.

Each method here has a run in the place of the generator: it asks the run to choose among the outcomes and returns what the
method would, of the same type. Equal values are one outcome: of 13 cards with four tens there are ten outcomes, the last of
probability 4/13. NumPy's generators are in `driven_numpy`.

n elements, of which k are taken.
"""

import math
import operator
from collections.abc import Callable, Hashable, Iterable, Sequence
from typing import Any, NoReturn

from irl_gym.errors import a_type
from irl_gym.tables.draws.uniforms import CallRun, Uniform, Unit


class Odd(Exception):
    """Arguments that are wrong, or right and not driven here."""


class Unlisted(Unit):
    """A number of which nothing is known, such as a normal one: it may be multiplied by zero, or left alone."""

    __slots__ = ()
    kind = ""

    def __init__(self, run: CallRun, method: str):
        super().__init__(run, method)
        self.low, self.high = -math.inf, math.inf

    def split(self, cuts: list[float]) -> NoReturn:
        """Refuse: no part of it has a probability that is known here."""
        self.refuse("is used, and its outcomes cannot be listed one by one")


def pick(run: CallRun, method: str, keys: Sequence[Hashable], weights: Sequence[float] | None = None) -> int:
    """The first index of one of the distinct keys. Without weights each index is equally probable."""
    groups: dict[Hashable, float] = {}
    firsts = []
    for index, key in enumerate(keys):
        if key not in groups:
            groups[key] = 0
            firsts.append(index)
        groups[key] += 1 if weights is None else weights[index]
    if weights is None and len(firsts) == len(keys):
        return run.choose(method, len(keys))
    total = len(keys) if weights is None else math.fsum(weights)
    return firsts[run.choose(method, len(firsts), [weight / total for weight in groups.values()])]


def order(run: CallRun, method: str, keys: Sequence[Hashable], k: int, weights: list[float] | None = None) -> list[int]:
    """Indices of k keys, one after the other, none twice; of equal keys the first comes first."""
    n, distinct = len(keys), len(set(keys))
    if distinct == n:
        afford(run, method, math.perm(n, min(k, 20)))
    left = list(range(n))
    taken = []
    for _ in range(k):
        chances = None if weights is None else [weights[index] for index in left]
        taken.append(left.pop(pick(run, method, [keys[index] for index in left], chances)))
    return taken


def afford(run: CallRun, method: str, outcomes: int) -> None:
    """Refuse a method whose outcomes are too many before the first of them is tried."""
    if outcomes > run.most:
        run.refuse_many(method, outcomes)


def keys_of(items: Iterable[Any]) -> list[Hashable]:
    """What makes two elements the same outcome: type and value; an element that may be changed is only itself."""
    keys = []
    for index, item in enumerate(items):
        try:
            hash(item)
        except TypeError:
            keys.append((index,))
        else:
            keys.append((type(item), item))
    return keys


def _random(run: CallRun) -> Uniform:
    return Uniform(Unit(run, "random"))


def _uniform(run: CallRun, a: float, b: float) -> Any:
    if not math.isfinite(b - a):
        raise Odd(f"uniform({a}, {b})")
    return Uniform(Unit(run, "uniform")) * (b - a) + a


def unlisted(run: CallRun, method: str, mean: float, deviation: float) -> Any:
    """A normal number, which is its mean where it does not deviate."""
    if not (math.isfinite(mean) and 0 <= deviation < math.inf):
        raise Odd(f"{method}({mean}, {deviation})")
    return Uniform(Unlisted(run, method)) * float(deviation) + float(mean)


def _gauss(run: CallRun, mu: float = 0.0, sigma: float = 1.0) -> Any:
    return unlisted(run, "gauss", mu, sigma)


def _normalvariate(run: CallRun, mu: float = 0.0, sigma: float = 1.0) -> Any:
    return unlisted(run, "normalvariate", mu, sigma)


def _randrange(run: CallRun, start: int, stop: int | None = None, step: int = 1) -> int:
    try:
        span = range(operator.index(start)) if stop is None else range(start, stop, step)
    except (TypeError, ValueError):
        raise Odd(f"randrange({start}, {stop}, {step})") from None
    if not span:
        raise Odd("an empty range")
    return span[run.choose("randrange", len(span))]


def _randint(run: CallRun, a: int, b: int) -> int:
    if b < a:
        raise Odd("an empty range")
    return a + run.choose("randint", b - a + 1)


def _getrandbits(run: CallRun, k: int) -> int:
    if k < 0:
        raise Odd("so few bits")
    return run.choose("getrandbits", 2**k)


def _choice(run: CallRun, seq: Any) -> Any:
    if not len(seq):
        raise Odd("a choice of nothing")
    return seq[pick(run, "choice", keys_of(seq))]


def _choices(
    run: CallRun, population: Any, weights: Iterable[float] | None = None, *, cum_weights: Any = None, k: int = 1
) -> list[Any]:
    if weights is not None and cum_weights is not None:
        raise Odd("both kinds of weights")
    chances = None if weights is None else [float(weight) for weight in weights]
    if cum_weights is not None:
        sums = [float(total) for total in cum_weights]
        chances = [after - before for before, after in zip([0.0, *sums], sums, strict=False)]
    wrong = chances is not None and (
        len(chances) != len(population) or min(chances, default=0) < 0 or not 0 < math.fsum(chances) < math.inf
    )
    if not len(population) or wrong:
        raise Odd("such weights")
    keys = keys_of(population)
    afford(run, "choices", len(set(keys)) ** min(k, 50))
    return [population[pick(run, "choices", keys, chances)] for _ in range(k)]


def _shuffle(run: CallRun, x: Any) -> None:
    items = list(x)
    for place, index in enumerate(order(run, "shuffle", keys_of(items), len(items))):
        x[place] = items[index]


def _sample(run: CallRun, population: Any, k: int, *, counts: Iterable[int] | None = None) -> list[Any]:
    if not isinstance(population, Sequence):
        raise Odd(f"a sample of {a_type(population)}")
    items = list(population)
    if counts is not None:
        times = list(counts)
        if len(times) != len(items) or sum(times) > run.most or min(times, default=0) < 0:
            raise Odd("such counts")
        items = [item for item, count in zip(items, times, strict=True) for _ in range(count)]
    if not 0 <= k <= len(items):
        raise Odd(f"a sample of {k} among {len(items)}")
    return [items[index] for index in order(run, "sample", keys_of(items), k)]


RANDOM: dict[str, Callable[..., Any]] = {
    "random": _random, "uniform": _uniform, "randrange": _randrange, "randint": _randint, "getrandbits": _getrandbits,
    "choice": _choice, "choices": _choices, "shuffle": _shuffle, "sample": _sample, "gauss": _gauss,
    "normalvariate": _normalvariate,
}  # fmt: skip
"""Methods of `random.Random` that are driven; all others are refused."""
