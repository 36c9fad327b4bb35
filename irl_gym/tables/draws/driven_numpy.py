"""The methods of NumPy's generators that are driven: integers, choices, permutations, counts, and uniform numbers.

As in `driven`, a run stands in the place of the generator. Whatever has `size` draws that many times, in order, and returns an
array of NumPy's type; uniform numbers come as an array of objects, which compares with an array of numbers.
"""

import math
import operator
from collections.abc import Callable, Hashable, Iterator, Sequence
from typing import Any

import numpy as np

from irl_gym.tables.draws.driven import Odd, afford, keys_of, order, pick, unlisted
from irl_gym.tables.draws.uniforms import CallRun, Uniform, Unit


def _array_keys(array: np.ndarray, axis: int = 0) -> list[Hashable]:
    if array.dtype == object and array.ndim == 1:
        return keys_of(array.tolist())
    if array.dtype == object:
        return list(range(array.shape[axis]))
    return array.tolist() if array.ndim == 1 else [part.tobytes() for part in np.moveaxis(array, axis, 0)]


def _whole(value: Any) -> int:
    try:
        return operator.index(value)
    except TypeError:
        if isinstance(value, float | np.floating) and float(value).is_integer():
            return int(value)
        raise Odd(f"{value!r}") from None


def _shape(size: Any) -> tuple[int, ...] | None:
    if size is None:
        return None
    try:
        return (operator.index(size),)
    except TypeError:
        return tuple(operator.index(length) for length in size)


def _count(shape: tuple[int, ...] | None) -> int:
    if shape is not None and min(shape, default=0) < 0:
        raise Odd(f"a size of {shape}")
    return 1 if shape is None else math.prod(shape)


def _filled(values: list[Any], shape: tuple[int, ...] | None, dtype: Any) -> Any:
    return values[0] if shape is None else np.array(values, dtype=dtype).reshape(shape)


def _broadcast(shape: tuple[int, ...] | None, *arguments: Any) -> tuple[tuple[int, ...] | None, Iterator[tuple[Any, ...]]]:
    """Arguments for each single draw, and the shape of the result: None where it is one number."""
    if all(np.ndim(argument) == 0 for argument in arguments):
        single = tuple(np.asarray(argument).item() for argument in arguments)
        return shape, iter([single] * _count(shape))
    arrays = np.broadcast_arrays(*arguments) if shape is None else [np.broadcast_to(a, shape) for a in arguments]
    return arrays[0].shape, zip(*(array.ravel().tolist() for array in arrays), strict=True)


def _chances(p: Any, n: int) -> list[float]:
    given = np.asarray(p)
    chances = np.asarray(p, dtype=np.float64)
    near = np.sqrt(np.finfo(given.dtype).eps) if given.dtype.kind == "f" else 1e-8  # NumPy's own tolerance
    if chances.shape != (n,) or not np.all(chances >= 0) or abs(chances.sum() - 1) > max(near, 1e-8):
        raise Odd("such probabilities")
    return chances.tolist()


def _integers(
    run: CallRun, low: Any, high: Any = None, size: Any = None, dtype: Any = np.int64, endpoint: bool = False,
    *, method: str = "integers"
) -> Any:  # fmt: skip
    """Each whole number of [low, high), or of [low, high]."""
    if high is None:
        low, high = 0, low
    if (
        type(low) is int
        and type(high) is int
        and low < high <= run.most
        and size is None
        and dtype is np.int64
        and not endpoint
    ):
        return np.int64(low + run.choose(method, high - low))  # what most environments ask for
    shape, bounds = _broadcast(_shape(size), low, high)
    pairs = [(_whole(least), _whole(most) + bool(endpoint)) for least, most in bounds]
    limits = np.iinfo(dtype) if dtype not in (bool, np.bool_) else None
    for least, beyond in pairs:
        if beyond <= least or (limits is not None and (least < limits.min or beyond - 1 > limits.max)):
            raise Odd(f"integers of [{least}, {beyond})")
    afford(run, method, math.prod(beyond - least for least, beyond in pairs))
    drawn = [least + run.choose(method, beyond - least) for least, beyond in pairs]
    if shape is None:
        return dtype(drawn[0]) if dtype in (int, bool) else np.dtype(dtype).type(drawn[0])
    return _filled(drawn, shape, dtype)


def _randint(run: CallRun, low: Any, high: Any = None, size: Any = None, dtype: Any = int) -> Any:
    return _integers(run, low, high, size, dtype, method="randint")


def _choice(
    run: CallRun, a: Any, size: Any = None, replace: bool = True, p: Any = None, axis: int = 0, shuffle: bool = True
) -> Any:
    """Elements of a sequence, or of range(a)."""
    array = np.asarray(a)
    whole = array.ndim == 0
    if whole:
        try:
            n = operator.index(array.item())
        except TypeError:
            raise Odd(f"a choice of {a!r}") from None
        keys: Sequence[Hashable] = range(n)
    else:
        n, keys = array.shape[axis], _array_keys(array, axis)
    shape = _shape(size)
    k = _count(shape)
    weights = None if p is None else _chances(p, n)
    if n < 1 or (not replace and (k > n or (k > 1 and not shuffle) or (weights and k > n - weights.count(0.0)))):
        raise Odd(f"a choice of {k} among {n}")
    if replace or k == 1:
        afford(run, "choice", len(set(keys)) ** k)
        drawn = [pick(run, "choice", keys, weights) for _ in range(k)]
    else:
        drawn = order(run, "choice", keys if weights is None else range(n), k, weights)
    index = _filled(drawn, shape, np.int64)
    if whole:
        return index
    return array.take(index, axis=axis) if array.ndim > 1 or shape is not None else array[index]


def _choice_of_state(run: CallRun, a: Any, size: Any = None, replace: bool = True, p: Any = None) -> Any:
    if np.ndim(a) > 1:
        raise Odd("a choice of several dimensions")
    return _choice(run, a, size, replace, p)


def _uniform(run: CallRun, low: Any = 0.0, high: Any = 1.0, size: Any = None, *, method: str = "uniform") -> Any:
    """Uniform numbers that are compared instead of drawn."""
    shape, bounds = _broadcast(_shape(size), low, high)
    numbers = []
    for least, most in bounds:
        if not math.isfinite(most - least):
            raise Odd(f"uniform({least}, {most})")
        numbers.append(Uniform(Unit(run, method)) * (most - least) + least)
    return _filled(numbers, shape, object)


def _normal(run: CallRun, loc: Any = 0.0, scale: Any = 1.0, size: Any = None, *, method: str = "normal") -> Any:
    """Normal numbers, of which nothing is known but their mean where they do not deviate."""
    shape, each = _broadcast(_shape(size), loc, scale)
    numbers = [unlisted(run, method, *single) for single in each]
    return _filled(numbers, shape, object if any(isinstance(one, Uniform) for one in numbers) else np.float64)


def _standard_normal(run: CallRun, size: Any = None, dtype: Any = np.float64, out: Any = None) -> Any:
    if out is not None or np.dtype(dtype) != np.float64:
        raise Odd(f"{np.dtype(dtype)} numbers, or numbers in an array")
    return _normal(run, size=size, method="standard_normal")


def _randn(run: CallRun, *shape: int) -> Any:
    return _normal(run, size=shape or None, method="randn")


def _random(run: CallRun, size: Any = None, dtype: Any = np.float64, out: Any = None) -> Any:
    if out is not None or np.dtype(dtype) != np.float64:
        raise Odd(f"{np.dtype(dtype)} numbers, or numbers in an array")
    return Uniform(Unit(run, "random")) if size is None else _uniform(run, size=size, method="random")


def _random_sample(run: CallRun, size: Any = None) -> Any:
    return _random(run, size)


def _rand(run: CallRun, *shape: int) -> Any:
    return _random(run, shape or None)


def _permutation(run: CallRun, x: Any, axis: int = 0) -> Any:
    """range(x), or the elements of x, in any order."""
    array = np.asarray(x)
    if array.ndim == 0:
        array = np.arange(_whole(array.item()))
    return array.take(order(run, "permutation", _array_keys(array, axis), array.shape[axis]), axis=axis)


def _permuted(run: CallRun, x: Any, axis: int | None = None, out: Any = None) -> Any:
    """All elements of x in any order, in its shape."""
    array = np.asarray(x)
    if out is not None or array.ndim == 0 or (axis is not None and array.ndim > 1):
        raise Odd("an axis or an output")
    flat = array.ravel()
    return flat.take(order(run, "permuted", _array_keys(flat), flat.size)).reshape(array.shape)


def _shuffle(run: CallRun, x: Any, axis: int = 0) -> None:
    """Put the elements of x in any order, in place."""
    if isinstance(x, np.ndarray):
        x[...] = x.take(order(run, "shuffle", _array_keys(x, axis), x.shape[axis]), axis=axis)
        return
    items = list(x)
    for place, index in enumerate(order(run, "shuffle", keys_of(items), len(items))):
        x[place] = items[index]


def _counts(run: CallRun, method: str, table: Callable[..., list[float]], size: Any, *arguments: Any) -> Any:
    """Whole numbers from 0, with a table of their probabilities for each single draw."""
    shape, each = _broadcast(_shape(size), *arguments)
    drawn = []
    for single in each:
        chances = table(*single)
        drawn.append(run.choose(method, len(chances), chances))
    return _filled(drawn, shape, np.int64)


def _binomial_table(n: Any, p: float) -> list[float]:
    n = _whole(n)
    if not (0 <= n <= 1000 and 0 <= p <= 1):  # binomial coefficients beyond are no floats
        raise Odd(f"binomial({n}, {p})")
    return [math.comb(n, k) * p**k * (1 - p) ** (n - k) for k in range(n + 1)]


def _binomial(run: CallRun, n: Any, p: Any, size: Any = None) -> Any:
    """How many of n trials hit."""
    return _counts(run, "binomial", _binomial_table, size, n, p)


def _hypergeometric_table(good: Any, bad: Any, taken: Any) -> list[float]:
    good, bad, taken = _whole(good), _whole(bad), _whole(taken)
    if min(good, bad, taken) < 0 or taken > good + bad or good + bad > 100_000:
        raise Odd(f"hypergeometric({good}, {bad}, {taken})")
    ways = math.comb(good + bad, taken)
    return [math.comb(good, k) * math.comb(bad, taken - k) / ways for k in range(min(good, taken) + 1)]


def _hypergeometric(run: CallRun, ngood: Any, nbad: Any, nsample: Any, size: Any = None) -> Any:
    """How many of a sample are good."""
    return _counts(run, "hypergeometric", _hypergeometric_table, size, ngood, nbad, nsample)


def _multinomial(run: CallRun, n: Any, pvals: Any, size: Any = None) -> Any:
    """How often each of several outcomes comes in n trials: one binomial draw after the other."""
    if size is not None or np.ndim(n) or np.ndim(pvals) != 1:
        raise Odd("several draws")
    left, rest = _whole(n), 1.0
    drawn = []
    chances = _chances(pvals, len(pvals))
    for chance in chances[:-1]:
        table = _binomial_table(left, min(chance / rest, 1.0) if rest > 0 else 0.0)
        drawn.append(run.choose("multinomial", len(table), table))
        left, rest = left - drawn[-1], rest - chance
    return np.array([*drawn, left])


_SHARED: dict[str, Callable[..., Any]] = {
    "binomial": _binomial, "hypergeometric": _hypergeometric, "multinomial": _multinomial, "permutation": _permutation,
    "shuffle": _shuffle, "uniform": _uniform, "normal": _normal, "standard_normal": _standard_normal,
}  # fmt: skip
GENERATOR = _SHARED | {"choice": _choice, "integers": _integers, "permuted": _permuted, "random": _random}
"""Methods of `np.random.Generator` that are driven; all others are refused."""
RANDOM_STATE = _SHARED | {
    "choice": _choice_of_state, "rand": _rand, "randint": _randint, "random": _random_sample, "random_sample": _random_sample,
    "randn": _randn,
}  # fmt: skip
"""The same for `np.random.RandomState`."""
