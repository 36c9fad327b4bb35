"""LinearReward: what it pays, and files that hold it."""

import json
import pickle

import models
import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given

from irl_gym.errors import InvalidFeatures, InvalidReward
from irl_gym.features import feature_maps as module
from irl_gym.features.bases import Fourier, Polynomial, RadialBasis
from irl_gym.features.feature_maps import Functions, OneHot, Table, Unravel
from irl_gym.features.linear_reward import FORMAT, LinearReward, load_reward
from irl_gym.mdp.rewards import RewardFunction, TabularReward
from irl_gym.spaces.states import StateIndex

POINTS = np.random.default_rng(0).uniform(0, 2, size=(9, 2))
ROWS = np.array([3, 0, 5, 5])
MAPS = {
    "OneHot": (OneHot(6), ROWS),
    "Table": (Table(np.random.default_rng(1).normal(size=(6, 4))), ROWS),
    "RadialBasis": (RadialBasis.grid([0, 0], [1, 1], 3), POINTS),
    "RadialBasis, a coordinate left out": (RadialBasis(np.zeros((1, 2)), np.array([1.0, np.inf])), POINTS),
    "RadialBasis of rows": (RadialBasis.grid([0, 0], [1, 2], (2, 3), coordinates=Unravel((2, 3))), ROWS),
    "Fourier": (Fourier([0, 0], [1, 1], 2), POINTS),
    "Fourier of arrays": (Fourier(np.zeros(2), np.ones(2), 2), POINTS),
    "Fourier of rows": (Fourier((0, 0), (1, 2), 2, Unravel((2, 3))), ROWS),
    "Polynomial": (Polynomial([0, np.float64(0.5)], [1, 1.5], 3), POINTS),
}
every_map = pytest.mark.parametrize(("phi", "observations"), MAPS.values(), ids=MAPS.keys())


def reward_of(phi, **note):
    return LinearReward(np.random.default_rng(2).uniform(-1, 1, phi.n_features), phi, note)


def squares(x):
    return np.stack([x, x**2], axis=1)


def swapped(x):
    return x[:, ::-1]


# --- what is paid ---


@every_map
def test_reward_is_the_weighted_sum_of_the_features(phi, observations):
    reward = reward_of(phi)
    np.testing.assert_allclose(reward.of(observations), phi(observations) @ reward.alpha, atol=1e-14)


@every_map
def test_reward_of_a_batch_equals_the_reward_of_each(phi, observations):
    reward = reward_of(phi)
    each = [reward.of(observations[i : i + 1])[0] for i in range(len(observations))]
    np.testing.assert_allclose(reward.pay(observations, np.zeros(len(observations)), observations), each, atol=1e-14)


def test_reward_is_paid_on_arrival():
    assert LinearReward(np.arange(4.0), OneHot(4)).pay(1, 0, 3) == 3.0


def test_reward_is_a_reward_function():
    assert isinstance(reward_of(OneHot(3)), RewardFunction)


def test_reward_of_a_long_batch_equals_that_of_its_blocks(monkeypatch):
    reward = reward_of(Table(np.random.default_rng(1).normal(size=(6, 1 << 10))))
    rows = np.random.default_rng(0).integers(6, size=(1 << 10) + 5)
    monkeypatch.setattr(module, "BLOCK", 1 << 14)
    np.testing.assert_allclose(reward.of(rows), (reward.features.values @ reward.alpha)[rows], atol=1e-11)


def test_reward_of_a_long_batch_of_dicts_equals_that_of_its_blocks():
    phi = Functions(lambda batch: np.repeat(batch["a"][:, None] + batch["b"][0], 1 << 10, axis=1), 1 << 10)
    batch = {"a": np.arange(2000.0), "b": (np.array([[1.0]] * 2000)[:, 0][:, None],)}
    reward = LinearReward(np.eye(1 << 10)[0], phi)
    np.testing.assert_allclose(reward.of(batch), np.arange(2000.0) + 1)


@given(model=models.models())
def test_reward_in_a_table_is_features_times_weights(model):
    phi = np.stack([model.R, model.R**2], axis=1)
    table = LinearReward(np.array([1.0, -2.0]), Table(phi)).tabular(model.mdp.n_states)
    np.testing.assert_allclose(table.values, model.R - 2 * model.R**2, atol=1e-14)


def test_reward_in_a_table_is_of_the_observations_of_the_rows():
    states = StateIndex(spaces.MultiDiscrete([2, 3]))
    reward = reward_of(RadialBasis.grid([0, 0], [1, 2], 2))
    expected = reward.of(np.array([[row, column] for row in range(2) for column in range(3)]))
    np.testing.assert_allclose(reward.tabular(states).values, expected, atol=1e-15)


def test_reward_in_a_table_keeps_its_note():
    assert reward_of(OneHot(3), learner="FeatureLP").tabular(3).note == {"learner": "FeatureLP"}


def test_reward_in_a_table_does_not_depend_on_the_blocks(monkeypatch):
    reward = reward_of(OneHot(9))
    monkeypatch.setattr(module, "BLOCK", 20)
    np.testing.assert_array_equal(reward.tabular(9).values, reward.alpha)


def test_reward_in_a_table_refuses_features_of_another_length():
    with pytest.raises(InvalidFeatures, match="of 6 states: expected 7"):
        reward_of(OneHot(6)).tabular(7)


# --- what it is ---


def test_reward_makes_a_map_of_an_array(unchecked):
    assert isinstance(LinearReward(np.ones(2), np.zeros((3, 2))).features, Table)


def test_reward_is_not_writeable_nor_changed_by_its_weights():
    alpha = np.zeros(3)
    reward = LinearReward(alpha, OneHot(3))
    alpha[:] = 7
    assert not reward.alpha.any() and not reward.alpha.flags.writeable


@every_map
def test_reward_survives_pickle(phi, observations):
    reward = reward_of(phi, l1=0.5)
    again = pickle.loads(pickle.dumps(reward))
    np.testing.assert_array_equal(again.of(observations), reward.of(observations))
    assert again.note == {"l1": 0.5} and not again.alpha.flags.writeable


def test_reward_shows_its_features_and_how_many_weights_it_uses():
    assert repr(LinearReward(np.array([0.0, 1.0, 2.0]), OneHot(3))) == "LinearReward(OneHot, 2 of 3 weights not 0)"


@pytest.mark.parametrize(
    ("alpha", "message"),
    [
        (np.zeros(4), r"shape \(4,\): expected \(3,\)"),
        (np.zeros((3, 1)), r"shape \(3, 1\)"),
        (np.array([0, np.nan, 0]), "finite weights"),
        (np.array([0, np.inf, 0]), "finite weights"),
        (["a", "b", "c"], "cannot be read as numbers"),
    ],
)
def test_reward_refuses_weights_that_do_not_fit(alpha, message, unchecked):
    with pytest.raises(InvalidReward, match=message):
        LinearReward(alpha, OneHot(3))


def test_reward_names_the_observation_and_column_of_a_nan():
    reward = LinearReward(np.zeros(2), Functions(lambda x: np.stack([x, np.where(x > 1, np.nan, x)], axis=1), 2))
    with pytest.raises(InvalidFeatures, match="feature 1 of observation number 2 is nan"):
        reward.of(np.array([0.0, 1.0, 2.0]))


# --- files ---


@every_map
@pytest.mark.parametrize("load", [LinearReward.load, load_reward])
def test_load_reads_what_save_wrote(tmp_path, phi, observations, load):
    reward = reward_of(phi, learner="FeatureLP", l1=0.5)
    reward.save(tmp_path / "reward.npz")
    again = load(tmp_path / "reward.npz")
    assert type(again.features) is type(phi) and again.note == reward.note
    assert again.alpha.tobytes() == reward.alpha.tobytes()
    np.testing.assert_array_equal(again.of(observations), reward.of(observations))


def test_load_reward_reads_a_table_too(tmp_path):
    TabularReward(np.arange(3.0)).save(tmp_path / "reward.npz")
    assert isinstance(load_reward(tmp_path / "reward.npz"), TabularReward)


def test_save_needs_no_pickle(tmp_path):
    reward_of(Table(np.eye(3))).save(tmp_path / "reward.npz")
    with np.load(tmp_path / "reward.npz", allow_pickle=False) as archive:
        assert {array.dtype.kind for array in archive.values()} == {"f", "U"}


def test_save_leaves_nothing_beside(tmp_path):
    for _ in range(2):
        reward_of(OneHot(3)).save(tmp_path / "reward.npz")
    assert [path.name for path in tmp_path.iterdir()] == ["reward.npz"]


class Own(OneHot):
    """A subclass, whose code no file holds."""


@pytest.mark.parametrize(
    ("phi", "message"),
    [
        (Functions(squares, 2), "features is a Functions, code that no file can hold"),
        (RadialBasis(np.zeros((1, 2)), np.ones(2), lambda x: x), r"features\.coordinates is a function"),
        (Fourier([0, 0], [1, 1], 1, swapped), r"features\.coordinates is a function"),
        (Own(3), "features is an Own"),
    ],
)
def test_save_refuses_features_that_are_code(tmp_path, phi, message):
    with pytest.raises(InvalidFeatures, match=rf"{message}.*tabular"):
        reward_of(phi).save(tmp_path / "reward.npz")
    assert not list(tmp_path.iterdir())


def header(**changes):
    whole = {"format": FORMAT, "features": {"type": "OneHot", "fields": {"n": 3}}, "note": {}, **changes}
    return {"header": np.array(json.dumps({key: value for key, value in whole.items() if value is not None}))}


CORRUPTED = {
    "no weights": header(),
    "weights of another number": {"alpha": np.zeros(4), **header()},
    "weights that are not finite": {"alpha": np.full(3, np.nan), **header()},
    "no features": {"alpha": np.zeros(3), **header(features=None)},
    "a number for features": {"alpha": np.zeros(3), **header(features=7)},
    "a list for features": {"alpha": np.zeros(3), **header(features=[1, 2])},
    "features of an unknown type": {"alpha": np.zeros(3), **header(features={"type": "system", "fields": {}})},
    "features without a type": {"alpha": np.zeros(3), **header(features={"fields": {"n": 3}})},
    "features with another field": {"alpha": np.zeros(3), **header(features={"type": "OneHot", "fields": {"m": 3}})},
    "features with a field that is wrong": {"alpha": np.zeros(3), **header(features={"type": "OneHot", "fields": {"n": -3}})},
    "fields that are a list": {"alpha": np.zeros(3), **header(features={"type": "OneHot", "fields": [3]})},
    "an array that is not there": {
        "alpha": np.zeros(3),
        **header(features={"type": "Table", "fields": {"values": {"array": "features.values"}}}),
    },
    "coordinates for features": {"alpha": np.zeros(3), **header(features={"type": "Unravel", "fields": {"shape": [3]}})},
    "another format": {"alpha": np.zeros(3), **header(format="irl_gym.LinearReward/99")},
    "a header that is a list": {"alpha": np.zeros(3), "header": np.array("[1]")},
    "no header": {"alpha": np.zeros(3)},
    "a pickle": {"alpha": np.zeros(3), "header": np.array({"format": FORMAT}, dtype=object)},
    "a pickle for weights": {"alpha": np.array([1, None, 2], dtype=object), **header()},
}


@pytest.mark.parametrize("load", [LinearReward.load, load_reward])
@pytest.mark.parametrize("arrays", CORRUPTED.values(), ids=CORRUPTED.keys())
def test_load_refuses_a_file_that_holds_no_reward(tmp_path, arrays, load):
    np.savez(tmp_path / "other.npz", **arrays)
    with pytest.raises(InvalidReward, match=r"other\.npz"):
        load(tmp_path / "other.npz")


@pytest.mark.parametrize("content", [b"", b"a letter", b"PK\x03\x04 cut short", pickle.dumps({"alpha": [1.0]})])
def test_load_refuses_what_is_no_archive(tmp_path, content):
    (tmp_path / "other.npz").write_bytes(content)
    with pytest.raises(InvalidReward, match=r"other\.npz holds no reward"):
        load_reward(tmp_path / "other.npz")


class Bomb:
    """Unpickling it is noticed."""

    def __reduce__(self):
        return pytest.fail, ("something was unpickled",)


@pytest.mark.parametrize("name", ["header", "alpha", "features.values"])
def test_load_unpickles_nothing(tmp_path, name):
    fields = {"values": {"array": "features.values"}}
    arrays = {"alpha": np.zeros(3), **header(features={"type": "Table", "fields": fields}), "features.values": np.eye(3)}
    np.savez(tmp_path / "bomb.npz", **{**arrays, name: np.array([Bomb()], dtype=object)})
    with pytest.raises(InvalidReward, match=r"bomb\.npz"):
        load_reward(tmp_path / "bomb.npz")


@pytest.mark.parametrize("load", [LinearReward.load, load_reward, TabularReward.load])
def test_load_says_when_there_is_no_file(tmp_path, load):
    with pytest.raises(
        FileNotFoundError, match=r"nowhere\.npz does not exist: expected a file that \w+\.save .*wrote\. Save one"
    ):
        load(tmp_path / "nowhere.npz")


def test_load_of_one_kind_refuses_the_other(tmp_path):
    TabularReward(np.arange(3.0)).save(tmp_path / "table.npz")
    reward_of(OneHot(3)).save(tmp_path / "linear.npz")
    with pytest.raises(
        InvalidReward, match=r"holds a TabularReward: expected a LinearReward\. Read it with TabularReward\.load"
    ):
        LinearReward.load(tmp_path / "table.npz")
    with pytest.raises(
        InvalidReward, match=r"holds a LinearReward: expected a TabularReward\. Read it with LinearReward\.load"
    ):
        TabularReward.load(tmp_path / "linear.npz")
