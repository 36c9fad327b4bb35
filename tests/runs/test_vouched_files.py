"""A file of a run that is not the one it left is named when the run is read or continued, with a mend that works."""

import io
import json

import numpy as np
import pytest
from forgetting import without_digests
from rich.console import Console

from irl_gym.agents.planners import ValueIteration
from irl_gym.errors import RunConflict, RunIncomplete, SolverFailed
from irl_gym.files.run_folder import FOR_PEOPLE, LOGS, read_json, write_json
from irl_gym.loop import final_stages
from irl_gym.loop.pipeline import recover_and_retrain
from irl_gym.mdp.policies import load_actions
from irl_gym.mdp.rewards import TabularReward
from irl_gym.reports.terminal_report import print_report
from irl_gym.runs.diagnosed import diagnose_unfinished
from irl_gym.runs.experiment import Experiment
from irl_gym.runs.reading.verified import recomputed
from irl_gym.runs.run import read_run

DATASET = "dataset/irl_gym/frozenlake-v1-expert-v0/data"
LAKE = {"env_kwargs": {"is_slippery": False}, "episodes": 5, "eval_episodes": 5, "num_envs": 8, "retrain": ValueIteration()}
ASKED = Experiment("FrozenLake-v1", 0.99, **LAKE)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    return recover_and_retrain(ASKED, tmp_path_factory.mktemp("vouched") / "run").out


def negated(path):
    reward = TabularReward.load(path)
    TabularReward(-reward.values, reward.note, reward.tolerance).save(path)


def rolled(path):
    np.savez(path, actions=np.roll(load_actions(path), 1))


def other_gamma(path):
    with np.load(path) as archive:
        arrays = dict(archive)
    np.savez(path, **arrays | {"gamma": np.array(0.5)})


def another(path):
    write_json(path, {**read_json(path), "gamma": 0.5, "expert_optimal": True})


def longer(path):
    path.write_bytes(path.read_bytes() + b" ")


SWAPS = {
    "reward.npz": negated, "expert.npz": rolled, "agent_policy.npz": rolled, "table.npz": other_gamma,
    "certificate.json": another, "metrics.json": another, "diagnosis.json": another, "environment.json": longer,
    "learning_curve.csv": longer, "ambiguity.npz": longer, "films/agent.json": longer, f"{DATASET}/main_data.hdf5": longer,
}  # fmt: skip


@pytest.mark.parametrize("name", SWAPS)
def test_a_swapped_file_is_named_by_who_reads_and_who_continues_and_the_mend_works(finished, copied, name):
    SWAPS[name](copied / name)
    with pytest.raises(
        RunIncomplete, match=rf"{name} is not the file that the run left, by its sha256.*; delete it, and it is made"
    ):
        read_run(copied)
    with pytest.raises(RunConflict, match=rf"{name} is not the file that the run left, by its sha256.*\. Delete it, and it"):
        recover_and_retrain(ASKED, copied)
    (copied / name).unlink()  # as both say
    recover_and_retrain(ASKED, copied)
    assert (copied / name).read_bytes() == (finished / name).read_bytes() and read_run(copied).vouched


@pytest.mark.parametrize("name", ["config.json", "run.json"])
def test_a_swapped_beginning_is_named_and_the_run_is_to_be_made_again(copied, name):
    write_json(copied / name, {**read_json(copied / name), "gamma": 0.5, "command": ["rm", "-r"]})
    with pytest.raises(RunIncomplete, match=rf"is damaged: {name} is not the file that the run left.*Make the run again"):
        read_run(copied)


def test_a_swapped_command_is_named_by_who_continues_and_the_mend_works(copied):
    write_json(copied / "run.json", {**read_json(copied / "run.json"), "command": ["rm", "-r"]})
    with pytest.raises(RunConflict, match=r"run\.json is not the file .* Delete it, and it is written again"):
        recover_and_retrain(ASKED, copied)
    (copied / "run.json").unlink()
    recover_and_retrain(ASKED, copied, command=("python", "mine.py"))
    assert read_run(copied).version["command"] == ["python", "mine.py"]


def test_the_doctor_says_nothing_of_files_that_were_swapped(copied):
    (copied / ".stages" / "metrics.json").unlink()  # as of a run that was killed
    assert diagnose_unfinished(copied) is not None
    negated(copied / "reward.npz")
    assert diagnose_unfinished(copied) is None


def test_a_table_that_is_made_again_and_is_another_is_refused(copied):
    record = read_json(copied / ".stages" / "start.json")
    record["sha256"]["table.npz"] = "0" * 64
    write_json(copied / ".stages" / "start.json", record)
    (copied / "table.npz").unlink()
    with pytest.raises(RunConflict, match=r"table\.npz was made again, and is another .* Choose another --out"):
        recover_and_retrain(ASKED, copied)


def test_every_file_is_recorded_but_those_that_nothing_is_made_from(finished):
    recorded = {name for one in (finished / ".stages").iterdir() for name in read_json(one)["sha256"]}
    there = {one.relative_to(finished).as_posix() for one in finished.rglob("*") if one.is_file()}
    others = {name for name in there if name.startswith((*FOR_PEOPLE, ".stages/", LOGS))}
    assert recorded == there - others and len(recorded) > 15


@pytest.mark.parametrize("name", ["report.html", "metrics.csv", "figures/rewards.png"])
def test_what_is_made_for_people_may_be_changed(copied, name):
    (copied / name).write_text("mine")
    assert read_run(copied).vouched and recover_and_retrain(ASKED, copied).stages["report"]["kept"]
    assert (copied / name).read_text() == "mine"


def test_a_run_that_is_continued_records_what_a_run_in_one_go_records(finished, copied):
    for name in ("agent", "metrics", "report"):
        (copied / ".stages" / f"{name}.json").unlink()
    recover_and_retrain(ASKED, copied)
    for one in (finished / ".stages").iterdir():
        assert read_json(one)["sha256"] == read_json(copied / ".stages" / one.name)["sha256"]


@pytest.mark.parametrize("continued", [False, True])
def test_a_run_without_digests_is_read_and_its_page_says_that_nothing_vouches_for_it(copied, continued):
    without_digests(copied)
    (copied / ".stages" / "start.json").unlink()
    (copied / "report.html").unlink()
    if continued:
        recover_and_retrain(ASKED, copied)
        assert "Nothing vouches for this run&#39;s files" in (copied / "report.html").read_text()
    assert not read_run(copied).vouched and "no digests are kept" in read_run(copied).caution


def test_a_page_of_a_run_with_digests_says_nothing_of_them(finished):
    assert read_run(finished).caution is None and "vouches" not in (finished / "report.html").read_text()


@pytest.mark.parametrize("name", ["../outside", "/etc/hostname", "films/../../outside"])
@pytest.mark.parametrize("key", ["files", "sha256"])
def test_a_record_that_names_files_outside_of_the_run_is_none(copied, monkeypatch, name, key):
    (copied.parent / "outside").touch()
    record = read_json(copied / ".stages" / "reward.json")
    record[key] = [*record[key], name] if key == "files" else {**record[key], name: "0" * 64}
    write_json(copied / ".stages" / "reward.json", record)
    with pytest.raises(RunIncomplete, match="'reward' was not finished"):
        read_run(copied)


def test_a_file_that_a_power_cut_left_empty_is_named_and_made_again_as_the_error_says(copied):
    (copied / "reward.npz").write_bytes(b"")
    with pytest.raises(RunConflict, match=r"reward\.npz is not the file that the run left.* Delete it, and its stage is run"):
        recover_and_retrain(ASKED, copied)
    (copied / "reward.npz").unlink()
    recover_and_retrain(ASKED, copied)
    assert read_run(copied).vouched


@pytest.mark.parametrize("stage", ["start", "reward", "record"])
def test_a_record_whose_digests_are_empty_vouches_for_nothing(copied, stage):
    kept = copied / ".stages" / f"{stage}.json"
    write_json(kept, {**read_json(kept), "sha256": {}})
    assert not read_run(copied).vouched


@pytest.mark.parametrize("told", [[], "all", 7, None, {"reward.npz": 7}, {"reward.npz": None}])
def test_digests_that_are_none_are_not_believed(copied, told):
    record = json.loads((copied / ".stages" / "reward.json").read_text())
    write_json(copied / ".stages" / "reward.json", {**record, "sha256": told})
    with pytest.raises(RunIncomplete, match=r"'reward' was not finished|reward\.npz is not the file"):
        read_run(copied)


def test_a_record_that_does_not_tell_its_demonstrations_leaves_the_loss_to_the_record(finished, copied):
    run = read_run(finished)
    write_json(copied / ".stages" / "demonstrations.json", {"files": []})
    asked = {**run.config, "epsilon": 0.1}
    assert recomputed(copied, asked, run.metrics["reward"], run.table, run.expert, run.tabular) is None


@pytest.mark.parametrize(("stage", "told"), [("expert", {"files": []}), ("reward", {"stats": 5}), ("agent", {"seconds": -1})])
def test_a_stage_whose_record_says_what_none_says_is_run_again(copied, stage, told):
    kept = copied / ".stages" / f"{stage}.json"
    was = read_json(kept)
    write_json(kept, told if stage == "expert" else was | told)
    stages = recover_and_retrain(ASKED, copied).stages
    assert [name for name, record in stages.items() if not record.get("kept")] == ["table", stage]
    assert read_json(kept)["sha256"] == was["sha256"]


def test_an_examination_that_fails_is_told_as_no_answer(copied, monkeypatch):
    def refused(case):
        raise SolverFailed("no solver gave an answer.")

    monkeypatch.setattr(final_stages, "diagnose", refused)
    for stage in ("ambiguity", "report"):
        (copied / ".stages" / f"{stage}.json").unlink()
    console = Console(file=io.StringIO(), width=250)
    print_report(recover_and_retrain(ASKED, copied), console)
    assert read_run(copied).diagnosis["answer"] == "not examined"
    told = "Not examined: the examination failed (SolverFailed: no solver gave an answer.)."
    assert told in console.file.getvalue() and told in (copied / "report.html").read_text()
