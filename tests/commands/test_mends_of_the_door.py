"""The mends that `irl-gym` names where it reads its arguments are executed."""

import shutil

import pytest

LOG = "episode,step,cell,action\na,0,0,1\na,1,2,2\n"
POND = ("--env-id", "FrozenLake-v1", "--env-kwargs", 'desc=["SF","FG"]', "is_slippery=false")
CSV = ("--csv", "log.csv", "--observation-columns", "cell", "--retrain", "value-iteration")
ASKER = ("--learner", "own_learner_here:Asker", "--retrain", "value-iteration", "--episodes", "5")
KNOWER = ("--learner", "own_learner_here:Knower", *ASKER[2:])
CASES = [
    ("expected a subcommand, as in `irl-gym run --env-id FrozenLake-v1`.", ("--env-id", "FrozenLake-v1"),
     ("learners", "--markdown")),
    ("Name it with --env-id.", ("run", *CSV), ("run", *POND, *CSV)),
    ("Leave the others out.", ("run", *POND, *CSV, "--epsilon", "0.1"), ("run", *POND, *CSV)),
    ("Leave the others out.", ("export", *POND, *CSV[:4], "--dataset-id", "me/log-v0", "--root", ".", "--seed", "3"),
     ("export", *POND, *CSV[:4], "--dataset-id", "me/log-v0", "--root", ".")),
    ("Name the right one with --observation-columns NAME", ("run", *POND, *CSV[:2]), ("run", *POND, *CSV)),
    ("Did you mean --observation-columns cell?", ("run", *POND, *CSV[:3], "cel"), ("run", *POND, *CSV)),
    ("Did you mean --action-column action?", ("run", *POND, *CSV, "--action-column", "actoin"), ("run", *POND, *CSV)),
    ("If only the states are known, pass --action-column none.", ("run", *POND, *CSV, "--action-column", "u"),
     ("run", *POND, *CSV, "--action-column", "none")),
    ("Pass --step-column none if", ("run", *POND, *CSV, "--step-column", "cell"),
     ("run", *POND, *CSV, "--step-column", "none")),
    ("Leave the other out.", ("run", "--seed", "1", "--seeds", "0,1"), ("learners",)),
    ("Run irl-gym in the folder that has it, or install it.", ("learners", "nowhere_to_be_found:Twin"),
     ("learners", "own_learner_here:Twin")),
    ("Write own_learner_here:Twin.", ("learners", "own_learner_here.py:Twin"), ("learners", "own_learner_here:Twin")),
    ("Write own_env_here:Pond-v0.", ("tabulate", "own_env_here.py:Pond-v0"), ("tabulate", "own_env_here:Pond-v0")),
    ("Did you mean 'doctor'?", ("doktor",), ("doctor", "--help")),
    ("Did you mean 'ppo'?", ("run", "--retrain", "ppoo"), ("run", "--retrain", "ppo", "--help")),
    ("Did you mean 'value-iteration'?", ("run", *POND, "--retrain=value_iteration"),
     ("run", *POND, "--retrain=value-iteration", "--total-timesteps", "9", "--episodes", "5")),
    ("Did you mean 'value-iteration'?", ("run", *POND, "--expert", "value_iteration", *ASKER[2:]),
     ("run", *POND, "--expert", "value-iteration", *ASKER[2:])),
    ("Did you mean 'value-iteration'?", ("export", *POND, "--dataset-id", "me/log-v0", "--expert", "value_iteration"),
     ("export", *POND, "--dataset-id", "me/log-v0", "--root", ".", "--expert", "value-iteration", "--episodes", "2")),
    ("Did you mean 'is_slippery'?", ("tabulate", *POND[:4], "is_slipery=false"), ("tabulate", *POND)),
    ("Leave epsilon out. (On the command line: the same without --epsilon.)",
     ("run", *POND, *KNOWER, "--epsilon", "0.1"), ("run", *POND, *KNOWER)),
    ("Leave dataset out, and give env_id. (On the command line: --env-id FrozenLake-v1 without --dataset or --csv.)",
     ("run", *POND, *CSV, *ASKER[:2]), ("run", *POND, *ASKER)),
    ("Choose another --out.", ("run", *POND, *CSV, "--out", "taken"), ("run", *POND, *CSV, "--out", "other")),
]  # fmt: skip


@pytest.mark.parametrize(("says", "breaks", "mended"), CASES, ids=[f"{one[1][0]}: {one[0]}" for one in CASES])
def test_a_mend_that_the_command_line_names_serves(irl_gym, here, says, breaks, mended):
    (here / "log.csv").write_text(LOG)
    (here / "taken").mkdir()
    (here / "taken/notes.txt").write_text("mine")
    done = irl_gym(*breaks)
    assert done.code == 2 and says in done.errors
    done = irl_gym(*mended)
    assert done.code == 0, done.errors


def test_a_run_that_is_named_twice_is_refused_and_another_one_in_its_place_serves(irl_gym, here, finished):
    for name in ("a", "b"):
        shutil.copytree(finished, here / name)
    done = irl_gym("compare", "a", "./a")
    assert done.code == 2 and "a twice: expected different folders. Put another run in its place." in done.errors
    assert irl_gym("compare", "a", "b").code == 0
