"""Generators that an environment draws from and does not hold are named, and its table is not exact."""

import random

import numpy as np
import pytest
from enumeration_envs import RAND, RANDOM, Corridor

from irl_gym.tables.enumeration.table import Enumeration

pytestmark = pytest.mark.usefixtures("unchecked")
MODULES_OWN = np.random.default_rng(0)


class Draws(Corridor):
    """Draws in the first cell only, and what it draws decides nothing."""

    of_class = random.Random(0)

    def __init__(self, draw):
        super().__init__(4)
        self.draw = draw

    def step(self, action):
        if self.cell == 0:
            self.draw()
        return self.moved(int(action))


class DrawsAtReset(Corridor):
    def reset(self, *, seed=None, options=None):
        RANDOM()
        return super().reset(seed=seed)


class DrawsLate(Corridor):
    """From its hundredth step on, which is hidden but decides nothing."""

    steps = 0

    def step(self, action):
        self.steps += 1
        if self.steps > 100:
            RAND()
        return self.moved(int(action) if self.cell < self.n - 2 else 0)


def closed_over():
    mine = np.random.RandomState(0)

    class Closed(Corridor):
        def step(self, action):
            mine.rand()
            return self.moved(int(action))

    return Closed()


SOURCES = {
    "the module random": lambda: Draws(lambda: RANDOM()),
    "the module numpy.random": lambda: Draws(lambda: RAND()),
    "Draws.of_class": lambda: Draws(lambda: Draws.of_class.random()),
    "MODULES_OWN": lambda: Draws(lambda: MODULES_OWN.random()),
    "Closed's mine": closed_over,
}


@pytest.mark.parametrize("name", SOURCES)
def test_a_generator_that_is_not_the_environments_own_is_named_and_nothing_is_exact(name):
    evidence = Enumeration(runs=5, start_runs=5).table(SOURCES[name](), 0.9).evidence
    assert not evidence.exact and "every outcome" not in evidence.method
    assert name in evidence.method.partition(", which is not its own.")[0]


@pytest.mark.parametrize(("kind", "name"), [(DrawsAtReset, "random"), (DrawsLate, "numpy.random")])
def test_draws_at_reset_or_after_many_steps_are_seen_too(kind, name):
    evidence = Enumeration(runs=5, start_runs=5).table(kind(), 0.9).evidence
    assert not evidence.exact and evidence.method.startswith(f"The environment draws from the module {name}, which is not its")


def test_what_was_drawn_from_outside_is_told_again_where_a_search_is_continued(tmp_path):
    settings = {"runs": 5, "start_runs": 5, "checkpoint": tmp_path / "search.npz"}
    first, second = (Enumeration(**settings).table(DrawsAtReset(), 0.9).evidence for _ in range(2))
    assert first == second
