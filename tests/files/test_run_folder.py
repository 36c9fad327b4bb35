"""A run's folder: stages are done once, whole or not at all, and another run is refused."""

import json
import os
import shutil

import pytest

from irl_gym.errors import InvalidParameter, RunConflict
from irl_gym.files.run_folder import LOGS, RunFolder, read_json, write_json, write_text

CONFIG = {"env_id": "A-v0", "seed": 1}


@pytest.fixture
def folder(tmp_path):
    return RunFolder(tmp_path / "run", CONFIG)


def writing(content):
    def make(beside):
        (beside / "a.txt").write_text(content)
        (beside / "deep").mkdir()
        (beside / "deep" / "b.txt").write_text(content)
        return {"content": content}

    return make


def logging(name):
    def make(beside):
        (beside / LOGS / name).mkdir(parents=True)
        (beside / LOGS / name / "events").write_text(name)
        return {}

    return make


def test_several_stages_log_into_one_folder(folder):
    for name in ("expert", "agent"):
        folder.run(name, logging(name))
    assert {path.parent.name for path in (folder.path / LOGS).rglob("events")} == {"expert", "agent"}


def test_a_stage_whose_logs_were_deleted_is_not_run_again(folder):
    folder.run("one", logging("agent"))
    shutil.rmtree(folder.path / LOGS)
    assert folder.done("one")


def test_a_stages_files_are_in_place_after_it(folder):
    folder.run("one", writing("x"))
    assert ((folder.path / "a.txt").read_text(), (folder.path / "deep" / "b.txt").read_text()) == ("x", "x")


def test_a_finished_stage_is_not_run_again(folder):
    folder.run("one", writing("x"))
    assert folder.run("one", writing("y"))["content"] == "x"


def test_a_finished_stage_is_known_to_a_later_run(folder):
    folder.run("one", writing("x"))
    assert RunFolder(folder.path, CONFIG).done("one")


def test_a_stage_that_fails_leaves_none_of_its_files_in_place(folder):
    def failing(beside):
        writing("x")(beside)
        raise RuntimeError("power cut")

    with pytest.raises(RuntimeError, match="power cut"):
        folder.run("one", failing)
    assert not (folder.path / "a.txt").exists() and not folder.done("one")


def test_a_stage_that_failed_can_be_run_again(folder):
    with pytest.raises(ZeroDivisionError):
        folder.run("one", lambda beside: {"x": 1 / 0})
    assert folder.run("one", writing("x"))["content"] == "x"


def test_a_stage_killed_between_renaming_and_its_record_is_run_again_over_its_files(folder):
    folder.run("one", writing("x"))
    (folder.path / ".stages" / "one.json").unlink()
    folder.run("one", writing("y"))
    assert (folder.path / "deep" / "b.txt").read_text() == "y"


def test_the_configuration_is_kept(folder):
    assert json.loads((folder.path / "config.json").read_text()) == CONFIG


def test_another_configuration_takes_a_folder_in_which_nothing_was_finished(folder):
    RunFolder(folder.path, {**CONFIG, "seed": 2})
    assert json.loads((folder.path / "config.json").read_text())["seed"] == 2


def test_another_configuration_is_refused_by_the_key_that_differs(folder):
    folder.run("one", writing("x"))
    with pytest.raises(RunConflict, match="its seed is 1, this one's is 2"):
        RunFolder(folder.path, {**CONFIG, "seed": 2})


def test_a_folder_that_holds_no_run_is_refused(tmp_path):
    (tmp_path / "thesis.tex").write_text("")
    with pytest.raises(RunConflict, match="holds no run"):
        RunFolder(tmp_path, CONFIG)


@pytest.mark.parametrize("content", ["{", "[]", "\x00"])
def test_a_broken_configuration_is_refused(tmp_path, content):
    (tmp_path / "config.json").write_text(content)
    with pytest.raises(RunConflict, match="Choose another --out"):
        RunFolder(tmp_path, CONFIG)


def test_a_stage_whose_file_was_deleted_is_run_again(folder):
    folder.run("one", writing("x"))
    (folder.path / "a.txt").unlink()
    folder.run("one", writing("y"))
    assert (folder.path / "a.txt").read_text() == "y"


@pytest.mark.parametrize("content", ["", "{", "[]", "{}"])
def test_a_stage_whose_record_is_broken_is_run_again(folder, content):
    folder.run("one", writing("x"))
    (folder.path / ".stages" / "one.json").write_text(content)
    assert folder.run("one", writing("y"))["content"] == "y"


def test_a_record_says_when_the_stage_was_kept(folder):
    assert ("kept" in folder.run("one", writing("x")), "kept" in folder.run("one", writing("x"))) == (False, True)


def test_what_a_cut_off_start_left_does_not_lock_the_folder(tmp_path):
    (tmp_path / ".config.json.tmp").write_text("{")
    assert RunFolder(tmp_path, CONFIG).path == tmp_path


def test_a_nested_difference_is_named_by_its_path(tmp_path):
    RunFolder(tmp_path, {"learner": {"l1": 0.0, "r_max": 1.0}}).run("one", writing("x"))
    with pytest.raises(RunConflict, match=r"its learner\.l1 is 0\.0, this one's is 1\.0"):
        RunFolder(tmp_path, {"learner": {"l1": 1.0, "r_max": 1.0}})


def test_a_file_that_was_changed_is_refused_by_name(folder):
    folder.run("one", writing("x"))
    with pytest.raises(RunConflict, match=r"a\.txt cannot be read"):
        folder.load("a.txt", lambda path: json.loads(path.read_text()))


def test_a_stage_whose_file_in_a_folder_was_deleted_is_run_again(folder):
    folder.run("one", writing("x"))
    (folder.path / "deep" / "b.txt").unlink()
    folder.run("one", writing("y"))
    assert (folder.path / "deep" / "b.txt").read_text() == "y"


@pytest.mark.parametrize("content", ["{}", "[]", "null", ""])
def test_read_json_refuses_what_is_no_object(folder, content):
    (folder.path / "metrics.json").write_text(content)
    with pytest.raises(RunConflict, match=r"metrics\.json cannot be read"):
        folder.load("metrics.json", read_json)


@pytest.mark.parametrize("content", ["[" * 100_000, '{"a":' * 100_000])
def test_json_that_is_nested_too_deeply_is_refused_like_other_damage(tmp_path, content):
    (tmp_path / "deep.json").write_text(content)
    with pytest.raises(ValueError, match="nested too deeply"):
        read_json(tmp_path / "deep.json")
    (tmp_path / "config.json").write_text(content)
    with pytest.raises(RunConflict, match="Choose another --out"):
        RunFolder(tmp_path, CONFIG)


def test_a_stage_whose_record_is_nested_too_deeply_is_run_again(folder):
    folder.run("one", writing("x"))
    (folder.path / ".stages" / "one.json").write_text("[" * 100_000)
    assert folder.run("one", writing("y"))["content"] == "y"


def test_a_folder_in_place_of_a_configuration_is_refused(tmp_path):
    (tmp_path / "config.json").mkdir()
    with pytest.raises(RunConflict, match="Choose another --out"):
        RunFolder(tmp_path, CONFIG)


def test_a_file_that_cannot_be_renamed_leaves_nothing_beside(tmp_path, monkeypatch):
    def refused(source, target):
        raise PermissionError(13, "Permission denied", str(target))

    monkeypatch.setattr(os, "replace", refused)
    with pytest.raises(PermissionError):
        write_json(tmp_path / "a.json", {"a": 1})
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_cannot_be_written_leaves_nothing_beside_and_the_old_one_in_place(tmp_path):
    (tmp_path / "a.txt").write_text("old")
    with pytest.raises(UnicodeEncodeError):
        write_text(tmp_path / "a.txt", "\ud800")
    assert [one.name for one in tmp_path.iterdir()] == ["a.txt"] and (tmp_path / "a.txt").read_text() == "old"


def test_a_folder_of_the_files_own_name_is_refused(tmp_path):
    (tmp_path / "a.json").mkdir()
    with pytest.raises(InvalidParameter, match=r"a\.json is a folder: expected a file"):
        write_json(tmp_path / "a.json", {"a": 1})
    assert [one.name for one in tmp_path.iterdir()] == ["a.json"]
