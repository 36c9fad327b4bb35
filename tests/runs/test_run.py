"""What a run leaves is read back whole; what is missing, damaged or newer is named."""

import csv
import json
import shlex
import shutil

import gymnasium as gym
import numpy as np
import pytest
from lake_run import COMMAND, asked

from irl_gym.errors import RunConflict, RunIncomplete, RunNewer
from irl_gym.files.run_folder import read_json, write_json
from irl_gym.loop.loop import Loop
from irl_gym.loop.pipeline import recover_and_retrain
from irl_gym.mdp.rewards import TabularReward
from irl_gym.runs.identity import write_environment
from irl_gym.runs.run import read_run
from irl_gym.tables.layouts import grid_layout


@pytest.fixture(scope="module")
def run(finished):
    return read_run(finished)


def test_a_run_knows_its_command_as_a_shell_reads_it(run):
    assert shlex.split(run.command) == list(COMMAND)


def test_a_run_knows_its_environment(run):
    assert (run.env_id, run.actions) == ("FrozenLake-v1", ("left", "down", "right", "up"))


def test_a_run_holds_its_table(run):
    assert (run.table.mdp.n_states, run.table.mdp.gamma, run.state_name(5)) == (16, 0.99, "row 1, column 1")


def test_a_run_holds_reward_expert_and_agent(run):
    assert run.tabular.values.shape == run.expert.shape == run.agent.shape == (16,)


def test_a_run_holds_its_map(run):
    assert run.grid.shape == (4, 4) and run.grid.letters[3, 3] == "G"


def test_a_map_is_read_as_it_was_written(toy_text):
    layout = grid_layout(gym.make("CliffWalking-v1"), toy_text("CliffWalking").mdp)
    again = type(layout).from_json(json.loads(json.dumps(layout.to_json())))
    assert all(np.array_equal(getattr(layout, name), getattr(again, name)) for name in layout.__dataclass_fields__)


def test_a_run_holds_widths_and_lambda_path(run):
    assert np.array_equal(run.widths["width"], run.widths["high"] - run.widths["low"], equal_nan=True)
    path = run.lambda_path
    assert len(path["breakpoints"]) == len(path["rewards"]) + 1 and path["r_max"] == 1.0 and path["margin_cap"] > 0


def test_the_diagnosis_is_the_doctors(run):
    assert (run.diagnosis["answer"] == "findings") is bool(run.diagnosis["findings"])


def test_the_curve_has_an_interval_around_its_mean(run):
    curve = run.curve
    assert curve.steps.size > 50 and (curve.low <= curve.mean).all() and (curve.mean <= curve.high).all()


def test_the_metrics_csv_is_read_in_one_line(finished, run):
    pandas = pytest.importorskip("pandas")
    table = pandas.read_csv(finished / "metrics.csv").pivot(index="policy", columns="metric", values="value")
    assert table.loc["retrained", "value"] == run.metrics["policies"]["retrained"]["value"]


def test_the_metrics_csv_tells_runs_apart_and_holds_the_rewards_numbers(finished, run):
    with (finished / "metrics.csv").open() as file:
        rows = list(csv.DictReader(file))
    config = run.config
    told = {(row["env"], float(row["gamma"]), int(row["seed"])) for row in rows}
    assert told == {(run.env_id, config["gamma"], config["seed"])}
    for name in ("env_kwargs", "learner", "retrain"):
        assert {row[name] for row in rows} == {json.dumps(config[name], sort_keys=True)}
    reward = {row["metric"]: row["value"] for row in rows if row["policy"] == "reward"}
    assert float(reward["l1_norm"]) == run.metrics["reward"]["l1_norm"] and reward["expert_optimal"] == "1"


def test_tensorboard_has_sb3s_scalars_and_the_curve(finished, run):
    event_accumulator = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    found = {}
    for file in sorted((finished / "tensorboard" / "retrained").iterdir()):
        events = event_accumulator.EventAccumulator(str(file))
        events.Reload()
        found |= {tag: events.Scalars(tag) for tag in events.Tags()["scalars"]}
    assert {"train/loss", "rollout/ep_rew_mean"} <= set(found)
    assert [event.step for event in found["loop/mean_return"]] == run.curve.steps.astype(int).tolist()


def test_a_run_whose_logs_were_deleted_is_kept(copied):
    shutil.rmtree(copied / "tensorboard")
    assert recover_and_retrain(asked(), copied).stages["agent"]["kept"]


def test_the_command_of_the_first_start_is_kept(copied):
    recover_and_retrain(asked(), copied, command=("python", "another.py"))
    assert read_run(copied).version["command"] == list(COMMAND)


def test_the_command_is_no_part_of_what_identifies_a_run(finished):
    assert read_json(finished / "config.json") == json.loads(json.dumps(asked().to_json()))


# --- what cannot be read ---


@pytest.mark.parametrize(
    "name", ["reward.npz", "metrics.json", "agent_policy.npz", "table.npz", "learning_curve.csv", "films/agent/000.webp"]
)
def test_a_run_without_a_file_is_incomplete_by_name(copied, name):
    (copied / name).unlink()
    with pytest.raises(RunIncomplete, match=rf"{name} is missing.*--out \S+/copy$"):
        read_run(copied)


@pytest.mark.parametrize("name", ["reward.npz", "metrics.json", "grid.json", "ambiguity.npz", "films/agent.json", "table.npz"])
def test_a_run_with_a_damaged_file_is_incomplete_by_name(unvouched, name):
    (unvouched / name).write_bytes(b"[1]")
    with pytest.raises(RunIncomplete, match=f"{name} cannot be read"):
        read_run(unvouched)


def test_a_curve_with_a_field_that_has_no_end_is_damage(unvouched):
    (unvouched / "learning_curve.csv").write_text("a" * 300_000)
    with pytest.raises(RunIncomplete, match=r"learning_curve\.csv cannot be read"):
        read_run(unvouched)


def test_a_copied_run_is_continued_where_it_is_and_not_where_it_came_from(finished, copied):
    (copied / "reward.npz").unlink()
    with pytest.raises(RunIncomplete) as told:
        read_run(copied)
    assert shlex.split(str(told.value).rpartition(" continues it: ")[2])[-2:] == ["--out", str(copied)]
    assert "a folder" not in str(told.value)


@pytest.mark.parametrize("name", ["reward.npz", "expert.npz", "agent_policy.npz"])
def test_a_run_with_a_file_of_another_table_is_incomplete_by_name(unvouched, name):
    copied = unvouched
    other = np.zeros(36, dtype=np.int64)
    TabularReward(other).save(copied / name) if name == "reward.npz" else np.savez(copied / name, actions=other)
    with pytest.raises(RunIncomplete, match=rf"copy is incomplete: {name} has shape \(36,\).*\(16,\) or \(16, 4\); delete it"):
        read_run(copied)


@pytest.mark.parametrize("name", ["config.json", "run.json"])
def test_a_run_whose_start_is_damaged_is_to_be_made_again_in_a_new_folder(unvouched, name):
    copied = unvouched
    (copied / name).write_text("{")
    with pytest.raises(RunIncomplete, match=rf"{name} cannot be read") as told:
        read_run(copied)
    words = str(told.value)
    assert "delete it" not in words and "no stage writes again. Make the run again" in words and "runs/again" in words
    assert "a folder" not in words  # where the damaged run is


@pytest.mark.parametrize("name", ["config.json", "run.json", "metrics.json", "environment.json", "films/agent.json"])
def test_json_that_is_nested_too_deeply_is_damage(unvouched, name):
    copied = unvouched
    (copied / name).write_text("[" * 100_000)
    with pytest.raises(RunIncomplete, match=rf"{name} cannot be read.*nested too deeply"):
        read_run(copied)


def test_a_run_that_was_killed_is_incomplete_by_its_stage(tmp_path):
    loop = Loop(asked(), tmp_path, command=COMMAND)
    loop.stage("expert")
    with pytest.raises(RunIncomplete, match=r"the stage 'demonstrations' was not finished.*: irl-gym run --env-kwargs"):
        read_run(tmp_path)


def test_a_run_from_python_is_continued_from_python(tmp_path):
    Loop(asked(), tmp_path)
    with pytest.raises(RunIncomplete, match=r"recover_and_retrain\(experiment"):
        read_run(tmp_path)


def test_a_folder_that_is_no_run_is_refused(tmp_path):
    with pytest.raises(RunIncomplete, match="holds no run"):
        read_run(tmp_path)


@pytest.mark.parametrize("read", [read_run, lambda path: recover_and_retrain(asked(), path)])
def test_a_run_of_a_newer_version_asks_for_an_upgrade(copied, read):
    write_json(copied / "run.json", {"format": "irl_gym.Run/2", "irl_gym": "9.0.0", "command": None})
    with pytest.raises(RunNewer, match=r"written by irl_gym 9\.0\.0: expected 'irl_gym\.Run/1'.*Upgrade"):
        read(copied)


@pytest.mark.parametrize("told", ["irl_gym.Run/0", "irl_gym.Run/01", "irl_gym.Run/x", "another.Run/2", 7])
def test_a_format_that_is_no_newer_one_is_refused_without_an_upgrade(copied, told):
    write_json(copied / "run.json", {"format": told, "irl_gym": "0.0.1", "command": None})
    with pytest.raises(RunConflict, match=r"has format .*: expected 'irl_gym\.Run/1'"):
        read_run(copied)


# --- runs of earlier versions ---


@pytest.fixture
def older(unvouched):
    """A run as version 0.1 left it."""
    copied = unvouched
    (copied / ".stages" / "start.json").unlink()
    for name in ("films", "tensorboard"):
        shutil.rmtree(copied / name)
    for name in ("run.json", "environment.json", "grid.json", "metrics.csv", "ambiguity.npz", "diagnosis.json", "report.html"):
        (copied / name).unlink()
    for stage in ("record", "ambiguity", "report"):
        (copied / ".stages" / f"{stage}.json").unlink()
    lines = [",".join(line.split(",")[:2]) for line in (copied / "learning_curve.csv").read_text().splitlines()]
    (copied / "learning_curve.csv").write_text("\r\n".join(lines) + "\r\n")
    return copied


def test_a_run_of_an_earlier_version_is_read_once_its_environment_is_named(older):
    with pytest.raises(RunIncomplete, match=r"no environment\.json.*no environment is made to read a run.*write_environment"):
        read_run(older)
    write_environment(older, gym.make("FrozenLake-v1"), "FrozenLake-v1")
    run = read_run(older)
    assert (run.command, run.films, run.grid, run.widths, run.lambda_path) == (None, {}, None, None, None)
    assert np.isnan(run.curve.mean).all() and run.table.mdp.n_states == 16 and run.actions[0] == "left"


def test_a_run_of_an_earlier_version_gets_the_new_stages_only(older):
    made = recover_and_retrain(asked(), older)
    assert [name for name, record in made.stages.items() if not record.get("kept")] == [
        "table",
        "record",
        "ambiguity",
        "report",
    ]
    assert set(read_run(older).films) == {"expert", "agent"} and made.page.exists()
