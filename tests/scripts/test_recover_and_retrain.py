"""The script as a person runs it, by subprocess."""

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from commands.conftest import MODULES
from stopped import HANG, run_until

from irl_gym.commands import run as run_command
from irl_gym.commands.arguments import Arguments
from irl_gym.runs.identity import STAGES

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "scripts" / "recover_and_retrain.py"
QUICK = ("--total-timesteps", "4096", "--episodes", "10")


def command(*arguments):
    return [sys.executable, str(SCRIPT), *arguments]


def run(*arguments, cwd):
    return subprocess.run(command(*arguments), cwd=cwd, capture_output=True, text=True, timeout=HANG)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    cwd = tmp_path_factory.mktemp("script")
    return run(*QUICK, "--env-kwargs", "is_slippery=false", cwd=cwd), cwd


def test_the_script_ends_well(finished):
    assert finished[0].returncode == 0, finished[0].stderr


@pytest.mark.parametrize("word", ["expert", "random", "retrained", "worst-tie regret", "lambda_0", "agreement", "seconds"])
def test_the_report_names(finished, word):
    assert word in finished[0].stdout


def test_each_stage_has_plain_lines_where_there_is_no_terminal(finished):
    said = finished[0].stderr.splitlines()
    assert said[0] == "loading: begun" and said[1].startswith("loading: done in ")
    assert "\x1b" not in finished[0].stderr + finished[0].stdout
    stages = [name for name in ("table", *STAGES) for _ in range(2)]
    assert [line.split(":")[0] for line in said[2:] if "%" not in line] == stages
    assert any(line.startswith("agent: done in ") and "mean return " in line for line in said)


def test_the_last_line_names_the_page(finished):
    said, cwd = "".join(finished[0].stdout.split()), finished[1]
    (page,) = (cwd / "runs").glob("*/report.html")
    assert said.endswith(f"Openruns/{page.parent.name}/report.htmlinabrowser.")


def test_the_report_begins_with_what_was_asked(finished):
    assert finished[0].stdout.startswith("FrozenLake-v1 (is_slippery=False); gamma 0.99; seed 0.")


def test_a_run_keeps_the_arguments_it_was_given(finished):
    (kept,) = (finished[1] / "runs").glob("*/run.json")
    wanted = ["irl-gym", "run", *QUICK, "--env-kwargs", "is_slippery=false"]
    assert json.loads(kept.read_text())["command"] == wanted


@pytest.mark.usefixtures("without_figures")
def test_each_experiment_gets_a_folder_of_its_own(finished, called):
    _, cwd = finished
    assert len(list((cwd / "runs").iterdir())) == 1
    called(SCRIPT, *QUICK, "--retrain", "value-iteration", cwd=cwd)
    assert len(list((cwd / "runs").iterdir())) == 2


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--env-id", "FrozenLaek-v1"), "UnknownEnvironment: environment 'FrozenLaek-v1'"),
        (("--gamma", "1.5"), "InvalidDiscount: gamma is 1.5"),
        (("--l1", "-1"), "InvalidParameter: l1 is -1"),
        (("--env-kwargs", "8x8"), "InvalidParameter: env-kwargs has '8x8'"),
        (("--env-kwargs", "{broken"), "InvalidParameter: env-kwargs is '{broken'"),
        (("--env-kwargs", "nonsense=1"), "InvalidParameter: FrozenLake-v1 takes no"),
        (("--expert", "pppo"), "InvalidParameter: expert is 'pppo': expected one of value-iteration, ppo"),
        (("--expert", "agent.zip"), "InvalidParameter: expert is 'agent.zip', which is no file"),
        (("--reveal", "8"), "InvalidParameter: reveal has '8'"),
        (("--steps", "9"), "InvalidParameter: steps is 9, but table is 'auto'"),
        (("--epsilon", "2"), "InvalidParameter: epsilon is 2"),
        (("--env-id", "Pendulum-v1"), "NotDiscrete"),
        (("--learner", "feature-lp", "--dataset", "lake-v0", "--dataset-root", "."), "DatasetMissing: dataset 'lake-v0'"),
        (("--dataset", "lake-v0", "--dataset-root", "."), "DatasetMissing: dataset 'lake-v0'"),
        (("--env-id", "CartPole-v1", "--learner", "trajectory-lp", "--features", "one-hot"), "choose radial"),
    ],
)
def test_a_mistake_gets_one_clear_line(tmp_path, called, arguments, says):
    made = called(SCRIPT, *arguments, cwd=tmp_path)
    assert made.returncode == 2 and says in made.stderr and "Traceback" not in made.stderr


def test_a_mistake_in_a_process_of_its_own_gets_one_clear_line(tmp_path):
    (tmp_path / "own_env_here.py").write_text(MODULES["own_env_here"])
    made = run("--env-id", "own_env_here:Fog-v0", cwd=tmp_path)
    assert made.returncode == 2 and "HiddenState: no table of own_env_here:Fog-v0: observation" in made.stderr
    assert "Traceback" not in made.stderr


def test_help_names_the_learners(tmp_path, called):
    text = called(SCRIPT, "--help", cwd=tmp_path).stdout
    assert all(name in text for name in ("finite-lp", "feature-lp", "trajectory-lp", "--slack", "--dataset", "--bins"))


@pytest.mark.usefixtures("without_figures")
def test_the_report_names_the_best_round_of_trajectories(tmp_path, called):
    words = ("--episodes", "10", "--retrain", "value-iteration", "--learner", "trajectory-lp", "--rounds", "2")
    made = called(SCRIPT, *words, cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    assert all(word in made.stdout for word in ("best round", "distance", "cut after"))


@pytest.mark.usefixtures("without_figures")
def test_a_dataset_alone_is_learned_from(finished, tmp_path, called):
    (held,) = sorted((finished[1] / "runs").iterdir())[:1]
    data = ("--dataset", "irl_gym/frozenlake-v1-expert-v0", "--dataset-root", str(held / "dataset"))
    made = called(SCRIPT, *data, "--retrain", "value-iteration", cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    said = " ".join(made.stdout.split())
    assert all(words in said for words in ("that of its episodes, paid by the table", "an optimal action", "table:"))


@pytest.mark.usefixtures("without_figures")
def test_an_environment_that_hides_something_is_learned_from_an_expert_that_errs(tmp_path, called):
    made = called(
        SCRIPT,
        "--env-id", "Taxi-v4", "--env-kwargs", "fickle_passenger=true", "--epsilon", "0.2", "--episodes", "60",
        "--retrain", "value-iteration", cwd=tmp_path,
    )  # fmt: skip
    assert made.returncode == 0, made.stderr
    said = " ".join(made.stdout.replace("│", " ").split())
    told = ("expert with its errors = 1", "expert not seen", "nothing is asked of it", "of 712 states")
    assert [words for words in told if words not in said] == []
    (metrics,) = tmp_path.glob("runs/*/metrics.json")
    found = json.loads(metrics.read_text())
    assert found["policies"]["retrained"]["score"] > 0.95 and not found["reward"]["expert_optimal"]
    assert found["reward"]["violated_states"] > 0 < found["reward"]["unknown_states"] and found["reward"]["slack"] == 1.0


def test_a_folder_that_holds_another_run_is_refused(finished, tmp_path, called):
    (held,) = sorted((finished[1] / "runs").iterdir())[:1]
    made = called(SCRIPT, "--out", str(held), "--seed", "7", cwd=tmp_path)
    assert made.returncode == 2 and "RunConflict" in made.stderr


def test_a_folder_that_may_not_be_written_gets_one_clear_line(monkeypatch, tmp_path, capsys):
    def refused(*_):
        raise PermissionError(13, "Permission denied", str(tmp_path / ".lock"))

    monkeypatch.setattr("irl_gym.loop.pipeline.recover_and_retrain", refused)
    assert run_command.main(Arguments(out=tmp_path), []) == 2
    said = capsys.readouterr().err.splitlines()
    assert said[-1] == f"PermissionError: [Errno 13] Permission denied: '{tmp_path / '.lock'}'"
    assert len(said) == 3 and said[0] == "loading: begun"


AGENT = "irl_gym.agents.planners:SB3.plan"
CHECKPOINT = "irl_gym.loop.learning_curve:Glances.arrays"
LONGER = ("--total-timesteps", "12288", "--episodes", "10", "--env-kwargs", "is_slippery=false")


def test_a_run_that_is_interrupted_says_how_to_go_on(tmp_path):
    made = run_until(SCRIPT, "--out", "run", "--episodes", "10", where=AGENT, sent=signal.SIGINT, cwd=tmp_path)
    assert made.returncode == 130 and made.stderr.splitlines()[-1].startswith("Stopped. The same command continues")


def test_a_run_that_was_killed_continues_with_the_stages_that_were_left(tmp_path, called):
    arguments = ("--out", "run", "--episodes", "10", "--total-timesteps", "4096")
    made = run_until(SCRIPT, *arguments, where=AGENT, sent=signal.SIGKILL, cwd=tmp_path)
    assert made.returncode == -signal.SIGKILL, made.stderr
    kept = (tmp_path / "run" / "reward.npz").stat().st_mtime_ns
    assert not (tmp_path / "run" / "metrics.json").exists()
    made = called(SCRIPT, *arguments, cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    assert (tmp_path / "run" / "reward.npz").stat().st_mtime_ns == kept


@pytest.mark.parametrize("more", [(), ("--seeds", "0-4"), ("--seeds", "0-4", "--out", "several")])
def test_the_first_line_is_there_before_anything_heavy_is_imported(tmp_path, more):
    code = f"""
import io, sys
from irl_gym.commands.door import main
class Watch:
    seen = None
    def find_spec(self, name, *_):
        if name in ("torch", "gymnasium", "cvxpy") and Watch.seen is None:
            Watch.seen = sys.stderr.getvalue()
sys.meta_path.insert(0, Watch())
sys.stderr = io.StringIO()
main(["run", "--env-id", "Nothing-v0", *{more}])
print(Watch.seen)
"""
    made = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=HANG)
    assert made.stdout.endswith("loading: begun\n\n"), made.stdout


@pytest.fixture(scope="module")
def in_one_go(tmp_path_factory):
    cwd = tmp_path_factory.mktemp("once")
    assert run(*LONGER, "--out", "once", cwd=cwd).returncode == 0
    return cwd / "once"


@pytest.mark.parametrize("sent", [signal.SIGKILL, pytest.param(signal.SIGINT, marks=pytest.mark.slow)])
def test_an_agent_that_was_stopped_in_its_training_goes_on_and_ends_in_the_same_bytes(in_one_go, tmp_path, sent):
    made = run_until(SCRIPT, *LONGER, "--out", "run", where=CHECKPOINT, nth=4, sent=sent, cwd=tmp_path)
    assert made.returncode == (130 if sent == signal.SIGINT else -sent), made.stderr
    assert (tmp_path / "run" / ".agent.tmp.npz").exists() and not (tmp_path / "run" / "agent.zip").exists()
    made = run(*LONGER, "--out", "run", cwd=tmp_path)
    assert made.returncode == 0 and "went on at step 6,144" in made.stderr, made.stderr
    assert not (tmp_path / "run" / ".agent.tmp.npz").exists()
    for name in ("agent_policy.npz", "learning_curve.csv", "metrics.json"):
        assert (tmp_path / "run" / name).read_bytes() == (in_one_go / name).read_bytes(), name
