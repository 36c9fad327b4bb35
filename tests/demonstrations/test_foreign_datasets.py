"""Datasets from strangers: nothing outside of them is read, and nothing in them is believed before it was looked at."""

import itertools
import json
import tracemalloc

import gymnasium as gym
import h5py
import numpy as np
import pytest

from irl_gym.demonstrations.datasets import load_minari, read_minari, write_minari
from irl_gym.demonstrations.imports import from_d4rl
from irl_gym.errors import InvalidDemonstrations
from irl_gym.files import archives
from irl_gym.files.arrow_files import check_arrow
from irl_gym.files.hdf5_files import DEEPEST
from irl_gym.mdp.episodes import Episode

ID = "lake-v0"
pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")  # Minari's, about metadata
EPISODES = [Episode(np.array([0, 4, 8]), np.array([1, 1]), np.zeros(2), False, True, seed=i) for i in range(3)]


@pytest.fixture(params=["hdf5", "arrow"])
def root(request, tmp_path):
    """A root with one dataset, in either format."""
    if request.param == "arrow":
        pytest.importorskip("pyarrow")
    write_minari(EPISODES, ID, gym.make("FrozenLake-v1"), root=tmp_path, algorithm="none", data_format=request.param)
    return tmp_path


@pytest.fixture
def hdf5(tmp_path):
    """A root with one dataset, and its file of episodes."""
    write_minari(EPISODES, ID, gym.make("FrozenLake-v1"), root=tmp_path, algorithm="none")
    return tmp_path, tmp_path / ID / "data" / "main_data.hdf5"


@pytest.fixture
def arrow(tmp_path):
    """The same with Arrow, and the folder of its first episode."""
    pytest.importorskip("pyarrow")
    write_minari(EPISODES, ID, gym.make("FrozenLake-v1"), root=tmp_path, algorithm="none", data_format="arrow")
    return tmp_path, tmp_path / ID / "data" / "0"


def soft_link(group):
    group["actions"] = h5py.SoftLink("/episode_1/actions")


def external_link(group):
    group["actions"] = h5py.ExternalLink("other.hdf5", "/secret")


def external_storage(group):
    group.create_dataset("actions", (2,), "i8", external=[("secret.bin", 0, 16)])


def virtual(group):
    layout = h5py.VirtualLayout(shape=(2,), dtype="i8")
    layout[:] = h5py.VirtualSource("other.hdf5", "secret", shape=(2,))
    group.create_virtual_dataset("actions", layout)


def circle(group):
    group["actions"] = group.file["/"]


def second_name(group):
    group["actions"] = group.file["episode_1/actions"]


def reference(group):
    group.create_dataset("actions", data=np.array([group.ref, group.ref], dtype=h5py.ref_dtype), dtype=h5py.ref_dtype)


def compound(group):
    group["actions"] = np.zeros(2, dtype=[("a", "i8")])


def complex_numbers(group):
    group["actions"] = np.zeros(2, dtype=complex)


def opaque(group):
    group.create_dataset("actions", data=np.zeros(2, dtype="V4"))


def a_type(group):
    group["actions"] = np.dtype("f8")


def nothing(group):
    group["actions"] = h5py.Empty("i8")


def bomb(group):
    group.create_dataset("actions", (10**12,), "i8", chunks=(1000,), compression="gzip")


def deep(group):
    for _ in range(DEEPEST):
        group = group.create_group("more")


DAMAGE = {
    soft_link: "is a link to something else", external_link: "is a link to something else",
    external_storage: "numbers in other files", virtual: "numbers in other files", circle: "leads back to an object",
    second_name: "leads back to an object", reference: "neither numbers", compound: "neither numbers",
    complex_numbers: "neither numbers", opaque: "neither numbers", a_type: "is a type", nothing: "neither numbers",
    bomb: "declares 8,000,000,0", deep: "deeper than 32",
}  # fmt: skip


@pytest.mark.parametrize(("damage", "says"), DAMAGE.items())
def test_a_tree_that_no_dataset_has_is_refused_before_it_is_read(hdf5, damage, says):
    root, path = hdf5
    (path.parent / "secret.bin").write_bytes(bytes(16))
    with h5py.File(path, "a") as file:
        del file["episode_2/actions"]
        damage(file["episode_2"])
    tracemalloc.start()
    with pytest.raises(InvalidDemonstrations, match=f"cannot be read .*{says}"):
        next(iter(read_minari(ID, root=root)))
    assert tracemalloc.get_traced_memory()[1] < 20_000_000
    tracemalloc.stop()


@pytest.mark.parametrize("damage", [external_link, external_storage, bomb, reference])
def test_a_tree_that_no_d4rl_file_has_is_refused_before_it_is_read(tmp_path, damage):
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        file["observations"], file["terminals"] = np.zeros(2, dtype=int), np.array([False, True])
        damage(file)
    with pytest.raises(InvalidDemonstrations, match=f"cannot be read .*{DAMAGE[damage]}"):
        from_d4rl(tmp_path / "a.hdf5", env=gym.make("FrozenLake-v1"))


def test_files_that_are_links_out_of_the_dataset_are_refused(root):
    data, outside = root / ID / "data", root / "outside"
    name = "main_data.hdf5" if (data / "main_data.hdf5").exists() else "0/part-0.arrow"
    (data / name).rename(outside)
    (data / name).symlink_to(outside)
    with pytest.raises(InvalidDemonstrations, match="leads out of the dataset's folder"):
        next(iter(read_minari(ID, root=root)))


def test_metadata_that_are_a_link_out_of_the_dataset_are_refused(root):
    data = root / ID / "data"
    (data / "metadata.json").rename(root / "outside.json")
    (data / "metadata.json").symlink_to(root / "outside.json")
    with pytest.raises(InvalidDemonstrations, match="leads out of the dataset's folder"):
        load_minari(ID, root=root)


def test_a_folder_of_an_episode_that_is_a_link_out_of_the_dataset_is_refused(arrow):
    root, folder = arrow
    folder.rename(root / "outside")
    folder.symlink_to(root / "outside")
    with pytest.raises(InvalidDemonstrations, match="leads out of the dataset's folder"):
        next(iter(read_minari(ID, root=root)))


def test_a_dataset_that_is_itself_a_link_of_the_users_is_read(root):
    (root / ID).rename(root / "elsewhere")
    (root / ID).symlink_to(root / "elsewhere")
    assert len(list(read_minari(ID, root=root))) == 3


HOSTILE = [10**400, -1, 1e300, float("nan"), None, True, "x", [], {}, [[]], {"type": "Box"}]


NAMES = ["total_episodes", "observation_space", "action_space", "data_format", "minari_version", "dataset_id", "env_spec"]
FINE = [("env_spec", None), ("dataset_id", "x")]


@pytest.mark.parametrize(("name", "value"), [one for one in itertools.product(NAMES, HOSTILE) if one not in FINE])
def test_metadata_that_no_dataset_has_are_refused(root, name, value):
    path = root / ID / "data" / "metadata.json"
    told = json.loads(path.read_text())
    path.write_text(json.dumps({**told, name: value}))
    with pytest.raises(InvalidDemonstrations, match="cannot be read"):
        load_minari(ID, root=root)


@pytest.mark.parametrize("name", ["total_episodes", "observation_space", "action_space", "data_format", "minari_version"])
def test_metadata_without_what_every_dataset_says_are_refused(root, name):
    path = root / ID / "data" / "metadata.json"
    told = json.loads(path.read_text())
    del told[name]
    path.write_text(json.dumps(told))
    with pytest.raises(InvalidDemonstrations, match=f"cannot be read .*{name}"):
        load_minari(ID, root=root)


@pytest.mark.parametrize("text", ["[" * 100_000, "", "3", "\x00", '{"total_episodes": ' + "9" * 5000 + "}"])
def test_metadata_that_are_no_json_are_refused(root, text):
    (root / ID / "data" / "metadata.json").write_text(text)
    with pytest.raises(InvalidDemonstrations, match="cannot be read"):
        load_minari(ID, root=root)


def test_more_episodes_than_the_files_have_room_for_are_refused(root):
    path = root / ID / "data" / "metadata.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "total_episodes": 10**12}))
    with pytest.raises(InvalidDemonstrations, match="for which it has no room"):
        load_minari(ID, root=root)


@pytest.mark.parametrize(
    ("part", "values", "says"),
    [
        ("actions", np.array([1, 4]), r"step 1 has action 4, which is not of Discrete\(4\)"),
        ("actions", np.array([1, -1]), "step 1 has action -1"),
        ("actions", np.array([1.0, 1.5]), "dtype float64, and no whole numbers"),
        ("rewards", np.array(["a", "b"], dtype=object), "and no numbers"),
        ("observations", np.array([0.0, np.nan, 1.0]), "which are not of Discrete"),
        ("observations", np.zeros((3, 2), dtype=int), r"shape \(3, 2\)"),
    ],
)
def test_an_episode_that_is_not_of_the_datasets_spaces_is_refused(hdf5, part, values, says):
    root, path = hdf5
    with h5py.File(path, "a") as file:
        del file[f"episode_1/{part}"]
        file[f"episode_1/{part}"] = values
    with pytest.raises(InvalidDemonstrations, match=f"episode 1.*{says}"):
        list(read_minari(ID, root=root))


@pytest.mark.parametrize("seed", [np.inf, -3.0, 1.5, "7", [1, 2], True])
def test_a_seed_that_is_none_is_refused(hdf5, seed):
    root, path = hdf5
    with h5py.File(path, "a") as file:
        file["episode_1"].attrs["seed"] = seed
    with pytest.raises(InvalidDemonstrations, match=r"cannot be read .*episode 1 has the seed .*, and no whole number"):
        list(read_minari(ID, root=root))


def test_a_whole_seed_that_is_a_float_or_missing_is_taken(hdf5):
    root, path = hdf5
    with h5py.File(path, "a") as file:
        file["episode_0"].attrs["seed"] = 7.0
        del file["episode_1"].attrs["seed"]
    assert [one.seed for one in read_minari(ID, root=root)] == [7, None, 2]


def test_arrow_whose_places_lead_outside_is_refused(arrow):
    import pyarrow as pa

    root, folder = arrow
    batch = pa.RecordBatch.from_arrays([pa.array([[1], [2], [3]])], names=["observations"])
    with pa.OSFile(str(folder / "part-0.arrow"), "wb") as file, pa.ipc.new_file(file, batch.schema) as writer:
        writer.write_batch(batch)
    places, outside = (np.array([0, 1, 2, last], dtype=np.int32).tobytes() for last in (3, 10**6))
    (folder / "part-0.arrow").write_bytes((folder / "part-0.arrow").read_bytes().replace(places, outside))
    with pytest.raises(InvalidDemonstrations, match=r"part-0\.arrow is damaged"):
        next(iter(read_minari(ID, root=root)))


@pytest.mark.parametrize("packing", ["zstd", "lz4"])
def test_arrow_that_declares_more_than_it_can_hold_is_refused_before_it_is_unpacked(arrow, monkeypatch, packing):
    import pyarrow as pa

    root, folder = arrow
    batch = pa.RecordBatch.from_arrays([pa.array(np.zeros(1_000_000))], names=["observations"])
    options = pa.ipc.IpcWriteOptions(compression=packing)
    with pa.OSFile(str(folder / "part-0.arrow"), "wb") as file, pa.ipc.new_file(file, batch.schema, options=options) as writer:
        writer.write_batch(batch)
    monkeypatch.setattr(archives, "FREE", 1 << 10)
    with pytest.raises(InvalidDemonstrations, match="declares 8,000,000: expected at most"):
        next(iter(read_minari(ID, root=root)))


def test_packed_arrow_in_proportion_is_no_damage(tmp_path):
    pa = pytest.importorskip("pyarrow")
    words = pa.array(["a", "b"] * 50).dictionary_encode()
    batch = pa.RecordBatch.from_arrays([words, pa.array(range(100))], names=["words", "numbers"])
    options = pa.ipc.IpcWriteOptions(compression="zstd")
    with pa.OSFile(str(tmp_path / "a.arrow"), "wb") as file, pa.ipc.new_file(file, batch.schema, options=options) as writer:
        writer.write_batch(batch)
    check_arrow(tmp_path / "a.arrow")
