"""The mends that errors about datasets, and what is read with them, name are executed, and serve."""

import json
import re
import shutil
import sys

import gymnasium as gym
import h5py
import minari
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.wrappers import TransformObservation
from mended import named

import irl_gym.demonstrations.recorded
from irl_gym.demonstrations.datasets import load_minari, minari_root, read_minari, write_minari
from irl_gym.demonstrations.endings import in_table
from irl_gym.demonstrations.imports import from_arrays
from irl_gym.demonstrations.minari_formats import LONGEST_ARROW
from irl_gym.errors import IrlGymError
from irl_gym.mdp.episodes import Episode, empirical_policy
from irl_gym.runs.named_parts import environment_of
from irl_gym.spaces.states import StateIndex
from irl_gym.tables.tabulate import tabulate

ID = "me/lake-v0"
SIXTEEN, ROW = StateIndex(spaces.Discrete(16)), spaces.Sequence(spaces.Discrete(16))
pytestmark = [pytest.mark.usefixtures("unchecked"), pytest.mark.filterwarnings("ignore::UserWarning")]


def lake(**arguments):
    return gym.make("FrozenLake-v1", **({"is_slippery": False} | arguments))


def one(observations=(0, 4, 8), actions=(1, 1), rewards=None, terminated=False):
    paid = np.zeros(len(observations) - 1) if rewards is None else np.array(rewards)
    return Episode(np.array(observations), None if actions is None else np.array(actions), paid, terminated, not terminated)


def write(root, *episodes, name=ID, env=None, **more):
    return write_minari(episodes or [one()], name, lake() if env is None else env, root=root, algorithm="x", **more)


def spaceless(root, n=16):
    return write_minari([one()], "me/log-v0", None, root=root, algorithm="x",
                        observation_space=spaces.Discrete(n), action_space=spaces.Discrete(4))  # fmt: skip


def read(root, name=ID, **how):
    return list(read_minari(name, root=root, **how))


def changed(root, **content):
    path = root / ID / "data" / "metadata.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | content))


OLD = {"name": "Reveal", "entry_point": "irl_gym.reveal:Reveal", "kwargs": {"shown": {"s": 16}}}
"""A wrapper as an earlier version named it."""


def recorded_in(root, **changes):
    """The dataset with other words of where it was recorded."""
    told = json.loads(json.loads((root / ID / "data" / "metadata.json").read_text())["env_spec"])
    changed(root, env_spec=json.dumps(told | changes))


def cut_off(root):
    path = root / ID / "data" / "main_data.hdf5"
    shutil.copytree(root / ID, root.parent / "whole")
    path.write_bytes(path.read_bytes()[:-100])
    return read(root)


def copied(root):
    shutil.rmtree(root / ID)
    shutil.copytree(root.parent / "whole", root / ID)
    return read(root)


def emptied(root):
    changed(root, total_episodes=0, total_steps=0)
    return read(root)


def file_for_root(root):
    return write(root / ID / "data" / "metadata.json")


def by_environment_variable(root):
    with minari_root(root):  # which sets MINARI_DATASETS_PATH
        return load_minari(ID)


class Drawn(gym.Env):
    """Has a space of another's making, or actions of another kind."""

    def __init__(self, observations=None, actions=None):
        self.observation_space = spaces.Discrete(16) if observations is None else observations
        self.action_space = spaces.Discrete(4) if actions is None else actions


def registered(entry_point):
    return gym.make(gym.envs.registration.EnvSpec("Local-v0", entry_point=entry_point))


def continuous(root):
    path, env = root / "me/push-v0/data", Drawn(actions=spaces.Box(-1, 1, (1,)))
    path.mkdir(parents=True)
    storage = minari.dataset.minari_storage.MinariStorage.new(path, env.observation_space, env.action_space, data_format="hdf5")
    buffer = minari.data_collector.EpisodeBuffer(
        id=0, observations=[0, 4], actions=[np.array([0.3], np.float32)], rewards=[0.0], terminations=[False],
        truncations=[True], infos={},
    )  # fmt: skip
    storage.update_episodes([buffer])
    storage.update_metadata({"dataset_id": "me/push-v0", "minari_version": minari.__version__})
    return read(root, "me/push-v0")


def numbered(root):
    with minari_root(root):
        found = list(minari.load_dataset("me/push-v0").iterate_episodes())
    return from_arrays([one.observations for one in found], [np.digitize(one.actions[:, 0], [-0.5, 0, 0.5]) for one in found],
                       space=spaces.Discrete(16), n_actions=4)  # fmt: skip


def goes_on(root):
    with h5py.File(root / ID / "data" / "main_data.hdf5", "r+") as file:
        file["episode_0/terminations"][0] = True
    return read(root)


def lacks_a_flag(root):
    with h5py.File(root / ID / "data" / "main_data.hdf5", "r+") as file:
        del file["episode_0/rewards"]
        file["episode_0/rewards"] = np.zeros(1)
    return read(root)


def paid_nan(root):
    return write(root, one(), one(rewards=[np.nan, 0]), name="me/nan-v0") and read(root, "me/nan-v0")


TABLE = tabulate(lake(), gamma=0.9)
LONG = one([0] * (LONGEST_ARROW + 1), [0] * LONGEST_ARROW)
JUMPS = one((0, 4, 9, 10), None)
IN_AN_END = [one([0, 4, 5, 5], [1, 2, 2])]


def lacks_a_package(root):
    gym.register("Late-v0", entry_point="late_package:Drawn")
    recorded_in(root, id="Late-v0", kwargs={})
    return environment_of(None, {}, ID, str(root))


def installed(root):
    sys.modules["late_package"] = sys.modules[__name__]
    return read(root, env=environment_of(None, {}, ID, str(root)))


CASES = [
    # datasets
    ("Copy or download it again,", cut_off, copied),
    ("or record it anew under another id.", cut_off, lambda root: write(root, name="me/lake-v1") and read(root, "me/lake-v1")),
    ("Give observation_space.",
     lambda root: write_minari([one()], "me/log-v0", None, root=root, algorithm="x", action_space=spaces.Discrete(4)),
     spaceless),
    ("is no folder: expected Minari's root, under which 'me/lake-v0' is. Name another.",
     lambda root: read(root / "nothing"), read),
    ("expected a folder, or a place for one", file_for_root, lambda root: write(root / "another")),
    ("Name one of these: me/lake-v0;", lambda root: read(root, "me/lakes-v0"), lambda root: read(root, "me/lake-v0")),
    ("or the root folder that it is under,",
     lambda root: write(root / "other", name="me/sea-v0") and read(root, "me/sea-v0"),
     lambda root: read(root / "other", "me/sea-v0")),
    ("or set MINARI_DATASETS_PATH to that.", lambda root: load_minari(ID, root=root.parent), by_environment_variable),
    ("Read it with Minari, give each action a number, and the episodes to `irl_gym.demonstrations.imports.from_arrays`.",
     continuous, numbered),
    ("Give the states of that environment's table,",
     lambda root: read(root, states=StateIndex(spaces.Discrete(64))), lambda root: read(root, states=TABLE.states)),
    ("or the dataset of another.",
     lambda root: read(root, states=StateIndex(spaces.Discrete(64))),
     lambda root: write(root, env=lake(map_name="8x8"), name="me/large-v0") and
         read(root, "me/large-v0", states=StateIndex(spaces.Discrete(64)))),
    ("Record some, or name another.", emptied, lambda root: write(root, name="me/lake-v1") and read(root, "me/lake-v1")),
    ("Leave --env-id and --env-kwargs out;",
     lambda root: read(root, env=lake(is_slippery=True)), lambda root: read(root, env=environment_of(None, {}, ID, str(root)))),
    ("in Python, make the environment with `irl_gym.demonstrations.recorded.recorded_environment(dataset)`.",
     lambda root: read(root, env=lake(is_slippery=True)),
     lambda root: read(root, env=irl_gym.demonstrations.recorded.recorded_environment(load_minari(ID, root=root)))),
    ("Name the one that it was recorded in,",
     lambda root: spaceless(root) and read(root, "me/log-v0", env=lake(map_name="8x8")),
     lambda root: read(root, "me/log-v0", env=lake())),
    ("or one with its spaces.",
     lambda root: spaceless(root) and read(root, "me/log-v0", env=lake(map_name="8x8")),
     lambda root: read(root, "me/log-v0", env=Drawn())),
    # minari_files, minari_formats
    ("Ask for the next version, such as -v1.", write, lambda root: write(root, name="me/lake-v1")),
    ("Choose another for 'me/lake-v0/more-v0'.",
     lambda root: write(root, name="me/lake-v0/more-v0"), lambda root: write(root, name="me/more-v0")),
    ("Wrap the environment in one that shows Box, Discrete, MultiDiscrete, MultiBinary, Text, Tuple or Dict.",
     lambda root: write(root, env=Drawn(ROW), name="me/a-v0"),
     lambda root: write(root, env=TransformObservation(Drawn(ROW), len, SIXTEEN.space), name="me/a-v0")),
    ("Register it with entry_point='module:Class';",
     lambda root: write(root, env=registered(lambda: Drawn()), name="me/a-v0"),
     lambda root: write(root, env=registered(f"{__name__}:Drawn"), name="me/a-v0")),
    ("or give env=None and the two spaces, and the dataset will not say where it was recorded.",
     lambda root: write(root, env=registered(lambda: Drawn()), name="me/a-v0"),
     spaceless),
    ("Choose hdf5.",
     lambda root: write(root, LONG, name="me/long-v0", data_format="arrow"), lambda root: write(root, LONG, name="me/long-v0")),
    # endings
    ("Pass after_end='cut' (--after-end cut) to leave out what follows an end.",
     goes_on, lambda root: read(root, after_end="cut")),
    ("Pass after_end='cut' (--after-end cut) to keep its first 1 steps,",
     lacks_a_flag, lambda root: read(root, after_end="cut")),
    ("or leave it out.", lacks_a_flag, lambda root: write(root, one(), name="me/lake-v1") and read(root, "me/lake-v1")),
    ("Write the dataset without that episode,",
     paid_nan, lambda root: write(root, one(), name="me/nan-v1") and read(root, "me/nan-v1")),
    ("or with 0.0 where rewards are not known.",
     paid_nan, lambda root: write(root, one(), one(rewards=[0.0, 0]), name="me/nan-v1") and read(root, "me/nan-v1")),
    ("Pass after_end='cut' (--after-end cut) to end the episode there.",
     lambda _: list(in_table(IN_AN_END, TABLE.mdp, TABLE.states, "refuse")),
     lambda _: list(in_table(IN_AN_END, TABLE.mdp, TABLE.states, "cut"))),
    # demonstrations
    ("Leave the episode out,",
     lambda _: list(in_table([JUMPS], TABLE.mdp, TABLE.states, "refuse")),
     lambda _: list(in_table([one(actions=None)], TABLE.mdp, TABLE.states, "refuse"))),
    ("or cut it into two there.",
     lambda _: list(in_table([JUMPS], TABLE.mdp, TABLE.states, "refuse")),
     lambda _: list(in_table([one((0, 4), None), one((9, 10), None)], TABLE.mdp, TABLE.states, "refuse"))),
    ("Read Minari datasets with `read_minari(dataset)`,",
     lambda root: empirical_policy(load_minari(ID, root=root), SIXTEEN, 4),
     lambda root: empirical_policy(read_minari(load_minari(ID, root=root)), SIXTEEN, 4)),
    ("and other data with `irl_gym.demonstrations.imports`.",
     lambda root: empirical_policy([([0, 4], [1])], SIXTEEN, 4),
     lambda root: empirical_policy(from_arrays([[0, 4]], [[1]], env=lake()), SIXTEEN, 4)),
    ("Cut the episode where it ended.",
     lambda _: Episode(np.array([0, 4, 5]), np.array([1, 2]), np.zeros(2), np.array([False, True]), False),
     lambda _: Episode(np.array([0, 4, 5]), np.array([1, 2]), np.zeros(2), True, False)),
    # recorded
    ("Name one with --env-id.",
     lambda root: spaceless(root) and environment_of(None, {}, "me/log-v0", str(root)),
     lambda root: read(root, "me/log-v0", env=environment_of("FrozenLake-v1", {}, "me/log-v0", str(root)))),
    ("or name an environment with --env-id, as module:id;",
     lambda root: recorded_in(root, id="Nobody-v7") or environment_of(None, {}, ID, str(root)),
     lambda root: read(root, env=environment_of("gymnasium:FrozenLake-v1", {}, ID, str(root)))),
    ("Name it yourself, with --env-id and --env-kwargs;",
     lambda root: recorded_in(root, kwargs={"map_name": "4x4:"}) or environment_of(None, {}, ID, str(root)),
     lambda root: environment_of("FrozenLake-v1", {"map_name": "4x4"}, ID, str(root))),
    ("Install or import the package that registers it,", lacks_a_package, installed),
    ("or name an environment with --env-id.",
     lacks_a_package, lambda root: environment_of("FrozenLake-v1", {}, ID, str(root))),
    ("Put that in its place in data/metadata.json.",
     lambda root: recorded_in(root, additional_wrappers=[OLD]) or environment_of(None, {}, ID, str(root)),
     lambda root: recorded_in(root, additional_wrappers=[OLD | {"entry_point": "irl_gym.environments.reveal:Reveal"}])
     or environment_of(None, {}, ID, str(root))),
    ("Is it another version? Name an environment with --env-id.",
     lambda root: recorded_in(root, kwargs={"colour": 1}) or environment_of(None, {}, ID, str(root)),
     lambda root: environment_of("FrozenLake-v1", {}, ID, str(root))),
]  # fmt: skip
FILES = [f"{one}.py" for one in ("datasets", "minari_files", "minari_formats", "endings", "mdp/episodes", "dataset_files",
                                 "recorded")]  # fmt: skip
ELSEWHERE = [
    "It comes first, then the policy.",
    "Give a table's, `table.states`.",  # test_mends_of_the_facade, as the next
    "Make one of a table, with `irl_gym.TabularPolicy(irl_gym.mdp.policies.as_distribution(policy, n_states, n_actions), "
    "table.states)`.",
    "Write the dataset anew.",
    "Leave it out.",
]
"""What no writer of ours leaves, which is written anew as in other cases."""


def message(breaks, root):
    with pytest.raises(IrlGymError) as caught:
        breaks(root)
    return str(caught.value)


@pytest.fixture
def root(tmp_path):
    write(tmp_path / "root")
    yield tmp_path / "root"
    gym.registry.pop("Late-v0", None)
    sys.modules.pop("late_package", None)


@pytest.mark.parametrize(("says", "breaks", "mended"), CASES, ids=[one[0] for one in CASES])
def test_a_mend_that_an_error_about_data_names_serves(root, says, breaks, mended):
    assert says in message(breaks, root) and mended(root)


def test_every_mend_that_an_error_about_data_names_is_executed():
    said = " ".join([*(one[0] for one in CASES), *ELSEWHERE])  # so that each part of a mend is a case
    assert not [one for one in named(*FILES) if not re.search(one, said) and "pip" not in one]
