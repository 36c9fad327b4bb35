"""What deepcopy leaves as it is leads a copy of an environment back to it: made anew, or refused."""

import logging
import threading
import types
import weakref
from multiprocessing.shared_memory import SharedMemory

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from walk_env import Stubborn

from irl_gym.copies.stripped import without_watchers
from irl_gym.enumeration.table import Enumeration
from irl_gym.errors import NotTabular

N = 5
LOG = logging.getLogger("a line of five cells")


class Line(gym.Env):
    """A line of five cells, whose author gives it the functions that move."""

    observation_space, action_space = spaces.Discrete(N), spaces.Discrete(2)

    def __init__(self, give):
        self.at = 0
        self.box = [0]
        give(self)

    def put(self, place):
        LOG.debug("put")
        self.at = place

    def see(self):
        return self.at

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.put(0)
        return self.see(), {}

    def step(self, action):
        self.put(min(max(self.see() + (1 if action else -1), 0), N - 1))
        return self.see(), 0.0, self.see() == N - 1, False, {}


def closes_over_self(env):
    env.put = lambda place: setattr(env, "at", place)


def default(env):
    def put(place, env=env, *, again=env):
        env.at = again.at = place

    env.put = put


def functions_of_functions(env):
    env.moves = {"put": lambda place: inner(place)}
    inner = lambda place: setattr(env, "at", place)  # noqa: E731
    env.put = lambda place: env.moves["put"](place)


def reads_a_list_that_stays(env):
    places = list(range(N))
    env.see = lambda: places[env.at]


def closes_over_an_attribute_that_stays(env):
    places = env.places = np.arange(N)
    cells = env.cells = spaces.Discrete(N)
    env.see = lambda: int(places[env.at]) if env.at in cells else -1


def closes_over_an_attribute_alone(env):
    places = env.places = np.arange(N)
    env.name = lambda place: int(places[place])
    env.see = types.MethodType(lambda self: self.name(self.at), env)


def closes_over_a_lock(env):
    lock = threading.Lock()
    env.see = lambda: env.at + lock.locked()


def logs(env):
    env.log = LOG


def a_method_behind_a_function(env):
    method = Line.put.__get__(env)
    env.put = types.MethodType(lambda self, place: method(place), env)


def through(put, see):
    def give(env):
        env.put, env.see = types.MethodType(put, env), types.MethodType(see, env)

    return give


def closes_over_a_list(env):
    box = env.box
    env.put, env.see = lambda place: box.__setitem__(0, place), types.MethodType(lambda self: self.box[0], env)


def closes_over_a_list_of_lists(env):
    boxes = [env.box]
    env.put = lambda place: boxes[0].__setitem__(0, place)
    env.see = types.MethodType(lambda self: self.box[0], env)


class One:
    at = 0


def weakly(refer, follow):
    def give(env):
        env.one = One()
        env.weak = refer(env.one)
        through(lambda self, place: setattr(follow(self.weak), "at", place), lambda self: self.one.at)(env)

    return give


def a_weak_reference_to_itself(env):
    env.renderer = One()
    env.renderer.env = weakref.ref(env)
    through(lambda self, place: setattr(self.renderer.env(), "at", place), lambda self: self.at)(env)


def a_weak_reference_that_reset_makes(env):
    def put(self, place):
        if place == 0:
            self.renderer = One()
            self.renderer.env = weakref.ref(self)
        self.renderer.env().at = place

    env.put = types.MethodType(put, env)


def a_weak_reference_that_a_step_makes(env):
    def put(self, place):
        if place == 0:
            self.one = One()
        elif place == 1:
            self.weak = weakref.ref(self.one)
        (self.one if place < 2 else self.weak()).at = place

    through(put, lambda self: self.one.at)(env)


class Copied:
    """Copies itself by what it is told to copy."""

    def __init__(self, array):
        self.array = array

    def __deepcopy__(self, memo):
        return Copied(self.array.copy())


def a_view_that_copies_itself(env):
    env.array = np.zeros(3, int)
    env.view = Copied(env.array[1:])
    through(lambda self, place: self.array.fill(place), lambda self: int(self.view.array[0]))(env)


def beside_what_has_no_pickle(give):
    def both(env):
        env.odd = Stubborn()
        give(env)

    return both


def sets_a_variable(env):
    at = 0

    def put(place):
        nonlocal at
        at = place

    env.put, env.see = put, lambda: at


class Attributes(dict):
    def __init__(self, **given):
        super().__init__(**given)
        self.__dict__ = self


def a_dictionary_of_its_own_attributes(env):
    env.one = Attributes(at=0)
    through(lambda self, place: setattr(self.one, "at", place), lambda self: self.one["at"])(env)


def attributes_beside_their_object(env):
    env.one = One()
    env.one.at = 0
    env.mine = vars(env.one)
    through(lambda self, place: self.mine.__setitem__("at", place), lambda self: self.one.at)(env)


def large(give):
    def both(env):
        give(env)
        env.one.places = list(range(400))

    return both


def made_anew_by_reset(give):
    def both(env):
        def put(self, place):
            if place == 0:
                give(self)
                self.one.places, self.put = list(range(400)), types.MethodType(put, self)
            self.one.at = place

        give(env)
        env.put = types.MethodType(put, env)

    return both


def its_own_attributes(env):
    env.mine = vars(env)
    env.put = types.MethodType(lambda self, place: self.mine.__setitem__("at", place), env)


def attributes_of_two(env):
    env.one, env.other = One(), One()
    env.other.__dict__ = env.one.__dict__
    through(lambda self, place: setattr(self.one, "at", place), lambda self: self.other.at)(env)


def shared_memory(env):
    env.memory = SharedMemory(create=True, size=8)
    weakref.finalize(env, env.memory.unlink)
    through(lambda self, place: self.memory.buf.__setitem__(0, place), lambda self: self.memory.buf[0])(env)


BOARD = [0]


def board():
    return BOARD


class WithBoard(Line):
    board = [0]  # noqa: RUF012

    def see(self):
        return BOARD[0] + self.board[0]


class OfProperty(Line):
    cell = property(lambda self: BOARD[0])

    def see(self):
        return self.cell


class Boarded(Line):
    board = [0]  # noqa: RUF012


class OfBase(Boarded):
    def see(self):
        return self.board[0]


class OfFunction(Line):
    def see(self):
        return sum(one for one in board())


class OfComprehension(Line):
    def see(self):
        return sum(BOARD[i] for i in range(1))


def of_the_module(env):
    env.mine = BOARD
    env.put = types.MethodType(lambda self, place: self.mine.__setitem__(0, place), env)


def of_a_function_that_is_held(env):
    of_the_module(env)
    env.see = types.MethodType(lambda self: BOARD[0], env)


def of_the_class(env):
    env.mine = [type(env).board]
    env.put = types.MethodType(lambda self, place: self.mine[0].__setitem__(0, place), env)


JOINED = (a_dictionary_of_its_own_attributes, attributes_beside_their_object)


@pytest.mark.parametrize(
    "give",
    [
        closes_over_self,
        default,
        functions_of_functions,
        a_method_behind_a_function,
        reads_a_list_that_stays,
        closes_over_an_attribute_that_stays,
        closes_over_an_attribute_alone,
        logs,
        closes_over_a_lock,
        a_weak_reference_to_itself,
        beside_what_has_no_pickle(a_weak_reference_to_itself),
        a_weak_reference_that_reset_makes,
        *JOINED,
        *(change(give) for give in JOINED for change in (large, made_anew_by_reset, beside_what_has_no_pickle)),
    ],
)
def test_a_function_that_holds_the_environment_holds_its_copy_in_a_copy(give):
    env = Line(give)
    table = Enumeration().table(env, 0.9)
    P = table.mdp.P.toarray().reshape(N, 2, N)[: N - 1].argmax(-1)
    assert (P.tolist(), table.evidence.exact) == ([[max(s - 1, 0), s + 1] for s in range(N - 1)], True)
    assert env.at == 0  # its own was not moved


REFUSED = {
    "a list of a closure's": (Line, closes_over_a_list, "changes what the function .* holds .box., which all"),
    "a list in a list of a closure's": (Line, closes_over_a_list_of_lists, "Line.put leads to a list"),
    "a weak reference": (Line, weakly(weakref.ref, lambda ref: ref()), "Line.weak leads to a One"),
    "a weak reference that a step makes": (Line, a_weak_reference_that_a_step_makes, "a state leads to a One"),
    "a weak proxy": (Line, weakly(weakref.proxy, lambda one: one), "Line.weak leads to a "),
    "a weak dict": (Line, weakly(lambda one: weakref.WeakValueDictionary({0: one}), lambda held: held[0]), "leads to a One"),
    "a view that copies itself": (Line, a_view_that_copies_itself, "share memory"),
    "a variable that is set": (Line, sets_a_variable, "changes what the function .*put holds .at., which all copies share"),
    "its own attributes": (Line, its_own_attributes, "whose __dict__ is held in another way too"),
    "attributes of two objects": (Line, attributes_of_two, "leads to a One whose __dict__ is held in another way too"),
    "memory that processes share": (Line, shared_memory, "Line.memory leads to a SharedMemory"),
    "a variable that is set beside what has no pickle": (
        Line,
        beside_what_has_no_pickle(sets_a_variable),
        "changes what the function .*put holds .at.",
    ),
    "a module's": (WithBoard, of_the_module, "changes .*test_apart.BOARD, which all copies share"),
    "a class's": (WithBoard, of_the_class, "changes WithBoard.board, which all copies share"),
    "a base class's": (OfBase, of_the_class, "changes Boarded.board, which all copies share"),
    "a module's, of a property": (OfProperty, of_the_module, "changes .*test_apart.BOARD, which all copies share"),
    "a module's, of a function": (OfFunction, of_the_module, "changes .*test_apart.BOARD, which all copies share"),
    "a module's, of a comprehension": (OfComprehension, of_the_module, "changes .*test_apart.BOARD, which all copies share"),
    "a module's, of what is held": (Line, of_a_function_that_is_held, "changes .*test_apart.BOARD, which all copies share"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_copies_share_is_refused_where_it_changes(name):
    kind, give, what = REFUSED[name]
    BOARD[0] = WithBoard.board[0] = Boarded.board[0] = 0
    with pytest.raises(NotTabular, match=what):
        Enumeration().table(kind(give), 0.9)


class Told(Line):
    def get_state(self):
        return self.see()

    def set_state(self, state):
        self.put(state)


def test_get_state_and_set_state_mend_what_leads_back():
    table = Enumeration().table(Told(closes_over_a_list_of_lists), 0.9)
    assert (table.mdp.n_states, table.evidence.exact) == (N, True)


def test_a_global_that_stays_is_shared_and_no_obstacle():
    BOARD[0] = WithBoard.board[0] = 0
    env = WithBoard(lambda env: setattr(env, "mine", BOARD))
    env.see = types.MethodType(lambda self: self.at + self.mine[0], env)
    assert Enumeration().table(env, 0.9).mdp.n_states == N


def test_functions_that_share_a_variable_share_it_in_a_copy():
    def give(env):
        count = 0

        def put(place):
            nonlocal count
            count += 1
            env.at = place

        env.put, env.counted = put, lambda: (env, count)

    env = Line(give)
    made = without_watchers(env)
    made.put(3)
    assert (made.counted()[1], env.counted()[1], made.at, env.at) == (1, 0, 3, 0)
