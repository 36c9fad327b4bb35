"""`irl-gym run` of several seeds, and from a file: what is kept where, what is told, and that it goes on where it stopped."""

import json
import shutil

import gymnasium as gym
import pytest

from irl_gym.commands.arguments import parse_seeds
from irl_gym.commands.csv_columns import Log
from irl_gym.demonstrations.datasets import read_minari
from irl_gym.errors import InvalidParameter, SolverFailed
from irl_gym.files.run_folder import read_json
from irl_gym.learners.linear_programs.finite import FiniteLP

FEW = ("--episodes", "5", "--retrain", "value-iteration")
LOG = """ep,t,cell,move,done
a,0,0,1,False
a,1,2,2,True
b,0,0,1,False
b,1,2,2,True
"""
COLUMNS = ("--episode-column", "ep", "--step-column", "t", "--observation-columns", "cell", "--action-column", "move")
POND = ("--env-id", "FrozenLake-v1", "--env-kwargs", 'desc=["SF","FG"]', "is_slippery=false")


@pytest.mark.parametrize(
    ("text", "seeds"), [("0-4", [0, 1, 2, 3, 4]), ("0,3,7", [0, 3, 7]), ("3", [3]), (" 5 , 1-2 ", [5, 1, 2])]
)
def test_seeds_are_numbers_and_ranges(text, seeds):
    assert parse_seeds(text) == seeds


@pytest.mark.parametrize("text", ["", "4-0", "a", "1,1", "0-99", "-1", "1..3", "0-2,2", "9" * 5_000])
def test_other_seeds_are_refused(text):
    with pytest.raises(InvalidParameter, match="such as 0-4 or 0,3,7"):
        parse_seeds(text)


@pytest.fixture
def broken_for(monkeypatch):
    """Let the learner fail for some seeds: `broken_for` holds them."""
    seeds, learn = set(), FiniteLP.learn

    def failing(self, problem, rng):
        if int(rng.bit_generator.seed_seq.entropy) in seeds:
            raise SolverFailed("no solver gave an answer: expected one.")
        return learn(self, problem, rng)

    monkeypatch.setattr(FiniteLP, "learn", failing)
    return seeds


def test_seeds_are_run_into_folders_of_their_own_and_pooled(irl_gym, here):
    done = irl_gym("run", *POND, *FEW, "--seeds", "0,3", "--out", "many")
    assert done.code == 0, done.errors
    assert sorted(one.name for one in (here / "many").iterdir()) == ["compare.html", "seed-0", "seed-3"]
    assert "runs A, B, mean over 2 seeds: score 1.000" in done.out and "Wrote many/compare.html: 2 runs" in done.out
    assert done.out.startswith("seed 0, many/seed-0: ") and "\nseed 3, many/seed-3: " in done.out
    kept = [read_json(here / f"many/seed-{seed}/run.json")["command"] for seed in (0, 3)]
    assert kept[1] == ["irl-gym", "run", *POND, *FEW, "--seed", "3", "--out", "many/seed-3"]


def test_the_command_of_one_seed_is_that_of_its_run(irl_gym, here):
    assert irl_gym("run", *POND, *FEW, "--seeds", "0,1", "--out", "many").code == 0
    before = (here / "many/seed-1/metrics.json").read_bytes()
    words = read_json(here / "many/seed-1/run.json")["command"]
    done = irl_gym(*words[1:])
    assert done.code == 0 and "(kept)" in done.out and (here / "many/seed-1/metrics.json").read_bytes() == before


def test_a_seed_that_fails_is_told_and_loses_no_other(irl_gym, here, broken_for):
    broken_for.add(1)
    done = irl_gym("run", *POND, *FEW, "--seeds", "0-2", "--out", "many")
    assert done.code == 2 and "SolverFailed: no solver gave an answer" in done.errors
    assert "seed-1 did not end, as told above." in done.out and "runs A, B, mean over 2 seeds" in done.out
    broken_for.clear()
    done = irl_gym("run", *POND, *FEW, "--seeds", "0-2", "--out", "many")
    assert done.code == 0 and "runs A, B, C, mean over 3 seeds" in done.out


def test_more_seeds_go_into_the_folder_that_the_first_ones_have(irl_gym, here):
    assert irl_gym("run", *POND, *FEW, "--seeds", "0").code == irl_gym("run", *POND, *FEW, "--seeds", "1").code == 0
    (folder,) = (here / "runs").iterdir()
    assert folder.name.startswith("FrozenLake-v1-") and folder.name.endswith("-seeds")
    assert sorted(one.name for one in folder.iterdir()) == ["seed-0", "seed-1"]


def test_ctrl_c_ends_all_seeds(irl_gym, here, monkeypatch):
    def stopped(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("irl_gym.loop.pipeline.recover_and_retrain", stopped)
    done = irl_gym("run", *POND, *FEW, "--seeds", "0-4")
    assert done.code == 130 and done.errors.count("Stopped.") == 1


def test_a_file_goes_into_a_run_and_is_kept_there_as_a_dataset(irl_gym, here):
    (here / "my log.csv").write_text(LOG)
    asked = ("run", *POND, "--csv", "my log.csv", *COLUMNS, "--terminated-column", "done", *FEW[2:], "--out", "run")
    done = irl_gym(*asked)
    assert done.code == 0, done.errors
    config = read_json(here / "run/config.json")
    assert config["dataset"].startswith("csv/my-log-") and config["dataset_root"] == "run/dataset"
    told = json.loads((here / "run/dataset" / config["dataset"] / "data/metadata.json").read_text())
    assert told["total_episodes"] == 2 and "Made of my log.csv, sha256 " in told["description"]
    assert read_json(here / "run/metrics.json")["policies"]["retrained"]["score"] == 1.0
    (here / "run/report.html").unlink()
    assert irl_gym(*asked).code == 0 and (here / "run/report.html").exists()


def test_a_file_of_states_alone_goes_into_a_run(irl_gym, here):
    (here / "states.csv").write_text("episode,step,cell\na,0,0\na,1,2\na,2,3\nb,0,0\nb,1,2\nb,2,3\n")
    alone = ("--csv", "states.csv", "--observation-columns", "cell", "--action-column", "none")
    done = irl_gym("run", *POND, *alone, *FEW[2:], "--out", "run")
    assert done.code == 0, done.errors
    assert read_json(here / "run/metrics.json")["policies"]["retrained"]["score"] == pytest.approx(1)
    told = {one["label"]: one["sentence"] for one in read_json(here / "run/certificate.json")["proof"]["facts"]}
    assert "actions inferred" in done.out and "4 can be of one action only" in told["actions inferred"]


def test_an_export_may_leave_the_actions_out(irl_gym, here):
    asked = ("export", *POND, "--dataset-id", "me/pond-v0", "--root", "data", "--episodes", "2", "--states-only")
    done = irl_gym(*asked)
    assert done.code == 0, done.errors
    assert [one.actions for one in read_minari("me/pond-v0", root="data")] == [None, None]


def test_a_file_that_changed_is_another_run(irl_gym, here):
    (here / "log.csv").write_text(LOG)
    asked = ("run", *POND, "--csv", "log.csv", *COLUMNS, "--terminated-column", "done", *FEW[2:], "--out", "run")
    assert irl_gym(*asked).code == 0
    (here / "log.csv").write_text(LOG + "c,0,0,1,False\nc,1,2,2,True\n")
    done = irl_gym(*asked)
    assert done.code == 2 and "RunConflict: run holds another run: its dataset is 'csv/log-" in done.errors


def test_several_seeds_learn_from_one_dataset_of_a_file(irl_gym, here):
    (here / "log.csv").write_text(LOG)
    asked = (*POND, "--csv", "log.csv", *COLUMNS, "--terminated-column", "done", *FEW[2:])
    done = irl_gym("run", *asked, "--seeds", "0,1", "--out", "many")
    assert done.code == 0 and "runs A, B, mean over 2 seeds" in done.out, done.errors
    assert (here / "many/dataset").is_dir() and not (here / "many/seed-0/dataset").exists()


def test_a_file_that_cannot_be_right_leaves_nothing(irl_gym, here):
    (here / "log.csv").write_text(LOG.replace("a,1,2,2,True", "a,1,2,9,True"))
    done = irl_gym("run", *POND, "--csv", "log.csv", *COLUMNS, "--terminated-column", "done", "--out", "run")
    assert done.code == 2 and "line 3 of log.csv" in done.errors and done.errors.count("\n") == 1
    assert not (here / "run").exists()


def test_what_a_file_loses_is_said_in_one_line_with_its_count_and_the_option(here, capsys):
    (here / "log.csv").write_text(LOG)
    env = gym.make("FrozenLake-v1", desc=["SF", "FG"], is_slippery=False)
    log = Log(here / "log.csv", "ep", "t", ("cell",), "move", terminated_column="done", last="drop")
    assert [len(one) for one in log.episodes(env)] == [1, 1]
    said = (
        "UserWarning: the last action of 2 of 2 episodes is dropped, with what it paid: give next observations, or --last keep"
    )
    assert (found := capsys.readouterr().err).startswith(said) and found.count("\n") == 1


def test_a_run_is_no_folder_for_seeds(irl_gym, here):
    assert irl_gym("run", *POND, *FEW, "--out", "one").code == 0
    done = irl_gym("run", *POND, *FEW, "--seeds", "0-1", "--out", "one")
    assert done.code == 2 and "RunConflict: one holds a run: expected a folder for one run a seed" in done.errors
    shutil.rmtree(here / "one")
