import collections
import threading

import gym_classics
import gymnasium as gym
import hypothesis
import hypothesis.strategies as st
import minigrid  # noqa: F401  (registers its environments)
import numpy as np
import pytest
from minigrid.wrappers import FullyObsWrapper, ImgObsWrapper
from walk_env import Bag, StandIn, Stubborn, Walk, frames, snapshots_of

if gym_classics._backend is None:  # a second call warns
    gym_classics.register("gymnasium")


ENVS = {
    "Walk": Walk,
    "FrozenLake": lambda: gym.make("FrozenLake-v1"),
    "CliffWalking": lambda: gym.make("CliffWalkingSlippery-v1"),
    "Taxi": lambda: gym.make("Taxi-v4", fickle_passenger=True, is_rainy=True),
    "Blackjack": lambda: gym.make("Blackjack-v1"),
    "DoorKey": lambda: ImgObsWrapper(FullyObsWrapper(gym.make("MiniGrid-DoorKey-6x6-v0"))),
    "gym-classics": lambda: gym.make("WindyGridworldKingsStochastic-v0"),
    "wrappers with state": frames,
}


def walk(env, snapshots, actions):
    """What a walk shows, with the draws rewound; it ends with the episode."""
    for stand_in in snapshots._stand_ins:
        stand_in.rewind()
    seen = []
    for action in actions:
        observation, reward, terminated, _, _ = env.step(action)
        seen.append((str(observation), reward, terminated))
        if terminated:
            break
    return seen


def differences(snapshots, state):
    """What differs between a state and the one now, in words."""
    return [str(one) for one in snapshots.differences(state, snapshots.take())]


def actions_of(env, seed, n=50):
    return np.random.default_rng(seed).integers(env.action_space.n, size=n).tolist()


@pytest.mark.parametrize("name", ENVS)
def test_snapshot_restores_what_the_next_walk_shows(name):
    env, snapshots = snapshots_of(ENVS[name]())
    for seed in range(4):  # each walk begins where the one before it was after 5 steps
        state, actions = snapshots.take(), actions_of(env, seed)
        first = walk(env, snapshots, actions)
        snapshots.restore(state)
        assert walk(env, snapshots, actions) == first
        snapshots.restore(state)
        assert snapshots.same(snapshots.take(), state)
        if len(walk(env, snapshots, actions[:5])) < 5:
            env.reset()
    assert snapshots.changed_constants() == []


@hypothesis.given(st.lists(st.integers(0, 6), max_size=40), st.lists(st.integers(0, 6), min_size=1, max_size=40))
@hypothesis.settings(max_examples=15)
def test_snapshot_of_any_place_in_a_minigrid_restores_it(before, after):
    env, snapshots = DOOR_KEY
    env.reset()
    walk(env, snapshots, before)
    state = snapshots.take()
    first = walk(env, snapshots, after)
    snapshots.restore(state)
    assert walk(env, snapshots, after) == first


DOOR_KEY = snapshots_of(ENVS["DoorKey"]())


def test_snapshot_holds_arrays_sets_dataclasses_and_deques():
    held = {"cells": np.zeros((2, 3)), "left": {1, 8}, "bag": Bag([1]), "queue": collections.deque([1, 2], maxlen=2)}
    env, snapshots = snapshots_of(Walk(**held))
    state = snapshots.take()
    env.cells[1, 2] = 5.0
    env.left.discard(8)
    env.bag.items.append(2)
    env.queue.append(3)
    assert differences(snapshots, state) == [
        "cells[1, 2]: np.float64(0.0) against np.float64(5.0)",
        "left: {8, 1} against {1}",
        "bag.items: [1] against [1, 2]",
        "queue[0]: 1 against 2",
        "queue[1]: 2 against 3",
    ]
    snapshots.restore(state)
    assert (env.cells[1, 2], env.left, env.bag.items, list(env.queue)) == (0.0, {1, 8}, [1], [1, 2])


def test_restore_removes_attributes_that_appeared_since():
    env, snapshots = snapshots_of(Walk())
    state = snapshots.take()
    env.cache = 3
    assert differences(snapshots, state) == ["cache: absent against 3"]
    snapshots.restore(state)
    assert not hasattr(env, "cache")


def test_same_looks_past_the_order_of_a_set_and_shared_strings():
    env, snapshots = snapshots_of(Walk(left={8, 16, 0}, a="".join(["o", "n"]), b="on"))
    state = snapshots.take()
    env.left, env.a = {0, 16, 8}, env.b
    assert state != snapshots.take()
    assert snapshots.same(state, snapshots.take())


def test_same_tells_a_shared_list_from_an_equal_one():
    env, snapshots = snapshots_of(Walk(a=[1], b=[1]))
    state = snapshots.take()
    env.b = env.a
    assert differences(snapshots, state) == ["b: the same object as another attribute's, in one state only"]


def test_differences_name_the_wrapper():
    env, snapshots = snapshots_of(frames())
    state = snapshots.take()
    env.step(0)
    assert "TimeAwareObservation.timesteps: 0 against 1" in differences(snapshots, state)


def test_snapshot_holds_functions_and_local_classes_by_reference():
    class Local:
        n = 0

    env, snapshots = snapshots_of(Walk(rule=lambda x: x + 1, local=Local()))
    rule, state = env.rule, snapshots.take()
    env.rule, env.local.n = None, 4
    snapshots.restore(state)
    assert (env.rule is rule, env.local.n, isinstance(state, bytes)) == (True, 0, True)


def test_snapshot_copies_what_cannot_be_pickled():
    env, snapshots = snapshots_of(Walk(inner=Stubborn()))
    state = snapshots.take()
    actions = actions_of(env, 0)
    first = walk(env, snapshots, actions)
    env.inner.n = 5
    assert "inner.n: 0 against 5" in differences(snapshots, state)
    for _ in range(2):  # the copy is not used up
        snapshots.restore(state)
        assert env.inner.n == 0
        assert walk(env, snapshots, actions) == first
        env.inner.n = 6
    assert type(env.np_random) is StandIn


def test_an_object_of_minigrids_that_is_carried_stays_that_of_its_grid():
    env, snapshots = snapshots_of(ENVS["DoorKey"]())
    base = env.unwrapped
    where = next(i for i, one in enumerate(base.grid.grid) if one is not None and one.type == "key")
    base.carrying = base.grid.grid[where]
    snapshots.restore(snapshots.take())
    assert base.carrying is base.grid.grid[where]


def test_an_object_that_points_back_at_the_environment_still_does():
    env, snapshots = snapshots_of(Walk())
    env.bag = Bag([env])
    snapshots.restore(snapshots.take())
    assert env.bag.items[0] is env


class Handle(Walk):
    """Cannot be copied, and speaks for itself."""

    def __init__(self):
        super().__init__(lock=threading.Lock())

    def get_state(self):
        return [self.place, self.has_key]

    def set_state(self, state):
        self.place, self.has_key = state


def test_snapshots_use_get_state_and_set_state_of_what_cannot_be_copied():
    env, snapshots = snapshots_of(gym.wrappers.FrameStackObservation(Handle(), 3))
    env.step(1)
    state, actions = snapshots.take(), actions_of(env, 0)
    first = walk(env, snapshots, actions)
    snapshots.restore(state)
    assert walk(env, snapshots, actions) == first
    assert any(line.startswith("state[0]: ") for line in differences(snapshots, state))


class Mended(Walk):
    """Holds a lock, and knows how to be copied."""

    def __init__(self):
        super().__init__(lock=threading.Lock())

    def __deepcopy__(self, memo):
        return Mended()


def test_what_can_neither_be_pickled_nor_copied_is_constant():
    env, snapshots = snapshots_of(Mended())
    lock, state = env.lock, snapshots.take()
    env.step(1)
    snapshots.restore(state)
    assert (env.lock is lock, env.place) == (True, 0)
    env.lock = threading.Lock()
    assert snapshots.changed_constants() == ["lock"]


class Slotted(Walk):
    __slots__ = ("__hidden", "count")

    def step(self, action):
        self.count = getattr(self, "count", 0) + 1
        self.__hidden = self.count
        return super().step(action)


def test_snapshot_holds_slots():
    env, snapshots = snapshots_of(Slotted())
    empty = snapshots.take()
    env.step(1)
    state = snapshots.take()
    env.step(1)
    snapshots.restore(state)
    assert (env.count, env._Slotted__hidden) == (1, 1)
    snapshots.restore(empty)
    assert not hasattr(env, "count")


def test_restore_gives_methods_back_that_were_put_in_each_others_place():
    env, snapshots = snapshots_of(Walk())
    env.reset, env.step = env.step, env.reset
    state = snapshots.take()
    env.reset, env.step = env.step, env.reset
    snapshots.restore(state)
    assert (env.reset.__func__, env.step.__func__) == (Walk.step, Walk.reset)
