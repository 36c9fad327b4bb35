"""What never changes is in no snapshot, is guarded, and is noticed when it changes after all."""

import re
import types

import minigrid  # noqa: F401  (registers its environments)
import numpy as np
import pytest
from walk_env import Bag, Walk, snapshots_of

from irl_gym.errors import InvalidParameter
from irl_gym.tables.copies.snapshots import ConstantChanged


def test_large_attributes_that_do_not_change_are_left_out_and_guarded():
    env, snapshots = snapshots_of(Walk(map=list(range(2000))))
    assert len(snapshots.take()) < 300
    assert snapshots.changed_constants() == []
    env.map[3] = 0
    assert snapshots.changed_constants() == ["map"]


def test_take_notices_a_constant_bound_to_another_object():
    env, snapshots = snapshots_of(Walk(map=list(range(2000))))
    env.map = list(range(1, 2001))
    with pytest.raises(ConstantChanged, match="map"):
        snapshots.take()
    assert snapshots.changed_constants() == ["map"]


def world(**more):
    """An attribute with a large part that never changes, and one that grows."""
    return {"map": [[r + c for c in range(70)] for r in range(70)], "path": [], **more}


class Grows(Walk):
    def step(self, action):
        path = self.world["path"] if isinstance(self.world, dict) else self.world.path
        path.append(action)
        return super().step(action)


@pytest.mark.parametrize("made", [world, lambda: types.SimpleNamespace(**world())], ids=["dict", "object"])
def test_a_large_part_of_an_attribute_is_left_out_beside_one_that_grows(made):
    env, snapshots = snapshots_of(Grows(world=made()))
    env.step(1)
    state, before = snapshots.take(), str(env.world)
    env.step(0)
    snapshots.restore(state)
    assert (len(state) < 500, str(env.world)) == (True, before)


def test_a_part_of_an_attribute_that_is_changed_in_place_is_noticed_and_can_be_included():
    env, snapshots = snapshots_of(Grows(world=world()))
    env.world["map"][3][4] = -1
    assert snapshots.changed_constants() == ["world['map']"]
    snapshots.include(["world['map']"])
    state = snapshots.take()
    env.world["map"][3][4] = -2
    snapshots.restore(state)
    assert (env.world["map"][3][4], snapshots.changed_constants()) == (-1, [])


@pytest.mark.parametrize("change", [{"map": [1]}, {"map": None}, {}], ids=["other", "none", "gone"])
def test_take_notices_another_part_in_the_place_of_a_constant(change):
    env, snapshots = snapshots_of(Grows(world=world()))
    env.world = {"path": [], **change}
    with pytest.raises(ConstantChanged, match=re.escape("world['map']")):
        snapshots.take()


def test_a_constant_that_is_built_anew_with_the_same_contents_stays_one_with_what_it_shares():
    env, snapshots = snapshots_of(Grows(world=world(), row=None))
    env.world = world()
    env.row = env.world["map"][3]
    state = snapshots.take()
    env.row = env.world = None
    snapshots.restore(state)
    assert (len(state) < 500, env.row is env.world["map"][3], len(env.world["map"])) == (True, True, 70)
    env.row[0] = -1
    assert snapshots.changed_constants() == ["world['map']"]


def test_include_puts_a_constant_into_the_state():
    env, snapshots = snapshots_of(Walk(map=list(range(2000))))
    snapshots.include(["map"])
    state = snapshots.take()
    env.map[3] = 0
    snapshots.restore(state)
    assert (env.map[3], snapshots.changed_constants()) == (3, [])


def test_include_refuses_a_name_that_is_no_attribute():
    _, snapshots = snapshots_of(Walk())
    with pytest.raises(InvalidParameter, match="name='mop' is no attribute"):
        snapshots.include(["mop"])


def test_an_attribute_may_share_an_object_of_a_constant():
    env, snapshots = snapshots_of(Walk(rooms=[Bag([i]) for i in range(400)], room=None))
    env.room = env.rooms[3]
    state = snapshots.take()
    env.room = None
    snapshots.restore(state)
    assert env.room is env.rooms[3]
    env.room.items.append(4)  # through the state, into the constant
    assert snapshots.changed_constants() == ["rooms"]
    snapshots.include(["rooms"])
    state = snapshots.take()
    env.room.items.append(5)
    snapshots.restore(state)
    assert (env.room is env.rooms[3], env.room.items) == (True, [3, 4])


def test_what_a_step_changes_inside_a_constant_is_noticed_after_any_number_of_states():
    env, snapshots = snapshots_of(Walk(map=list(range(2000))))
    for _ in range(1_100):
        snapshots.take()
    snapshots.check()
    env.map[3] = 0
    with pytest.raises(ConstantChanged, match="map"):
        snapshots.check()


def large(part):
    return [part, *range(600)]


INSIDE = {
    "a list's": (lambda: large([1]), lambda part: part.append(2)),
    "a dict's order": (lambda: large({1: 1, 2: 1}), lambda part: part.update({1: part.pop(1)})),
    "a set's": (lambda: large({1}), lambda part: part.add(2)),
    "an array's": (lambda: large(np.zeros(3)), lambda part: part.fill(1)),
    "an array's shape": (lambda: large(np.zeros(3)), lambda part: part.resize((1, 3))),
    "an array's objects": (lambda: large(np.full(3, None)), lambda part: part.fill(1)),
    "a bytearray's": (lambda: large(bytearray(3)), lambda part: part.append(1)),
    "an object's": (lambda: large(Bag([1])), lambda part: setattr(part, "items", [2])),
    "a slot's": (lambda: large(Slot(1)), lambda part: setattr(part, "n", 2)),
    "one of many": (lambda: [[{i: 1}] for i in range(400)], lambda part: part[0].update({0: True})),
    "a list in a tuple": (lambda: large(([1],)), lambda part: part[0].append(2)),
    "one that says how it is pickled": (lambda: large(Told([1])), lambda part: part.items.append(2)),
}


class Told(Bag):
    def __reduce__(self):
        return Told, (self.items,)


class Slot:
    __slots__ = ("n",)

    def __init__(self, n):
        self.n = n


@pytest.mark.parametrize("name", INSIDE)
def test_check_sees_any_change_inside_a_constant(name):
    make, change = INSIDE[name]
    env, snapshots = snapshots_of(Walk(map=make()))
    snapshots.check()
    change(env.map[0])
    with pytest.raises(ConstantChanged, match="map"):
        snapshots.check()


def test_a_part_that_is_put_in_the_place_of_its_equal_is_no_change():
    env, snapshots = snapshots_of(Walk(map=large(np.zeros(3))))
    env.map[0] = np.zeros(3)
    snapshots.check()
    env.map[0][1] = 5
    with pytest.raises(ConstantChanged, match="map"):
        snapshots.check()
