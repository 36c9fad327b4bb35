"""A line of five cells, in many ways in which what deepcopy leaves as it is leads a copy back to it."""

import logging
import threading
import types
import weakref
from multiprocessing.shared_memory import SharedMemory

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from walk_env import Stubborn

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
