"""The subcommands that are new with `irl-gym`: tables, learners, papers, and a file as a dataset."""

import gymnasium as gym
import numpy as np
import pytest

from irl_gym.commands.learners import rows
from irl_gym.demonstrations.datasets import read_minari
from irl_gym.learners.registry import BUILT_IN, learner_class
from irl_gym.tables.table_files import load_table


def test_a_table_is_kept_and_told(irl_gym, here):
    done = irl_gym("tabulate", "--env-id", "FrozenLake-v1", "--gamma", "0.9", "--out", "lake.npz")
    assert done.code == 0, done.errors
    said = {line[:24].strip(): line[25:] for line in done.out.splitlines()}
    assert said["states"] == "16, 16 reachable, 5 terminal" and said["actions"] == "4" and said["exact"] == "yes"
    assert said["hidden state"].startswith("none found: ") and done.out.endswith("Wrote lake.npz.\n")
    table = load_table(here / "lake.npz", gym.make("FrozenLake-v1").observation_space)
    assert table.mdp.gamma == 0.9 and table.mdp.n_states == 16 and table.reward.values.sum() == pytest.approx(1.0)


def test_a_table_says_what_is_shown_of_what_the_environment_hides(irl_gym, here):
    done = irl_gym("tabulate", "--env-id", "Blackjack-v1")
    assert done.code == 0 and "hidden, and shown here   natural (2 values)" in done.out, done.out


def test_a_table_of_cells_says_that_it_is_not_exact(irl_gym, here):
    done = irl_gym("tabulate", "--env-id", "MountainCar-v0", "--bins", "8", "--out", "car.npz")
    assert (
        done.code == 0 and "exact                    no" in done.out and "hidden state             not looked for" in done.out
    )


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--env-id", "Pendulum-v1"), "NotDiscrete"),
        (("--env-id", "own_env_here:Fog-v0", "--reveal", "none"), "--reveal name=number"),
        (("--out", "none/table.npz"), "there is no folder none"),
        (("--steps", "9"), "expected --table sample with it"),
    ],
)
def test_no_table_gets_one_clear_line(irl_gym, here, words, says):
    done = irl_gym("tabulate", *words)
    assert done.code == 2 and says in done.errors and done.errors.count("\n") == 1 and not (here / "table.npz").exists()


def test_learners_are_told_by_what_they_declare(here, monkeypatch):
    monkeypatch.syspath_prepend(here)
    found = {row[0]: row[1:] for row in rows(["own_learner_here:Twin"])}
    assert [*found] == [*BUILT_IN, "own_learner_here:Twin"]
    assert {name: row[0] for name, row in found.items()} == {name: learner_class(name).needs.column for name in found}
    alone = "yes (demonstrations; states alone)"
    assert found["trajectory-lp"][1:] == [alone, "yes (environment)", "no", "no", "features (optional)"]
    assert found["own_learner_here:Twin"] == found["finite-lp"]


def test_learners_are_a_table_in_markdown_too(irl_gym):
    head, rule, *lines = irl_gym("learners", "--markdown").out.splitlines()
    assert (
        head.startswith("| learner | setting | ") and rule.count("---") == head.count("|") - 1 and len(lines) == len(BUILT_IN)
    )
    said = irl_gym("learners").out
    assert [name for name in BUILT_IN if name not in said] == []


def test_papers_are_listed(irl_gym):
    assert "\n    ng-russell-2000\n" in irl_gym("reproduce", "--help").out


def test_a_file_becomes_a_dataset(irl_gym, here):
    (here / "log.csv").write_text("episode,step,cell,action\na,0,0,1\na,1,4,1\nb,0,0,2\n")
    asked = ("--csv", "log.csv", "--observation-columns", "cell", "--dataset-id", "me/log-v0", "--root", ".")
    done = irl_gym("export", "--env-id", "FrozenLake-v1", *asked)
    assert done.code == 0 and done.out.startswith("me/log-v0: 2 episodes, 3 steps, "), done.errors
    found = [*read_minari("me/log-v0", root=here)]
    assert [one.actions.tolist() for one in found] == [[1, 1], [2]] and np.array_equal(found[0].observations[:2], [0, 4])


def test_one_of_a_kind_is_told_in_the_singular(irl_gym, here):
    (here / "log.csv").write_text("episode,step,cell,action\na,0,0,1\n")
    asked = ("--csv", "log.csv", "--observation-columns", "cell", "--dataset-id", "me/log-v0", "--root", ".")
    done = irl_gym("export", "--env-id", "FrozenLake-v1", *asked)
    assert done.code == 0 and done.out.startswith("me/log-v0: 1 episode, 1 step, "), done.errors


def test_of_several_columns_all_are_named_where_one_is_mistyped(irl_gym, here):
    (here / "log.csv").write_text("episode,step,x1,x2,action\na,0,0,0,1\n")
    done = irl_gym("run", "--env-id", "CartPole-v1", "--csv", "log.csv", "--observation-columns", "x1", "y2")
    assert done.code == 2 and "Did you mean --observation-columns x1 x2?" in done.errors
