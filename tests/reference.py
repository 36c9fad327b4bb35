"""Oracles that share no code with irl_gym: the LP of Ng & Russell as printed, and value iteration on dense arrays.

Axes: S states, A actions; P is (S, A, S) and the rows of terminal states are zero.
"""

import numpy as np
from scipy.optimize import linprog


def paper_lp(P: np.ndarray, gamma: float, expert: np.ndarray, *, l1: float = 0.0, r_max: float = 1.0):
    """Section 3.2, with the explicit inverse. Unknowns: t (S), R+ (S), R- (S). Returns the objective and R.

    maximise    sum_s t(s) - l1 sum(R+ + R-)
    subject to  t(s) <= (P_pi(s) - P_a(s)) (I - gamma P_pi)^-1 R,    0 <= the same,    for all a != pi(s)
                R = R+ - R-,    0 <= R+, R- <= r_max,    |R| <= r_max
    """
    S, A, _ = P.shape
    P_pi = P[np.arange(S), expert]
    inverse = np.linalg.inv(np.eye(S) - gamma * P_pi)
    upper = []
    for s in range(S):
        for a in range(A):
            if a == expert[s]:
                continue
            margin = (P_pi[s] - P[s, a]) @ inverse
            picks_t = np.eye(S)[s]
            upper.append(np.concatenate([picks_t, -margin, margin]))  # t(s) - margin R <= 0
            upper.append(np.concatenate([np.zeros(S), -margin, margin]))  # (4): -margin R <= 0
    for sign in (1, -1):
        upper.extend(np.hstack([np.zeros((S, S)), sign * np.eye(S), -sign * np.eye(S)]))  # |R| <= r_max
    right = np.concatenate([np.zeros(len(upper) - 2 * S), np.full(2 * S, r_max)])
    cost = np.concatenate([-np.ones(S), np.full(2 * S, l1)])
    bounds = [(None, None)] * S + [(0, r_max)] * (2 * S)
    found = linprog(cost, A_ub=np.array(upper), b_ub=right, bounds=bounds, method="highs")
    assert found.success, found.message
    return -found.fun, found.x[S : 2 * S] - found.x[2 * S :]


def critical_l1_by_bisection(P: np.ndarray, gamma: float, expert: np.ndarray, *, steps: int = 40) -> float:
    """The paper's own way to lambda_0: the largest l1 at which the LP's optimum is above 0."""
    low, high = 0.0, 1.0
    while paper_lp(P, gamma, expert, l1=high)[0] > 1e-9:
        low, high = high, 2 * high
    for _ in range(steps):
        middle = (low + high) / 2
        if paper_lp(P, gamma, expert, l1=middle)[0] > 1e-9:
            low = middle
        else:
            high = middle
    return low


def values(P: np.ndarray, gamma: float, R: np.ndarray) -> np.ndarray:
    """V* (S,) of a step reward R (S, A), by sweeps until nothing is left of the first guess."""
    V = np.zeros(len(P))
    for _ in range(int(np.ceil(np.log(1e-13) / np.log(gamma)))):
        V = action_values(P, gamma, R, V).max(axis=1)
    return V


def action_values(P: np.ndarray, gamma: float, R: np.ndarray, V: np.ndarray) -> np.ndarray:
    """Q = R + gamma P V (S, A); nothing is paid in terminal states."""
    return np.where(P.sum(axis=2) == 0, 0.0, R) + gamma * P @ V


def optimal_actions(P: np.ndarray, gamma: float, R: np.ndarray) -> np.ndarray:
    """(S,) the first optimal action of each state, ties to 1e-9."""
    Q = action_values(P, gamma, R, values(P, gamma, R))
    return (Q >= Q.max(axis=1, keepdims=True) - 1e-9).argmax(axis=1)


def margins(P: np.ndarray, gamma: float, expert: np.ndarray, R: np.ndarray, *, skip_equal: bool = False) -> np.ndarray:
    """(S,) min over a != pi(s) of (P_pi(s) - P_a(s)) V with V = (I - gamma P_pi)^-1 R.

    With `skip_equal` actions with the expert's successors are left out; infinite where nothing is left.
    """
    S = len(P)
    P_pi = P[np.arange(S), expert]
    V = np.linalg.inv(np.eye(S) - gamma * P_pi) @ R
    differences = (P_pi[:, None, :] - P) @ V
    differences[np.arange(S), expert] = np.inf
    if skip_equal:
        differences[np.abs(P_pi[:, None, :] - P).max(axis=2) < 1e-12] = np.inf
    return differences.min(axis=1)


def section_4_lp(
    P, gamma, expert, Phi, S_0, *, penalty: float = 2.0, l1: float = 0.0, cap: float | None = None, printed: bool = False
):
    """Section 4, with the explicit inverse. Unknowns: alpha+ (K), alpha- (K), z (one a state). Returns objective and alpha.

    maximise    sum_{s in S_0} z_s - l1 sum(alpha+ + alpha-)
    subject to  z_s <= x and z_s <= penalty x,    x = (P_pi(s) - P_a(s)) sum_i alpha_i V_i, for each a != pi(s)
                V_i = (I - gamma P_pi)^-1 phi_i,    alpha = alpha+ - alpha-,    0 <= alpha+, alpha- <= 1
    Rows without a difference in successors are not counted, but where `printed`. `Phi` is (S, K).
    With a cap z_s <= cap too, which is ours.
    """
    S, A, _ = P.shape
    K = Phi.shape[1]
    P_pi = P[np.arange(S), expert]
    V = np.linalg.inv(np.eye(S) - gamma * P_pi) @ Phi
    rows = [(s, a) for s in S_0 for a in range(A) if a != expert[s] and (printed or np.abs(P_pi[s] - P[s, a]).max() > 1e-12)]
    counted = sorted({s for s, _ in rows})
    upper = []
    for s, a in rows:
        x = (P_pi[s] - P[s, a]) @ V
        picks_z = np.eye(len(counted))[counted.index(s)]
        upper.append(np.concatenate([-x, x, picks_z]))
        upper.append(np.concatenate([-penalty * x, penalty * x, picks_z]))
    cost = np.concatenate([np.full(2 * K, l1), -np.ones(len(counted))])
    bounds = [(0, 1)] * (2 * K) + [(None, cap)] * len(counted)
    found = linprog(cost, A_ub=np.array(upper), b_ub=np.zeros(len(upper)), bounds=bounds, method="highs")
    assert found.success, found.message
    return -found.fun, found.x[:K] - found.x[K : 2 * K]


def uniform_margin(P, gamma, expert, Phi, S_0):
    """The largest margin that all rows of section 4 can have at once: max eps, d_r . alpha >= eps, |alpha_i| <= 1."""
    S, A, _ = P.shape
    P_pi = P[np.arange(S), expert]
    V = np.linalg.inv(np.eye(S) - gamma * P_pi) @ Phi
    d = [(P_pi[s] - P[s, a]) @ V for s in S_0 for a in range(A) if np.abs(P_pi[s] - P[s, a]).max() > 1e-12]
    K = Phi.shape[1]
    upper = np.hstack([-np.array(d), np.ones((len(d), 1))])
    found = linprog([0.0] * K + [-1.0], A_ub=upper, b_ub=np.zeros(len(d)), bounds=[(-1, 1)] * K + [(None, None)])
    assert found.success, found.message
    return -found.fun
