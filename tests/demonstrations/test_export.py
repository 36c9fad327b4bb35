"""An export is killed at every moment and ends in the dataset that it would have ended in."""

import contextlib
import itertools
import os
import signal
import sys
import tracemalloc
from pathlib import Path

import gymnasium as gym
import minari
import numpy as np
import pytest
from numbered import Numbered

from irl_gym.demonstrations import export
from irl_gym.demonstrations.datasets import described, minari_root, read_minari
from irl_gym.demonstrations.export import Amount, export_dataset
from irl_gym.errors import DatasetExists, InvalidDemonstrations, InvalidParameter, RunConflict

ID = "lake/some/expert-v0"
ENV = gym.make("FrozenLake-v1")


def run(root, demonstrator=None, *, amount=None, plan=None, dataset_id=ID, data_format="hdf5", begin=None, on_progress=None):
    about = described(dataset_id, ENV, None, None, data_format, {"algorithm_name": "numbers"})
    demonstrator = demonstrator or Numbered()
    return export_dataset(
        begin or (lambda folder: demonstrator), about, amount or Amount(episodes=7), plan or {"seed": 0}, root=root,
        on_progress=on_progress,
    )  # fmt: skip


def without_seeds(contents):
    return sorted(one.partition("'seed'")[0] for one in contents)


def content(root, dataset_id=ID):
    return [str(vars(one)) for one in read_minari(dataset_id, root=root)]


@pytest.fixture(autouse=True)
def a_shard_for_each_episode(monkeypatch):
    monkeypatch.setattr(export, "SHARD_BYTES", 1)


@pytest.fixture
def cut_off(tmp_path):
    """A root in which an export stopped after four episodes."""
    with pytest.raises(KeyboardInterrupt):
        run(tmp_path, Numbered(breaks_at=4))
    return tmp_path


@pytest.mark.parametrize("data_format", ["hdf5", "arrow"])
def test_plain_minari_opens_the_dataset(tmp_path, monkeypatch, data_format):
    run(tmp_path, data_format=data_format)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    assert list(minari.list_local_datasets()) == [ID]
    dataset = minari.load_dataset(ID)
    assert [len(one) for one in dataset.iterate_episodes()] == [1, 2, 3, 1, 2, 3, 1]
    assert len(dataset.sample_episodes(3)) == 3 and dataset.total_steps == 13
    assert dataset.recover_environment().spec.id == "FrozenLake-v1"


def test_namespaces_are_minaris(tmp_path):
    run(tmp_path)
    with minari_root(tmp_path):
        assert minari.namespace.list_local_namespaces() == ["lake", "lake/some"]


@pytest.mark.parametrize("data_format", ["hdf5", "arrow"])
def test_exports_combine_and_split(tmp_path, data_format):
    first = run(tmp_path, data_format=data_format)
    second = run(tmp_path, data_format=data_format, dataset_id="lake/other-v0", amount=Amount(episodes=2))
    with minari_root(tmp_path):
        both = minari.combine_datasets([first, second], "lake/both-v0")
        parts = minari.split_dataset(both, [4, 5], seed=0)
    found = [str(vars(one)) for part in parts for one in read_minari(part)]
    assert without_seeds(found) == without_seeds(content(tmp_path) + content(tmp_path, "lake/other-v0"))  # Minari drops seeds


def test_steps_end_with_the_episode_that_reaches_them(tmp_path):
    assert run(tmp_path, amount=Amount(steps=5)).total_steps == 6


def test_whichever_of_episodes_and_steps_is_reached_first_ends_it(tmp_path):
    assert run(tmp_path, amount=Amount(episodes=2, steps=100)).total_episodes == 2


def test_nothing_is_left_beside_the_dataset(tmp_path):
    run(tmp_path)
    assert [one.name for one in tmp_path.iterdir()] == ["lake"]


def test_an_export_goes_on_after_what_was_written(cut_off):
    rest = Numbered()
    run(cut_off, rest)
    assert rest.asked == [4, 5, 6]


def test_an_export_that_was_cut_off_ends_the_same(cut_off, tmp_path_factory):
    straight = tmp_path_factory.mktemp("straight")
    run(straight), run(cut_off)
    files = [root / ID / "data" / name for root in (straight, cut_off) for name in ("main_data.hdf5", "metadata.json")]
    assert files[0].read_bytes() == files[2].read_bytes() and files[1].read_bytes() == files[3].read_bytes()


def test_a_damaged_shard_and_those_after_it_are_made_again(cut_off, tmp_path_factory):
    (damaged,) = cut_off.glob(".exporting-*/shards/000002.npz")
    stored = bytearray(damaged.read_bytes())
    stored[stored.index(b"rewards.npy") + 150] ^= 255
    damaged.write_bytes(stored)
    straight, rest = tmp_path_factory.mktemp("straight"), Numbered()
    run(straight), run(cut_off, rest)
    assert rest.asked == [2, 3, 4, 5, 6] and content(cut_off) == content(straight)


def test_what_is_under_way_is_no_dataset(cut_off):
    with minari_root(cut_off):
        assert not minari.list_local_datasets()


def killed_at(number, root):
    """Export in a child that kills itself before its file operation of this number; was it killed?"""
    child = os.fork()
    if child == 0:
        with contextlib.suppress(BaseException):
            count = 0

            def hook(event, arguments):
                nonlocal count
                if event in ("open", "os.rename", "os.remove", "os.mkdir", "os.rmdir"):
                    count += 1
                    if count == number:
                        os.kill(os.getpid(), signal.SIGKILL)

            sys.addaudithook(hook)
            run(root, amount=Amount(episodes=2))
        os._exit(0)
    return os.WIFSIGNALED(os.waitpid(child, 0)[1])


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_kill_before_any_file_operation_loses_nothing(tmp_path):
    run(tmp_path / "straight", amount=Amount(episodes=2))
    expected = content(tmp_path / "straight")
    number, killed = 1, True
    while killed:
        root = tmp_path / str(number)
        killed = killed_at(number, root)
        with minari_root(root):
            there = list(minari.list_local_datasets())  # a warning here would be a broken id
        if there:
            assert content(root) == expected
        if killed:
            after = contextlib.nullcontext() if any(root.glob(".*")) or not there else pytest.raises(DatasetExists)
            with after:  # as long as there is a trace of the export, it ends well
                run(root, amount=Amount(episodes=2))
        assert content(root) == expected, number
        assert sorted(one.name for one in root.iterdir()) == ["lake"], number
        number += 1
    assert number > 30


def test_a_taken_id_is_refused_before_anything_is_drawn(tmp_path):
    run(tmp_path)
    second = Numbered()
    with pytest.raises(DatasetExists, match=ID):
        run(tmp_path, second)
    assert not second.asked and [one.name for one in tmp_path.iterdir()] == ["lake"]


def test_an_id_inside_a_dataset_is_refused(tmp_path):
    run(tmp_path)
    with pytest.raises(DatasetExists, match=r"is a dataset .* expected a namespace"):
        run(tmp_path, dataset_id=f"{ID}/inner-v0")


@pytest.mark.parametrize(
    ("other", "says"),
    [
        ({"plan": {"seed": 1}}, "with seed 0: expected that, not 1"),
        ({"amount": Amount(episodes=8)}, "with episodes 7: expected that, not 8"),
        ({"data_format": "arrow"}, "with data_format 'hdf5': expected that, not 'arrow'"),
    ],
)
def test_another_plan_is_refused_while_one_is_under_way(cut_off, other, says):
    with pytest.raises(RunConflict, match=says):
        run(cut_off, **other)
    assert len(content_after_all(cut_off)) == 7


def content_after_all(root):
    run(root)
    return content(root)


def test_another_plan_is_taken_when_nothing_was_drawn(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        run(tmp_path, Numbered(breaks_at=0))
    assert not list(tmp_path.iterdir())
    assert run(tmp_path, plan={"seed": 1}).total_episodes == 7


def test_what_the_demonstrator_kept_is_found_again(tmp_path):
    def begin(folder):
        (folder / "expert.zip").write_text("trained")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(tmp_path, begin=begin)
    seen = []
    run(tmp_path, begin=lambda folder: seen.append((folder / "expert.zip").read_text()) or Numbered())
    assert seen == ["trained"]


@pytest.mark.parametrize("where", ["", ".ready", "/shards"])
def test_nothing_is_written_or_read_through_a_link_in_place_of_an_exports_folder(cut_off, tmp_path_factory, where):
    (folder,) = cut_off.glob(".exporting-*")
    planted, outside = Path(f"{folder}{where}"), tmp_path_factory.mktemp("outside") / "there"
    if planted.exists():
        planted.rename(outside)
    planted.symlink_to(outside)
    with pytest.raises(RunConflict, match="is a link"):
        run(cut_off)
    assert not outside.exists() or len(list(outside.rglob("*.npz"))) == 4


def test_a_folder_that_another_user_put_there_is_refused(cut_off, monkeypatch):
    monkeypatch.setattr("os.geteuid", lambda: os.getuid() + 1)
    with pytest.raises(RunConflict, match="or another user's: expected what an export of yours left"):
        run(cut_off)


def test_two_processes_at_one_export_are_kept_apart(tmp_path):
    def begin(folder):
        with pytest.raises(RunConflict, match="another process exports"):
            run(tmp_path)
        return Numbered()

    assert run(tmp_path, begin=begin).total_episodes == 7


@pytest.mark.parametrize("amount", [{}, {"episodes": 0}, {"steps": 0}, {"steps": 2.5}])
def test_an_amount_below_one_is_refused(unchecked, amount):
    with pytest.raises(InvalidParameter, match=r"episodes|steps"):
        Amount(**amount)


def test_a_root_that_is_a_file_is_refused(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InvalidParameter, match="expected a folder"):
        run(tmp_path / "file")


def test_progress_ends_at_one_in_both_stages(tmp_path):
    told = []
    run(tmp_path, on_progress=lambda *one: told.append(one))
    assert [stage for stage, share in told if share == 1] == ["episodes", "writing", "writing"]


def test_memory_does_not_grow_with_the_number_of_episodes(tmp_path, monkeypatch):
    monkeypatch.setattr(export, "SHARD_BYTES", 500_000)

    def peak(episodes):
        tracemalloc.start()
        run(tmp_path, Numbered(least=2_000), amount=Amount(episodes=episodes), dataset_id=f"lake/peak-v{episodes}")
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    peak(2)  # what is made once
    assert peak(240) < peak(40) + 1_000_000  # of 48 kB each


def test_amounts_and_plans_of_numpy_are_taken(tmp_path, unchecked):
    made = run(tmp_path, amount=Amount(episodes=np.int64(2)), plan={"seed": np.int64(3), "epsilon": np.float32(0.5)})
    assert made.total_episodes == 2


def test_a_demonstrator_that_ends_too_early_is_refused_and_what_it_gave_is_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(export, "SHARD_BYTES", 1 << 20)
    few = Numbered()
    monkeypatch.setattr(few, "episodes", lambda first: itertools.islice(Numbered().episodes(first), 3))
    with pytest.raises(InvalidDemonstrations, match="the demonstrator ended after episode 2: expected episodes without end"):
        run(tmp_path, few)
    rest = Numbered()
    assert run(tmp_path, rest).total_episodes == 7 and rest.asked[0] == 3
