"""A wheel that is installed runs the main job in an empty folder, outside of any clone: `irl-gym` of a new environment.

What irl_gym depends on is lent by the environment of the tests, and irl_gym itself is the wheel's: no editable install is seen.
"""

import os
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest
from commands.conftest import MODULES
from stopped import HANG

ROOT = Path(__file__).parents[2]
LOG = "episode,step,cell,action\na,0,0,1\na,1,4,1\na,2,8,2\na,3,9,1\na,4,13,2\na,5,14,2\n"
FEW = ("--episodes", "20", "--total-timesteps", "8192")
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def command(tmp_path_factory):
    """The console script of an environment in which the wheel is installed."""
    folder = tmp_path_factory.mktemp("installed")
    subprocess.run([sys.executable, "-m", "build", "--wheel", "--outdir", folder / "dist", ROOT], check=True, timeout=HANG)
    venv.create(folder / "bare", with_pip=True)
    python, (wheel,) = folder / "bare/bin/python", (folder / "dist").glob("*.whl")
    subprocess.run([python, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", wheel], check=True, timeout=HANG)
    (site,) = (folder / "bare").glob("lib/*/site-packages")
    (site / "lent.pth").write_text(sysconfig.get_path("purelib"))
    return folder / "bare/bin/irl-gym"


@pytest.fixture
def run(command, tmp_path):
    """The command with words, in an empty folder; what it says."""

    def call(*words):
        plain = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
        done = subprocess.run([command, *words], cwd=tmp_path, env=plain, capture_output=True, text=True, timeout=HANG)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return call


def test_the_wheel_runs_the_main_job_in_an_empty_folder(run, tmp_path):
    said = run("run", "--env-id", "FrozenLake-v1", *FEW)
    (made,) = (tmp_path / "runs").iterdir()
    assert "Under the true reward" in said and (made / "report.html").exists() and (made / "agent.zip").exists()
    assert "Wrote" in run("report", "--run", str(made))


def test_the_wheel_finds_the_users_environment_and_learner(run, tmp_path):
    for name, text in MODULES.items():
        (tmp_path / f"{name}.py").write_text(text)
    said = run("run", "--env-id", "own_env_here:Pond-v0", "--learner", "own_learner_here:Twin", *FEW)
    assert said.startswith("own_env_here:Pond-v0; gamma 0.99; seed 0.")


def test_the_wheel_learns_from_the_users_file(run, tmp_path):
    (tmp_path / "log.csv").write_text(LOG)
    where = ("--env-id", "FrozenLake-v1", "--env-kwargs", "is_slippery=false")
    said = run("run", *where, "--csv", "log.csv", "--observation-columns", "cell", *FEW, "--out", "mine")
    assert "csv/log-" in (tmp_path / "mine/config.json").read_text() and "Kept in mine" in said
