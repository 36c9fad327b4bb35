"""Functions of the modules random and numpy.random are driven as an environment's own generators are, and left as they were."""

import random
import threading

import numpy as np
import pytest
from enumeration_envs import Corridor, Slippery, same_table

from irl_gym.tables.enumeration.table import Enumeration

pytestmark = pytest.mark.usefixtures("unchecked")


def table_of(env, **limits):
    return Enumeration(**{"runs": 200, "start_runs": 200} | limits).table(env, 0.9)


@pytest.mark.parametrize("kind", ["module np.random", "module random"])
def test_driving_leaves_the_modules_as_they_were(kind):
    np.random.seed(3)  # noqa: NPY002
    before = np.random.get_state()[1].tolist(), random.getstate(), dict(vars(np.random)), dict(vars(random))  # noqa: NPY002
    table_of(Slippery(kind))
    after = np.random.get_state()[1].tolist(), random.getstate(), dict(vars(np.random)), dict(vars(random))  # noqa: NPY002
    assert after == before


@pytest.mark.parametrize(
    "draw",
    [
        lambda env: np.random.randn(),  # noqa: NPY002
        lambda env: np.random.normal(2.0, 3.0),  # noqa: NPY002
        lambda env: random.gauss(0, 1),
        lambda env: env.np_random.standard_normal(),
        lambda env: np.random.rand(),  # noqa: NPY002
    ],
)
def test_what_is_drawn_only_to_be_multiplied_by_zero_leaves_the_table_exact(draw):
    class Zero(Corridor):
        def step(self, action):
            observation, reward, *rest = self.moved(int(action))
            return observation, reward + 0.0 * draw(self), *rest

    assert same_table(table_of(Zero()), table_of(Corridor()))


def test_another_thread_draws_from_the_modules_as_ever():
    drawn = []

    class Asks(Corridor):
        def step(self, action):
            other = threading.Thread(target=lambda: drawn.append(np.random.rand()))  # noqa: NPY002
            other.start()
            other.join()
            return self.moved(int(action) if np.random.rand() < 0.5 else 0)  # noqa: NPY002

    Enumeration(revisits=0, runs=5, start_runs=5).table(Asks(4), 0.9)
    assert {type(one) for one in drawn} == {float}
