"""Measure what labels are worth to DAgger, and as many to cloning: exact values, expert = 1, random = 0, gamma 0.99.

A class that cannot be anything errs however many labels it has. Cloning learns where the expert goes, DAgger where its own
mistakes lead. Two worlds: FrozenLake 8x8 (slippery), in macrocells of 2x2 and by a softmax of Fourier features; and a
tightrope, on which the class cannot see the one knot where another step is asked for, and the expert never falls. With full
tables both are only counts.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import matplotlib
import numpy as np
import tyro

from irl_gym import TabularMDP, TabularReward, policy_iteration, tabulate
from irl_gym.commands.terminal import print_table
from irl_gym.features.bases import Fourier
from irl_gym.features.feature_maps import Unravel
from irl_gym.judging.metrics import normalised_score, policy_value, random_value
from irl_gym.learners.cloning.clone import Clone
from irl_gym.learners.cloning.softmax import SoftmaxClone
from irl_gym.learners.interactive.dagger import DAgger
from irl_gym.learners.interactive.labels import Labels
from irl_gym.learners.interactive.visits import drawn_visits
from irl_gym.learners.problem import Oracle, Problem, Spaces
from irl_gym.mdp.planning.dynamic_programming import occupancy
from irl_gym.mdp.policies import TabularPolicy, as_distribution
from irl_gym.spaces.states import StateIndex

GAMMA = 0.99
AT = (30, 100, 300, 1_000, 3_000)
"""Labels at which values are compared."""
LONGEST = 200
"""Steps of an episode."""
FIGURE = Path(__file__).parents[1] / "docs/figures/dagger.png"
Curve = list[tuple[int, float]]
"""Labels asked for, and what the policy is worth after them."""


@dataclass(frozen=True)
class World:
    """A table, its reward, its expert, and classes by name."""

    mdp: TabularMDP
    reward: TabularReward
    expert: np.ndarray
    states: Any
    classes: dict[str, Any]

    def problem(self) -> Problem:
        """Whose expert can be asked."""
        policy = TabularPolicy(as_distribution(self.expert, self.mdp.n_states, self.mdp.n_actions), self.states)
        spaces = Spaces(self.states.space, gym.spaces.Discrete(self.mdp.n_actions), self.states)
        return Problem(spaces, oracle=Oracle(policy), dynamics=self.mdp, reward=self.reward)

    def score(self, policy: np.ndarray) -> float:
        """Between random and expert, exactly."""
        ends = random_value(self.mdp, self.reward), policy_value(self.mdp, self.reward, self.expert)
        return normalised_score(policy_value(self.mdp, self.reward, policy), *ends)


def lake() -> World:
    """FrozenLake 8x8, slippery."""
    table = tabulate(gym.make("FrozenLake-v1", map_name="8x8"), gamma=GAMMA, check_steps=0)
    cells = [row // 2 * 4 + column // 2 for row in range(8) for column in range(8)]
    features = Fourier([0.0, 0.0], [7.0, 7.0], 3, Unravel((8, 8)))
    classes = {"macrocells 2x2": Clone(cells=cells, majority=True), "softmax of 16 features": SoftmaxClone(features)}
    return World(table.mdp, table.reward, policy_iteration(table.mdp, table.reward).policy, table.states, classes)


def tightrope(length: int = 20, n_actions: int = 5) -> World:
    """A rope that is walked round and round: action 0 goes on, but over the knot, action 1; all else falls to the ground, from
    which action 2 climbs back to the start. A right step on the rope is paid 1.
    """
    S, knot, ground = length + 1, length // 2, length
    P, paid = np.zeros((S, n_actions, S)), np.zeros((S, n_actions))
    expert = np.append(np.where(np.arange(length) == knot, 1, 0), 2)
    P[:, :, ground] = 1.0
    for s in range(S):
        P[s, expert[s]] = np.eye(S)[(s + 1) % length if s < length else 0]
        paid[s, expert[s]] = float(s < length)
    mdp = TabularMDP.from_dense(P, GAMMA, np.eye(S)[0])
    classes = {"one cell for the rope": Clone(cells=[0] * length + [1], majority=True)}
    return World(mdp, TabularReward(paid), expert, StateIndex(gym.spaces.Discrete(S)), classes)


def by_dagger(world: World, learner: Any, seed: int, episodes: int = 1, **options: Any) -> Iterator[tuple[int, float]]:
    """What the last policy is worth, after each round."""
    asking = DAgger(rounds=10_000, learner=learner, episodes=episodes, max_episode_steps=LONGEST, **options)
    for one in asking.iterate(world.problem(), np.random.default_rng(seed)):
        yield one.queries, world.score(one.policy)


def by_cloning(world: World, learner: Any, seed: int, episodes: int = 1) -> Iterator[tuple[int, float]]:
    """The same, of the expert's own episodes."""
    mdp, rng, problem = world.mdp, np.random.default_rng(seed), world.problem()
    weights, assured = np.zeros((mdp.n_states, mdp.n_actions)), np.full((mdp.n_states, mdp.n_actions), 1 / mdp.n_actions)
    oracle: Any = problem.oracle
    labels = Labels(oracle, world.states, mdp.n_actions, "always")
    while True:
        weights += drawn_visits(mdp, assured, 1.0, labels, episodes, LONGEST, rng).aggregated(weights.shape)
        policy = np.asarray(learner.fit(weights, mdp, states=world.states).policy)
        yield int(weights.sum()), world.score(policy)


def until(curve: Iterator[tuple[int, float]], most: int) -> Curve:
    """As far as a number of labels."""
    found: Curve = []
    for labels, value in curve:
        found.append((labels, value))
        if labels >= most:
            break
    return found


def at(curve: Curve, labels: int) -> float:
    """What the last policy is worth that was learned from at most so many labels; 0 of none, which is the random one."""
    return next((value for n, value in reversed(curve) if n <= labels), 0.0)


def kept(curve: Curve) -> Curve:
    """What DAgger keeps where the table and the reward are known: the best policy so far."""
    values = np.maximum.accumulate([value for _, value in curve])
    return [(labels, float(value)) for (labels, _), value in zip(curve, values, strict=True)]


def limit(world: World, learner: Any, rounds: int = 30, **options: Any) -> list[float]:
    """Of infinitely many labels: what the policy of each round of DAgger is worth in the exact mode."""
    asking = DAgger(rounds, learner, **options)
    return [world.score(one.policy) for one in asking.iterate(world.problem(), np.random.default_rng(0))]


def told(curves: list[Curve]) -> list[str]:
    """The mean at each number of labels."""
    return [f"{np.mean([at(one, labels) for one in curves]):.3f}" for labels in AT]


def labels_to(curve: Iterator[tuple[int, float]], value: float) -> int:
    """Labels until a policy is worth so much."""
    return next(labels for labels, found in curve if found >= value)


def draw(curves: dict[str, dict[str, list[Curve]]], ends: dict[str, float], path: Path) -> None:
    """The curves, means over seeds, and the clone's limits."""
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, len(curves), figsize=(4 * len(curves), 3.4), constrained_layout=True, sharey=True)
    grid = np.unique(np.geomspace(AT[0], AT[-1], 40).astype(int))
    for axis, (title, each) in zip(axes, curves.items(), strict=True):
        for (name, seeds), colour in zip(each.items(), ("C0", "C2", "C1"), strict=True):
            values = np.array([[at(one, n) for n in grid] for one in seeds])
            axis.plot(grid, values.mean(axis=0), color=colour, label=name)
            axis.fill_between(grid, values.min(axis=0), values.max(axis=0), color=colour, alpha=0.15, linewidth=0)
        axis.axhline(ends[title], color="C1", linestyle=":", label="cloning's limit")
        axis.set(title=title.replace(", ", "\n"), xscale="log", xlabel="labels")
    axes[0].set_ylabel("exact value (expert 1, random 0)")
    axes[0].legend(loc="lower right", fontsize="small")
    figure.savefig(path, dpi=110, metadata={"Software": None})
    plt.close(figure)


def main(seeds: int = 4, full_seeds: int = 8, figure: Path = FIGURE) -> None:
    """Print the tables, and draw the figure.

    Args:
        seeds: of the curves.
        full_seeds: of the counts with full tables.
        figure: where to.
    """
    worlds = {"FrozenLake 8x8": lake(), "tightrope": tightrope()}
    curves: dict[str, dict[str, list[Curve]]] = {}
    ends: dict[str, float] = {}
    rows = []
    for name, world in worlds.items():
        for kind, learner in world.classes.items():
            title, n = f"{name}, {kind}", 2 if isinstance(learner, SoftmaxClone) else 1

            def seen(curve: Any, **options: Any) -> list[Curve]:
                return [until(curve(seed=seed, **options), AT[-1]) for seed in range(seeds)]

            given: dict[str, Any] = {"world": world, "learner": learner, "episodes": n}
            last = {cost: seen(by_dagger, **given, cost=cost) for cost in ("mistakes", "advantage")}
            found = {f"DAgger, {cost}": [*map(kept, each)] for cost, each in last.items()}
            curves[title] = {**found, "cloning": seen(by_cloning, **given)}
            clone = learner.fit(occupancy(world.mdp, world.expert), world.mdp, states=world.states).policy
            ends[title] = world.score(np.asarray(clone))
            for cost, each in last.items():
                value = limit(world, learner, cost=cost)
                for how, some, end in (("last", each, value[-1]), ("kept", found[f"DAgger, {cost}"], max(value))):
                    rows.append([title, f"DAgger, {cost}, {how}", *told(some), f"{end:.3f}"])
            rows.append([title, "cloning", *told(curves[title]["cloning"]), f"{ends[title]:.3f}"])
    print_table(f"Value by labels, means of {seeds} seeds", ["world, class", "by", *(f"{n:,}" for n in AT), "limit"], rows)
    draw(curves, ends, figure)
    world, rows = worlds["FrozenLake 8x8"], []
    ways = {"DAgger, ask='unseen'": partial(by_dagger, ask="unseen"), "DAgger": by_dagger, "cloning": by_cloning}
    for name, curve in ways.items():
        found = [labels_to(curve(world, Clone(), seed), 0.99) for seed in range(full_seeds)]
        rows.append([name, f"{np.median(found):,.0f}", f"{min(found):,}", f"{max(found):,}"])
    print_table(f"FrozenLake 8x8, full table: labels to 0.99, {full_seeds} seeds", ["by", "median", "least", "most"], rows)


if __name__ == "__main__":
    tyro.cli(main)
