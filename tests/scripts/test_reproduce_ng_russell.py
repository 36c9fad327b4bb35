"""The script as a person runs it, by subprocess."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from stopped import HANG

SCRIPT = Path(__file__).parents[2] / "scripts" / "reproduce_ng_russell.py"
FIGURES = {"figure_1.png", "figure_2.png", "figure_4.png", "figure_5.png"}


def run(*arguments, cwd):
    return subprocess.run([sys.executable, str(SCRIPT), *arguments], cwd=cwd, capture_output=True, text=True, timeout=HANG)


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    cwd = tmp_path_factory.mktemp("paper")
    return run("--quick", cwd=cwd), cwd / "runs" / "ng_russell_2000"


def test_the_quick_run_meets_its_bars_and_is_quiet(quick):
    made, _ = quick
    assert made.returncode == 0, made.stdout + made.stderr
    assert made.stderr == "" and "\x1b" not in made.stdout and "Every verdict is yes." in made.stdout


def test_the_quick_run_leaves_figures_and_numbers(quick):
    assert {one.name for one in quick[1].iterdir()} == FIGURES | {"ng_russell_2000.json", "timings.json"}


def test_figures_are_small_enough_for_a_page(quick):
    assert all((quick[1] / name).stat().st_size < 150_000 for name in FIGURES)


def test_numbers_hold_every_check_and_no_seconds(quick):
    found = json.loads((quick[1] / "ng_russell_2000.json").read_text())
    checks = [one for name in ("experiment_1", "experiment_2", "experiment_3") for one in found[name]["checks"]]
    assert {"what", "paper", "ours", "deviation", "bar", "verdict"} <= set(checks[0])
    assert "seconds" not in json.dumps(found) and found["quick"] is True


def test_the_same_seed_gives_the_same_bytes(quick, tmp_path):
    assert run("--experiments", "1", "--out", "a", cwd=tmp_path).returncode == 0
    for name in ("figure_1.png", "figure_2.png"):
        assert (tmp_path / "a" / name).read_bytes() == (quick[1] / name).read_bytes()
    one, other = (json.loads((folder / "ng_russell_2000.json").read_text()) for folder in (tmp_path / "a", quick[1]))
    assert json.dumps(one["experiment_1"]) == json.dumps(other["experiment_1"])


@pytest.mark.parametrize("arguments", [("--seed", "-1"), ("--experiments",)])
def test_a_mistake_gets_one_clear_line(tmp_path, called, arguments):
    made = called(SCRIPT, *arguments, cwd=tmp_path)
    assert made.returncode == 2 and "Traceback" not in made.stderr
