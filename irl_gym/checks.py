"""Checks of arguments that many places share: a number in a range, an array of floats, a sparse matrix, discrete actions."""

import numbers
import os
import sys
from typing import Any

import numpy as np
import scipy.sparse as sp
from gymnasium import spaces

from irl_gym.errors import InvalidInput, InvalidParameter, IrlGymError, NotDiscrete, a_type

LARGEST = 1e300
"""Sums of larger numbers overflow."""
SUM_TOLERANCE, SINGLE_TOLERANCE = 1e-9, 1e-6
"""How far probabilities may sum up from 1; and those of single precision (float32), which are then divided by their sum."""
MOST_COMBINATIONS = 1024
"""Actions, of several whole numbers between bounds, that are all taken; of more, some along each axis."""


def checked_number(
    name: str,
    value: Any,
    expected: str,
    *,
    above: float | None = None,
    least: float | None = None,
    below: float | None = None,
    whole: bool = False,
    error: type[InvalidInput] = InvalidParameter,
) -> float:
    """Return a finite number within a range, as a float.

    Args:
        name: what it is called.
        value: what was given.
        expected: what the message says was expected, with the mend.
        above: it has to be greater than this.
        least: or at least this.
        below: and less than this.
        whole: only integers, NumPy's among them.
        error: raised when it is not.

    Raises:
        InvalidInput: of the class given.
    """
    kind = numbers.Integral if whole else numbers.Real
    try:
        number = float(value) if isinstance(value, kind) and not isinstance(value, bool) else np.nan
    except OverflowError:  # a whole number beyond floats
        number = np.inf
    fine = np.isfinite(number) and (above is None or number > above) and (least is None or number >= least)
    if not (fine and (below is None or number < below)):
        raise error(f"{name} is {value!r}: expected {expected}.")
    return number


def checked_flag(name: str, value: Any) -> bool:
    """Return True or False, NumPy's too, as a bool.

    Raises:
        InvalidParameter: anything else, such as a word or a number.
    """
    if isinstance(value, bool | np.bool_):
        return bool(value)
    raise InvalidParameter(f"{name} is {value!r:.80}: expected True or False.")


def is_word(value: Any, *words: str) -> bool:
    """Is this one of some words? Arrays, which compare with text one by one, are none."""
    return isinstance(value, str) and value in words


def any_array(name: str, value: Any, expected: str, error: type[InvalidInput]) -> np.ndarray:
    """Return an array-like as an array of any type.

    Raises:
        InvalidInput: of the class given, for rows of several lengths.
    """
    try:
        return np.asarray(value)
    except (ValueError, OverflowError) as reason:
        raise error(f"{name} is rows of several lengths, or none at all ({reason}): expected {expected}.") from reason


def checked_rng(rng: Any) -> np.random.Generator:
    """Return a generator as it is.

    Raises:
        InvalidParameter: anything else, such as a seed.
    """
    if isinstance(rng, np.random.Generator):
        return rng
    raise InvalidParameter(f"rng is {rng!r}: expected a generator. Make one of a seed: `np.random.default_rng(0)`.")


def checked_csr(
    data: Any, indices: Any, indptr: Any, shape: tuple[int, int], name: str, error: type[InvalidInput]
) -> sp.csr_array:
    """A sparse matrix of its parts, which SciPy's own code believes: it reads, and writes, wherever they say.

    Args:
        data: (nnz,) real numbers.
        indices: (nnz,) whole numbers, the column of each.
        indptr: (rows + 1,) whole numbers, where each row begins among them, and nnz.
        shape: rows and columns.
        name: what the matrix is called.
        error: raised when it is none.

    Raises:
        InvalidInput: of the class given; naming the part and the first value that cannot be.
    """
    _check_parts(data, indices, indptr, shape, name, error)
    return sp.csr_array((data, indices, indptr), shape=shape, dtype=np.float64)


def sparse_copy(name: str, matrix: Any, error: type[InvalidInput]) -> sp.csr_array:
    """A copy of any sparse matrix of SciPy's as CSR with float64, once its structure is known to be whole.

    Raises:
        InvalidInput: of the class given, for a matrix that is damaged, has other than two axes, or holds no real numbers.
    """
    if matrix.ndim != 2 or matrix.dtype.kind not in "biuf":
        raise error(f"{name} has shape {matrix.shape} and dtype {matrix.dtype}: expected real numbers along two axes.")
    if matrix.format == "coo":
        data, inside = matrix.data, True
        for places, n in zip(matrix.coords, matrix.shape, strict=True):
            fits = places.dtype.kind in "iu" and places.shape == data.shape == (data.size,)
            inside &= bool(fits and ((places >= 0) & (places < n)).all())
        if not inside:
            raise error(f"{name} has entries outside its shape {matrix.shape}: expected two places inside for each.")
    elif matrix.format in ("csc", "bsr"):
        height, width = matrix.data.shape[1:] if matrix.format == "bsr" else (1, 1)
        rows, columns = matrix.shape[0] // max(height, 1), matrix.shape[1] // max(width, 1)
        shape = (rows, columns) if matrix.format == "bsr" else (columns, rows)
        _check_parts(matrix.data.reshape(len(matrix.data), -1)[:, 0], matrix.indices, matrix.indptr, shape, name, error)
    elif matrix.format == "csr":
        _check_parts(matrix.data, matrix.indices, matrix.indptr, matrix.shape, name, error)
    csr: Any = sp.csr_array(matrix, copy=True)
    if matrix.format not in ("csr", "csc", "bsr", "coo"):  # lists, dictionaries and diagonals
        _check_parts(csr.data, csr.indices, csr.indptr, csr.shape, name, error)
    return csr.astype(np.float64, copy=False)


def _check_parts(data: Any, indices: Any, indptr: Any, shape: Any, name: str, error: type[InvalidInput]) -> None:
    """The structure of a matrix whose rows (or columns, or rows of blocks) are compressed: `shape` begins with these."""
    for part, array, kinds in (("data", data, "biuf"), ("indices", indices, "iu"), ("indptr", indptr, "iu")):
        if not isinstance(array, np.ndarray) or array.ndim != 1 or array.dtype.kind not in kinds:
            found = f"shape {np.shape(array)} and dtype {getattr(array, 'dtype', type(array).__name__)}"
            raise error(f"{name}.{part} has {found}: expected {'real' if kinds == 'biuf' else 'whole'} numbers along one axis.")
    if len(indptr) != shape[0] + 1 or indptr[0] != 0 or not indptr[-1] == len(indices) == len(data):
        span = f" from {indptr[0]} to {indptr[-1]}" if len(indptr) else ""
        raise error(
            f"{name} has {len(data)} numbers, {len(indices)} indices and {len(indptr)} pointers{span}: expected an index for "
            f"each number, and {shape[0] + 1} pointers from 0 to as many. `prune()` drops numbers that no pointer reaches."
        )
    falls = np.flatnonzero(indptr[1:] < indptr[:-1])
    if falls.size:
        at = int(falls[0])
        raise error(f"{name}.indptr[{at + 1}] is {indptr[at + 1]}, after {indptr[at]}: expected pointers that never fall.")
    wrong = np.flatnonzero((indices < 0) | (indices >= shape[1]))
    if wrong.size:
        raise error(f"{name}.indices[{wrong[0]}] is {indices[wrong[0]]}: expected 0 to {shape[1] - 1}.")


def float_array(name: str, value: Any, expected: str, error: type[InvalidInput]) -> np.ndarray:
    """Return an array-like as a new float64 array.

    Raises:
        InvalidInput: of the class given, for anything that is not rows of numbers of one length.
    """
    try:
        if np.iscomplexobj(value):
            raise TypeError("complex numbers")  # NumPy would drop the imaginary part
        return np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError, RecursionError) as reason:  # 10**400, a list within itself
        raise error(f"{name} is {a_type(value)} that cannot be read as numbers ({reason}): expected {expected}.") from reason


def discrete_actions(
    space: spaces.Space, what: str = "the action space", error: type[IrlGymError] = NotDiscrete
) -> spaces.Discrete:
    """Return a space of actions that are one number, as it is.

    Raises:
        NotDiscrete: any other, with the wrapper that makes it one; or the error of the class given.
    """
    if isinstance(space, spaces.Discrete):
        return space
    raise error(f"{what} is {space}: expected Discrete. {_made_discrete(space)}")


def _made_discrete(space: spaces.Space) -> str:
    wrappers = "gymnasium.wrappers"
    found = _combinations(space)
    if found is not None:
        several, number = found
        made = f"{wrappers}.TransformAction(env, lambda n: {several}, gymnasium.spaces.Discrete({number}))"
        return f"Number its combinations, with `{made}`."
    if isinstance(space, spaces.Box):
        if np.isfinite(space.low).all() and np.isfinite(space.high).all():
            return f"Take some of them, such as 5 along each axis, with `{wrappers}.DiscretizeAction(env, 5)`."
        box = f"gymnasium.spaces.Box(-1, 1, {space.shape}, numpy.{space.dtype})"
        bounded = f"{wrappers}.TransformAction(env, lambda action: action, {box})"
        return f"Bound them and take some, such as 5 along each axis, with `{wrappers}.DiscretizeAction({bounded}, 5)`."
    return f"Turn a number into such an action with a function of yours, in `{wrappers}.TransformAction`."


def _combinations(space: spaces.Space) -> tuple[str, int] | None:
    """Python that makes an action of the number n, and how many there are; None where actions are no few whole numbers."""
    if isinstance(space, spaces.MultiDiscrete):
        counts, least = space.nvec.astype(object), space.start
    elif isinstance(space, spaces.MultiBinary):
        counts, least = np.full(space.shape, 2, dtype=object), np.zeros(space.shape, dtype=int)
    elif isinstance(space, spaces.Box) and space.dtype.kind in "iu":
        counts, least = space.high.astype(object) - space.low.astype(object) + 1, space.low
    else:
        return None
    number = int(np.prod(counts, dtype=object))
    if isinstance(space, spaces.Box) and number > MOST_COMBINATIONS:
        return None
    shape, shift = np.shape(least), np.ravel(least).tolist()
    several = f"numpy.array(numpy.unravel_index(n, {tuple(np.ravel(counts).tolist())}))" + (f" + {shift}" if any(shift) else "")
    several = several if len(shape) == 1 else f"({several}).reshape({shape})"
    return (f"({several}).astype(numpy.{space.dtype})" if isinstance(space, spaces.Box) else several), number


def of_single_precision(data: np.ndarray, rows: np.ndarray, n_rows: int) -> tuple[np.ndarray, float]:
    """Probabilities (nnz,) of rows (nnz,) whose sums are 1 in double precision too, and how far they were from 1.

    Rows that sum to 1 but for the rounding of float32 are divided by their sums, if their numbers are such.
    """
    sums = np.bincount(rows, weights=data, minlength=n_rows)
    off = np.abs(sums - 1)
    mended = (off > SUM_TOLERANCE) & (off <= SINGLE_TOLERANCE)
    if not mended.any() or (data[mended[rows]].astype(np.float32) != data[mended[rows]]).any():
        return data, 0.0
    return data / np.where(mended, sums, 1.0)[rows], float(off[mended].max())


def shown_sum(total: float) -> str:
    """A sum that is not 1, in enough digits to see it."""
    told = f"{total:.9g}"
    return told if told != "1" else f"1 {'+' if total > 1 else '-'} {abs(total - 1):.1g}"


def no_module(name: str, attribute: str) -> str:
    """What is said of a module that Python does not find: where it was looked for, and what to do.

    Args:
        name: its name.
        attribute: what was asked for in it, behind a colon.
    """
    if name.endswith(".py"):
        return f"{name} is a file: expected a module's name. Write {name.removesuffix('.py')}:{attribute}."
    here = os.getcwd()
    places = f"in {here} and among what is installed" if {"", here} & {*sys.path} else "among what is installed"
    return (
        f"there is no module {name!r}, which was looked for {places}: expected one that Python finds. Run irl-gym in the "
        "folder that has it, or install it."
    )
