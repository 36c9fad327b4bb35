"""The mends that errors of our environments name are executed, and serve."""

import gymnasium as gym
import numpy as np
import pytest
from mended import told

import irl_gym_envs  # noqa: F401  (registers its environments)

pytestmark = pytest.mark.usefixtures("unchecked")


def grid(**how):
    return gym.make("irl_gym/GridWorld-v0", **how)


def begun(name, act, seed=None):
    """What an environment does before or, with a seed, after its first reset."""
    env = gym.make(f"irl_gym/{name}-v0", render_mode="rgb_array" if act == "render" else None).unwrapped
    if seed is not None:
        env.reset(seed=seed)
    return env.render() if act == "render" else env.step(0)


def many(seed=None, **how):
    env = gym.make_vec("irl_gym/MountainCar-v0", 2, vectorization_mode="vector_entry_point", **how)
    if seed is not None:
        env.reset(seed=seed)
    return env.step(np.zeros(2, dtype=int))


def drawn(**how):
    env = gym.make("irl_gym/ContinuousGridWorld-v0", **how)
    env.reset(seed=0)
    return env.render()


TWO = {"start": [[4, 0], [4, 1]], "start_probabilities": [0.5, 0.5]}
CASES = [
    ("Move it, or make `size` larger.",
     lambda: grid(goals=[5, 4]), lambda: grid(goals=[4, 4]), lambda: grid(goals=[5, 4], size=6)),
    ("Move one of them.", lambda: grid(walls=[0, 4]), lambda: grid(walls=[1, 4]), lambda: grid(walls=[0, 4], goals=[1, 4])),
    ("list the cells in `start`, or drop them.",
     lambda: grid(start="uniform", start_probabilities=[1.0]), lambda: grid(**TWO), lambda: grid(start="uniform")),
    ("leave at least one free.",
     lambda: grid(size=[1, 2], goals=[[0, 0], [0, 1]], start="uniform"),
     lambda: grid(size=[1, 2], goals=[[0, 1]], start="uniform")),
    ("Draw a single environment of gymnasium.make.",
     lambda: many(render_mode="rgb_array"), lambda: drawn(render_mode="rgb_array")),
    ("step before the first episode: call reset first.", many, lambda: many(seed=0)),
    *(("step before the first episode: call reset first.",
       lambda name=name: begun(name, "step"), lambda name=name: begun(name, "step", seed=0))
      for name in ("ContinuousGridWorld", "MiniGrid", "MountainCar")),
    ("render before the first episode: call reset first.",
     lambda: begun("MiniGrid", "render"), lambda: begun("MiniGrid", "render", seed=0)),
]  # fmt: skip


@pytest.mark.parametrize(("says", "breaks", "mended"), [(one[0], one[1], one[2:]) for one in CASES],
                         ids=[one[0] for one in CASES])  # fmt: skip
def test_a_mend_that_an_error_of_an_environment_names_serves(says, breaks, mended):
    assert says in told(breaks) and all(each() is not None for each in mended)


def test_a_render_mode_is_offered_that_draws():
    says = 'make it with gym.make("irl_gym/ContinuousGridWorld-v0", render_mode="rgb_array").'
    with pytest.warns(UserWarning, match="render was called without a render mode") as caught:
        assert drawn(disable_env_checker=True) is None
    assert says in str(caught[0].message) and drawn(render_mode="rgb_array") is not None
