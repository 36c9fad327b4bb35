"""Measure what EPIC, DARD and STARC say of rewards: figures of their papers, invariances, and how they follow regret.

Exits with 0 where every bar holds, 1 where one fails, 2 for numbers that cannot be measured with.

For example:
    python scripts/reward_distances.py
    python scripts/reward_distances.py --only invariance bound --mdps 50
"""

import sys
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import tyro
from rich.console import Console
from rich.progress import track
from scipy.stats import rankdata

from irl_gym.checks import checked_number
from irl_gym.commands.terminal import print_table
from irl_gym.errors import InvalidParameter
from irl_gym.judging import distances as known
from irl_gym.judging.distances.bounds import epic_bound
from irl_gym.judging.distances.gridworlds import PRINTED, gridworld, gridworld_rewards, other_than_printed
from irl_gym.judging.distances.random_rewards import random_mdp, random_reward, redistributed, relative_regret, shaped
from irl_gym.judging.distances.variants import LEVELLED, VARIANTS

Measured = Literal["figure", "invariance", "regret", "bound"]
CONSOLE = Console(width=120)


@dataclass(frozen=True)
class Arguments:
    """Measure what EPIC, DARD and STARC say of rewards."""

    only: tuple[Measured, ...] = get_args(Measured)
    """What to measure: EPIC's figure A.2(a), invariances, rank correlation with regret, EPIC's bound on regret."""
    mdps: int = 200
    """Random MDPs for the invariances and the bound."""
    pairs: int = 1000
    """Random MDPs, each with a pair of rewards, for the rank correlation with regret."""
    seed: int = 0
    """Of everything that is drawn."""

    def __post_init__(self) -> None:
        for name, least in (("mdps", 1), ("pairs", 2), ("seed", 0)):
            checked_number(name, getattr(self, name), f"a whole number of at least {least}", least=least, whole=True)
        if not self.only:
            raise InvalidParameter(f"only is empty: expected some of {', '.join(get_args(Measured))}.")


def figure(_: Arguments) -> bool:
    """The distances of EPIC's gridworlds."""
    rewards = gridworld_rewards()
    found = {name: known.distance_matrix(VARIANTS[name], gridworld(), rewards) for name in ("EPIC", "DARD", "STARC, VAL")}
    for name, matrix in found.items():
        rows = ([other, *(f"{x:.4f}" for x in row)] for other, row in zip(rewards, matrix, strict=True))
        print_table(f"3x3 gridworlds, {name}", (name, *rewards), rows)
    wrong = other_than_printed(found["EPIC"])
    CONSOLE.print("; ".join(wrong) or f"{len(PRINTED)} distances that the paper prints: the same to the last digit")
    return not wrong


def invariance(given: Arguments) -> bool:
    """Scaling, shaping and S'-redistribution: the largest and smallest distances over random MDPs."""
    rng, mdps = np.random.default_rng(given.seed), given.mdps
    found = {name: np.zeros((mdps, 4)) for name in VARIANTS}
    for i in track(range(mdps), "invariance", console=CONSOLE):
        mdp = random_mdp(rng, int(rng.integers(4, 33)), int(rng.integers(2, 5)), float(rng.choice([0.5, 0.9, 0.99])))
        R = rng.normal(size=(mdp.n_states, mdp.n_actions, mdp.n_states))
        moved = redistributed(rng, mdp, R)
        others = [7 * rng.random() * R, shaped(rng, mdp, R), moved, 3 * shaped(rng, mdp, moved)]
        for name, distance in VARIANTS.items():
            found[name][i] = known.distance_matrix(distance, mdp, [R, *others])[0, 1:]
    rows = ([name, *(f"{x.max():.1e} ({x.min():.1e})" for x in values.T)] for name, values in found.items())
    columns = ("distance", "scaling", "shaping", "S'-redistribution", "all three")
    print_table(f"from R to an equivalent reward, {mdps} random MDPs: largest (smallest)", columns, rows)
    return max(found[name].max() for name in LEVELLED) < 1e-8 and found["EPIC"][:, 2].min() > 1e-8


def regret(given: Arguments) -> bool:
    """Rank correlation of each distance with the regret of planning for the other reward, over the range of values."""
    rng, pairs = np.random.default_rng(given.seed), given.pairs
    found = np.zeros((pairs, 1 + len(VARIANTS)))
    for i in track(range(pairs), "regret", console=CONSOLE):
        mdp = random_mdp(rng)
        first, end = random_reward(rng, mdp), random_reward(rng, mdp)
        second = first + (end - first) * rng.integers(1, 17) / 16
        found[i] = [relative_regret(mdp, first, second), *(d.distance(mdp, first, second) for d in VARIANTS.values())]
    rho = dict(zip(VARIANTS, np.corrcoef(rankdata(found, axis=0).T)[0, 1:], strict=True))
    print_table(f"regret in {pairs} random MDPs", ("distance", "rank correlation"), ((n, f"{x:.3f}") for n, x in rho.items()))
    return bool(rho["STARC, VAL"] > rho["EPIC"])


def bound(given: Arguments) -> bool:
    """EPIC's theorem 4.9: regret is never above the bound."""
    rng, found = np.random.default_rng(given.seed), []
    for _ in track(range(given.mdps), "bound", console=CONSOLE):
        mdp = random_mdp(rng, int(rng.integers(3, 13)), int(rng.integers(2, 5)), float(rng.choice([0.5, 0.9, 0.99])))
        R, other = rng.normal(size=(2, mdp.n_states, mdp.n_actions, mdp.n_states))
        found.append(epic_bound(mdp, R, R + rng.choice([0.1, 1.0, 10.0]) * other))
    share = np.array([(b.regret / b.bound, b.regret / b.sharper) for b in found])
    named = zip(("16 K |R|", "4 K |C(R) - mean|"), share.T, strict=True)
    rows = ((name, f"{(x > 1).sum()}", f"{x.max():.2g}") for name, x in named)
    print_table(f"EPIC's bound, {given.mdps} random MDPs", ("theorem 4.9", "violated", "regret / bound"), rows)
    return bool((share <= 1).all())


def main() -> int:
    """Measure what was asked."""
    given = tyro.cli(Arguments, description=__doc__)
    bars = {"figure": figure, "invariance": invariance, "regret": regret, "bound": bound}
    kept = {name: bars[name](given) for name in given.only}
    CONSOLE.print(", ".join(f"{name}: {'holds' if held else 'FAILS'}" for name, held in kept.items()))
    return 0 if all(kept.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
