"""Experiment 3 of Ng & Russell (2000), figure 5: the continuous grid world and the linear program of section 5.

    R = sum_i alpha_i phi_i (8),  phi_i Gaussians of unit height on a 15 x 15 grid over the unit square, |alpha_i| <= 1
    V^_i = mean over m = 5000 trajectories of sum_{t <= 30} gamma^t phi_i(s_t) (11)
    round k: maximise sum_j p(alpha . (V^expert - V^_j)) over the policies j found so far; plan for alpha . phi; add that policy
Conventions:
    world       [0, 1]^2, moves of 0.2, noise uniform in [-0.1, 0.1] on each coordinate, clipped; true reward 1 on [0.8, 1]^2,
                not absorbing; gamma = 0.9; the first state is uniform (D)
    planning    50 x 50 cells, multilinear, the noise averaged over 500 draws: with 50, the noise of the table itself decides
                between actions that are nearly as good. The expert is optimal for the same table
    features    centres from edge to edge, sigma = 1.5 spacings. The paper prints no width; see `alternatives` for others
    values      V(s_0) = sum_t gamma^t R(s_t), R(s_0) included, by 50,000 trials of 50 steps in the world itself, not the table
    differ      share of the cells, which are the states that policies tell apart, whose action is not the expert's
    answer      the algorithm explores: its newest policy is optimal for a reward that only the policies found so far speak for.
                What `TrajectoryLP.fit` answers after k rounds is the round nearest to the expert in the features; no true
                reward is needed to know it. The newest policy's curve and the answer's are both kept
Axes: n runs, k rounds.
"""

from dataclasses import asdict, dataclass, replace
from typing import Any

import gymnasium as gym
import numpy as np

from irl_gym.agents.planners import ValueIteration, tabular_actions
from irl_gym.agents.simulator import Simulator
from irl_gym.commands.ng_russell_2000.records import Check, Progress, at_least, at_most, near, reported
from irl_gym.environments.rollouts import moments_of, run_episodes
from irl_gym.features.bases import RadialBasis
from irl_gym.learners.linear_programs.estimates import nearest
from irl_gym.learners.linear_programs.trajectory import TrajectoryLP
from irl_gym.mdp.planning.dynamic_programming import value_iteration
from irl_gym.mdp.policies import Policy, TabularPolicy, as_distribution
from irl_gym.tables.discretize import discretize
from irl_gym.tables.tabulate import make
from irl_gym.tables.tabulation import Tabulation

ENVIRONMENT = "irl_gym_envs:irl_gym/ContinuousGridWorld-v0"
GOAL = ((0.8, 0.8), (1.0, 1.0))
SEEDS = 1_000_000
"""Between runs."""


@dataclass(frozen=True)
class Experiment3:
    """The continuous grid world."""

    gamma: float = 0.9
    """Discount."""
    bins: int = 50
    """Cells along each side, for planning."""
    noise_draws: int = 500
    """Draws of the noise from each cell, for planning."""
    centres: int = 15
    """Gaussians along each side."""
    width: float = 1.5
    """sigma, in spacings of the centres."""
    trajectories: int = 5000
    """m, of the expert and of each policy."""
    horizon: int = 30
    """Steps of each."""
    rounds: int = 30
    """Of the algorithm."""
    runs: int = 5
    """Repetitions with other seeds."""
    trials: int = 50_000
    """Episodes in which a policy's true value is measured."""
    trial_steps: int = 50
    """Steps of each."""
    optimum_trials: int = 1_000_000
    """The same for the expert."""
    judged_from: int = 15
    """First round to which the bars apply."""
    least_value: float = 0.99
    """Bar on true values, of the optimum."""
    most_differ: float = 0.12
    """Bar on the share of states where actions differ."""
    seed: int = 0
    """Of everything that is drawn."""
    others: bool = True
    """Measure other widths and a noisier table, too, one run each."""

    @classmethod
    def quick(cls) -> "Experiment3":
        """Fewer cells, trajectories and rounds; looser bars, since one round that explores weighs half: some seconds."""
        return cls(
            bins=30, noise_draws=100, trajectories=1000, rounds=16, runs=2, trials=10_000, optimum_trials=100_000,
            judged_from=10, least_value=0.95, most_differ=0.2, others=False,
        )  # fmt: skip

    def run(self, on_progress: Progress | None = None) -> "Outcome3":
        """Run the algorithm several times, and measure every round."""
        report = on_progress or (lambda share: None)
        world = _World.of(self)
        optimum, error = world.value(world.expert, self.optimum_trials)
        total = self.runs + (3 if self.others else 0)
        found = [self._run(world, run, lambda share, run=run: report((run + share) / total)) for run in range(self.runs)]
        outcome = Outcome3(self, optimum, error, world.near_ties(0.01), tuple(found), {})
        if not self.others:
            return outcome
        alternatives: dict[str, float] = {}
        for number, (name, other) in enumerate({
            "sigma = 1 spacing": replace(self, width=1.0),
            "sigma = 2 spacings": replace(self, width=2.0),
            "50 draws of the noise": replace(self, noise_draws=50),
        }.items()):  # fmt: skip
            done = self.runs + number
            curves = other._run(_World.of(other), 0, lambda share, done=done: report((done + share) / total))
            late = slice(self.judged_from - 1, None)
            alternatives[f"{name}: differ, mean of one run"] = float(curves.differ[late].mean())
            alternatives[f"{name}: differ, most"] = float(curves.differ[late].max())
            alternatives[f"{name}: value over optimum, least"] = float(curves.value[late].min() / optimum)
        return replace(outcome, alternatives=alternatives)

    def _run(self, world: "_World", run: int, report: Progress) -> "Curves":
        """One run: a line for each round."""
        seed = SEEDS * (self.seed * 1000 + run + 1)
        episodes = run_episodes(world.env, world.expert, self.trajectories, seed=seed + SEEDS // 2, most=self.horizon)
        spread = RadialBasis.grid((0.0, 0.0), (1.0, 1.0), self.centres, width=self.width)
        learner = TrajectoryLP(spread, trajectories=self.trajectories, horizon=self.horizon, max_rounds=self.rounds, seed=seed)
        simulator = Simulator(world.env, ValueIteration(), self.gamma, table=world.table)
        lines: list[tuple[float, ...]] = []
        for number, result in enumerate(learner.iterate(simulator, episodes)):
            policy: Any = result.policy
            value, _ = world.value(policy, self.trials)
            proof = result.proof
            lines.append((value, *world.compare(policy), proof.distance, proof.distance_error, proof.regret))
            report((number + 1) / self.rounds)
        value, differ, worse, distance, noise, regret = np.array(lines).T
        return Curves(value, differ, worse, distance, noise, regret, learner.patience)


@dataclass(frozen=True, eq=False)
class _World:
    """The square, the table that is planned on, and the expert."""

    settings: Experiment3
    env: gym.Env
    table: Tabulation
    Q: np.ndarray
    expert: TabularPolicy

    @classmethod
    def of(cls, settings: Experiment3) -> "_World":
        env = make(ENVIRONMENT, goal=GOAL, max_episode_steps=settings.trial_steps)
        table = discretize(env, gamma=settings.gamma, bins=settings.bins, samples=settings.noise_draws, seed=settings.seed)
        solution = value_iteration(table.mdp, table.reward, sweeps=50)
        actions = as_distribution(solution.policy, table.mdp.n_states, table.mdp.n_actions)
        return cls(settings, env, table, solution.Q, TabularPolicy(actions, table.states))

    def value(self, policy: Policy, trials: int) -> tuple[float, float]:
        """True value and its standard error: mean over trials of sum_t gamma^t R(s_t); the same first states for all."""
        gamma, total = self.settings.gamma, np.zeros(trials)
        low, high = np.array(GOAL)
        for moment in moments_of(self.env, policy, trials, seed=7 + self.settings.seed, most=self.settings.trial_steps):
            if moment.time:
                total[moment.who] += gamma**moment.time * moment.rewards
            else:
                total[moment.who] += ((moment.observations >= low) & (moment.observations <= high)).all(axis=1)
        return float(total.mean()), float(total.std(ddof=1) / np.sqrt(trials))

    def compare(self, policy: Policy) -> tuple[float, float]:
        """Share of cells whose action is not the expert's; and in which it costs more than 1 % of the mean value."""
        ours, theirs = (tabular_actions(one, self.table.states) for one in (policy, self.expert))
        best = self.Q.max(axis=1)
        loss = best - self.Q[np.arange(len(self.Q)), ours]
        return float((ours != theirs).mean()), float((loss > 0.01 * best.mean()).mean())

    def near_ties(self, share: float) -> float:
        """Share of cells whose second best action costs less than this share of the mean value."""
        ordered = np.sort(self.Q, axis=1)
        return float((ordered[:, -1] - ordered[:, -2] < share * ordered[:, -1].mean()).mean())


@dataclass(frozen=True, eq=False)
class Curves:
    """One run, round by round."""

    value: np.ndarray
    """(k,) true value of the newest policy."""
    differ: np.ndarray
    """(k,) share of states where its action is not the expert's."""
    worse: np.ndarray
    """(k,) share where it costs more than 1 % of the mean value."""
    distance: np.ndarray
    """(k,) ||V^expert - V^new||_1, what rounds are chosen by."""
    noise: np.ndarray
    """(k,) of it: the standard errors of its terms."""
    regret: np.ndarray
    """(k,) how much better the newest policy is than the expert, under the fitted reward."""
    patience: int
    """Rounds without a nearer policy after which `fit` stops."""

    @property
    def answer(self) -> np.ndarray:
        """(k,) the round that `fit` answers with after 1, 2, ... rounds: the nearest so far."""
        return np.array([self._after(k + 1)[0] for k in range(len(self.distance))])

    @property
    def stop(self) -> int:
        """The round, from 0, after which `fit` stops of itself."""
        rounds = len(self.distance)
        return next((k for k in range(rounds) if self._after(k + 1)[1]), rounds - 1)

    def _after(self, rounds: int) -> tuple[int, bool]:
        """The answer after some rounds, and whether `fit` stops."""
        return nearest(self.distance[:rounds].tolist(), self.noise[:rounds].tolist(), self.patience)


@dataclass(frozen=True, eq=False)
class Outcome3:
    """What experiment 3 gave."""

    settings: Experiment3
    """What was asked."""
    optimum: float
    """The expert's true value."""
    optimum_error: float
    """Its standard error."""
    near_ties: float
    """Share of cells whose second best action costs less than 1 % of the mean value."""
    runs: tuple[Curves, ...]
    """n."""
    alternatives: dict[str, float]
    """What other conventions give."""

    def of(self, name: str, *, answers: bool = False) -> np.ndarray:
        """(n, k) curves by name: of the newest policies, or of the answers so far."""
        return np.array([getattr(one, name)[one.answer] if answers else getattr(one, name) for one in self.runs])

    @property
    def checks(self) -> tuple[Check, ...]:
        """Against the paper; curves from round `judged_from` on."""
        asked, late = self.settings, slice(self.settings.judged_from - 1, None)
        value, differ, worse = (self.of(name)[:, late] for name in ("value", "differ", "worse"))
        value = value / self.optimum
        answered = self.of("value", answers=True)[:, late] / self.optimum
        mistaken = self.of("differ", answers=True)[:, late]
        fits = [(one, one.answer[one.stop]) for one in self.runs]
        paper, least, most = "0.03 to 0.10", asked.least_value, asked.most_differ
        error, same = 0.002 + 3 * self.optimum_error, "1, to noise"
        return (
            near("optimum, true value (target; printed: about 6.65)", 6.55, self.optimum, error),
            at_least("value over optimum, mean of runs, least", same, value.mean(axis=0).min(), least),
            at_least("value over optimum, answer so far, any run", same, answered.min(), least),
            at_most("actions differ, mean of runs, most", paper, differ.mean(axis=0).max(), most),
            at_most("actions differ, answer so far, any run", paper, mistaken.max(), most),
            reported("value over optimum, worst single round", same, value.min()),
            reported("actions differ, mean of all rounds", paper, differ.mean()),
            reported("actions differ, worst single round", paper, differ.max()),
            reported("single rounds beyond a bar, share", "not said", self._beyond(value, differ)),
            reported("actions that cost more than 1 %, mean", "not said", worse.mean()),
            reported("states with a second action within 1 %", "not said", self.near_ties),
            reported("fit: rounds until it stops, most", "not said", max(one.stop + 1 for one in self.runs)),
            reported("fit: value over optimum, worst run", same, min(float(one.value[k]) for one, k in fits) / self.optimum),
            reported("fit: actions differ, worst run", paper, max(float(one.differ[k]) for one, k in fits)),
            *(reported(what, "not said", one) for what, one in self.alternatives.items()),
        )

    def _beyond(self, value: np.ndarray, differ: np.ndarray) -> float:
        return float(((value < self.settings.least_value) | (differ > self.settings.most_differ)).mean())

    def to_json(self) -> dict[str, Any]:
        """As json holds it."""
        names = ("value", "differ", "worse", "distance", "noise", "regret", "answer")
        return {
            "settings": asdict(self.settings),
            "optimum": self.optimum,
            "optimum_error": self.optimum_error,
            "runs": [{name: getattr(one, name).tolist() for name in names} for one in self.runs],
            "checks": [one.to_json() for one in self.checks],
        }
