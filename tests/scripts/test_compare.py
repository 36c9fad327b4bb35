"""The script as a person runs it, by subprocess."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PLAN = ("--episodes", "5", "--retrain", "value-iteration")


def script(name, *arguments, cwd):
    command = [sys.executable, str(ROOT / "scripts" / f"{name}.py"), *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=300)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    cwd = tmp_path_factory.mktemp("script")
    for name, more in {"plain": (), "priced": ("--l1", "0.5")}.items():
        made = script("recover_and_retrain", *PLAN, *more, "--out", name, cwd=cwd)
        assert made.returncode == 0, made.stderr
    return cwd


def test_two_runs_make_one_page(finished):
    made = script("compare", "plain", "priced", "--out", "both.html", cwd=finished)
    assert made.returncode == 0, made.stderr
    text = (finished / "both.html").read_text()
    assert "2 runs side by side" in text and "learner.l1" in text and "2 runs side by side" in made.stdout


def test_one_run_is_refused(finished):
    made = script("compare", "plain", cwd=finished)
    assert made.returncode == 2 and "InvalidParameter: runs has 1" in made.stderr and "Traceback" not in made.stderr


def test_a_folder_that_is_no_run_is_named(finished):
    made = script("compare", "plain", "nowhere", cwd=finished)
    assert made.returncode == 2 and "RunIncomplete: nowhere" in made.stderr and "Traceback" not in made.stderr
