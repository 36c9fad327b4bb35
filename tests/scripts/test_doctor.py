"""The script as a person runs it, on runs that went well, badly, and not to their end."""

import re
import shutil
from dataclasses import replace

import numpy as np
import pytest
from forgetting import without_digests
from reports.page.made_runs import stepped_run

from irl_gym.agents.planners import ValueIteration
from irl_gym.commands import doctor as doctor_command
from irl_gym.judging.diagnoses.doctor import CHECKS
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.learners.linear_programs.trajectory import TrajectoryLP
from irl_gym.loop.pipeline import recover_and_retrain
from irl_gym.mdp.rewards import TabularReward
from irl_gym.runs.diagnosed import diagnose_run, diagnose_unfinished
from irl_gym.runs.experiment import Experiment
from irl_gym.runs.run import read_run
from irl_gym.runs.supply import supplied


@pytest.fixture(scope="module")
def runs(without_figures, tmp_path_factory):
    """Finished runs: a healthy one, one of the paper's own program, one of an expert with noise."""
    folder = tmp_path_factory.mktemp("runs")
    plain = {"env_id": "FrozenLake-v1", "gamma": 0.99, "retrain": ValueIteration(), "episodes": 30, "eval_episodes": 5}
    for name, changes in {
        "healthy": {},
        "paper": {"learner": FiniteLP(margin_cap=None)},
        "noisy": {"epsilon": 0.1, "episodes": 200},
    }.items():
        recover_and_retrain(Experiment(**{**plain, **changes}), folder / name)
    return folder


@pytest.fixture
def doctor(script, tmp_path):
    return lambda folder: script("doctor", "--run", folder, cwd=tmp_path)


def test_a_healthy_run_exits_with_0(doctor, runs):
    done = doctor(runs / "healthy")
    assert done.returncode == 0 and done.stdout.startswith("Healthy. Examined: 11 states") and done.stderr == ""


def test_findings_exit_with_1_and_are_printed_with_their_mends(doctor, runs):
    done = doctor(runs / "paper")
    assert done.returncode == 1 and "avoidable-ties" in done.stdout and 'Mend: margin_cap="auto"' in done.stdout


def test_a_run_whose_demonstrations_are_gone_is_not_called_healthy(doctor, runs, tmp_path):
    out = shutil.copytree(runs / "noisy", tmp_path / "gone")
    shutil.rmtree(out / "dataset")
    done = doctor(out)
    assert done.returncode == 3 and done.stdout.startswith(
        "Not examined: what the expert was seen to do cannot be read any more"
    )
    assert "Healthy" not in done.stdout


def test_what_is_a_record_and_not_computed_is_said(doctor, runs):
    said = "as lambda_0 and what its solver said, and what episodes showed is the run's own record; all else is computed now."
    assert said in doctor(runs / "paper").stdout


def test_mends_are_flags_too_and_states_have_their_names(doctor, runs):
    said = doctor(runs / "paper").stdout
    assert "Flags: --margin-cap auto, --l1 0" in said and re.search(
        r"s=(\d+) a=\d \(row \d, column \d; (left|down|right|up)\)", said
    )


def test_a_run_that_did_not_finish_says_why_and_what_can_be_said(doctor, runs, tmp_path):
    shutil.copytree(runs / "healthy", tmp_path / "killed")
    (tmp_path / "killed" / ".stages" / "reward.json").unlink()
    done = doctor(tmp_path / "killed")
    assert done.returncode == 1 and "'reward' was not finished" in done.stderr and "no-reward" in done.stdout


def test_a_run_without_its_page_is_told_apart_and_how_to_write_it(doctor, runs, tmp_path):
    out = shutil.copytree(runs / "healthy", tmp_path / "no page")
    for name in ("report.html", ".stages/report.json"):
        (out / name).unlink()
    done = doctor(out)
    assert done.returncode == 1 and done.stdout.startswith("Healthy.") and done.stderr == ""
    told = "The run did not finish: only its page, report.html, is missing. This command writes it: "
    assert f"{told}irl-gym report --run '{out}'" in done.stdout


def test_a_run_of_an_earlier_version_without_a_page_did_finish(doctor, runs, tmp_path):
    out = shutil.copytree(runs / "healthy", tmp_path / "older")
    for name in ("run.json", "report.html", ".stages/report.json"):
        (out / name).unlink()
    assert doctor(out).returncode == 0


def test_a_reward_of_another_table_is_named_with_its_run(doctor, runs, tmp_path):
    out = without_digests(shutil.copytree(runs / "healthy", tmp_path / "mixed"))
    TabularReward(np.zeros(36)).save(out / "reward.npz")
    assert f"{out} is incomplete: reward.npz has shape (36,)" in doctor(out).stderr


def test_a_folder_without_a_run_exits_with_2(doctor, tmp_path):
    done = doctor(tmp_path)
    assert done.returncode == 2 and "holds no run" in done.stderr and "Traceback" not in done.stderr


def test_a_folder_that_may_not_be_read_gets_one_clear_line(monkeypatch, tmp_path, capsys):
    def refused(path):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr("irl_gym.runs.run.read_run", refused)
    assert doctor_command.main(doctor_command.Arguments(tmp_path)) == 2
    assert capsys.readouterr().err == f"PermissionError: [Errno 13] Permission denied: '{tmp_path}'\n"


def test_what_a_run_without_a_table_says_is_told_as_its_record(monkeypatch, tmp_path, capsys):
    run = replace(stepped_run(tmp_path), stages={"reward": {"status": "optimal", "stats": {}}})
    monkeypatch.setattr("irl_gym.runs.run.read_run", lambda path: run)
    doctor_command.main(doctor_command.Arguments(tmp_path))
    assert "Everything is the run's own record." in capsys.readouterr().out


def test_one_episode_is_judged_and_told_to_tell_no_noise(doctor, tmp_path):
    learner = TrajectoryLP(np.eye(16), trajectories=100, max_rounds=2)
    asked = Experiment("FrozenLake-v1", 0.99, learner=learner, retrain=ValueIteration(), episodes=1, eval_episodes=5)
    made = recover_and_retrain(asked, tmp_path / "one")
    assert read_run(made.out).stages["reward"]["stats"]["regret_error"] is None
    assert "One episode tells no noise" in doctor(made.out).stdout and "one episode tells no noise" in made.page.read_text()


def test_an_expert_with_noise_is_judged_by_what_its_episodes_show(runs):
    assert "nothing-to-compare" not in supplied(diagnose_run, read_run(runs / "noisy")).names


def test_an_unfinished_run_with_its_reward_is_diagnosed_as_a_finished_one(runs):
    unfinished, finished = diagnose_unfinished(runs / "paper"), supplied(diagnose_run, read_run(runs / "paper"))
    assert unfinished.to_json()["findings"] == finished.to_json()["findings"]
    assert (
        unfinished.examined == f"{finished.examined} Not examined, of {len(CHECKS)} questions: 5, as no finished run judged it."
    )


def test_a_folder_that_holds_too_little_has_no_diagnosis(tmp_path):
    assert diagnose_unfinished(tmp_path) is None
