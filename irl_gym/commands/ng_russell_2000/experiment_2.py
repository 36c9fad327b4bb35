"""Experiment 2 of Ng & Russell (2000), figure 4: the mountain car and the linear program of section 4.

    R = sum_i alpha_i phi_i (8),  phi_i(x) = exp(-(x - c_i)^2 / (2 sigma^2)) of the position x alone, 26 of them
    maximise    sum_{s in S_0} min_{a != pi(s)} p(E_{s' ~ P_s,pi(s)} V(s') - E_{s' ~ P_sa} V(s'))
    subject to  |alpha_i| <= 1,    p(x) = x for x >= 0, and 2 x below
(a) "reach": the true reward is -1 a step, without discount. (b) "park": 1 for x in [-0.72, -0.32], gamma = 0.99.
Conventions:
    car         Gymnasium's physics, x in [-1.2, 0.5], no time limit; arrival at 0.5 ends the episode
    features    unit height, spacing = sigma = 1.7/19, centres -1.2 + (i - 3) sigma: three widths beyond each end, so that their
                sum is sqrt(2 pi) = 2.5066 all along the road. A terminal state counts its features once
    model       120 x 120 cells, multilinear; V_i and the expectations of (10) exactly from the table
    expert      policy iteration on that table
    S_0         5000 of the 14,400 cells, drawn uniformly; states whose actions all have the same successors are not counted
    discount    "reach" needs gamma < 1 here: 1 - 1e-6, which changes a value of n steps by about 1e-6 n^2 / 2
    ties        "park" leaves 14 % of the cells with several optimal actions: no force first, then backward, then forward
Axes: N points of the road, K = 26 features, n runs with other samples S_0.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import gymnasium as gym
import numpy as np

from irl_gym.commands.ng_russell_2000.driving import Drive, drive
from irl_gym.commands.ng_russell_2000.records import Check, Progress, at_least, at_most, near, reported
from irl_gym.features.bases import RadialBasis
from irl_gym.learners.base import Outcome
from irl_gym.learners.linear_programs.feature import FeatureLP
from irl_gym.mdp.optimality import certify
from irl_gym.mdp.planning.dynamic_programming import policy_iteration, tied
from irl_gym.mdp.policies import TabularPolicy, as_distribution
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.tables.discretize import discretize
from irl_gym.tables.tabulate import make
from irl_gym.tables.tabulation import Tabulation

ENVIRONMENT = "irl_gym_envs:irl_gym/MountainCar-v0"
ROAD = (-1.2, 0.5)
PARKING = (-0.72, -0.32)
SIGMA = 1.7 / 19
N_FEATURES = 26
PLATEAU = -float(np.sqrt(2 * np.pi))
"""Of a reward whose weights are all -1."""
ARTEFACT = 0.3
"""The right end of the road, where the paper's fitted reward rises again."""
BACKWARD, NONE, FORWARD = range(3)


def gaussians() -> RadialBasis:
    """The 26 features of position; velocity is left out."""
    centres = ROAD[0] + (np.arange(N_FEATURES) - 3) * SIGMA
    return RadialBasis(np.stack([centres, np.zeros(N_FEATURES)], axis=1), np.array([SIGMA, np.inf]))


@dataclass(frozen=True)
class Experiment2:
    """The mountain car, both true rewards."""

    bins: int = 120
    """Cells along each coordinate."""
    S_0: int = 5000
    """States sampled."""
    runs: int = 5
    """Samples S_0 drawn, with seeds `seed`, `seed` + 1, ..."""
    undiscounted: float = 1 - 1e-6
    """gamma of "reach"."""
    gamma: float = 0.99
    """gamma of "park"."""
    preference: tuple[int, ...] = (NONE, BACKWARD, FORWARD)
    """Order in which the expert's ties are broken."""
    points: int = 341
    """Points of the road at which rewards are reported: every 0.005."""
    cars: int = 2000
    """Cars driven with the policies of "park", from anywhere."""
    steps: int = 300
    """Steps of each; the last third is judged."""
    seed: int = 0
    """Of the samples and the cars."""
    others: bool = True
    """Measure other conventions too."""

    @classmethod
    def quick(cls) -> "Experiment2":
        """A coarser grid, fewer states and cars: a few seconds."""
        return cls(bins=60, S_0=1500, runs=2, cars=500, others=False)

    def run(self, on_progress: Progress | None = None) -> "Outcome2":
        """Fit both rewards, from each sample, and drive."""
        report = on_progress or (lambda share: None)
        reach = self._fits("reach", self.undiscounted, self.preference)
        report(0.3)
        park = self._fits("park", self.gamma, self.preference)
        report(0.6)
        outcome = Outcome2(self, reach, park, self._drives(park), {})
        report(0.8)
        return replace(outcome, alternatives=self._alternatives()) if self.others else outcome

    def _fits(self, task: str, gamma: float, preference: Sequence[int] | None, runs: int | None = None) -> "Fits":
        """One true reward, several samples; `preference` None takes the set of all optimal actions as the expert's."""
        env = make(ENVIRONMENT, task=task)
        table = discretize(env, gamma=gamma, bins=self.bins)
        acting = ~table.mdp.terminal
        mdp = TabularMDP(table.mdp.P, gamma, acting / acting.sum())  # every cell counts, not only what the start reaches
        solution = policy_iteration(mdp, table.reward, preference=preference or self.preference)
        several = tied(solution.Q, 1e-8 * float(np.abs(solution.Q).max()))
        expert = solution.policy if preference is not None else several
        seeds = range(self.seed, self.seed + (runs or self.runs))
        results = [FeatureLP(gaussians(), S_0=self.S_0, seed=s).fit(mdp, expert, states=table.states) for s in seeds]
        road = np.linspace(*ROAD, self.points)
        observations = np.stack([road, np.zeros(self.points)], axis=1)
        rewards: list[Any] = [one.reward for one in results]
        broken = [certify(mdp, expert, one.tabular(table.states)).violated.size / acting.sum() for one in rewards]
        return Fits(
            env=env,
            table=replace(table, mdp=mdp),
            expert=solution.policy,
            tied=float((several.sum(axis=1) > 1)[acting].mean()),
            steps=float(-solution.V.min()) if task == "reach" else 0.0,
            results=tuple(results),
            violated=np.array(broken),
            road=road,
            R=np.array([one.of(observations) for one in rewards]),
        )

    def _drives(self, park: "Fits") -> tuple[Drive, ...]:
        """How the true world's cars fare with the expert, and with a policy optimal for each fitted reward."""
        table = park.table
        policies = [park.expert]
        for result in park.results:
            reward: Any = result.reward
            fitted = reward.tabular(table.states)
            policies.append(policy_iteration(table.mdp, fitted, preference=self.preference).policy)
        acting = [
            TabularPolicy(as_distribution(one, table.mdp.n_states, table.mdp.n_actions), table.states) for one in policies
        ]
        how = {"n": self.cars, "steps": self.steps, "gamma": self.gamma, "seed": self.seed}
        return tuple(drive(park.env, one, within=PARKING, **how) for one in acting)

    def _alternatives(self) -> dict[str, float]:
        """What other conventions give, from the first sample."""
        found: dict[str, float] = {}
        for gamma in (0.99, 0.999, 0.9999):
            other = self._fits("reach", gamma, self.preference, 1)
            found[f"(a) features with alpha = -1, gamma = {gamma}"] = float(other.at_bound[0])
        ties: dict[str, tuple[int, ...] | None] = {
            "backward first": (BACKWARD, NONE, FORWARD),
            "forward first": (FORWARD, NONE, BACKWARD),
            "the expert takes all": None,
        }
        for name, preference in ties.items():
            left, right = self._fits("park", self.gamma, preference, 1).hump(0)
            found[f"(b) left zero, ties: {name}"], found[f"(b) right zero, ties: {name}"] = left, right
        return found


@dataclass(frozen=True, eq=False)
class Fits:
    """One true reward, and what was fitted from each sample of states."""

    env: gym.Env
    """The world."""
    table: Tabulation
    """Its grid; the first state is uniform."""
    expert: np.ndarray
    """(S,) actions."""
    tied: float
    """Share of cells with several optimal actions."""
    steps: float
    """"reach": the steps that the worst cell takes."""
    results: tuple[Outcome, ...]
    """n."""
    violated: np.ndarray
    """(n,) share of all cells in which (4) is violated."""
    road: np.ndarray
    """(N,) positions."""
    R: np.ndarray
    """(n, N) fitted rewards along the road."""

    @property
    def alpha(self) -> np.ndarray:
        """(n, K) weights."""
        rewards: list[Any] = [one.reward for one in self.results]
        return np.array([one.alpha for one in rewards])

    @property
    def at_bound(self) -> np.ndarray:
        """(n,) features with alpha = -1."""
        return (self.alpha <= -1 + 1e-4).sum(axis=1)

    def hump(self, run: int) -> tuple[float, float]:
        """Zeros of R left and right of the middle of the interval; NaN where R is not above 0 there."""
        R, road = self.R[run], self.road
        middle = int(np.abs(road - np.mean(PARKING)).argmin())
        if R[middle] <= 0:
            return float("nan"), float("nan")
        ends = []
        for side in (-1, 1):
            here = middle
            while 0 < here < len(R) - 1 and R[here + side] > 0:
                here += side
            there = int(np.clip(here + side, 0, len(R) - 1))
            slope = (R[here] - R[there]) or 1.0
            ends.append(float(road[here] + (road[there] - road[here]) * R[here] / slope))
        return ends[0], ends[1]


@dataclass(frozen=True, eq=False)
class Outcome2:
    """What experiment 2 gave."""

    settings: Experiment2
    """What was asked."""
    reach: Fits
    """-1 a step."""
    park: Fits
    """1 in the interval."""
    drives: tuple[Drive, ...]
    """In the true world of "park": the expert, then the policy of each run."""
    alternatives: dict[str, float]
    """What other conventions give."""

    @property
    def humps(self) -> np.ndarray:
        """(n, 2) zeros of the reward fitted to "park", around the interval."""
        return np.array([self.park.hump(run) for run in range(len(self.park.R))])

    @property
    def checks(self) -> tuple[Check, ...]:
        """Against the paper."""
        reach, park = self.reach, self.park
        x, R = park.road, park.R
        inside, artefact = (x >= PARKING[0]) & (x <= PARKING[1]), x > ARTEFACT
        humps = self.humps
        beyond = ~((x >= humps.min() - 1e-9) & (x <= humps.max() + 1e-9)) & ~artefact
        expert, fitted = self.drives[0], self.drives[1:]
        middle = float(np.median(reach.R, axis=1)[np.abs(np.median(reach.R, axis=1) - PLATEAU).argmax()])
        return (
            at_least("(a) features with alpha = -1, fewest of runs", N_FEATURES, float(reach.at_bound.min()), 24),
            near("(a) plateau of R, farthest of runs", round(PLATEAU, 4), middle, 0.0005),
            reported("(a) largest |R - plateau| on the road", "nearly none", np.abs(reach.R - PLATEAU).max()),
            reported("(a) steps from the farthest cell", "not said", reach.steps),
            at_least("(b) interval with R > 0, least share of runs", "all", (R[:, inside] > 0).mean(axis=1).min(), 1.0),
            at_most("(b) second humps, x < 0.3: largest R beyond the zeros", "below 0", R[:, beyond].max(), 0.0),
            reported("(b) left zero, mean of runs", PARKING[0], humps[:, 0].mean()),
            reported("(b) right zero, mean of runs", PARKING[1], humps[:, 1].mean()),
            reported("(b) spread of the zeros over runs", "not said", float(np.ptp(humps, axis=0).max())),
            reported("(b) height of the hump, mean of runs", "not said", R[:, inside].max(axis=1).mean()),
            at_least("(b) artefact: rise at the right end, median", "rises", np.median(_rise(R[:, x > 0])), 0.5),
            reported("(b) cells where (4) is violated, mean share", "not said", park.violated.mean()),
            at_least(
                "(b) last 100 steps parked, least of runs", "parks",
                min(one.parked for one in fitted), 0.95,
            ),
            at_least(
                "(b) true value over expert's, least of runs", "fairly good",
                min(one.value for one in fitted) / expert.value, 0.95,
            ),
            reported("(b) cars that leave, expert", "unavoidable", expert.left),
            reported("(b) cars that leave, fitted, most of runs", "unavoidable", max(one.left for one in fitted)),
            *(reported(what, "not said", value) for what, value in self.alternatives.items()),
        )  # fmt: skip

    def to_json(self) -> dict[str, Any]:
        """As json holds it."""
        fits = {
            name: {
                "alpha": one.alpha.tolist(),
                "road": one.road.tolist(),
                "R": one.R.tolist(),
                "objective": [float(result.proof.objective) for result in one.results],
                "violated": one.violated.tolist(),
                "tied": one.tied,
            }
            for name, one in (("reach", self.reach), ("park", self.park))
        }
        return {
            "settings": asdict(self.settings),
            **fits,
            "zeros": [[None if np.isnan(x) else x for x in ends] for ends in self.humps.tolist()],
            "drives": [asdict(one) for one in self.drives],
            "checks": [one.to_json() for one in self.checks],
        }


def _rise(R: np.ndarray) -> np.ndarray:
    """(n,) how far each line ends or peaks above what is its lowest point before."""
    return (R - np.minimum.accumulate(R, axis=1)).max(axis=1)
