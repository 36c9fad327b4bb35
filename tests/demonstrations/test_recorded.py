"""The environment of a dataset is made by its id alone: what else a file names is neither imported nor called, but named."""

import inspect
import json
import sys

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces

from irl_gym.demonstrations.datasets import load_minari, write_minari
from irl_gym.demonstrations.recorded import OF_GYMNASIUM, recorded_environment
from irl_gym.errors import InvalidDemonstrations, NotTrusted, UnknownEnvironment
from irl_gym.mdp.episodes import Episode
from irl_gym.runs.experiment import Experiment
from irl_gym.runs.named_parts import environment_of

ID = "their/data-v0"
LAKE = {"map_name": "4x4", "is_slippery": True}
# Minari remarks on metadata that these tests leave at their defaults.
pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")


@pytest.fixture
def evil(tmp_path, monkeypatch):
    """A module that leaves a mark where it is imported, or one of its names is called; the mark."""
    mark = tmp_path / "mark"
    write = f"open({str(mark)!r}, 'a').write"
    (tmp_path / "evil_names.py").write_text(f"{write}('imported')\ndef call(*given, **named):\n    {write}('called')\n")
    monkeypatch.syspath_prepend(tmp_path)
    yield mark
    sys.modules.pop("evil_names", None)


@pytest.fixture
def dataset(tmp_path):
    """A dataset as a stranger makes it: of FrozenLake, but for what its spec says."""

    def make(**changes):
        env = gym.make("FrozenLake-v1")
        episode = Episode(np.array([0, 0]), np.array([0]), np.zeros(1), False, True)
        write_minari([episode], ID, env, root=tmp_path, algorithm="x")
        path = tmp_path / ID / "data" / "metadata.json"
        content = json.loads(path.read_text())
        spec = json.loads(content["env_spec"]) | {"kwargs": LAKE} | changes.pop("spec", {})
        path.write_text(json.dumps({key: one for key, one in content.items() if key not in changes.get("without", ())}
                                   | {"env_spec": json.dumps(spec)}))  # fmt: skip
        return load_minari(ID, root=tmp_path)

    return make


def wrapper(entry_point, **kwargs):
    return {"additional_wrappers": [{"name": "Theirs", "entry_point": entry_point, "kwargs": kwargs}]}


def test_an_entry_point_is_not_called_and_the_error_shows_it(dataset, tmp_path):
    command = f"touch {tmp_path / 'mark'}"
    found = dataset(spec={"id": "Theirs-v0", "entry_point": "os:system", "kwargs": {"command": command}})
    with pytest.raises(UnknownEnvironment, match=r"Theirs-v0', which is not registered.*os:system.*touch.*--trust-dataset"):
        recorded_environment(found)
    assert not (tmp_path / "mark").exists()


def test_the_module_of_an_id_is_not_imported(dataset, evil):
    with pytest.raises(UnknownEnvironment, match="evil_names:Theirs-v0"):
        recorded_environment(dataset(spec={"id": "evil_names:Theirs-v0", "entry_point": "evil_names:call"}))
    assert not evil.exists()


def test_what_is_registered_here_is_made_whatever_the_entry_point_says(dataset, evil):
    found = dataset(spec={"entry_point": "evil_names:call", "vector_entry_point": "evil_names:call"})
    env = recorded_environment(found)
    assert type(env.unwrapped).__name__ == "FrozenLakeEnv" and env.spec.vector_entry_point is None and not evil.exists()


@pytest.mark.parametrize("entry_point", ["evil_names:call", "gymnasium.wrappers.vector:RecordVideo", "evil_names", 7])
def test_a_wrapper_that_is_not_known_is_refused_by_name(dataset, evil, entry_point):
    with pytest.raises(NotTrusted, match=f"the wrapper '?{entry_point}.*Nothing was run"):
        recorded_environment(dataset(spec=wrapper(entry_point)))
    assert not evil.exists()


@pytest.mark.parametrize("entry_point", ["irl_gym.reveal:Reveal", "irl_gym.starts:SeededStarts"])
def test_a_wrapper_of_an_older_irl_gym_is_told_with_what_it_is_called_here(dataset, entry_point):
    called = rf"irl_gym\.environments\.\w+:{entry_point.partition(':')[2]}"
    with pytest.raises(UnknownEnvironment, match=rf"'{entry_point}', of another version of irl_gym: expected {called}"):
        recorded_environment(dataset(spec=wrapper(entry_point)))


def test_a_wrapper_of_gymnasium_is_taken_from_gymnasium_whatever_module_the_file_names(dataset):
    env = recorded_environment(dataset(spec=wrapper("gymnasium.wrappers.evil:ClipReward", min_reward=0.0, max_reward=0.5)))
    assert type(env) is gym.wrappers.ClipReward


@pytest.mark.parametrize("entry_point", ["gymnasium.wrappers.transform_reward:TransformReward", "gymnasium.wrappers:os"])
def test_a_wrapper_of_gymnasium_that_takes_a_function_is_refused(dataset, entry_point):
    with pytest.raises(NotTrusted, match="the wrapper"):
        recorded_environment(dataset(spec=wrapper(entry_point, func="os:system")))


def test_a_wrapper_that_only_watches_is_left_out_so_that_no_video_is_written(dataset, tmp_path):
    video = {"name": "RecordVideo", "entry_point": "gymnasium.wrappers.rendering:RecordVideo",
             "kwargs": {"video_folder": str(tmp_path / "videos")}}  # fmt: skip
    env = recorded_environment(dataset(spec={"additional_wrappers": [video]}))
    assert env.spec.additional_wrappers == () and not (tmp_path / "videos").exists()


@pytest.mark.parametrize(("asked", "made"), [("human", None), ("rgb_array", "rgb_array")])
def test_no_window_is_opened_on_a_files_word(dataset, asked, made):
    assert recorded_environment(dataset(spec={"kwargs": {**LAKE, "render_mode": asked}})).render_mode == made


def test_no_wrapper_that_a_file_may_ask_for_takes_a_function():
    for name in OF_GYMNASIUM & set(dir(gym.wrappers)):
        kinds = inspect.signature(getattr(gym.wrappers, name)).parameters.values()
        assert not [one for one in kinds if "Callable" in str(one.annotation)], name


@pytest.mark.parametrize("value", ["a/b.xml", "os:system", "..\\x", ["SF", {"deep": "os:system"}], {"os:system": 1}])
def test_an_argument_that_may_name_a_module_or_a_file_is_refused_by_name(dataset, value):
    with pytest.raises(NotTrusted, match=r"with the argument 'desc', which may name.*--env-id and --env-kwargs"):
        recorded_environment(dataset(spec={"kwargs": {"desc": value}}))


def test_an_argument_that_is_registered_so_here_is_plain(dataset, monkeypatch):
    spec = gym.registry["FrozenLake-v1"]
    monkeypatch.setitem(gym.registry, "Filed-v0", gym.envs.registration.EnvSpec(
        "Filed-v0", lambda desc: gym.make(spec).unwrapped, kwargs={"desc": "maps/a"}))  # fmt: skip
    assert recorded_environment(dataset(spec={"id": "Filed-v0", "kwargs": {"desc": "maps/a"}}))


def test_what_would_have_been_run_cannot_write_on_the_terminal(dataset):
    found = dataset(spec=wrapper("evil_names:call", text="\x1b[2J\n\u202e[red]"))
    with pytest.raises(NotTrusted) as refused:
        recorded_environment(found)
    assert str(refused.value).isascii() and str(refused.value).isprintable()


@pytest.mark.parametrize("missing", ["observation_space", "action_space"])
def test_opening_a_dataset_without_its_spaces_makes_nothing(dataset, evil, missing):
    with pytest.raises(InvalidDemonstrations, match=f"no {missing} in its metadata.json"):
        dataset(spec={"entry_point": "evil_names:call"}, without=[missing])
    assert not evil.exists()


@pytest.mark.parametrize("kwargs", [[1], "os:system", 7])
def test_arguments_that_are_no_names_and_values_are_refused_when_it_is_opened(dataset, kwargs):
    with pytest.raises(InvalidDemonstrations, match="expected names and values"):
        dataset(spec={"kwargs": kwargs})


def test_who_trusts_a_dataset_gets_what_it_names(dataset, evil, tmp_path):
    dataset(spec={"id": "Theirs-v0", "entry_point": "evil_names:call", "kwargs": {}})
    with pytest.raises(Exception, match="inherit from the gymnasium"):  # what it made is no environment
        environment_of(None, {}, ID, str(tmp_path), trust_dataset=True)
    assert evil.read_text() == "importedcalled"


def test_our_own_environments_need_not_be_imported_first(tmp_path, monkeypatch):
    env = gym.make("irl_gym_envs:irl_gym/GridWorld-v0", size=4)
    episode = Episode(np.array([0, 0]), np.array([0]), np.zeros(1), False, True)
    write_minari([episode], ID, env, root=tmp_path, algorithm="x")
    ours = [key for key in gym.registry if key.startswith("irl_gym/")]
    modules = [key for key in sys.modules if key == "irl_gym_envs"]
    with monkeypatch.context() as patch:
        for key in ours:
            patch.delitem(gym.registry, key)
        for key in modules:
            patch.delitem(sys.modules, key)
        assert recorded_environment(load_minari(ID, root=tmp_path)).spec.kwargs["size"] == 4


def test_trust_is_part_of_an_experiment_only_where_it_is_given():
    one, other = (Experiment(None, 0.9, dataset=ID, trust_dataset=trust) for trust in (True, False))
    assert one.to_json()["trust_dataset"] is True and "trust_dataset" not in other.to_json()


def test_a_dataset_of_spaces_alone_needs_no_trust(tmp_path):
    episode = Episode(np.array([0, 0]), np.array([0]), np.zeros(1), False, True)
    both = {"observation_space": spaces.Discrete(16), "action_space": spaces.Discrete(4)}
    write_minari([episode], ID, None, root=tmp_path, algorithm="x", **both)
    assert environment_of("FrozenLake-v1", {}, ID, str(tmp_path)).spec.id == "FrozenLake-v1"
