"""The modules' functions are driven by one at a time, and stand again as they stood."""

import random
import threading

import numpy as np
import pytest

from irl_gym.tables.draws.driven_modules import DrivenModules
from irl_gym.tables.draws.exact_draws import Draws


def standing():
    return [random.random, random.choice, np.random.rand, np.random.choice, np.random.seed]


def coin():
    return random.random() < 0.5


def test_what_is_imported_by_name_while_driven_draws_as_ever_afterwards():
    kept = []
    assert len([*Draws(modules=True).outcomes(lambda: (kept.append(random.random), coin())[1])]) == 2
    assert type(kept[0]()) is float


def test_drives_within_a_drive_leave_it_driven():
    outer, inner = Draws(modules=True), Draws(modules=True)
    for within in (outer, inner):
        found = [(p, one) for p, _, one in outer.outcomes(lambda it=within: (it.seeded(0, coin), coin())[1])]
        assert found == [(0.5, True), (0.5, False)] or found == [(0.5, False), (0.5, True)]


def test_an_error_halfway_leaves_the_modules_as_they_were(monkeypatch):
    class Breaks:
        def __setattr__(self, name, value):
            raise KeyboardInterrupt

        drawn = None

    before, driven = standing(), DrivenModules(Draws()._stand_ins)
    monkeypatch.setattr(Breaks, "__setattr__", object.__setattr__, raising=True)
    broken = Breaks()
    monkeypatch.undo()
    driven._functions.append((broken, "drawn", coin))
    with pytest.raises(KeyboardInterrupt), driven.driven():
        pass
    assert standing() == before


def test_threads_that_drive_wait_for_each_other():
    before, found = standing(), []
    first_inside, second_inside, first_done = (threading.Event() for _ in range(3))

    def first():
        first_inside.set()
        second_inside.wait(0.3)  # in vain
        return coin()

    def second():
        second_inside.set()
        first_done.wait(0.3)
        return coin()

    def search(run, done=None):
        found.append(sorted((p, one) for p, _, one in Draws(modules=True).outcomes(run)))
        if done is not None:
            done.set()

    threads = [threading.Thread(target=search, args=[first, first_done]), threading.Thread(target=search, args=[second])]
    threads[0].start()
    first_inside.wait(10)
    threads[1].start()
    for one in threads:
        one.join(10)
    assert found == [[(0.5, False), (0.5, True)]] * 2 and standing() == before
