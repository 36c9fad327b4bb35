"""Linear-programming IRL for large state spaces (Ng & Russell 2000, section 4; lecture notes 2.2.4).

R = sum_i alpha_i phi_i (8), so V = sum_i alpha_i V_i (9), V_i the value of the expert's policy under phi_i. On a sample S_0:
    maximise    sum_{s in S_0} min_{a != pi(s)} p(E_{s' ~ P_s,pi(s)} V(s') - E_{s' ~ P_sa} V(s')) - l1 ||alpha||_1
    subject to  |alpha_i| <= 1,    p(x) = x for x >= 0, and 2 x below
The features may express no reward that makes the expert optimal, so (10) is not a constraint: what violates it counts twice.

Departs: an action with the expert's successors has no row, and a state without another action is not counted. As printed such a
row says 0, so that its state's min is at most 0 whatever the reward, and the optimum is another one;
`trivial_rows="as printed"` keeps these rows, and is the program as printed.

`margin_cap=tau` Departs: each margin counts up to tau only. The paper's sum buys one state's margin at the price of others',
and pays for violations with large margins elsewhere, also where the features express a reward that makes the expert optimal.
Rows that no such reward in the span makes strict are left out of the margins one by one, never their whole state; what violates
them still costs. They are rows of S_0: weights that satisfy (10) in all of S_0 tie the expert with these actions, where other
features, or a smaller S_0, may not. Of a generative model that holds of the rows as estimated. Where the features express no
reward that makes the expert optimal, no row is left out.
`margin_cap="auto"`: tau is half of the largest margin that all other rows can have at once: with l1 = 0 it is attained by each
of them, so that the expert is optimal in S_0, and strictly but for the rows left out. Where the features express no reward that
makes the expert optimal, a tenth of the mean margin under the paper's reward.

Departs: an action that the expert takes too, when it takes several, has to be as good; its rows d and -d both go into the sum,
where they cost (penalty - 1) |d|. `certify` judges all reachable states of a table, not the sample only.
Axes: S states, A actions, K features.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

import numpy as np

from irl_gym.checks import checked_number, float_array, is_word
from irl_gym.environments.generative import GenerativeModel, least_horizon, truncation_bound
from irl_gym.errors import InvalidMDP, InvalidParameter, InvalidPolicy, a_type
from irl_gym.features.feature_maps import FeatureMap, as_features, check_length
from irl_gym.features.linear_reward import LinearReward
from irl_gym.learners.base import Outcome, featured
from irl_gym.learners.linear_programs.feature_program import NOTHING, SolvedFeatures, solve_features
from irl_gym.learners.linear_programs.feature_rows import FeatureRows, chosen_states, rows_of_model, rows_of_table
from irl_gym.learners.linear_programs.proofs.feature_proof import FeatureProof, SampledFeatureProof
from irl_gym.learners.linear_programs.weights import Weights, check_weighing
from irl_gym.learners.needs import Needs
from irl_gym.learners.problem import Problem
from irl_gym.mdp.margins import least_per_state
from irl_gym.mdp.planning.discounted import Discounted
from irl_gym.mdp.policies import Policy, completed
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.programs.killable import within
from irl_gym.programs.solvers import SolverName, Solving
from irl_gym.records import Record
from irl_gym.spaces.states import States


@dataclass(frozen=True, eq=False)
class FeatureLP(Record):
    """Linear-programming IRL for large state spaces, with rewards linear in features (Ng & Russell 2000, section 4).

    Raises:
        InvalidParameter: a field outside its range.
        InvalidFeatures: features that are neither a map nor an array (S, K).
    """

    features: FeatureMap | np.ndarray | None = None
    """phi: a map, or an array (S, K) with one row a state; None for those of the problem that `learn` is given."""
    S_0: int | Sequence[int] | Sequence[Sequence[float]] | np.ndarray | None = None
    """The sample: a number of states, drawn uniformly from those that count; the states themselves, as rows of the table or as
    (m, d) states of a generative model; None for all."""
    penalty: float = 2.0
    """Slope of p below 0, at least 1: the paper's 2."""
    margin_cap: float | Literal["auto"] | None = None
    """tau > 0, the cap on margins; "auto" chooses it; None is the paper's program."""
    l1: float = 0.0
    """Price of ||alpha||_1, at least 0."""
    samples: int = 1
    """Rollouts for each state and action, where the world is a generative model."""
    horizon: int | None = None
    """Steps after which a rollout is cut; None for the least H with gamma^H <= 0.01."""
    seed: int = 0
    """Of the sample and of the rollouts."""
    solver: SolverName = "auto"
    """"auto" chooses by size; see `irl_gym.programs.solvers`."""
    time_limit: float | None = None
    """Seconds for the whole fit: all its programs, all attempts at them, and the proof, together; None for no limit.
    Kept within a fifth, as `FiniteLP.time_limit` is; a caller's features are not cut."""
    trivial_rows: Literal["left out", "as printed"] = "left out"
    """Rows of actions with the expert's successors, 0 under every reward: as printed they hold the state's min at 0."""
    needs: ClassVar[Needs] = Needs(("dynamics", "expert or demonstrations"), ("features",), "inferred")
    """The parts of a problem that `learn` reads."""

    def __post_init__(self) -> None:
        if self.features is not None:
            object.__setattr__(self, "features", as_features(self.features))
        check_weighing(self)
        if self.margin_cap is not None and not is_word(self.margin_cap, "auto"):
            checked_number("margin_cap", self.margin_cap, "a number above 0, 'auto' or None", above=0)
        if not is_word(self.trivial_rows, "left out", "as printed"):
            raise InvalidParameter(f"trivial_rows is {self.trivial_rows!r}: expected 'left out' or 'as printed'.")
        checked_number("samples", self.samples, "a whole number of at least 1", least=1, whole=True)
        if isinstance(self.S_0, int | float | str | np.number):
            checked_number("S_0", self.S_0, "a number of at least 1, states, or None for all", least=1, whole=True)
        elif self.S_0 is not None and not float_array("S_0", self.S_0, "states, all of one length", InvalidParameter).size:
            raise InvalidParameter("S_0 is empty: expected at least one state, or None for all.")

    def learn(self, problem: Problem, rng: np.random.Generator | None = None) -> Outcome[LinearReward, FeatureProof]:
        """The same as `fit`, of a problem; where the expert is known by episodes alone, its most frequent actions are taken.

        Args:
            problem: with the dynamics, a table or a generative model; the expert's policy, or on a table its episodes; and
                features, if the learner has none.
            rng: nothing is drawn from it, but from the learner's own seed.

        Raises:
            MissingPart: one of these is not there. And whatever `fit` raises.
        """
        known, learner = self.needs.of(problem, self), featured(self, problem)
        world: Any = known.dynamics  # which is required
        return replace(learner.fit(world, known.policy, states=known.spaces.states), inferred=known.inferred)

    def fit(
        self, world: TabularMDP | GenerativeModel, expert: Any, /, *, states: States | None = None
    ) -> Outcome[LinearReward, FeatureProof]:
        """Learn the weights of a reward under which the expert is optimal, or violates (10) least.

        Args:
            world: a table, whose values are exact; or a generative model, whose values are means of rollouts.
            expert: for a table (S,) actions, (S, A) probabilities or (S, A) set of optimal actions; else a policy with
                `predict`. Probabilities of NaN say that nothing is known of a state, as in a policy read from data: it has no
                row and is not judged, and what follows it has the value of random actions.
            states: turns rows of the table into the observations that the features are of, such as `tabulate(...).states`; None
                where they are of rows.

        Raises:
            InvalidPolicy: an expert of the wrong shape or content.
            InvalidParameter: S_0 with states outside the table.
            InvalidFeatures: what the features give is not (N, K) finite numbers.
            DegenerateExpert: S_0 has no state in which another action leads elsewhere.
            NotSettable: the environment of a generative model cannot be set to a state.
            SolverTimeout, SolverFailed: no answer.
        """
        solving = Solving.begun(self.solver, self.time_limit)
        with within(solving.deadline):
            if isinstance(world, GenerativeModel):
                return self._fit_model(world, expert, solving)
            if isinstance(world, TabularMDP):
                return self._fit_table(world, expert, states, solving)
        raise InvalidMDP(
            f"the world is {a_type(world)}: expected a TabularMDP, such as `tabulate(env, gamma=...).mdp`, or a "
            "GenerativeModel(env, gamma), first, and then the expert."
        )

    @property
    def phi(self) -> FeatureMap:
        """The features, as a map."""
        return as_features(self.features)

    def _fit_table(
        self, mdp: TabularMDP, expert: Any, states: States | None, solving: Solving
    ) -> Outcome[LinearReward, FeatureProof]:
        if states is not None and not isinstance(states, States):
            raise InvalidParameter(
                f"states is {states!r}: expected a numbering, such as `tabulate(...).states`, or None for rows."
            )
        size, decode = (mdp.n_states, _rows) if states is None else (states.n_states, states.decode_batch)
        if size != mdp.n_states:
            raise InvalidParameter(f"states has {size} states: expected {mdp.n_states}, the table's. Is it another table's?")
        if states is None:
            check_length(self.phi, mdp.n_states)
        S_0: Any = self.S_0
        expert, known = completed(expert, mdp.n_states)
        discounted = Discounted(mdp.P_pi(expert), mdp.gamma)
        chosen = chosen_states(mdp, expert, S_0, np.random.default_rng(self.seed), known)
        found = rows_of_table(mdp, expert, self.phi, decode, chosen, discounted, printed=self.trivial_rows == "as printed")
        solved = solve_features(found, self.penalty, self.l1, self.margin_cap, solving)
        proof = FeatureProof(**self._proved(found, solved))
        return Outcome(self._reward(solved.weights), solved.status, proof, self._stats(solved.weights, found))

    def _fit_model(self, model: GenerativeModel, expert: Policy, solving: Solving) -> Outcome[LinearReward, FeatureProof]:
        if not isinstance(expert, Policy):
            raise InvalidPolicy(
                f"the expert is {a_type(expert)}: expected a policy with `predict`, since the model has no table."
            )
        S_0 = self._states_of(model)
        horizon = least_horizon(model.gamma) if self.horizon is None else int(self.horizon)
        found = rows_of_model(
            model,
            expert,
            self.phi,
            S_0,
            samples=int(self.samples),
            horizon=horizon,
            seed=int(self.seed),
            printed=self.trivial_rows == "as printed",
        )
        solved = solve_features(found, self.penalty, self.l1, self.margin_cap, solving)
        weights = solved.weights
        tolerance, error, short = np.full(len(S_0), 1e-9 * found.rows.scale), None, np.zeros(len(S_0))
        values, free = found.rows.d @ weights.alpha, ~solved.ties
        margin = least_per_state(values[free], found.row_states[free], len(S_0))
        short[found.states] = np.maximum(-found.rows.least(weights.alpha), 0.0)
        if found.batches is not None:
            spread = (found.batches @ weights.alpha).std(axis=0, ddof=1) / np.sqrt(len(found.batches))
            error = float(spread.max())
            tolerance[found.states] += 2 * spread[found.rows.active(weights.alpha, 1.0)[0]]
        violated = np.flatnonzero(short > tolerance)
        proof = SampledFeatureProof(
            **self._proved(found, solved),
            expert_optimal=not violated.size,
            worst_violation=float(short.max(initial=0.0)),
            margin=margin,
            violated=violated,
            indifferent=bool(np.abs(values).max() <= NOTHING * found.rows.scale),
            standard_error=error,
        )
        extra = {"horizon": horizon, "truncation_per_unit_of_reward": truncation_bound(model.gamma, horizon)}
        return Outcome(self._reward(weights), solved.status, proof, self._stats(weights, found) | extra)

    def _states_of(self, model: GenerativeModel) -> np.ndarray:
        """(m, d) S_0 of a generative model."""
        S_0: Any = self.S_0
        if S_0 is None:
            raise InvalidParameter(
                "S_0 is None, all states: expected a number of states to draw, or (m, d) states of the model."
            )
        where = model.physics.coordinates
        if np.ndim(S_0) == 0:
            return model.states(int(S_0), np.random.default_rng(self.seed))
        states = float_array("S_0", S_0, "(m, d) states", InvalidParameter)
        if states.ndim != 2 or states.shape[1] != len(where.low):
            raise InvalidParameter(
                f"S_0 has shape {states.shape}: expected (m, {len(where.low)}), of {', '.join(where.names)}."
            )
        wrong = np.argwhere(~((states >= where.low) & (states <= where.high)))
        if wrong.size:
            row, j = wrong[0]
            raise InvalidParameter(
                f"S_0[{row}] has {where.names[j]} {states[row, j]:.6g}: expected {where.low[j]:.6g} to {where.high[j]:.6g}."
            )
        return states

    def _reward(self, weights: Weights) -> LinearReward:
        return LinearReward(weights.alpha, self.phi, {"learner": "FeatureLP", "scaling": self.phi.scaling})

    def _proved(self, found: FeatureRows, solved: SolvedFeatures) -> dict[str, Any]:
        """The fields of a proof, of a table or of a generative model."""
        rows, alpha = found.rows, solved.weights.alpha
        return {
            "objective": solved.objective,
            "dual_bound": solved.bound,
            "penalty": float(self.penalty),
            "margin_cap": solved.cap,
            "l1": float(self.l1),
            "alpha_l1_norm": float(np.abs(alpha).sum()),
            "states": int(np.unique(found.states).size),
            "trivial": found.trivial,
            "rank": rows.rank,
            "n_features": rows.d.shape[1],
            "expressible": solved.expressible,
            "zero": not alpha.any(),
            "unbreakable_rows": found.pairs(solved.ties),
        }

    def _stats(self, weights: Weights, found: FeatureRows) -> dict[str, Any]:
        return {"programs": {"weights": weights.answer.to_json()}, "rows": len(found.rows.groups)}


def _rows(rows: np.ndarray) -> np.ndarray:
    return rows
