"""The mends that errors about copies and searches of environments name are executed, and serve."""

import pickle
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from enumeration_envs import Board, Corridor, Shows
from gymnasium.wrappers import TimeAwareObservation, TimeLimit
from mended import GAMMA, done, mends, told, unsaid
from mended_envs import (
    Breaks,
    BreaksAndIsSet,
    Counts,
    Crowded,
    Fails,
    Late,
    LateAndSet,
    Leaves,
    OfTheModule,
    Renews,
    Set,
    Told,
    locked,
    of_a_buffer,
    of_a_copy,
    of_a_dictionary,
    of_a_file,
    of_a_function,
    of_its_attributes,
    of_itself,
    of_one,
    of_the_module,
)

import irl_gym
from irl_gym.agents.simulator import Simulator
from irl_gym.features.feature_maps import Functions
from irl_gym.learners.linear_programs.trajectory import TrajectoryLP
from irl_gym.mdp.episodes import collect
from irl_gym.tables.counted.counting import Interaction
from irl_gym.tables.draws.exact_draws import Draws
from irl_gym.tables.enumeration.table import Enumeration

pytestmark = pytest.mark.usefixtures("unchecked")


def table(env, **how):
    return Enumeration(**how).table(env, GAMMA)


def coded(env, **how):
    """What the first mend of a table's error makes."""
    return done(mends(told(lambda: table(env, **how)))[0], env)


def searched(path, **how):
    """A search that was stopped after so many states, gone on with in another environment."""
    told(lambda: table(Board(6), checkpoint=path / "search", max_states=10))
    return table(Board(6), checkpoint=path / "search", **how)


def anew(path, env):
    (path / "search").unlink()
    return table(env, checkpoint=path / "search")


class Turns(Board):
    """Goes another way after it was told to."""

    turned = False

    def step(self, action):
        return super().step((action + self.turned) % 4)


def turned(path, before):
    """A search of one that turned before it went on, or before it began anew."""
    env = Turns(6)
    told(lambda: table(env, checkpoint=path / "search", max_states=10))
    Turns.turned = True
    try:
        before()
        return table(env, checkpoint=path / "search")
    finally:
        Turns.turned = False


def damaged(path):
    (path / "search").write_bytes(b"?")
    return table(Board(6), checkpoint=path / "search")


def stand_in():
    draws, real = Draws(), np.random.default_rng(0)
    return draws, draws.twin(real), real


COUNTED = Counts(TimeLimit(Corridor(), 10))
DICT = Shows(gym.spaces.Dict({"cell": gym.spaces.Discrete(7)}), lambda cell: {"cell": cell})
TIMED = TimeAwareObservation(gym.make("FrozenLake-v1", is_slippery=False), flatten=False, normalize_time=False)


class Ends(gym.Wrapper):
    """Turns the limit into an end."""

    def step(self, action):
        *moved, terminated, truncated, info = self.env.step(action)
        return *moved, terminated or truncated, False, info


ENDS = Ends(TimeLimit(Corridor(), 10))


def counted(env):
    return irl_gym.tabulate(env, gamma=GAMMA, by=Interaction(500), check_steps=0)


class Always:
    """Goes down always, whatever is paid."""

    def plan(self, *_, **__):
        return self

    def predict(self, observations, state=None, episode_start=None, deterministic=False):
        return np.ones(np.shape(observations["obs"]), dtype=np.int64), None


def from_episodes(env):
    """What TrajectoryLP learns where no table can be made."""
    features = Functions(lambda seen: np.asarray(seen["obs"], dtype=float).reshape(-1, 1), 1)
    world = Simulator(env, Always(), GAMMA)
    return TrajectoryLP(features, trajectories=5, horizon=5, max_rounds=1).fit(world, collect(env, Always(), 2, seed=0))


ELSEWHERE = "Show what is hidden ("  # test_table.py: test_nothing_is_hidden_in_the_revealed_fickle_taxi
SET_STATE = "give the environment get_state() and set_state(state)."
CASES = [
    # searches
    ("Raise it, as in `tabulate(env, gamma=..., by=Enumeration(max_states=...))`; with a `checkpoint` file it continues where "
     "it stopped.", lambda path: table(Board(6), max_states=10), lambda path: table(Board(6), max_states=40), searched),
    ("expected the same environment and settings. Name another file, or remove it to begin anew.",
     lambda path: searched(path, seed=1), lambda path: table(Board(6), checkpoint=path / "other", seed=1),
     lambda path: anew(path, Board(6))),
    ("expected the same environment. Name another file, or remove it to begin anew.",
     lambda path: turned(path, lambda: None), lambda path: turned(path, (path / "search").unlink)),
    ("Remove it to begin anew.", damaged, lambda path: anew(path, Board(6))),
    ("expected a file in a folder that exists. Make it.", lambda path: table(Board(3), checkpoint=path / "new" / "search"),
     lambda path: (path / "new").mkdir() or table(Board(3), checkpoint=path / "new" / "search")),
    ("Fix what reset draws, as with `irl_gym.environments.seeded_starts.SeededStarts(env, seeds=(0,))`.",
     lambda path: table(Crowded(), start_runs=300), lambda path: table(coded(Crowded(), start_runs=300))),
    ("It belongs to a search of this process; give the environment its own generator back first.",
     lambda path: pickle.dumps(stand_in()[1]), lambda path: pickle.dumps(stand_in()[2])),
    ("Give the environment its own generator back.",
     lambda path: stand_in()[1].random(), lambda path: stand_in()[2].random()),
    # copies
    ("Make the function a method that uses `self`; or " + SET_STATE, lambda path: table(Told(of_a_function)),
     lambda path: table(Told()), lambda path: table(Set(of_a_function))),
    ("Hold the object, and write vars(...) of it where that is needed; give a dictionary a __getattr__ in the place of "
     "`self.__dict__ = self`; or " + SET_STATE, lambda path: table(Told(of_its_attributes)),
     lambda path: table(Told(of_itself)), lambda path: table(Told(of_a_dictionary)),
     lambda path: table(Set(of_its_attributes))),
    ("Load it in __init__, as by numpy.array(...) of it; open it with mode='r' where it is only read, or 'c' where no other "
     "reads the file; or " + SET_STATE, lambda path: table(Told(of_a_file(path, "w+"))),
     lambda path: table(Told(of_a_file(path, "w+", np.array))), lambda path: table(Told(of_a_file(path, "r"))),
     lambda path: table(Told(of_a_file(path, "c"))), lambda path: table(Set(of_a_file(path, "w+")))),
    ("Mend the environment.", lambda path: table(Fails()), lambda path: table(Fails((0, 1)))),
    ("Keep it in one that __init__ or reset makes; make a function that needs it a method that uses `self`.",
     lambda path: table(OfTheModule(of_the_module)), lambda path: table(Told())),
    ("Count what it does instead, with `irl_gym.tabulate(env, gamma=gamma, "
     "by=irl_gym.tables.counted.counting.Interaction())`; or, in the environment, "
     "make it in __init__, and anew in reset only for a seed.",
     lambda path: table(Renews(True)), lambda path: table(Renews(False)),
     lambda path: irl_gym.tabulate(Renews(True), gamma=GAMMA, by=Interaction(500))),
    ("Hold one of them, and make the other where it is needed; hold a copy of it where neither changes; or " + SET_STATE,
     lambda path: table(Told(of_a_buffer)), lambda path: table(Told(of_one)), lambda path: table(Told(of_a_copy)),
     lambda path: table(Set(of_a_buffer))),
    ("Make it in __init__ or reset, and " + SET_STATE,
     lambda path: table(Late()), lambda path: table(LateAndSet(sooner=True))),
    ("Give it get_state() and set_state(state), or mend its __deepcopy__.",
     lambda path: table(Breaks()), lambda path: table(BreaksAndIsSet()), lambda path: table(Leaves())),
    ("Give Told get_state() and set_state(state), or a __deepcopy__ that leaves this attribute out.",
     lambda path: table(Told(locked)), lambda path: table(Set(locked)), lambda path: table(Leaves(locked))),
    ("Leave out what counts on it.", lambda path: table(COUNTED), lambda path: table(COUNTED.env)),
    ("Enumerate, with `by=None`; leave the wrapper out; or learn from episodes alone, with TrajectoryLP.",
     lambda path: counted(TIMED), lambda path: irl_gym.tabulate(TIMED, gamma=GAMMA, by=None),
     lambda path: counted(TIMED.env), lambda path: from_episodes(TIMED)),
    ("Make it with `normalize_time=False`.", lambda path: table(TimeAwareObservation(TIMED.env, normalize_time=True)),
     lambda path: table(TimeAwareObservation(TIMED.env, normalize_time=False))),
    ("Show it, with `gymnasium.wrappers.TimeAwareObservation(env, flatten=False)`; or leave the wrapper out.",
     lambda path: table(ENDS, revisits=0), lambda path: table(coded(ENDS, revisits=0)), lambda path: table(ENDS.env)),
]  # fmt: skip


@pytest.mark.parametrize(("says", "breaks", "mended"), [(says, breaks, rest) for says, breaks, *rest in CASES],
                         ids=[one[0] for one in CASES])  # fmt: skip
def test_a_mend_that_an_error_about_copies_or_searches_names_serves(tmp_path, says, breaks, mended):
    assert says in told(breaks, tmp_path) and all(each(tmp_path) is not None for each in mended)


def test_every_mend_that_an_error_about_copies_or_searches_names_is_executed():
    root = Path(irl_gym.__file__).parent
    assert not unsaid(
        CASES,
        *(one.relative_to(root) for part in ("copies", "enumeration", "draws") for one in root.glob(f"tables/{part}/*.py")),
    )
