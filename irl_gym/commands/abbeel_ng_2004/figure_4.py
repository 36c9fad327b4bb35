"""Figure 4 of Abbeel & Ng (2004), its three cloning curves: value of the clone over the expert's, by trajectories shown.

    mimic the expert    the expert's action in each cell that was shown, random moves in the others:  Clone()
    one distribution    a macrocell, that of all steps shown in it:                                   Clone(cells=...)
    one action          a macrocell, the most frequent of the steps shown in it:                      the same, majority=True
The last two err however much is shown. In a macrocell that was not shown the second moves at random; the third has one action,
drawn once for all of it, which also decides between actions as frequent. (Random at each step in its place, it is worth about
0.02 less, farther from the paper.) Values are exact. The paper prints no length of a trajectory; with 460 steps in place of 100
those of few trajectories are worth about 0.03 more. The method's own curve is not of this experiment.
Axes: n instances, C curves, M numbers of trajectories.
"""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from irl_gym.commands.abbeel_ng_2004.gridworld import Gridworld
from irl_gym.commands.ng_russell_2000.records import Check, Progress, near, reported
from irl_gym.learners.cloning.clone import Clone
from irl_gym.mdp.planning.dynamic_programming import policy_evaluation, value_iteration
from irl_gym.mdp.sampling import Successors
from irl_gym.mdp.tabular_mdp import TabularMDP

MIMIC, DISTRIBUTION, ACTION = CURVES = ("mimic the expert", "one distribution a macrocell", "one action a macrocell")
PUBLISHED = {
    MIMIC: {1: 0.114, 10: 0.198, 100: 0.544, 1000: 0.950},
    DISTRIBUTION: {1: 0.140, 10: 0.394, 100: 0.851},
    ACTION: {1: 0.148, 10: 0.350, 100: 0.691},
}
"""Read off the figure, to about 0.003."""


FAINT = 1e-9
"""What an action that is drawn for a macrocell counts: less than any step."""


@dataclass(frozen=True)
class Figure4:
    """The cloning curves."""

    world: Gridworld = field(default_factory=Gridworld)
    """Where it is."""
    instances: int = 20
    """n rewards that are drawn."""
    sizes: tuple[int, ...] = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1_000, 10_000, 100_000)
    """Trajectories that are shown, drawn anew for each."""
    steps: int = 100
    """Of a trajectory."""
    within: float = 0.05
    """Of the printed curve: the bar."""
    seed: int = 0
    """Of rewards and trajectories."""

    @classmethod
    def quick(cls) -> "Figure4":
        """Three instances and few trajectories, with a looser bar: under a minute."""
        return cls(instances=3, sizes=(1, 10, 100, 1_000), within=0.15)

    def run(self, on_progress: Progress | None = None) -> "Outcome4":
        """Draw instances, clone their experts, evaluate the clones."""
        report, mdp, found = on_progress or (lambda share: None), self.world.mdp(), []
        learners = (Clone(), Clone(cells=self.world.cells), Clone(cells=self.world.cells, majority=True))
        for number in range(self.instances):
            rng = np.random.default_rng([self.seed, number])
            R = np.repeat(self.world.weights(rng)[self.world.cells][:, None], mdp.n_actions, axis=1)
            expert = value_iteration(mdp, R, sweeps=30).policy
            best = mdp.d0 @ policy_evaluation(mdp, R, expert)
            drawn, shares = np.eye(mdp.n_actions)[rng.integers(mdp.n_actions, size=self.world.n_cells)[self.world.cells]], []
            for counts in self._shown(mdp, expert, rng):
                seen = (counts, counts, counts + FAINT * drawn)
                clones = [one.fit(steps).policy for one, steps in zip(learners, seen, strict=True)]
                shares.append([mdp.d0 @ policy_evaluation(mdp, R, clone) / best for clone in clones])
                report((number + len(shares) / len(self.sizes)) / self.instances)
            found.append(np.transpose(shares))
        return Outcome4(self, np.array(found))

    def _shown(self, mdp: TabularMDP, expert: np.ndarray, rng: np.random.Generator) -> Iterator[np.ndarray]:
        """(S, A) how often a step was shown, for each number of trajectories."""
        successors = Successors(mdp)
        for m in self.sizes:
            states, visits = successors.start(m, rng), np.zeros(mdp.n_states)
            for _ in range(self.steps):
                visits += np.bincount(states, minlength=mdp.n_states)
                states = successors.draw(states, expert[states], rng)
            yield visits[:, None] * np.eye(mdp.n_actions)[expert]


@dataclass(frozen=True, eq=False)
class Outcome4:
    """What figure 4 gave."""

    settings: Figure4
    """What was asked."""
    shares: np.ndarray
    """(n, C, M) value of the clone over the expert's."""

    @property
    def means(self) -> np.ndarray:
        """(C, M) over the instances."""
        return self.shares.mean(axis=0)

    @property
    def errors(self) -> np.ndarray:
        """(C, M) standard errors of the means."""
        return self.shares.std(axis=0, ddof=1) / np.sqrt(len(self.shares))

    @property
    def checks(self) -> tuple[Check, ...]:
        """Against the paper, where its curve was read off; then the ends of the curves."""
        sizes, means, found = self.settings.sizes, self.means, []
        for curve, name in enumerate(CURVES):
            found += [
                near(f"{name}, {m:,} shown", PUBLISHED[name][m], means[curve, at], self.settings.within)
                for at, m in enumerate(sizes)
                if m in PUBLISHED[name]
            ]
        last = f"{sizes[-1]:,} shown"
        ends = [reported(f"{name}, {last}", "not read off", means[curve, -1]) for curve, name in enumerate(CURVES)]
        return (*found, *ends, reported("largest standard error of a mean", "not said", self.errors.max()))

    def to_json(self) -> dict[str, Any]:
        """As json holds it."""
        return {
            "settings": asdict(self.settings),
            "curves": {name: self.shares[:, curve].tolist() for curve, name in enumerate(CURVES)},
            "checks": [one.to_json() for one in self.checks],
        }
