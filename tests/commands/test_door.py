"""`irl-gym`: help costs nothing, what is mistyped is offered right, and a user's own modules are found where they stand."""

import importlib.metadata
import os
import re
import resource
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from commands.conftest import STAGE
from stopped import HANG

from irl_gym.commands import door

ROOT = Path(__file__).parents[2]
BAR = 0.6
"""Seconds of processor time that --help may take over a bare interpreter."""
HEAVY = {"torch", "cvxpy", "minari", "stable_baselines3", "matplotlib", "scipy", "pandas", "pygame"}
LOADED = """
import contextlib, sys
from irl_gym.commands import door
for name in (*door.SUBCOMMANDS, "no-such-subcommand"):
    for more in ("--help", "--no-such-option"):
        with contextlib.suppress(SystemExit):
            door.main([name, *(["ng-russell-2000"] if name == "reproduce" else []), more])
print("loaded", *{one.partition(".")[0] for one in sys.modules})
"""
TUNED = """
from dataclasses import dataclass
from typing import ClassVar

from irl_gym.learners.needs import Needs

@dataclass(frozen=True)
class Tuned:
    needs: ClassVar = Needs(("dynamics",))
    power: float = 1.0
    \"\"\"How much often counts.\"\"\"
    times: int = 2

    def learn(self, problem, rng): ...
"""
FEW = ("--episodes", "5", "--retrain", "value-iteration")


def process(*words, cwd=None):
    return subprocess.run([sys.executable, *words], cwd=cwd, capture_output=True, text=True, timeout=HANG)


def seconds(*words):
    """The least processor time of some starts of Python."""
    found = []
    for _ in range(3):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        assert process(*words).returncode == 0
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        found.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return min(found)


@pytest.mark.parametrize("words", [("--help",), ("run", "--help"), ("run", "--learner", "feature-lp", "--help")])
def test_help_costs_little_more_than_a_bare_interpreter(words):
    over = seconds("-m", "irl_gym", *words) - seconds("-c", "pass")
    print(f"irl-gym {' '.join(words)}: {over:.2f} s of processor time over a bare interpreter")
    assert over <= BAR


def test_help_and_mistyped_options_load_nothing_heavy():
    done = process("-c", LOADED)
    loaded = done.stdout.rpartition("loaded ")[2].split()
    assert "irl_gym" in loaded and HEAVY & {*loaded} == set() and done.stdout.count("usage: ") == len(door.SUBCOMMANDS)


def test_the_table_of_learners_loads_nothing_that_trains_or_draws():
    code = "import sys; from irl_gym.commands.door import main; main(['learners']); print(*{*sys.modules})"
    loaded = {one.partition(".")[0] for one in process("-c", code).stdout.splitlines()[-1].split()}
    assert "irl_gym" in loaded and (HEAVY - {"cvxpy", "scipy", "minari"}) & loaded == set()


def test_the_console_script_is_the_door():
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]
    point = importlib.metadata.EntryPoint("irl-gym", scripts["irl-gym"], "console_scripts")
    assert [*scripts] == ["irl-gym"] and point.load() is door.main


def test_help_names_every_subcommand(irl_gym):
    done = irl_gym("--help")
    assert done.code == 0 and [name for name in door.SUBCOMMANDS if f"\n  {name} " not in done.out] == []
    assert irl_gym().out == irl_gym("help").out == done.out


def test_ctrl_c_ends_any_subcommand_without_a_traceback(irl_gym, monkeypatch):
    def stopped(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("irl_gym.commands.doctor.command", stopped)
    done = irl_gym("doctor", "anything")
    assert (done.code, done.out, done.errors) == (130, "", "Stopped.\n")


def test_the_version_is_told(irl_gym):
    assert irl_gym("--version").out == f"irl-gym {importlib.metadata.version('irl_gym')}\n"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("rnu",), "subcommand is 'rnu': expected one of run, report, compare"),
        (("rnu",), "Did you mean 'run'?"),
        (("--env-id", "Taxi-v4"), "expected a subcommand, as in `irl-gym run --env-id FrozenLake-v1`"),
        (("reproduce", "ng-russell-200"), "Did you mean 'ng-russell-2000'?"),
        (("run", "--lerner", "feature-lp"), "--learner STR"),
        (("run", "--env-id", "FrozenLaek-v1"), "The closest are FrozenLake"),
        (("run", "--learner", "finte-lp"), "Did you mean 'finite-lp'?"),
        (("doctor", "--rum", "runs/demo"), "--run PATH"),
        (("run", "FrozenLaek-v1"), "The closest are FrozenLake"),
        (("doctor", "runs/nowhere"), "RunIncomplete: runs/nowhere holds no run"),
        (("tabulate", "own_env_here:Pond-v1"), "The closest are own_env_here:Pond-v0"),
    ],
)
def test_what_is_mistyped_is_offered_as_it_is_spelled(irl_gym, words, says):
    done = irl_gym(*words)
    assert done.code == 2 and says in " ".join(done.errors.split()) and "Traceback" not in done.errors


@pytest.mark.parametrize(
    ("learner", "has", "lacks"),
    [
        ("finite-lp", "--slack", "--features"),
        ("feature-lp", "--sample", "--rounds"),
        ("trajectory-lp", "--rounds", "--margin-cap"),
        ("my_module:MyLearner", "--options", "--l1"),
    ],
)
def test_help_shows_the_options_of_the_learner_that_is_named_and_no_others(irl_gym, learner, has, lacks):
    for words in (("--learner", learner), (f"--learner={learner}",)):
        said = irl_gym("run", *words, "--help").out
        assert f"{has} " in said and f"{lacks} " not in said and "--retrain " in said


def test_help_lists_the_fields_of_a_learner_of_ones_own(irl_gym, here):
    (here / "own_learner_here.py").write_text(TUNED)
    said = " ".join(irl_gym("run", "--learner", "own_learner_here:Tuned", "--help").out.replace("│", " ").split())
    assert "or one json object. power: How much often counts. times: int" in said and "--features " not in said


def test_help_names_the_options_of_a_file_as_such_and_no_empty_default(irl_gym):
    said = irl_gym("run", "--help").out
    assert "file options" in said and "log options" not in said and "(default: )" not in said + irl_gym("compare", "--help").out


def test_a_first_word_without_a_name_is_what_the_subcommand_is_of(irl_gym, here):
    done = irl_gym("tabulate", "own_env_here:Pond-v0", "--out", "pond.npz")
    assert done.code == 0 and "4, 4 reachable" in done.out and (here / "pond.npz").exists()


@pytest.mark.slow
def test_a_continuous_world_is_told_with_two_commands_that_run(irl_gym, here):
    said = irl_gym("run", "--env-id", "MountainCar-v0", "--env-kwargs", "goal_velocity=0.01").errors
    told = [shlex.split(one)[1:] for one in re.findall(r"`(irl-gym [^`]*)`", said)]
    assert told[0][-4:] == ["--bins", "31", "--retrain", "value-iteration"]
    assert told[1][-2:] == ["--learner", "trajectory-lp"]
    few = ((), ("--total-timesteps", "2048", "--rounds", "1"))
    for words, less in zip(told, few, strict=True):
        done = irl_gym(*words, *less, "--episodes", "2")
        assert done.code == 0 and "Under the true reward" in done.out, done.errors


def test_the_users_own_modules_are_found_where_the_user_stands(here):
    where = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "envs")])}
    words = ["run", "--env-id", "own_env_here:Pond-v0", "--learner", "own_learner_here:Twin", *FEW, "--out", "run"]
    start = "import sys; sys.path[0] = '/nowhere'; from irl_gym.commands.door import main; sys.exit(main())"
    done = subprocess.run([sys.executable, "-c", start, *words], capture_output=True, text=True, timeout=HANG, env=where)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("own_env_here:Pond-v0; gamma 0.99; seed 0.") and (here / "run/report.html").exists()


def test_the_module_ends_as_the_command_does(tmp_path):
    done = process("-m", "irl_gym", "run", "--env-id", "FrozenLake-v1", *FEW, cwd=tmp_path)
    assert done.returncode == 0 and "Under the true reward" in done.stdout
    assert all(STAGE.match(line) for line in done.stderr.splitlines())
    assert process("-m", "irl_gym", "rnu", cwd=tmp_path).returncode == 2


@pytest.mark.parametrize("what", ["env-id", "learner"])
def test_a_module_that_is_missing_is_told_with_where_it_was_looked_for(irl_gym, here, what):
    done = irl_gym("run", f"--{what}", "nowhere_to_be_found:Mine-v0")
    assert done.code == 2 and done.errors.count("\n") == 1 and "and there is no module 'nowhere_to_be_found'" in done.errors
    assert f"looked for in {here} and among what is installed: expected one that Python finds. Run irl-gym in" in done.errors


def test_an_installed_module_comes_before_one_of_that_name_where_the_user_stands(irl_gym, here):
    (here / "queue.py").write_text("raise RuntimeError")
    assert irl_gym("learners").code == 0 and sys.path[-1] == str(here)


def test_python_that_is_asked_to_trust_no_folder_trusts_none(here):
    told = process("-P", "-m", "irl_gym", "run", "--learner", "own_learner_here:Twin", cwd=here).stderr
    assert "no module 'own_learner_here', which was looked for among what is installed" in told


def test_an_error_in_a_learner_of_the_users_own_is_told_as_theirs(irl_gym, here):
    done = irl_gym("run", "--env-id", "own_env_here:Pond-v0", "--learner", "own_learner_here:Broken", *FEW, "--out", "run")
    file = here / "own_learner_here.py"
    line = 1 + file.read_text().splitlines().index("        return np.zeros(3)[7]")
    told = f"Code that is not irl_gym's raised an error, {file}, line {line}, in learn: IndexError: "
    assert done.code == 70 and done.errors.startswith(told), done.errors


def test_an_own_module_that_python_cannot_read_is_told_as_theirs(irl_gym, here):
    (here / "own_learner_here.py").write_text("class Twin\n")
    done = irl_gym("learners", "own_learner_here:Twin")
    told = f"Code that is not irl_gym's raised an error, {here / 'own_learner_here.py'}, line 1: SyntaxError: "
    assert done.code == 70 and done.errors.startswith(told), done.errors


def test_what_an_own_module_imports_and_python_does_not_find_is_named(irl_gym, here):
    (here / "own_env_here.py").write_text("import nowhere_to_be_found\n")
    done = irl_gym("tabulate", "own_env_here:Pond-v0")
    assert done.code == 2 and "No module named 'nowhere_to_be_found'" in done.errors
    assert "there is no module 'own_env_here'" not in done.errors
