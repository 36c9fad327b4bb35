"""Environments that break with an error about copies, and the same when the error's mend was applied."""

import copy
import threading
import types

import gymnasium as gym
import numpy as np
from enumeration_envs import Corridor


class Told(Corridor):
    """Keeps its cell in a part that `see` reads and `put` writes, as it is told."""

    def __init__(self, give=lambda env: None):
        super().__init__()
        self.box = [0]
        give(self)

    def put(self, cell):
        self.box[0] = cell

    def see(self):
        return self.box[0]

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.put(self.cell)
        return self.see(), {}

    def step(self, action):
        self.cell = self.see()
        _, *rest = self.moved(int(action))
        self.put(self.cell)
        return self.see(), *rest


class OfTheModule(Told):
    def see(self):
        return SHARED[0]


class Set(Told):
    """Can be read and set."""

    def get_state(self):
        return int(self.see())

    def set_state(self, cell):
        self.put(cell)


def of_a_function(env):
    boxes = [env.box]
    env.put = lambda cell: boxes[0].__setitem__(0, cell)


SHARED = [0]


def of_the_module(env):
    env.mine = SHARED
    env.put = types.MethodType(lambda self, cell: self.mine.__setitem__(0, cell), env)


def of_a_buffer(env):
    env.box = bytearray(4)
    env.seen = np.frombuffer(env.box, np.uint8)
    env.see = types.MethodType(lambda self: int(self.seen[0]), env)


def of_one(env):
    env.box = bytearray(4)
    env.see = types.MethodType(lambda self: int(np.frombuffer(self.box, np.uint8)[0]), env)


def of_a_copy(env):
    env.names = bytearray(b"abcd")
    env.seen = np.frombuffer(bytes(env.names), np.uint8).copy()


def of_its_attributes(env):
    env.mine = vars(env)
    env.put = types.MethodType(lambda self, cell: self.mine.__setitem__("box", [cell]), env)


def of_itself(env):
    env.put = types.MethodType(lambda self, cell: vars(self).__setitem__("box", [cell]), env)


class Names(dict):
    """A dictionary whose entries are read as attributes."""

    def __getattr__(self, name):
        if name not in self:
            raise AttributeError(name)
        return self[name]


def of_a_dictionary(env):
    env.box = Names(cell=0)
    env.put, env.see = (
        types.MethodType(one, env) for one in (lambda self, cell: self.box.update(cell=cell), lambda self: self.box.cell)
    )


def of_a_file(path, mode, load=lambda held: held):
    """One that keeps an array of a file, in memory once it was loaded; the file is there for who only reads."""
    (path / "held").write_bytes(bytes(8))

    def give(env):
        env.held = load(np.memmap(path / "held", np.uint8, mode, shape=(8,)))

    return give


def locked(env):
    env.lock = threading.Lock()


class Leaves(Told):
    """Leaves the lock out of its copies."""

    def __deepcopy__(self, memo):
        made = object.__new__(type(self))
        memo[id(self)] = made
        vars(made).update({name: copy.deepcopy(value, memo) for name, value in vars(self).items() if name != "lock"})
        return made


class Breaks(Told):
    def __deepcopy__(self, memo):
        raise OSError("no more devices")


class BreaksAndIsSet(Breaks, Set):
    pass


class Renews(Corridor):
    """Makes a new generator at each reset, or only for a seed."""

    def __init__(self, always):
        super().__init__()
        self.always, self.rng = always, np.random.default_rng()

    def reset(self, *, seed=None, options=None):
        if self.always or seed is not None:
            self.rng = np.random.default_rng(seed)
        return super().reset(seed=seed)

    def step(self, action):
        return self.moved(int(action) if self.rng.random() < 0.8 else 1 - int(action))


class Late(Told):
    """What cannot be copied comes with a step, or sooner."""

    def __init__(self, sooner=False):
        super().__init__()
        self.sooner = sooner

    def reset(self, *, seed=None, options=None):
        if self.sooner:
            locked(self)
        return super().reset(seed=seed)

    def step(self, action):
        locked(self)
        return super().step(action)


class LateAndSet(Late, Set):
    pass


class Fails(Corridor):
    """Knows its first action only, until it is mended."""

    def __init__(self, known=(0,)):
        super().__init__()
        self.known = known

    def step(self, action):
        return self.moved(self.known[int(action)])


class Crowded(Corridor):
    """Each reset draws one of very many first observations."""

    def __init__(self):
        super().__init__()
        self.observation_space = gym.spaces.Discrete(10**9)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.cell = int(self.np_random.integers(10**9))
        return self.cell, {}

    def step(self, action):
        return self.cell, 0.0, bool(action), False, {}


class Counts(gym.ObservationWrapper):
    """Shows the steps taken, up to a limit that it knows of, beside the cell."""

    def __init__(self, env):
        super().__init__(env)
        self.steps, self.observation_space = 0, gym.spaces.MultiDiscrete([7, 11])

    def reset(self, **options):
        self.steps = -1
        return super().reset(**options)

    def observation(self, observation):
        self.steps += 1
        return np.array([observation, self.steps])
