"""Measure tables that are enumerated, beside published ones and in plain Python, and Blackjack's beside hands of the game.

    python scripts/measure_environments.py --parts large constant blackjack published --hands 1000000

P is hidden: the enumeration steps copies of the environment and does not ask for its table.
"""

import resource
import time
from dataclasses import dataclass
from itertools import product
from typing import Any, Literal

import gymnasium as gym
import numpy as np
import tyro
from gymnasium import spaces
from rich.console import Console
from rich.table import Table

from irl_gym import policy_iteration, tabulate
from irl_gym.environments.reveal import Reveal, known_hidden
from irl_gym.judging.metrics import policy_value
from irl_gym.tables.enumeration.table import Enumeration

RULES: dict[str, dict] = {"default": {"sab": False}, "natural": {"natural": True, "sab": False}, "sab": {"sab": True}}
LAKES = product(("4x4", "8x8"), (True, False))
KNOWN = {f"FrozenLake {n}{', slippery' * slip}": ("FrozenLake-v1", {"map_name": n, "is_slippery": slip}) for n, slip in LAKES}
KNOWN |= {"CliffWalking": ("CliffWalking-v1", {}), "CliffWalking, slippery": ("CliffWalkingSlippery-v1", {})}
KNOWN |= {"Taxi": ("Taxi-v4", {}), "Taxi, rainy": ("Taxi-v4", {"is_rainy": True})}


@dataclass(frozen=True)
class Arguments:
    """What to measure."""

    parts: tuple[Literal["large", "constant", "blackjack", "published"], ...] = ("large", "constant", "blackjack", "published")
    """Which tables to print."""
    hands: int = 1_000_000
    """Hands of Blackjack that are played, for each of its rules."""


class Square(gym.Env):
    """500 x 500 cells, deterministic, in plain Python."""

    observation_space, action_space = spaces.Tuple([spaces.Discrete(500)] * 2), spaces.Discrete(4)

    def reset(self, *, seed=None, options=None):
        """Begin in a corner."""
        self.at = (0, 0)
        return self.at, {}

    def step(self, action):
        """Move to a neighbour; end in the corner opposite."""
        x, y = self.at[0] + (1, 0, -1, 0)[action], self.at[1] + (0, 1, 0, -1)[action]
        self.at = (min(max(x, 0), 499), min(max(y, 0), 499))
        return self.at, -1.0, self.at == (499, 499), False, {}


class Racetrack(gym.Env):
    """A car on size x size cells between walls, with a speed of up to 2 each way; its nine actions fail with probability 0.1.

    Its world is the map, nested lists of `tiles` x `tiles` numbers, and the path so far, which grows.
    """

    action_space = spaces.Discrete(9)

    def __init__(self, size=10, tiles=70, rebuilt=False):
        self.size, self.tiles, self.rebuilt = size, tiles, rebuilt
        self.observation_space = spaces.MultiDiscrete([size, size, 5, 5])
        self.world = self._built()

    def _built(self):
        half = self.size / 2
        wall = [[(r - half) ** 2 + (c - half) ** 2 < self.size for c in range(self.size)] for r in range(self.size)]
        rows = range(self.tiles)
        return {"map": [[int(wall[r % self.size][c % self.size]) for c in rows] for r in rows], "path": []}

    def reset(self, *, seed=None, options=None):
        """Begin on a cell of the first row."""
        super().reset(seed=seed)
        if self.rebuilt:
            self.world = self._built()
        self.at, self.speed = (0, int(self.np_random.integers(self.size))), (0, 0)
        self.world["path"] = [self.at]
        return self._seen(), {}

    def step(self, action):
        """Change the speed and drive; a wall or the edge leads back to the middle of the first row."""
        push = (0, 0) if self.np_random.random() < 0.1 else (action // 3 - 1, action % 3 - 1)
        self.speed = tuple(min(2, max(-2, v + a)) for v, a in zip(self.speed, push, strict=True))
        r, c = (x + v for x, v in zip(self.at, self.speed, strict=True))
        done = r >= self.size - 1
        r = min(r, self.size - 1)
        if not (0 <= r and 0 <= c < self.size) or self.world["map"][r][c]:
            r, c, done, self.speed = 0, self.size // 2, False, (0, 0)
        self.at = r, c
        self.world["path"].append(self.at)
        return self._seen(), -1.0, done, False, {}

    def _seen(self):
        return np.array([*self.at, *(v + 2 for v in self.speed)])


def blackjack(rules: str, hands: int) -> tuple[str, ...]:
    """The optimal value, and that of hands in the environment itself; moves unlike Sutton & Barto's Figure 5.2."""
    env = gym.make("Blackjack-v1", **RULES[rules])
    shown, base = bool(known_hidden(env)), env.unwrapped
    table = tabulate(Reveal(env) if shown else env, gamma=0.999999)
    policy = policy_iteration(table.mdp, table.reward).policy
    seen: list[Any] = [table.states.decode(row) for row in range(table.mdp.n_states)]
    keys = [(*one["observation"], one["natural"]) if shown else (*one, 0) for one in seen]  # terminal copies come last
    act = dict(zip(keys[::-1], policy.tolist()[::-1], strict=True))
    unlike = 0
    for total, card, ace in product(range(4, 22), range(1, 11), (0, 1)):
        hard = total >= 17 or (2 <= card <= 6 and (total >= 13 or (total == 12 and card >= 4)))
        soft = total >= 19 or (total == 18 and 2 <= card <= 8)
        unlike += (total > 11 or not ace) and (act[total, card, ace, 0] == 0) != (soft if ace else hard)
    paid = np.empty(hands)
    for i in range(hands):
        (at, _), ended = base.reset(seed=0 if i == 0 else None), False
        natural = shown and sorted(getattr(base, "player")) == [1, 10]  # noqa: B009
        while not ended:
            at, paid[i], ended, _, _ = base.step(act[(*at, natural)])
            natural = False
    value, error = policy_value(table.mdp, table.reward, policy), paid.std(ddof=1) / hands**0.5
    return f"{value:.6f}", f"{paid.mean():.6f}", f"{error:.6f}", f"{abs(paid.mean() - value) / error:.2f} s.e.", str(unlike)


def published(name: str, _: int) -> tuple[str, ...]:
    """Enumeration beside the table that is published."""
    env = gym.make(KNOWN[name][0], **KNOWN[name][1])
    known, found = tabulate(env, gamma=0.99, check_steps=0), Enumeration().table(env, 0.99)
    n, mine = np.arange(found.mdp.n_states), found.mdp
    ended = np.isin(n, list(found.states.terminal_copies.values()))
    rows = known.states.encode_batch(found.states.decode_batch(n), terminated=ended)
    states, part = np.array_equal(np.sort(rows), np.flatnonzero(known.mdp.reachable)), known.mdp.restrict(rows)
    support = ((part.P != 0) != (mine.P != 0)).nnz == 0 and np.array_equal(part.d0 > 0, mine.d0 > 0)
    off = max(abs(part.P - mine.P).max(), abs(part.d0 - mine.d0).max())
    paid = abs(known.payments.mean[rows] - found.payments.mean).max()
    return str(n.size), str(states), str(support), f"{off:.0e}", f"{paid:.0e}", str(found.evidence.exact)


def large(*_: Any) -> tuple[str, ...]:
    """An enumeration, and the peak memory of this process so far."""
    found = Enumeration().table(Square(), 0.99)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    return f"{found.mdp.n_states:,}", f"{found.mdp.P.nnz:,}", str(found.evidence.exact), f"{peak:.2f} GB"


def constant(name: str, _: int) -> tuple[str, ...]:
    """An enumeration whose copies leave out what never changes; processor time, of it and of one without that map."""
    used = []
    for tiles in (70, 23):
        begin = time.process_time()
        found = Enumeration().table(Racetrack(23, tiles, rebuilt=name == "built at each reset"), 0.99)
        used.append(time.process_time() - begin)
    return f"{found.mdp.n_states:,}", str(found.evidence.exact), f"{used[0]:.1f}", f"{used[1]:.1f}"


PARTS = {
    "large": (large, ("500 x 500",), "plain Python|states|transitions|exact|peak memory"),
    "constant": (constant, ("built once", "built at each reset"), "a map of 4,900 numbers|states|exact|seconds of it|without"),
    "blackjack": (blackjack, RULES, "Blackjack|value, by table|by hands|standard error|off by|moves unlike Figure 5.2"),
    "published": (published, KNOWN, "P hidden|states|same|same support|P, d0 off by|R off by|exact"),
}

if __name__ == "__main__":
    asked = tyro.cli(Arguments, description=__doc__)
    for measure, names, headings in (PARTS[part] for part in asked.parts):
        shown = Table(*headings.split("|"), "seconds")
        for name in names:
            begin = time.perf_counter()
            shown.add_row(name, *measure(name, asked.hands), f"{time.perf_counter() - begin:.1f}")
        Console(width=150).print(shown)
