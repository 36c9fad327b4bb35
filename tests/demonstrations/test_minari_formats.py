"""Episodes on disk are what Minari itself would have written, for every kind of observation."""

import h5py
import minari
import numpy as np
import pytest
from gymnasium import spaces
from minari.data_collector import EpisodeBuffer

from irl_gym.demonstrations import minari_formats
from irl_gym.demonstrations.datasets import minari_root, read_minari, write_minari
from irl_gym.errors import InvalidParameter
from irl_gym.mdp.episodes import Episode

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")  # Minari remarks on metadata that is not given
SPACES = {
    "discrete": (spaces.Discrete(5), np.array([0, 4, 2])),
    "box": (spaces.Box(-1, 1, (2,), np.float32), np.array([[0, 1], [0.5, 0], [-1, 1]], dtype=np.float32)),
    "picture": (spaces.Box(0, 255, (40, 40, 3), np.uint8), np.arange(3 * 4800).reshape(3, 40, 40, 3).astype(np.uint8)),
    "multidiscrete": (spaces.MultiDiscrete([2, 3]), np.array([[0, 2], [1, 1], [0, 0]])),
    "dict": (
        spaces.Dict(a=spaces.Discrete(3), b=spaces.Tuple((spaces.Discrete(2), spaces.MultiBinary(2)))),
        {"a": np.array([0, 1, 2]), "b": (np.array([1, 0, 1]), np.array([[0, 1], [1, 1], [0, 0]], dtype=np.int8))},
    ),
}
ACTIONS = spaces.Discrete(4, start=2)


def both(name, data_format, root):
    """The same episode written by Minari and by us; their folders."""
    space, observations = SPACES[name]
    one = Episode(observations, np.array([3, 0]), np.array([0.5, 1.0]), True, False, seed=7)
    kwargs = {"observation_space": space, "action_space": ACTIONS, "data_format": data_format}
    write_minari([one], "our/data-v0", None, root=root, algorithm="x", **kwargs)
    buffer = EpisodeBuffer(
        seed=7, observations=observations, actions=one.actions + 2, rewards=one.rewards,
        terminations=np.array([False, True]), truncations=np.array([False, False]), infos={},
    )  # fmt: skip
    with minari_root(root):
        minari.create_dataset_from_buffers("minari/data-v0", [buffer], jpeg_encoding=False, algorithm_name="x", **kwargs)
    return root / "our" / "data-v0" / "data", root / "minari" / "data-v0" / "data"


def laid_out(path):
    """Everything in an HDF5 file that a reader could tell apart, but for its bytes."""
    found = {}

    def look(name, item):
        found[name] = sorted((key, int(value)) for key, value in item.attrs.items())
        if isinstance(item, h5py.Dataset):
            found[name] = [item.dtype, item.shape, item.chunks, item.maxshape, item[()].tolist()]

    with h5py.File(path) as file:
        file.visititems(look)
    return found


@pytest.mark.parametrize("name", SPACES)
def test_hdf5_is_laid_out_as_minari_does(name, tmp_path):
    ours, theirs = both(name, "hdf5", tmp_path)
    assert laid_out(ours / "main_data.hdf5") == laid_out(theirs / "main_data.hdf5")


@pytest.mark.parametrize("name", SPACES)
def test_arrow_is_minaris_to_the_byte(name, tmp_path):
    ours, theirs = both(name, "arrow", tmp_path)
    for file in ("0/part-0.arrow", "0/metadata.json"):
        assert (ours / file).read_bytes() == (theirs / file).read_bytes()


@pytest.mark.parametrize("data_format", ["hdf5", "arrow"])
@pytest.mark.parametrize("name", SPACES)
def test_observations_of_every_kind_come_back(name, data_format, tmp_path):
    both(name, data_format, tmp_path)
    (one,) = read_minari("our/data-v0", root=tmp_path)
    assert str(one.observations) == str(SPACES[name][1]) and one.actions.tolist() == [3, 0]


def test_a_text_comes_back_from_hdf5(tmp_path):
    one = Episode(np.array(["go", "wörd"]), np.array([0]), np.zeros(1), True, False)
    write_minari(
        [one], "our/text-v0", None, root=tmp_path, algorithm="x", action_space=ACTIONS,
        observation_space=spaces.Text(8, charset="gowördl"),
    )  # fmt: skip
    (again,) = read_minari("our/text-v0", root=tmp_path)
    assert again.observations == ["go", "wörd"]


def test_an_episode_too_long_for_arrow_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(minari_formats, "LONGEST_ARROW", 3)
    with pytest.raises(InvalidParameter, match=r"episode 0 has 3 steps: expected at most 2.*hdf5"):
        write_minari(
            [Episode(np.zeros(4, dtype=int), np.zeros(3, dtype=int), np.zeros(3), True, False)], "our/long-v0", None,
            root=tmp_path, algorithm="x", data_format="arrow", observation_space=ACTIONS, action_space=ACTIONS,
        )  # fmt: skip
    assert not list(tmp_path.iterdir())


def test_the_longest_arrow_episode_is_read_as_one(tmp_path):
    steps = minari_formats.LONGEST_ARROW - 1
    long = Episode(np.zeros(steps + 1, dtype=int), np.zeros(steps, dtype=int), np.zeros(steps), True, False)
    short = Episode(np.zeros(2, dtype=int), np.zeros(1, dtype=int), np.zeros(1), True, False)
    write_minari(
        [long, short], "our/long-v0", None, root=tmp_path, algorithm="x", data_format="arrow", action_space=ACTIONS,
        observation_space=spaces.Discrete(1),
    )  # fmt: skip
    assert [len(one) for one in read_minari("our/long-v0", root=tmp_path)] == [steps, 1]


def test_arrow_without_pyarrow_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(InvalidParameter, match=r'pip install "irl_gym\[data\]"'):
        write_minari(
            [], "our/data-v0", None, root=tmp_path, algorithm="x", data_format="arrow", observation_space=ACTIONS,
            action_space=ACTIONS,
        )  # fmt: skip
