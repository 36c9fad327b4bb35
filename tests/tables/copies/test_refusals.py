"""What a snapshot takes for a refusal to be copied, and what for a bug of the environment's own."""

import threading

import pytest
from walk_env import Walk, snapshots_of

from irl_gym.errors import NotTabular
from irl_gym.tables.copies.object_graphs import Pairs


class Faulty:
    """Raises what it is given when it is pickled or copied, but not while it is new."""

    def __init__(self):
        self.error = None

    def __reduce_ex__(self, protocol):
        if self.error is not None:
            raise self.error
        return Faulty, ()


@pytest.mark.parametrize("error", [KeyError("a bug"), MemoryError(), KeyboardInterrupt()])
def test_take_lets_pass_what_is_no_refusal_to_be_pickled(error):
    env, snapshots = snapshots_of(Walk(inner=Faulty()))
    env.inner.error = error
    with pytest.raises(type(error)) as passed:
        snapshots.take()
    assert passed.value is error


@pytest.mark.parametrize("error", [TypeError("no"), RuntimeError("not enabled"), NotImplementedError("not yet")])
def test_take_tells_what_can_neither_be_pickled_nor_copied(error):
    env, snapshots = snapshots_of(Walk(inner=Faulty()))
    env.inner.error = error
    with pytest.raises(NotTabular, match="can neither be pickled nor copied") as told:
        snapshots.take()
    assert told.value.__cause__ is error


class Copied(Walk):
    """Copies itself with what it holds as it is."""

    def __deepcopy__(self, memo):
        return Copied(**{name: value for name, value in vars(self).items() if name not in ("place", "has_key")})


@pytest.mark.parametrize("error", [KeyError("a bug"), MemoryError()])
def test_a_bug_while_an_attribute_is_tried_is_no_refusal(error):
    inner = Faulty()
    inner.error = error
    with pytest.raises(type(error)) as passed:
        snapshots_of(Copied(inner=inner))
    assert passed.value is error


@pytest.mark.parametrize("error", [KeyError("a bug"), MemoryError()])
def test_a_bug_while_a_constant_is_guarded_passes(error):
    env, snapshots = snapshots_of(Walk(map=[Faulty(), list(range(2000))]))
    env.map[0].error = error
    with pytest.raises(type(error)) as passed:
        snapshots.changed_constants()
    assert passed.value is error


class Compared:
    """Raises what it is given when it is compared."""

    __slots__ = ()
    error: Exception

    def __eq__(self, other):
        raise self.error

    __hash__ = None


def test_a_comparison_that_refuses_is_a_difference(monkeypatch):
    monkeypatch.setattr(Compared, "error", ValueError("ambiguous"), raising=False)
    assert [one.name for one in Pairs().unlike("one", Compared(), Compared())] == ["one"]


def test_a_bug_in_a_comparison_passes(monkeypatch):
    monkeypatch.setattr(Compared, "error", KeyError("a bug"), raising=False)
    with pytest.raises(KeyError, match="a bug"):
        list(Pairs().unlike("one", Compared(), Compared()))


class Falls(Walk):
    def step(self, action):
        raise KeyError("no such cell")


def test_an_error_in_the_steps_that_are_rehearsed_is_named():
    with pytest.raises(NotTabular, match=r"the environment raised KeyError \('no such cell'\)"):
        snapshots_of(Falls())


class Unset(Walk):
    """Cannot be copied, and cannot be set either."""

    def __init__(self):
        super().__init__(lock=threading.Lock())

    def get_state(self):
        return self.place

    def set_state(self, state):
        raise LookupError("no such state")


def test_an_error_of_set_state_is_named():
    _, snapshots = snapshots_of(Unset())
    with pytest.raises(NotTabular, match=r"the environment raised LookupError \(no such state\)"):
        snapshots.restore(snapshots.take())
