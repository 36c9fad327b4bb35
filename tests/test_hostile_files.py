"""What the fuzz driver found, one small input a kind; `tests/fuzz` looks for more."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from fuzz.experts import write_experts
from fuzz.readers import write_linear, write_path, write_search
from gymnasium import spaces

from irl_gym.agents.experts import load_expert
from irl_gym.demonstrations.imports import from_arrays, from_rollouts
from irl_gym.demonstrations.shards import Shards
from irl_gym.errors import (
    InvalidDemonstrations,
    InvalidFeatures,
    InvalidParameter,
    InvalidPolicy,
    InvalidReward,
    RunConflict,
    UnknownObservation,
)
from irl_gym.features.bases import Fourier, Polynomial, RadialBasis
from irl_gym.features.linear_reward import LinearReward
from irl_gym.files.archives import read_arrays
from irl_gym.judging.ambiguity.lambda_path import LambdaPath
from irl_gym.mdp.episodes import Episode
from irl_gym.runs.choices import parse_keywords
from irl_gym.tables.enumeration.explored import load_explored

INTO = {"space": spaces.Discrete(16), "n_actions": 4}


def change(path, **arrays):
    """Put other arrays into an archive."""
    np.savez(path, **{**read_arrays(path), **arrays})


def header(path, **values):
    told = json.loads(str(read_arrays(path)["header"]))
    change(path, header=np.array(json.dumps({**told, **values})))


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    folder = tmp_path_factory.mktemp("kept")
    write_path(folder)
    return (folder / "path.npz").read_bytes()


@pytest.mark.parametrize(
    ("arrays", "says"),
    [
        ({"breakpoints": np.zeros(2)}, "breakpoints of shape"), ({"l1_norms": np.array(0.5)}, "of shape"),
        ({"rewards": np.zeros((0, 5, 0))}, "of shape"), ({"gaps": np.array("x")}, "gaps of shape"),
        ({"total_margins": np.array([])}, "total_margins of shape"),
    ],
)  # fmt: skip
def test_a_lambda_path_whose_arrays_do_not_fit_together_is_refused(kept, tmp_path, arrays, says):
    (tmp_path / "path.npz").write_bytes(kept)
    change(tmp_path / "path.npz", **arrays)
    with pytest.raises(InvalidReward, match=says):
        LambdaPath.load(tmp_path / "path.npz")


@pytest.mark.parametrize(
    ("name", "value"), [("gap", [1]), ("r_max", 10**400), ("solves", "x"), ("whole", 3), ("violation", {})]
)
def test_a_lambda_path_with_a_number_that_is_none_is_refused(kept, tmp_path, name, value):
    (tmp_path / "path.npz").write_bytes(kept)
    header(tmp_path / "path.npz", **{name: value})
    with pytest.raises(InvalidReward, match=name):
        LambdaPath.load(tmp_path / "path.npz")


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("parents", [-1, 1], "its parents hold 1"), ("parents", [-1, 7], "its parents hold 7"),
        ("successors", [0, 1, -2], "its successors hold -2"), ("successors", [0, 9, -1], "its successors hold 9"),
        ("probabilities", [0.5, np.nan, 1], "its probabilities hold nan"), ("rewards", [0, np.inf, 0], "its rewards hold inf"),
        ("first_line", [0, 9], "its first_line hold 9"), ("first_line", [1, 3], "first_line does not fit"),
        ("script_lengths", [0, 0], "scripts does not fit"), ("actions", [-1, 2], "its actions hold 2"),
        ("states", [[0], [0]], "stands in it twice"), ("rows", [0.5, 0, 0], "its rows have shape"),
        ("start_numbers", [5], "its start_numbers hold 5"), ("sampled", [99], "its sampled hold 99"),
    ],
)  # fmt: skip
def test_a_search_with_a_number_that_numbers_nothing_is_refused(tmp_path, name, value, says):
    write_search(tmp_path)
    path = tmp_path / "search.npz"
    change(path, **{name: np.array(value)})
    with pytest.raises(RunConflict, match=says):
        load_explored(path, spaces.Discrete(3), 2, {"seed": 0})


def test_a_search_with_a_state_outside_the_space_is_refused(tmp_path):
    write_search(tmp_path)
    change(tmp_path / "search.npz", states=np.array([[0], [3]]))
    with pytest.raises(RunConflict, match=r"observation 3 is outside Discrete\(3\)") as told:
        load_explored(tmp_path / "search.npz", spaces.Discrete(3), 2, {"seed": 0})
    assert isinstance(told.value.__cause__, UnknownObservation)


@pytest.mark.parametrize(
    "features",
    [
        lambda: Fourier([0] * 40, [1] * 40, 3), lambda: Polynomial([0] * 40, [1] * 40, 40), lambda: Fourier([0], [1], 10**12),
        lambda: RadialBasis.grid([0], [1], 2**63 - 1),
    ],
)  # fmt: skip
def test_more_features_than_memory_holds_are_refused_before_they_are_made(features):
    with pytest.raises(InvalidFeatures, match="more than 1,000,000 features"):
        features()


def test_a_linear_reward_whose_file_asks_for_more_features_is_refused(tmp_path):
    write_linear(tmp_path)
    path = tmp_path / "fourier.npz"
    features = json.loads(str(read_arrays(path)["header"]))["features"]
    features["fields"]["order"] = 10**12
    header(path, features=features)
    with pytest.raises(InvalidReward, match="more than 1,000,000 features"):
        LinearReward.load(path)


def test_an_expert_with_a_negative_action_is_refused_without_a_table_of_all_actions(tmp_path):
    write_experts(tmp_path)
    change(tmp_path / "actions.npz", actions=np.array([2**62, -1]))
    with pytest.raises(InvalidPolicy, match=r"policy\[s=1\] is action -1"):
        load_expert(tmp_path / "actions.npz")


@pytest.mark.parametrize(
    ("name", "value"), [("lengths", [9]), ("lengths", [-1]), ("lengths", [2**62, 2**62]), ("actions", [1.5] * 2), ("seeds", [])]
)
def test_a_shard_whose_columns_do_not_fit_together_is_set_aside(tmp_path, name, value):
    episode = Episode(np.array([0, 1, 2]), np.array([0, 1]), np.zeros(2), True, False)
    Shards(tmp_path / "shards", spaces.Discrete(3)).append([episode])
    change(tmp_path / "shards" / "000000.npz", **{name: np.array(value)})
    assert Shards(tmp_path / "shards", spaces.Discrete(3)).n_episodes == 0
    assert (tmp_path / "shards" / "000000.npz.damaged").exists()


@pytest.mark.parametrize("text", ["a=" + "[" * 100_000, '{"a": ' + "[" * 100_000, '{"a": ' + "9" * 5_000 + "}"])
def test_arguments_of_an_environment_that_python_cannot_read_are_refused(text):
    with pytest.raises(InvalidParameter, match="env-kwargs"):
        parse_keywords([text])


@pytest.mark.parametrize("value", [10**400, [[0], [1, 2]], {}])
def test_observations_that_no_array_holds_are_refused(value):
    with pytest.raises(InvalidDemonstrations):
        from_arrays([[value, value]], [[1]], **INTO)


@pytest.mark.parametrize(
    ("part", "value"), [("pos", 10**400), ("pos", 3), ("buffer_size", -1), ("full", np.zeros(2)), ("rewards", np.zeros(2))]
)
def test_a_buffer_with_a_part_that_is_none_is_refused(part, value):
    held = {
        "observations": np.array([[0], [4]]), "actions": np.array([[[1]], [[1]]]), "rewards": np.zeros((2, 1)), "pos": 2,
        "dones": np.array([[0], [1]]), "buffer_size": 2, "next_observations": np.array([[4], [8]]), "full": False,
    }  # fmt: skip
    assert len(from_rollouts(SimpleNamespace(**held), **INTO)) == 1
    with pytest.raises(InvalidDemonstrations, match="the buffer"):
        from_rollouts(SimpleNamespace(**{**held, part: value}), **INTO)
