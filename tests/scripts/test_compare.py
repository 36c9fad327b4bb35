"""The script as a person runs it, by subprocess."""

import shutil

import pytest


@pytest.fixture(scope="module")
def finished(script, planned, tmp_path_factory):
    cwd = tmp_path_factory.mktemp("script")
    shutil.copytree(planned / "plain", cwd / "plain")
    made = script(
        "recover_and_retrain", "--episodes", "5", "--retrain", "value-iteration", "--l1", "0.5", "--out", "priced", cwd=cwd
    )
    assert made.returncode == 0, made.stderr
    return cwd


def test_two_runs_make_one_page(script, finished):
    made = script("compare", "plain", "priced", "--out", "both.html", cwd=finished)
    assert made.returncode == 0, made.stderr
    text = (finished / "both.html").read_text()
    assert "2 runs side by side" in text and "learner.l1" in text and "2 runs side by side" in made.stdout


def test_one_run_is_refused(script, finished):
    made = script("compare", "plain", cwd=finished)
    assert made.returncode == 2 and "InvalidParameter: runs has 1 folder, plain: expected two or more" in made.stderr


def test_a_page_in_a_folder_that_does_not_exist_is_refused(script, finished):
    made = script("compare", "plain", "priced", "--out", "none/both.html", cwd=finished)
    assert made.returncode == 2 and "there is no folder none" in made.stderr and "Traceback" not in made.stderr


def test_a_folder_that_is_no_run_is_named(script, finished):
    made = script("compare", "plain", "nowhere", cwd=finished)
    assert made.returncode == 2 and "RunIncomplete: nowhere" in made.stderr and "Traceback" not in made.stderr
