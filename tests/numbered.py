"""A demonstrator whose episodes are known by their number."""

import numpy as np

from irl_gym.mdp.episodes import Episode


class Numbered:
    """Episode i has 1 + i % 3 steps, and is drawn from i."""

    def __init__(self, breaks_at=None, least=1):
        self.breaks_at, self.least, self.asked = breaks_at, least, []

    def episodes(self, first):
        i = first
        while True:
            if i == self.breaks_at:
                raise KeyboardInterrupt
            self.asked.append(i)
            rng, steps = np.random.default_rng(i), self.least + i % 3
            yield Episode(rng.integers(16, size=steps + 1), rng.integers(4, size=steps), rng.random(steps), True, False, i)
            i += 1
