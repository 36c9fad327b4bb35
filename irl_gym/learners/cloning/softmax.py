"""Behaviour cloning by a softmax of features, the policy class in which cloning is a convex program.

    pi(a | s) = exp(theta_a . phi(s)) / sum_b exp(theta_b . phi(s))
    minimise f(theta) = -sum_{s,a} n(s, a) log pi(a | s) / N + l2 ||theta||^2 / 2
    grad_a f = sum_s phi(s) (n(s) pi(a | s) - n(s, a)) / N + l2 theta_a
f is l2-strongly convex, so the norm of its gradient bounds how far it is above its least (`SoftmaxProof`), whatever the solver
says. Where nothing was demonstrated the features decide. Axes: S states, A actions, K features.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from scipy.optimize import minimize
from scipy.special import log_softmax

from irl_gym.checks import checked_number, discrete_actions
from irl_gym.errors import SolverFailed
from irl_gym.features.feature_maps import FeatureMap, as_features, check_length, over_rows
from irl_gym.learners.base import Outcome, featured
from irl_gym.learners.cloning.clone import weights_of
from irl_gym.learners.cloning.proofs import SoftmaxProof, told_of
from irl_gym.learners.needs import Needs
from irl_gym.learners.problem import Problem
from irl_gym.mdp.episodes import EmpiricalPolicy
from irl_gym.mdp.tabular_mdp import TransitionTable
from irl_gym.programs.deadline import Deadline
from irl_gym.programs.killable import check_limit, within
from irl_gym.programs.status import Status
from irl_gym.spaces.states import StateIndex, States

SHORT = 1e-6
"""Nats a step that f may be above its least."""


@dataclass(frozen=True, eq=False)
class SoftmaxClone:
    """Behaviour cloning by a softmax of features.

    Raises:
        InvalidParameter: a field outside its range.
        InvalidFeatures: features that are neither a map nor an array (S, K).
    """

    features: FeatureMap | np.ndarray | None = None
    """phi: a map, or an array (S, K) with one row a state; None for those of the problem that `learn` is given."""
    l2: float = 1e-4
    """Price of half the sum of the squared weights, above 0: what keeps the weights of an expert that never errs finite."""
    max_iterations: int = 20_000
    """Of L-BFGS."""
    time_limit: float | None = None
    """Seconds for the whole fit, asked for at each iteration; None for no limit. A caller's features are not cut."""
    needs: ClassVar[Needs] = Needs(("demonstrations",), ("dynamics", "features"), "inferred")
    """The parts of a problem that `learn` reads; the dynamics tell which states matter."""
    how: ClassVar[str] = "cloned from the episodes, by a softmax of features"
    """How its policy comes about."""
    on_rows: ClassVar[bool] = True
    """Its policy is one of numbered states, so that without them there is none."""

    def __post_init__(self) -> None:
        if self.features is not None:
            object.__setattr__(self, "features", as_features(self.features))
        checked_number("l2", self.l2, "a number above 0", above=0)
        checked_number("max_iterations", self.max_iterations, "a whole number of at least 1", least=1, whole=True)
        Deadline.after(self.time_limit)  # checks it

    def learn(self, problem: Problem, rng: np.random.Generator | None = None) -> Outcome[None, SoftmaxProof]:
        """The same as `fit`, of a problem; nothing is drawn.

        Args:
            problem: with demonstrations; and features, if the learner has none.
            rng: not used.

        Raises:
            MissingPart: one of these is not there. And whatever `fit` raises.
            NotDiscrete: observations that cannot be numbered, or actions that are not one number.
        """
        known, learner = self.needs.of(problem, self), featured(self, problem)
        discrete_actions(known.spaces.actions)
        table = known.dynamics if isinstance(known.dynamics, TransitionTable) else None
        found = learner.fit(known.shown.weights, table, states=known.spaces.states or StateIndex(known.spaces.observations))
        return replace(found, inferred=known.inferred)

    def fit(
        self, seen: EmpiricalPolicy | np.ndarray, table: TransitionTable | None = None, /, *, states: States | None = None
    ) -> Outcome[None, SoftmaxProof]:
        """Clone what was seen.

        Args:
            seen: how often each action was taken in each state, or (S, A) weights; see `Clone.fit`.
            table: P and d0, which tell what can be reached; None where they are not known.
            states: turns rows into the observations that the features are of; None where they are of rows.

        Raises:
            InvalidDemonstrations: counts that no episodes could have given, or of another table.
            InvalidFeatures: what the features give is not (S, K) finite numbers.
            SolverFailed: f may be more than 1e-6 above its least.
            SolverTimeout: the time is up.
        """
        with within(Deadline.after(self.time_limit)):
            return self._fitted(seen, table, states)

    def _fitted(
        self, seen: EmpiricalPolicy | np.ndarray, table: TransitionTable | None, states: States | None
    ) -> Outcome[None, SoftmaxProof]:
        counts, phi = weights_of(seen, table), as_features(self.features)
        decode: Callable[[np.ndarray], Any] = (lambda rows: rows) if states is None else states.decode_batch
        if states is None:
            check_length(phi, len(counts))
        X = over_rows(phi, decode, np.arange(len(counts)))
        shown = counts.sum(axis=1) > 0
        theta, gradient_norm, iterations = self._solved(X[shown], counts[shown] / counts.sum())
        policy = np.exp(log_softmax(X @ theta, axis=1))
        told = told_of(counts, policy, shown, table, "there the features decide")
        proof = SoftmaxProof(**told, weights=theta.size, l2=float(self.l2), gradient_norm=gradient_norm)
        if proof.suboptimality > SHORT:
            raise SolverFailed(
                f"after {iterations} iterations the log loss may be {proof.suboptimality:.1e} nats above its least: expected "
                f"at most {SHORT:g}. Raise l2, or raise max_iterations."
            )
        return Outcome(None, Status.OPTIMAL, proof, {"iterations": iterations, "theta": theta.tolist()}, policy)

    def fit_costs(
        self, costs: np.ndarray, visited: np.ndarray, table: TransitionTable | None = None, /, *, states: States | None = None
    ) -> Outcome[None, SoftmaxProof]:
        """Cost-weighted classification: clone the cheapest actions, each state weighted by what others cost more on average.

        Convex in place of the cost itself, which is not; it is the least cost where the features tell all states apart.

        Args:
            costs: (S, A) what each action costs, added up over all visits of a state.
            visited: (S,) where that is known.
            table: as `fit`, and so the errors.
            states: as `fit`.
        """
        rows, best = np.arange(len(costs)), costs.argmin(axis=1)
        weights = np.where(visited, costs.mean(axis=1) - costs[rows, best], 0.0)
        weights[visited] += np.finfo(float).eps * (weights.max() or 1.0)
        labels = np.zeros(costs.shape)
        labels[rows, best] = weights
        return self.fit(labels, table, states=states)

    def _solved(self, X: np.ndarray, n: np.ndarray) -> tuple[np.ndarray, float, int]:
        """Theta (K, A), the norm of the gradient there, and the iterations; of features (m, K) and shares (m, A)."""
        shape, here = (X.shape[1], n.shape[1]), n.sum(axis=1, keepdims=True)

        def f(flat: np.ndarray) -> tuple[float, np.ndarray]:
            check_limit()
            theta = flat.reshape(shape)
            log_pi = log_softmax(X @ theta, axis=1)
            gradient = X.T @ (here * np.exp(log_pi) - n) + self.l2 * theta
            return float(-(n * log_pi).sum() + self.l2 * (flat @ flat) / 2), gradient.ravel()

        options = {"maxiter": int(self.max_iterations), "maxfun": 10**9, "maxcor": 30, "ftol": 0.0, "gtol": 1e-9}
        found = minimize(f, np.zeros(shape[0] * shape[1]), jac=True, method="L-BFGS-B", options=options)
        return found.x.reshape(shape), float(np.linalg.norm(f(found.x)[1])), int(found.nit)
