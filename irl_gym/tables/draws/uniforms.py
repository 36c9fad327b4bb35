"""A uniform number that is not drawn: only compared.

An environment draws u from [0, 1) and asks `u < 0.3`, `cumsum(p) > u`, `int(4 * u)`. What it does depends on the answers alone,
and there are finitely many. So `random()` gives a `Uniform` that holds no number but the interval in which it lies:

    before      u in [0, 1)
    u < 0.3     is asked: two outcomes, of probability 0.3 and 0.7; the path takes one
    after       u in [0, 0.3) or in [0.3, 1), and every later answer agrees

`Unit` is that interval, `Uniform` is scale * unit + shift. Who needs the number itself, as `math.sqrt(u)` does, is refused.
Equality has probability zero, and is False. The 53 bits of a drawn number are taken for a real number: an error below 2**-53.
"""

import math
import numbers
from collections.abc import Callable
from itertools import pairwise
from typing import Any, NoReturn, Protocol, runtime_checkable

import numpy as np


@runtime_checkable
class CallRun(Protocol):
    """What a draw needs to know of the call that it happens in."""

    number: int
    """Of this run of the call; 0 between runs."""
    most: int
    """Outcomes of one call at most."""

    def choose(self, method: str, count: int, weights: list[float] | None = None) -> int:
        """One of `count` outcomes, equally probable without weights; weights sum to 1."""
        ...

    def refuse(self, message: str) -> NoReturn:
        """Raise NotEnumerable."""
        ...

    def refuse_many(self, method: str, count: int) -> NoReturn:
        """Raise NotEnumerable: a draw has too many outcomes."""
        ...


class Unit:
    """A number uniform on [0, 1), of which only an interval is known."""

    __slots__ = ("high", "low", "method", "number", "run")
    kind = "uniform "

    def __init__(self, run: CallRun, method: str):
        self.run, self.number, self.method = run, run.number, method
        self.low, self.high = 0.0, 1.0

    def split(self, cuts: list[float]) -> None:
        """Narrow the interval to one of the parts that ascending cuts make; those outside it make none."""
        if self.run.number != self.number:
            self.refuse("is used after the call that drew it: expected one that is used up within the call")
        low, high = self.low, self.high
        inside = [cut for cut in cuts if low < cut < high]
        if not inside:
            return
        edges = [low, *inside, high]
        width = high - low
        part = self.run.choose(self.method, len(edges) - 1, [(after - before) / width for before, after in pairwise(edges)])
        self.low, self.high = edges[part], edges[part + 1]

    def refuse(self, how: str) -> NoReturn:
        """Raise NotEnumerable."""
        self.run.refuse(
            f"a {self.kind}number of {self.method}() {how}. Have the environment draw with integers() or choice(), or count "
            "samples."
        )


class Uniform:
    """scale * unit + shift: compares and rounds like a number, and is none."""

    __slots__ = ("scale", "shift", "unit")
    __array_priority__ = 1000.0

    def __init__(self, unit: Unit, scale: float = 1.0, shift: float = 0.0):
        self.unit, self.scale, self.shift = unit, scale, shift

    def _less(self, other: Any) -> Any:
        """Is this number less than another? It is greater otherwise, but for NaN."""
        if isinstance(other, Uniform):
            return self._less_than_uniform(other)
        number = _as_number(other)
        if number is None:
            return NotImplemented
        unit = self.unit
        place = (number - self.shift) / self.scale
        unit.split([place])
        return unit.high <= place if self.scale > 0 else unit.low >= place

    def _greater(self, other: Any) -> Any:
        if isinstance(other, Uniform):
            return other._less_than_uniform(self)
        less = self._less(other)
        return less if less is NotImplemented else not less and other == other

    def _less_than_uniform(self, other: "Uniform") -> bool:
        """Of another number: where their intervals, or being the same number, settle it."""
        if other.unit is self.unit:
            return self - other < 0
        self.unit.split([])
        other.unit.split([])
        (low, high), (other_low, other_high) = self._bounds(), other._bounds()
        if low < other_high and other_low < high:
            self.unit.refuse("is compared with another uniform number: expected a comparison with a plain number")
        return high <= other_low

    def __lt__(self, other: Any) -> Any:
        return self._less(other)

    def __gt__(self, other: Any) -> Any:
        return self._greater(other)

    def __le__(self, other: Any) -> Any:
        return not self._greater(other) if isinstance(other, Uniform) else self._less(other)

    def __ge__(self, other: Any) -> Any:
        return not self._less(other) if isinstance(other, Uniform) else self._greater(other)

    def __eq__(self, other: object) -> Any:
        if isinstance(other, np.ndarray):
            return NotImplemented
        if isinstance(other, Uniform) and other.unit is self.unit:
            return (other.scale, other.shift) == (self.scale, self.shift)
        return False

    def __bool__(self) -> bool:
        return True

    def _bounds(self) -> tuple[float, float]:
        """The numbers between which it lies."""
        low, high = self.scale * self.unit.low + self.shift, self.scale * self.unit.high + self.shift
        return (low, high) if low < high else (high, low)

    def _settle(self, grain: float, offset: float, *, zero: bool = True) -> float:
        """Split at each (whole number + offset) * grain in reach; return the middle of what is left. Zero may be no cut."""
        self.unit.split([])
        low, high = self._bounds()
        first, last = math.floor(low / grain - offset), math.ceil(high / grain - offset)
        if last - first > self.unit.run.most + 1:
            self.unit.refuse(f"is rounded to one of {last - first:,}: expected at most {self.unit.run.most:,} outcomes")
        places = ((whole + offset) * grain for whole in range(first, last + 1))
        self.unit.split(sorted((place - self.shift) / self.scale for place in places if zero or place))
        low, high = self._bounds()
        return (low + high) / 2

    def __floor__(self) -> int:
        return math.floor(self._settle(1.0, 0.0))

    def __ceil__(self) -> int:
        return math.ceil(self._settle(1.0, 0.0))

    def __trunc__(self) -> int:
        return math.trunc(self._settle(1.0, 0.0, zero=False))

    def __int__(self) -> int:
        return self.__trunc__()

    def __round__(self, digits: int | None = None) -> float:
        middle = self._settle(10.0 ** -(digits or 0), 0.5)
        return round(middle) if digits is None else round(middle, digits)

    def rint(self) -> float:
        """What `np.rint` asks of an object."""
        return float(self.__round__())

    def __abs__(self) -> "Uniform":
        return -self if self < 0 else self

    def __pos__(self) -> "Uniform":
        return self

    def __neg__(self) -> "Uniform":
        return Uniform(self.unit, -self.scale, -self.shift)

    def _moved(self, scale: float, shift: float) -> Any:
        """Another image of the same unit number; a plain number where nothing random is left."""
        if not (math.isfinite(scale) and math.isfinite(shift)):
            self.unit.refuse(f"is multiplied by {scale} and moved by {shift}: expected finite numbers")
        return Uniform(self.unit, scale, shift) if scale else shift

    def __add__(self, other: Any) -> Any:
        number = _as_number(other)
        if number is not None:
            return self._moved(self.scale, self.shift + number)
        if not isinstance(other, Uniform):
            return NotImplemented
        if other.unit is not self.unit:
            self.unit.refuse("is added to another uniform number: expected plain numbers")
        return self._moved(self.scale + other.scale, self.shift + other.shift)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        return self + -other if isinstance(other, Uniform) or _as_number(other) is not None else NotImplemented

    def __rsub__(self, other: Any) -> Any:
        return -self + other

    def __mul__(self, other: Any) -> Any:
        number = _as_number(other)
        if number is not None:
            return self._moved(self.scale * number, self.shift * number)
        if isinstance(other, Uniform):
            self.unit.refuse("is multiplied by a uniform number: expected plain numbers")
        return NotImplemented

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        number = _as_number(other)
        return NotImplemented if number is None else self._moved(self.scale / number, self.shift / number)

    def __floordiv__(self, other: Any) -> Any:
        quotient = self / other  # a TypeError of Python's where that is no number
        return float(math.floor(quotient))

    def __mod__(self, other: Any) -> Any:
        return self - (self // other) * other

    def __divmod__(self, other: Any) -> Any:
        quotient = self // other
        return quotient, self - quotient * other

    def __copy__(self) -> "Uniform":
        return self

    def __deepcopy__(self, memo: Any) -> "Uniform":
        return self

    def __repr__(self) -> str:
        low, high = self._bounds()
        return f"Uniform({low}, {high})"

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> Any:
        asks = _COMPARISONS.get(ufunc)
        if asks is not None and method == "__call__" and not kwargs:
            mine = inputs[0] is self
            other = np.asarray(inputs[1] if mine else inputs[0])
            if other.dtype.kind in "biuf":
                return self._compare_all(other, less=asks == mine)
        if "out" in kwargs:
            self.unit.refuse("is written into an array of numbers: expected comparisons with plain numbers")
        boxes = [_box(value) if isinstance(value, Uniform) else np.asarray(value).astype(object) for value in inputs]
        return getattr(ufunc, method)(*boxes, **kwargs)

    def _compare_all(self, others: np.ndarray, *, less: bool) -> Any:
        """Is it less (or greater) than each of these? One draw among the parts that they make, and not one a number."""
        unit = self.unit
        places = (others - self.shift) / self.scale
        unit.split(np.sort(places, axis=None).tolist())
        return unit.high <= places if less == (self.scale > 0) else unit.low >= places


_COMPARISONS = {np.less: True, np.less_equal: True, np.greater: False, np.greater_equal: False}
"""Does it ask whether its first argument is the lesser?"""


def _as_number(value: Any) -> float | None:
    """The float that a plain number is; None for anything else."""
    if type(value) is float or isinstance(value, _NUMBERS):
        return float(value)
    if isinstance(value, np.ndarray) and value.ndim == 0 and value.dtype.kind in "biuf":
        return float(value)
    return None


_NUMBERS = (float, int, np.integer, np.floating, np.bool_, numbers.Real)


def _box(value: Any) -> np.ndarray:
    """A 0-dimensional array of one object."""
    box = np.empty((), dtype=object)
    box[()] = value
    return box


def _refused(name: str) -> Callable[..., NoReturn]:
    """A method that needs the number itself, such as NumPy looks for by the name of its function."""

    def method(self: Uniform, *args: Any, **kwargs: Any) -> NoReturn:
        self.unit.refuse(f"is used as such, by {name}: expected comparisons with plain numbers, + - * / with them, or rounding")

    method.__name__ = method.__qualname__ = name
    return method


_REFUSED = (
    "__float__ __complex__ __hash__ __reduce_ex__ __pow__ __rpow__ __rtruediv__ __rfloordiv__ __rmod__ __str__ __format__ sqrt "
    "cbrt square exp exp2 expm1 log log2 log10 log1p sin cos tan arcsin arccos arctan arctan2 sinh cosh tanh hypot degrees "
    "radians conjugate is_integer hex as_integer_ratio"
)
for _name in _REFUSED.split():
    setattr(Uniform, _name, _refused(_name))
