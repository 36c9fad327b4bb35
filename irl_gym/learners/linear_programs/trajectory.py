"""Linear-programming IRL from sampled trajectories (Ng & Russell 2000, section 5; lecture notes: "in the next lecture").

Known are episodes of the expert, and a world that can be run and solved for a reward. With V^_i of (11), the mean over
trajectories of sum_t gamma^t phi_i(s_t), the value of a policy under R = alpha . phi is alpha . V^. Round k:
    maximise    sum_j p(alpha . (V^expert - V^_j)) over the policies j found so far
    subject to  |alpha_i| <= 1,    p(x) = x for x >= 0, and 2 x below
    then        find a policy optimal for alpha . phi, estimate its V^, and add it (12)
from a random first policy. Trajectories are cut after H steps, which costs a value gamma^(H+1) R_max / (1 - gamma) at most
(footnote 2).

Which round is best? The paper looks at the policies. Here: the round whose policy has V^ nearest to the expert's in the sum of
absolute differences. For *every* reward alpha . phi with |alpha_i| <= 1, the expert's own too if it is one of them, the sampled
values of policy and expert differ by that distance at most; their true values by it, the noise of the samples and what cutting
costs. It takes no true reward to know it.
Axes: N episodes, K features.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal, cast

import numpy as np

from irl_gym.checks import checked_number, is_word
from irl_gym.environments.generative import least_horizon, truncation_bound
from irl_gym.errors import InvalidParameter, a_type
from irl_gym.features.feature_maps import FeatureMap, as_features, checked_features
from irl_gym.features.feature_sums import discounted_sums
from irl_gym.features.linear_reward import LinearReward
from irl_gym.learners.base import Outcome, featured
from irl_gym.learners.linear_programs.estimates import Estimate, nearest, usable
from irl_gym.learners.linear_programs.expressible import uniform_margin
from irl_gym.learners.linear_programs.proofs.trajectory_proof import TrajectoryProof
from irl_gym.learners.linear_programs.weights import Rows, Weights, best_weights, check_weighing
from irl_gym.learners.needs import Needs
from irl_gym.learners.problem import Problem, World
from irl_gym.mdp.episodes import Episode
from irl_gym.programs.killable import within
from irl_gym.programs.solvers import SolverName, Solving, Status
from irl_gym.records import Record


@dataclass(frozen=True, eq=False)
class TrajectoryLP(Record):
    """Linear-programming IRL from sampled trajectories (Ng & Russell 2000, section 5).

    Raises:
        InvalidParameter: a field outside its range.
        InvalidFeatures: features that are neither a map nor an array (S, K).
    """

    features: FeatureMap | np.ndarray | None = None
    """phi of observations: a map, or an array (S, K) where these are integers; None for those of the problem that `learn` is
    given."""
    trajectories: int = 1_000
    """m, run for each policy."""
    horizon: int | None = None
    """H, steps after which trajectories are cut, the expert's too; None for the least H with gamma^H <= 0.01. A time limit
    makes it shorter; see `estimates.usable`."""
    max_rounds: int = 30
    """Rounds at most."""
    patience: int = 10
    """`fit` stops when so many rounds in a row have not come nearer to the expert."""
    penalty: float = 2.0
    """Slope of p below 0, at least 1: the paper's 2."""
    gap_cap: Literal["auto"] | None = None
    """None is the paper's sum. "auto" Departs: each gap counts up to half of the largest that all policies found can have at
    once, where there is one. A policy that loops for ever, far worse than the expert, then buys no violation by another: on
    FrozenLake without slip "auto" recovers the expert, and the paper's sum does not; with slip it can be the worse."""
    l1: float = 0.0
    """Price of ||alpha||_1, at least 0."""
    seed: int = 0
    """Of trajectories and planners."""
    solver: SolverName = "auto"
    """"auto" chooses by size; see `irl_gym.programs.solvers`."""
    time_limit: float | None = None
    """Seconds for the whole fit: its programs, all attempts at them, planning by value iteration and trajectories; None for
    no limit. An agent's training is not cut: the time is up when the next program would begin."""
    needs: ClassVar[Needs] = Needs(("environment", "demonstrations"), ("features",), "not read")
    """The parts of a problem that `learn` reads."""
    how: ClassVar[str] = "planned for the learned reward, in the best of the learner's own rounds"
    """How its policy comes about."""

    def __post_init__(self) -> None:
        if self.features is not None:
            object.__setattr__(self, "features", as_features(self.features))
        check_weighing(self)
        if self.gap_cap is not None and not is_word(self.gap_cap, "auto"):
            raise InvalidParameter(f"gap_cap is {self.gap_cap!r}: expected 'auto' or None.")
        for name in ("trajectories", "max_rounds", "patience"):
            checked_number(name, getattr(self, name), "a whole number of at least 1", least=1, whole=True)

    @property
    def phi(self) -> FeatureMap:
        """The features, as a map."""
        return as_features(self.features)

    def learn(self, problem: Problem, rng: np.random.Generator | None = None) -> Outcome[LinearReward, TrajectoryProof]:
        """The same as `fit`, of a problem.

        Args:
            problem: with an environment, episodes, and features if the learner has none.
            rng: nothing is drawn from it, but from the learner's own seed.

        Raises:
            MissingPart: one of these is not there. And whatever `fit` raises.
        """
        learner, known = featured(self, problem), cast("Any", self.needs.of(problem, self))  # which has what is required
        return learner.fit(known.environment, known.demonstrations)

    def fit(self, world: World, episodes: Iterable[Episode], /) -> Outcome[LinearReward, TrajectoryProof]:
        """The best round: the one whose policy is nearest to the expert in the features.

        Stops after `max_rounds`, when `patience` rounds have not come nearer, or when a policy cannot be told from the expert:
        its distance is no more than the standard errors of its terms; or when alpha = 0 is best, after which nothing changes.

        Args:
            world: such as Simulator(env, planner, gamma).
            episodes: the expert's, at least one; `read_minari` gives them.

        Raises:
            InvalidParameter: a world that cannot be run and solved.
            InvalidDemonstrations: no episode, or none that ends or goes on to the horizon.
            InvalidFeatures: what the features give is not (N, K) finite numbers.
            SolverTimeout, SolverFailed: no answer.
        """
        results: list[Outcome[LinearReward, TrajectoryProof]] = []
        best = 0
        for result in self.iterate(world, episodes):
            results.append(result)
            proofs = [one.proof for one in results]
            best, enough = nearest([p.distance for p in proofs], [p.distance_error for p in proofs], self.patience)
            if enough or result.proof.zero:
                break
        history = [{key: one.stats[key] for key in ROUND} | {"distance": one.proof.distance} for one in results]
        stats = {**results[best].stats, "best_round": best + 1, "best_by": "distance", "rounds": history}
        return replace(results[best], proof=replace(results[best].proof, rounds=len(results)), stats=stats)

    def iterate(self, world: World, episodes: Iterable[Episode], /) -> Iterator[Outcome[LinearReward, TrajectoryProof]]:
        """A result a round, `max_rounds` of them; arguments and errors as `fit`."""
        if not isinstance(world, World):
            raise InvalidParameter(
                f"the world is {a_type(world)}: expected one that can be run and solved, such as "
                "Simulator(env, ValueIteration(), gamma)."
            )
        solving = Solving.begun(self.solver, self.time_limit)
        asked = least_horizon(world.gamma) if self.horizon is None else int(self.horizon)
        expert = usable(episodes, asked, getattr(world, "limit", None))
        horizon, r_unit = expert.horizon, self._largest(expert.episodes)
        theirs = Estimate.of(discounted_sums(expert.episodes, self.phi, world.gamma, horizon=horizon))
        with within(solving.deadline):
            found = [Estimate.of(world.sums(None, self.phi, self.trajectories, horizon=horizon, seed=self.seed))]
        for number in range(1, self.max_rounds + 1):
            rows = Rows(theirs.mean - np.array([one.mean for one in found]), np.arange(len(found)))
            program = {"slope": float(self.penalty), "l1": float(self.l1), "cap": self._cap(rows, solving)}
            weights = best_weights(rows, **program, solving=solving)
            reward = LinearReward(weights.alpha, self.phi, {"learner": "TrajectoryLP", "scaling": self.phi.scaling})
            with within(solving.deadline):
                policy = world.plan(reward, seed=self.seed + number)
                sums = world.sums(policy, self.phi, self.trajectories, horizon=horizon, seed=self.seed + number)
            newest = Estimate.of(sums)
            cut = truncation_bound(world.gamma, horizon, r_unit)
            proof = self._proof(rows, weights, program, theirs, found, newest, horizon, cut)
            status = weights.answer.status if weights.alpha.any() else Status.ZERO_WEIGHTS
            stats = {
                "round": number,
                "regret": proof.regret,
                "regret_error": proof.regret_error,
                "objective": proof.objective,
                "seconds_solving": weights.answer.seconds,
                "expert_episodes": len(expert.episodes),
                "episodes_dropped": expert.dropped,
            }
            yield Outcome(reward, status, proof, stats, policy)
            found.append(newest)

    def _largest(self, expert: list[Episode]) -> float:
        """The largest ||phi||_1 that the expert met: no reward with |alpha_i| <= 1 pays it more."""
        return max(float(np.abs(checked_features(self.phi, one.observations)).sum(axis=1).max()) for one in expert)

    def _cap(self, rows: Rows, solving: Solving) -> float:
        """What a gap counts up to; infinite for no cap."""
        uniform = uniform_margin(rows, solving=solving) if self.gap_cap == "auto" else 0.0
        return uniform / 2 if uniform > 0 else np.inf

    def _proof(
        self,
        rows: Rows,
        weights: Weights,
        program: dict[str, float],
        theirs: Estimate,
        found: list[Estimate],
        newest: Estimate,
        horizon: int,
        cut: float,
    ) -> TrajectoryProof:
        alpha = weights.alpha

        def error(other: Estimate) -> float:
            return float(np.sqrt(theirs.variance(alpha) + other.variance(alpha)))

        difference = theirs.mean - newest.mean
        noise = np.sqrt(theirs.variances + newest.variances)
        return TrajectoryProof(
            gaps=rows.d @ alpha,
            gap_errors=np.array([error(one) for one in found]),
            regret=float(-difference @ alpha),
            regret_error=error(newest),
            distance=float(np.abs(difference).sum()),
            distance_error=float(noise.sum()),
            objective=rows.objective(alpha, **program),
            dual_bound=rows.bound(weights.y, **program),
            penalty=program["slope"],
            gap_cap=program["cap"] if np.isfinite(program["cap"]) else None,
            l1=program["l1"],
            alpha_l1_norm=float(np.abs(alpha).sum()),
            rank=rows.rank,
            n_features=rows.d.shape[1],
            horizon=horizon,
            truncation=cut,
            zero=not alpha.any(),
            round=len(found),
            rounds=None,
        )


ROUND = ("round", "objective", "regret", "regret_error")
"""What `fit` keeps of each round, with its distance."""
