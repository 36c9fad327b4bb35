"""The script as a person runs it, by subprocess, with few draws."""

import subprocess
import sys
from pathlib import Path

import pytest
from stopped import HANG

SCRIPT = Path(__file__).parents[2] / "scripts" / "reward_distances.py"


def run(*arguments):
    return subprocess.run([sys.executable, str(SCRIPT), *arguments], capture_output=True, text=True, timeout=HANG)


@pytest.fixture(scope="module")
def small():
    return run("--mdps", "10", "--pairs", "60")


def test_every_bar_holds(small):
    assert small.returncode == 0, small.stdout + small.stderr
    assert "figure: holds, invariance: holds, regret: holds, bound: holds" in small.stdout


def test_the_figure_is_printed(small):
    numbers = ("0.0000", "0.7500", "0.1602", "0.3676")
    assert any(all(number in line for number in numbers) for line in small.stdout.splitlines() if "Sparse" in line)


def test_an_unknown_measurement_is_refused():
    assert run("--only", "everything").returncode != 0


def test_nothing_to_measure_gets_one_clear_line():
    made = run("--only")
    assert made.returncode == 2 and "only is empty: expected some of figure" in made.stderr


@pytest.mark.parametrize(("flag", "value"), [("--mdps", "0"), ("--pairs", "1"), ("--seed", "-1")])
def test_numbers_that_cannot_be_measured_with_get_one_clear_line(flag, value):
    made = run("--only", "bound", flag, value)
    assert made.returncode == 2 and f"{flag[2:]} is {value}: expected a whole number" in made.stderr
    assert "Traceback" not in made.stderr
