"""Measured bars: FeatureLP on hundreds of thousands of states, each in a process of its own for its time and memory.

Seconds are the processor's, of all threads: at least the clock's on an idle machine, and not more on a busy one.
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from stopped import HANG

GIGABYTE = 2**30

GRID = """
import json, resource, sys, time
import gymnasium as gym
import numpy as np
from yardstick import yard
from irl_gym.features.bases import RadialBasis
from irl_gym.features.feature_maps import Unravel
from irl_gym.learners.linear_programs.feature import FeatureLP

side, K, S_0 = (int(text) for text in sys.argv[1:])
mdp = gym.make("irl_gym_envs:irl_gym/GridWorld-v0", size=side).unwrapped.mdp(0.99)
row, column = np.divmod(np.arange(side**2), side)
expert = np.where(row >= side - 1 - column, 0, 1)  # up or right, whichever is further from the goal in the corner
phi = RadialBasis.grid([0, 0], [side - 1, side - 1], K, coordinates=Unravel((side, side)))
started = time.process_time()
result = FeatureLP(phi, S_0=S_0).fit(mdp, expert)
certificate = result.proof
print(json.dumps({
    "yards": (time.process_time() - started) / yard(),
    "bytes": 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss,
    "states": certificate.states,
    "features": certificate.n_features,
    "gap": certificate.duality_gap,
    "objective": certificate.objective,
}))
"""


def measured(side, K, S_0):
    """What FeatureLP took on a grid of side x side cells with K x K Gaussians and S_0 states."""
    command = [sys.executable, "-c", GRID, *map(str, (side, K, S_0))]
    done = subprocess.run(command, capture_output=True, text=True, timeout=HANG, cwd=Path(__file__).parents[2])
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def quarter_million():
    return measured(500, 8, 20_000)


@pytest.fixture(scope="module")
def million():
    return measured(1000, 10, 2_000)


@pytest.mark.slow
def test_feature_lp_of_250_000_states_takes_less_than_1000_yards(quarter_million):
    assert quarter_million["features"] == 64 and quarter_million["states"] == 20_000
    assert quarter_million["yards"] < 1_000


@pytest.mark.slow
def test_feature_lp_of_250_000_states_needs_less_than_4_gb(quarter_million):
    assert quarter_million["bytes"] < 4 * GIGABYTE


@pytest.mark.slow
def test_feature_lp_of_a_million_states_needs_less_than_4_gb(million):
    assert million["features"] == 100 and million["states"] == 2_000
    assert million["bytes"] < 4 * GIGABYTE


@pytest.mark.slow
@pytest.mark.parametrize("size", ["quarter_million", "million"])
def test_feature_lp_of_many_states_closes_the_gap(size, request):
    found = request.getfixturevalue(size)
    assert abs(found["gap"]) <= 1e-6 * max(1.0, abs(found["objective"]))
