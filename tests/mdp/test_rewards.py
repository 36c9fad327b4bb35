import contextlib
import json
import pickle

import models
import numpy as np
import pytest
from hypothesis import given

from irl_gym.errors import InvalidReward
from irl_gym.mdp.rewards import FORMAT, RewardFunction, TabularReward, as_reward, read_archive, write_archive


@given(model=models.models())
def test_reward_on_states_is_paid_on_arrival(model):
    np.testing.assert_allclose(TabularReward(model.R).expected(model.mdp), model.P @ model.R, atol=1e-12)


def test_reward_on_states_pays_the_terminal_state_on_arrival():
    grid = models.paper_grid()
    expected = TabularReward(grid.R).expected(grid.mdp)
    assert expected[3, 1] == pytest.approx(0.775) and (expected[4] == 0).all()


def test_reward_on_steps_is_paid_for_the_step_but_not_in_terminal_states():
    model = models.random_model(0, kind="terminal")
    expected = TabularReward(np.ones((7, 3))).expected(model.mdp)
    np.testing.assert_array_equal(expected, np.tile(~model.mdp.terminal[:, None], 3))


@pytest.mark.parametrize(("values", "paid"), [([1.0, 2.0, 3.0], 3.0), ([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]], 4.0)])
def test_pay_takes_a_single_step(values, paid):
    assert TabularReward(np.array(values)).pay(1, 1, 2) == paid


@pytest.mark.parametrize("values", [np.arange(4.0), np.arange(12.0).reshape(4, 3)])
def test_pay_of_a_batch_equals_pay_of_each_step(values):
    reward = TabularReward(values)
    s, a, after = np.array([0, 1, 3, 3]), np.array([2, 0, 1, 1]), np.array([1, 1, 2, 0])
    assert reward.pay(s, a, after).tolist() == [reward.pay(*step) for step in zip(s, a, after, strict=True)]


def test_reward_is_a_reward_function():
    assert isinstance(TabularReward(np.zeros(3)), RewardFunction)


@pytest.mark.parametrize(("shape", "on_states"), [((5,), True), ((5, 2), False)])
def test_reward_knows_what_it_is_a_function_of(shape, on_states):
    reward = TabularReward(np.zeros(shape))
    assert (reward.on_states, reward.n_states) == (on_states, 5)


@pytest.mark.parametrize("again", [lambda r: r, lambda r: pickle.loads(pickle.dumps(r))])
def test_reward_is_not_writeable(again):
    with pytest.raises(ValueError, match="read-only"):
        again(TabularReward(np.zeros(3))).values[0] = 1


def test_reward_does_not_change_with_the_array_it_was_made_from():
    values = np.zeros(3)
    reward = TabularReward(values)
    values[:] = 7
    assert not reward.values.any()


@pytest.mark.parametrize("values", [np.array([0.1, -1e-300, 3e200]), np.linspace(-1, 1, 6).reshape(3, 2)])
def test_load_reads_what_save_wrote(tmp_path, values):
    TabularReward(values, {"learner": "FiniteLP", "l1": 0.5}).save(tmp_path / "reward.npz")
    found = TabularReward.load(tmp_path / "reward.npz")
    assert found.values.tobytes() == values.tobytes() and found.note == {"learner": "FiniteLP", "l1": 0.5}


def test_save_replaces_the_file_and_leaves_nothing_beside(tmp_path):
    for value in (1.0, 2.0):
        TabularReward(np.array([value])).save(tmp_path / "reward.npz")
    assert TabularReward.load(tmp_path / "reward.npz").values == 2
    assert [path.name for path in tmp_path.iterdir()] == ["reward.npz"]


def test_load_says_when_there_is_no_file(tmp_path):
    with pytest.raises(FileNotFoundError, match="nowhere"):
        TabularReward.load(tmp_path / "nowhere.npz")


def write_text(path):
    path.write_text("a letter")


def write_nothing(path):
    path.touch()


def write_array(path):
    with path.open("wb") as file:
        np.save(file, np.zeros(3))


def write_other_npz(path):
    np.savez(path, weights=np.zeros(3))


def write_pickle(path):
    np.savez(path, values=np.zeros(3), header=np.array({"format": FORMAT}, dtype=object))


def write_broken_header(path):
    np.savez(path, values=np.zeros(3), header=np.array("{"))


@pytest.mark.parametrize("write", [write_text, write_nothing, write_array, write_other_npz, write_pickle, write_broken_header])
def test_load_refuses_a_file_that_holds_no_reward(tmp_path, write):
    write(tmp_path / "other.npz")
    with pytest.raises(InvalidReward, match=r"other\.npz holds no reward"):
        TabularReward.load(tmp_path / "other.npz")


@pytest.mark.parametrize("write", [write_text, write_nothing, write_array, write_pickle])
def test_load_gives_no_advice_to_unpickle_when_a_file_holds_no_reward(tmp_path, write):
    write(tmp_path / "other.npz")
    with pytest.raises(InvalidReward, match=r"it is no npz archive|pickled objects, which are never read") as told:
        TabularReward.load(tmp_path / "other.npz")
    assert "unsafely" not in str(told.value) and "allow_pickle" not in str(told.value)


def test_load_says_what_the_system_says_when_it_is_given_a_folder(tmp_path):
    with pytest.raises(
        InvalidReward, match=r"holds no reward \(Is a directory\): expected a file that TabularReward\.save wrote"
    ):
        TabularReward.load(tmp_path)


@pytest.mark.parametrize("header", [{"format": "irl_gym.TabularReward/99", "note": {}}, ["a", "list"]])
def test_load_refuses_another_format(tmp_path, header):
    np.savez(tmp_path / "later.npz", values=np.zeros(3), header=np.array(json.dumps(header)))
    with pytest.raises(InvalidReward, match=r"has format .*newer version"):
        TabularReward.load(tmp_path / "later.npz")


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (np.zeros((2, 2, 2)), r"shape \(2, 2, 2\)"),
        (np.zeros(0), r"shape \(0,\)"),
        (np.float64(3), r"shape \(\)"),
        (np.array([0, np.nan]), r"R\[1\] is nan"),
        (np.array([[0, 1], [np.inf, 2]]), r"R\[1, 0\] is inf"),
    ],
)
def test_reward_refuses_values_that_are_no_table_of_numbers(values, message, unchecked):
    with pytest.raises(InvalidReward, match=message):
        TabularReward(values)


@pytest.mark.parametrize("shape", [(6,), (7, 2), (6, 3)])
def test_expected_refuses_the_reward_of_another_table(shape):
    with pytest.raises(InvalidReward, match=rf"shape \({shape[0]},.*expected \(7,\) or \(7, 3\)"):
        TabularReward(np.zeros(shape)).expected(models.random_model(0).mdp)


def test_archive_holds_header_and_arrays(tmp_path):
    write_archive(
        tmp_path / "a.npz", {"format": "x/1", "n": np.int64(3), "shape": (2, 2)}, {"v": np.eye(2), "f.g": np.arange(3)}
    )
    header, arrays = read_archive(tmp_path / "a.npz", ("y/1", "x/1"))
    assert header == {"format": "x/1", "n": 3, "shape": [2, 2]} and sorted(arrays) == ["f.g", "v"]
    np.testing.assert_array_equal(arrays["v"], np.eye(2))


def test_archive_of_another_format_is_refused_with_those_expected(tmp_path):
    write_archive(tmp_path / "a.npz", {"format": "x/1"}, {})
    with pytest.raises(InvalidReward, match=r"a\.npz has format .*expected 'y/1' or 'z/1'"):
        read_archive(tmp_path / "a.npz", ("y/1", "z/1"))


@pytest.mark.parametrize("content", [b"PK\x03\x04", b"PK\x05\x06", b"\x93NUMPY\x01"])
def test_archive_that_is_cut_short_is_refused_and_closed(tmp_path, content):
    (tmp_path / "a.npz").write_bytes(content)  # a file left open would be a ResourceWarning, and so an error
    with pytest.raises(InvalidReward, match=r"a\.npz holds no reward"):
        read_archive(tmp_path / "a.npz", (FORMAT,))


def test_archive_cut_anywhere_is_refused(tmp_path):
    TabularReward(np.arange(9.0)).save(tmp_path / "whole.npz")
    whole = (tmp_path / "whole.npz").read_bytes()
    for length in range(0, len(whole), 37):
        (tmp_path / "cut.npz").write_bytes(whole[:length])
        with pytest.raises(InvalidReward, match=r"cut\.npz holds no reward"):
            TabularReward.load(tmp_path / "cut.npz")


def test_load_refuses_a_file_without_values(tmp_path):
    write_archive(tmp_path / "empty.npz", {"format": FORMAT}, {"weights": np.zeros(3)})
    with pytest.raises(InvalidReward, match=r"empty\.npz has no values"):
        TabularReward.load(tmp_path / "empty.npz")


def test_as_reward_makes_a_table_of_an_array_and_leaves_one_as_it_is():
    made = as_reward(np.arange(3.0))
    assert isinstance(made, TabularReward) and as_reward(made) is made


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(("given", "told"), [([[1.0, 2.0], [3.0]], "list that cannot be read"), (np.ones(3) * 1j, "complex")])
def test_a_reward_that_is_no_array_of_real_numbers_is_refused(given, told):
    with pytest.raises(InvalidReward, match=told):
        as_reward(given)


def test_a_flipped_bit_is_named_not_raised_as_it_is(tmp_path):
    path = tmp_path / "reward.npz"
    TabularReward(np.arange(6.0)).save(path)
    whole = path.read_bytes()
    for place in range(0, len(whole), 3):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0xFF]) + whole[place + 1 :])
        with contextlib.suppress(InvalidReward):  # a byte that nobody reads does no harm
            TabularReward.load(path)
