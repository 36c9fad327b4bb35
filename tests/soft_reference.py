"""The soft program of `irl_gym.learners.linear_programs.soft` as its page prints it, dense, by another solver; shares no code
with irl_gym.

Axes: S states, A actions; P is (S, A, S) and the rows of terminal states are zero; `expert` is (S, A), NaN where not known.
"""

import numpy as np
from scipy.optimize import linprog


def soft_lp(P, gamma, expert, *, weights, slack=None, cap=None, l1=0.0, r_max=1.0, avoided=(), ties=()):
    """Maximise sum_s w_s (t_s - C xi_s - C eta_s) - l1 N; returns it. Unknowns: V, t, xi, eta and N's terms p and q, (S) each.

    subject to  (P_pi(s) - P_a(s)) V >= t_s - xi_s     known s, a that pi does not take, with other successors than pi's
                (P_pi(s) - P_a(s)) V >= -eta_s         known s, a that pi takes too, or (s, a) among `ties`
                r_a(s) >= -r_max,  r_pi(s) <= r_max    r_a = V - gamma P_a V; pi uniform where not known
                N = sum of p_s >= r_pi(s)+ and q_s >= -r_a(s) for all a; of r_pi(s) + r_max where avoided
    """
    S, A, _ = P.shape
    eye, zero = np.eye(S), np.zeros(S)
    ended = P.sum(axis=(1, 2)) == 0
    known = ~np.isnan(expert).any(axis=1) & ~ended
    pi = np.where(known[:, None], expert, 1 / A)
    P_pi = np.einsum("sa,sat->st", pi, P)
    r_pi = eye - gamma * P_pi
    rows, right, with_margin = [], [], set()
    for s in np.flatnonzero(known):
        taken = np.flatnonzero(expert[s] > 0)
        for a in range(A):
            row = P_pi[s] - P[s, a]
            if np.abs(row).max() < 1e-12:
                continue
            gains = a not in taken and [s, a] not in [list(pair) for pair in ties]
            if gains:
                with_margin.add(s)
            soft = (slack is not None) * eye[s]
            rows.append(np.concatenate([-row, gains * eye[s], -gains * soft, -(not gains) * soft, zero, zero]))
            right.append(0.0)
    for s in range(S):
        rows.append(np.concatenate([r_pi[s], zero, zero, zero, zero, zero]))
        right.append(r_max)
        rows.append(np.concatenate([r_pi[s], zero, zero, zero, -eye[s], zero]))
        right.append(0.0)
        for a in range(A):
            r_a = eye[s] - gamma * P[s, a]
            rows.append(np.concatenate([-r_a, zero, zero, zero, zero, zero]))
            right.append(r_max)
            rows.append(np.concatenate([-r_a, zero, zero, zero, zero, -eye[s]]))
            right.append(0.0)
    gain = np.array([weights[s] if s in with_margin else 0.0 for s in range(S)])
    price = (slack or 0.0) * np.asarray(weights)
    low = np.isin(np.arange(S), avoided)
    cost = np.concatenate([l1 * r_pi.T @ low, -gain, price, price, l1 * ~low, l1 * ~low])
    t_bounds = [(0, cap if s in with_margin else 0) for s in range(S)]
    bounds = [(None, None)] * S + t_bounds + [(0, None)] * (4 * S)
    found = linprog(cost, A_ub=np.array(rows), b_ub=np.array(right), bounds=bounds, method="highs")
    assert found.success, found.message
    return -found.fun - l1 * r_max * low.sum()


def breakable(P, gamma, expert):
    """(S, A) rows of (4) that some reward makes strict, the other known rows at 0 or above: an LP a row, in V."""
    S, A, _ = P.shape
    known = ~np.isnan(expert).any(axis=1) & (P.sum(axis=(1, 2)) > 0)
    pi = np.where(known[:, None], expert, 1 / A)
    differences = np.einsum("sa,sat->st", pi, P)[:, None] - P
    rows = [(s, a, differences[s, a]) for s in np.flatnonzero(known) for a in range(A)]
    above = [-row for _, _, row in rows] + [row for s, a, row in rows if expert[s, a] > 0]
    least = [-(np.eye(S)[s] - gamma * P[s, a]) for s in range(S) for a in range(A)]
    most = list(np.eye(S) - gamma * np.einsum("sa,sat->st", pi, P))
    right = np.concatenate([np.zeros(len(above)), np.ones(len(least) + len(most))])
    found = np.zeros((S, A), dtype=bool)
    for s, a, row in rows:
        if expert[s, a] == 0 and np.abs(row).max() > 1e-12:
            solved = linprog(-row, A_ub=np.array(above + least + most), b_ub=right, bounds=(None, None), method="highs")
            found[s, a] = -solved.fun > 1e-7
    return found
