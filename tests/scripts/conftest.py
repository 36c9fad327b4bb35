"""Scripts as a person runs them, by subprocess, and a run that several tests only read."""

import io
import runpy
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from stopped import HANG

ROOT = Path(__file__).parents[2]
PLAN = ("--episodes", "5", "--retrain", "value-iteration")


@pytest.fixture(scope="session")
def process():
    """A script by its name, in a process of its own."""

    def run(name, *arguments, cwd):
        command = [sys.executable, str(ROOT / "scripts" / f"{name}.py"), *map(str, arguments)]
        return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=HANG)

    return run


@pytest.fixture
def called(capsys, monkeypatch, unchecked):
    """A script called in this process with a command line: what it returns and says, without another start of Python."""

    def call(path, *arguments, cwd, typed=""):
        monkeypatch.chdir(cwd)
        monkeypatch.setattr(sys, "stdin", io.StringIO(typed))
        monkeypatch.setattr(sys, "argv", [str(path), *map(str, arguments)])
        monkeypatch.setattr(sys, "path", [*sys.path])  # where they stand is added
        with pytest.raises(SystemExit) as ended:
            runpy.run_path(str(path), run_name="__main__")
        said = capsys.readouterr()
        return SimpleNamespace(returncode=ended.value.code or 0, stdout=said.out, stderr=said.err)

    return call


@pytest.fixture
def script(called):
    """A script by its name, called in this process."""
    return lambda name, *arguments, **how: called(ROOT / "scripts" / f"{name}.py", *arguments, **how)


@pytest.fixture(scope="session")
def planned(process, tmp_path_factory):
    """A folder with a finished run, `plain`, whose agent was planned; to be copied by who changes it."""
    cwd = tmp_path_factory.mktemp("planned")
    made = process("recover_and_retrain", *PLAN, "--out", "plain", cwd=cwd)
    assert made.returncode == 0, made.stderr
    return cwd
