"""Which mixture of actions explains where steps led: maximum likelihood, many states at a time.

Of N steps from a state let q(s') be the share that led to s'. Whoever takes a with probability w_a comes to s' with probability
p(s') = sum_a w_a P_a(s'), and
    maximise    f(w) = sum_s' q(s') log p(s')    subject to  w >= 0,  sum_a w_a = 1
is concave. With g_a(w) = sum_s' q(s') P_a(s') / p(s') no mixture has f above f(w) + log max_a g_a(w), by Jensen's inequality,
since sum_a v_a g_a is the mean of p_v / p under q: a certificate in nats a step, whoever found w. So w is optimal iff no g_a is
above 1 (Lindsay 1983). The sum need not be a constraint: f(w) - sum_a w_a has the same maximum (Kim et al. 2020). What is
solved is optimality, by a primal-dual interior point:
    z_a = 1 - g_a(w),    w_a z_a = mu -> 0,    w, z > 0
which leads to the middle of the optima where there are several: p(s') is unique where q > 0, but w only where the rows that can
have weight are independent there. A weight is `settled` if it is the same in every optimum.
Axes: n states, A actions, m pairs of a state and a successor seen.
"""

from dataclasses import dataclass

import numpy as np

from irl_gym.records import Record

ROUNDS = 80
"""Newton steps at most; about 15 are usual."""
CLOSE = 1e-11
"""mu at which to stop."""
NO_WEIGHT = 1e-9
"""A weight below this is 0: one action in so many steps would have more."""
WEIGHED = 1e-4
"""An action may have weight in some optimum unless 1 - g_a is above this."""
INDEPENDENT = 1e-7
"""An eigenvalue of the Hessian below this share of the largest is none: so many more steps would tell these rows apart."""
BLOCK = 1 << 22
"""Numbers held at a time."""


@dataclass(frozen=True, eq=False)
class Mixtures(Record):
    """The most likely mixtures of n states."""

    weights: np.ndarray
    """(n, A) w, rows that sum to 1."""
    short: np.ndarray
    """(n,) no mixture is more likely by more than this, in nats a step."""
    settled: np.ndarray
    """(n, A) booleans: is the weight the same in every most likely mixture?"""


def most_likely(likelihood: np.ndarray, shares: np.ndarray, begins: np.ndarray) -> Mixtures:
    """The most likely mixture in each state.

    Args:
        likelihood: (m, A) P_a(s') of the pairs seen, those of a state one after the other; none is all 0.
        shares: (m,) q, which sum to 1 in each state.
        begins: (n,) the first pair of each state.
    """
    ends, A = np.append(begins[1:], len(shares)), likelihood.shape[1]
    parts, first = [], 0
    while first < begins.size:
        last = max(first + 1, int(np.searchsorted(ends, begins[first] + BLOCK // A**2, side="right")))
        pairs = slice(begins[first], ends[last - 1])
        L = likelihood[pairs] / likelihood[pairs].max(axis=1, keepdims=True)  # which moves f by a constant
        parts.append(_solved(L, shares[pairs], begins[first:last] - begins[first]))
        first = last
    return Mixtures(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def _solved(L: np.ndarray, q: np.ndarray, begins: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The fields of `Mixtures`, of some states."""
    (m, A), n = L.shape, begins.size
    state = np.repeat(np.arange(n), np.diff(np.append(begins, m)))

    def towards(w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(m, A) P_a / p, and (n, A) g."""
        ratio = L / (L * w[state]).sum(axis=1, keepdims=True)
        return ratio, np.add.reduceat(q[:, None] * ratio, begins)

    def curved(ratio: np.ndarray) -> np.ndarray:
        """(n, A, A) minus the Hessian of f."""
        half = np.sqrt(q)[:, None] * ratio
        return np.add.reduceat((half[:, :, None] * half[:, None, :]).reshape(m, -1), begins).reshape(n, A, A)

    w, z, diagonal = np.full((n, A), 1 / A), np.ones((n, A)), np.arange(A)
    for _ in range(ROUNDS):
        ratio, g = towards(w)
        mu = (w * z).mean(axis=1, keepdims=True)
        if (mu <= CLOSE).all() and (np.abs(1 - g - z) <= CLOSE).all():
            break
        H, aim = curved(ratio), 0.1 * np.maximum(mu, CLOSE)
        H[:, diagonal, diagonal] += z / w
        dw = np.linalg.solve(H, (aim / w - (1 - g))[:, :, None])[:, :, 0]
        dz = (aim - z * dw) / w - z
        w, z = w + _inside(w, dw) * dw, z + _inside(z, dz) * dz
    w = np.where(w > NO_WEIGHT, w, 0.0)  # an interior point leaves every weight above 0
    w = w / w.sum(axis=1, keepdims=True)
    ratio, g = towards(w)
    return w, np.log(np.maximum(g.max(axis=1), 1.0)), _settled(curved(ratio), (w > WEIGHED) | (1 - g < WEIGHED))


def _inside(x: np.ndarray, dx: np.ndarray) -> np.ndarray:
    """(n, 1) how far a step may go, at most whole, so that x > 0 stays."""
    return np.minimum(1.0, 0.99 / np.maximum((-dx / x).max(axis=1, keepdims=True), 1e-300))


def _settled(H: np.ndarray, weighed: np.ndarray) -> np.ndarray:
    """(n, A) weights that no change of w moves which leaves p as it is, of actions that may have some (n, A)."""
    A = H.shape[1]
    both = weighed[:, :, None] & weighed[:, None, :]
    sizes, directions = np.linalg.eigh(np.where(both, H, np.eye(A)))
    free = sizes <= INDEPENDENT * sizes[:, -1:]
    return (directions**2 * free[:, None, :]).sum(axis=2) <= INDEPENDENT
