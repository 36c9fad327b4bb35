"""I - gamma P_pi, factorised once: values (5), visits, and bounds of both that hold with all rounding.

The inverse has no negative entry, so for x >= 0 and any y >= 0
    y >= x + gamma P_pi y  in every state    implies    y >= (I - gamma P_pi)^-1 x,
and the same with <=. A computed y is moved up (or down) by a thousandth and then *checked* by one product: what is proved does
not rest on the factors. Axes: S states.
"""

import numpy as np
import scipy.sparse as sp

from irl_gym._typing import Sparse, Vector
from irl_gym.programs import native
from irl_gym.programs.killable import made

EPSILON = float(np.finfo(np.float64).eps)
MOVED = 1e-3
"""Share by which a solution is moved so that it can be checked to be a bound."""


class Discounted:
    """I - gamma P_pi, factorised once.

    Args:
        P_pi: (S, S) transitions under a policy.
        gamma: discount.
        sums: rounded operations that the entries of P_pi are the result of; the bounds allow for them.
    """

    def __init__(self, P_pi: Sparse, gamma: float, *, sums: int = 0):
        self._P = sp.csr_array(gamma * P_pi)
        self._terms = (int(np.diff(self._P.indptr).max(initial=0)) + 8 + sums) * EPSILON
        identity = sp.eye_array(P_pi.shape[0], format="csc")
        self._factor = made(P_pi.shape[0] ** 3, native.factors, sp.csc_matrix(identity - self._P))

    def solve(self, right: np.ndarray) -> np.ndarray:
        """X with (I - gamma P_pi) x = right."""
        return self._factor.solve(np.ascontiguousarray(right, dtype=np.float64))

    def solve_transposed(self, right: np.ndarray) -> np.ndarray:
        """X with (I - gamma P_pi)^T x = right."""
        return self._factor.solve(np.ascontiguousarray(right, dtype=np.float64), "T")

    def above(self, right: Vector) -> Vector:
        """(S,) at least (I - gamma P_pi)^-1 right, for right >= 0, and at most about 0.1 % more; infinite where not proved."""
        y, rounding = self._moved(right, MOVED)
        proved = bool((y - self._P @ y - right >= rounding).all())
        return y if proved else np.full(y.shape, np.inf)

    def below(self, right: Vector) -> Vector:
        """(S,) at most (I - gamma P_pi)^-1 right, for right >= 0, and at most about 0.1 % less; 0 where not proved."""
        y, rounding = self._moved(right, -MOVED)
        proved = bool(((right + self._P @ y - y >= rounding) | (y == 0)).all())
        return y if proved else np.zeros(y.shape)

    def _moved(self, right: Vector, share: float) -> tuple[Vector, Vector]:
        """A solution moved up or down, and the rounding (S,) of its check."""
        plain = np.maximum(self.solve(right), 0.0)
        y = np.maximum(self.solve((1 + share) * right + np.sign(share) * 8 * self._terms * plain), 0.0)
        return y, self._terms * (y + right + self._P @ y)
