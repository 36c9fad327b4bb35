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
    made = script("recover_and_retrain", *PLAN, "--out", "run", cwd=cwd)
    assert made.returncode == 0, made.stderr
    return cwd


def test_a_page_that_is_written_again_is_the_run_s_own(finished, tmp_path):
    made = script("report", "--run", finished / "run", "--out", tmp_path / "again.html", cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    assert "Wrote" in made.stdout and made.stderr == ""
    assert (tmp_path / "again.html").read_bytes() == (finished / "run" / "report.html").read_bytes()


def test_the_page_lies_in_the_run_s_folder_unless_asked_otherwise(finished):
    (finished / "run" / "report.html").unlink()
    made = script("report", "--run", "run", cwd=finished)
    assert made.returncode == 0 and (finished / "run" / "report.html").stat().st_size > 1_000_000, made.stderr


def test_a_folder_that_is_no_run_gets_one_clear_line(tmp_path):
    made = script("report", "--run", ".", cwd=tmp_path)
    assert made.returncode == 2 and made.stderr.startswith("RunIncomplete") and "Traceback" not in made.stderr


def test_a_page_that_cannot_be_written_gets_one_clear_line(finished, tmp_path):
    made = script("report", "--run", finished / "run", "--out", tmp_path / "none" / "a.html", cwd=tmp_path)
    assert made.returncode == 2 and "FileNotFoundError" in made.stderr and "Traceback" not in made.stderr
