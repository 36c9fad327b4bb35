"""Glances: an agent is judged again when it was updated, and only then."""

import re
from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest

from irl_gym.errors import DamagedFile
from irl_gym.loop.learning_curve import Glances
from irl_gym.loop.table_world import TableWorld
from irl_gym.loop.worlds import SteppedWorld
from irl_gym.tables.tabulate import tabulate


class Counting:
    """A policy that always goes the same way and counts how often it is asked; its model has had no update."""

    def __init__(self):
        self.model, self.asked = SimpleNamespace(_n_updates=0), 0

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        self.asked += 1
        return np.zeros(np.shape(observation)[:1], np.int64), state


def stepped():
    return SteppedWorld(gym.make("CartPole-v1", max_episode_steps=5), 0.9, 2, 20, 0)


def tabular():
    env = gym.make("FrozenLake-v1")
    return TableWorld(env, tabulate(env, gamma=0.9, check_steps=0), 8, 0)


@pytest.mark.parametrize("world", [stepped, tabular])
def test_an_agent_is_judged_again_only_after_an_update(world):
    policy, glances = Counting(), Glances(world(), lambda steps, told: None)
    asked = []
    for steps, updates in ((0, 0), (64, 0), (128, 4)):
        policy.model._n_updates = updates
        glances.see(steps, policy)
        asked.append(policy.asked)
    assert asked[0] == asked[1] and asked[2] == 2 * asked[0]


@pytest.mark.parametrize("world", [stepped, tabular])
def test_a_curve_has_a_point_for_each_look_and_the_same_for_the_same_agent(world):
    policy, glances = Counting(), Glances(world(), lambda steps, told: None)
    for steps in (0, 64, 128):
        glances.see(steps, policy)
    curve = glances.curve()
    assert len(set(curve.value)) == 1 and list(curve.steps) == [0, 64, 128]


@pytest.mark.parametrize("world", [stepped, tabular])
def test_a_curve_that_goes_on_from_what_was_kept_is_the_same(world):
    policy, told = Counting(), []
    whole, begun, gone_on = (Glances(world(), lambda steps, told_: told.append((steps, told_))) for _ in range(3))
    for steps in (0, 64, 128):
        whole.see(steps, policy)
    for steps in (0, 64):
        begun.see(steps, policy)
    gone_on.take(begun.arrays())
    asked = policy.asked
    gone_on.see(128, policy)
    ours, theirs = whole.curve(), gone_on.curve()
    assert policy.asked == asked and all(
        np.array_equal(getattr(ours, key), getattr(theirs, key), equal_nan=True) for key in vars(ours)
    )


@pytest.mark.parametrize(
    ("world", "name", "value"),
    [(stepped, "values", np.nan), (tabular, "glanced", 4), (tabular, "glanced", -1), (stepped, "glanced", np.inf),
     (tabular, "steps", -1), (tabular, "updates", -7), (tabular, "updates", None), (tabular, "glanced", [[0, 1]]),
     (stepped, "values", [0.0])],
)  # fmt: skip
def test_a_curve_that_no_training_in_this_world_leaves_is_refused(world, name, value):
    glances = Glances(world(), lambda steps, told: None)
    for steps in (0, 64):
        glances.see(steps, Counting())
    kept = dict(glances.arrays())
    one = kept.pop(name)
    kept |= {} if value is None else {name: np.array(value) if isinstance(value, list) else np.full(one.shape, value)}
    with pytest.raises(DamagedFile, match=name):
        glances.take(kept)


@pytest.mark.parametrize("world", [stepped, tabular])
def test_the_mean_return_is_told_as_the_agent_trains(world):
    told = []
    Glances(world(), lambda steps, known: told.append((steps, known))).see(64, Counting())
    assert told[0][0] == 64 and re.fullmatch(r"mean return \S+ after 64 steps", told[0][1])
