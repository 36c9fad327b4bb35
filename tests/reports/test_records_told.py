"""What only a record says is told as one; what a stranger wrote into it does nothing to who reads it."""

import csv
import html
import io
import shutil

import pytest
from forgetting import with_digests_anew
from lake_run import asked, of_policies
from rich.console import Console

from irl_gym.agents.planners import ValueIteration
from irl_gym.files.run_folder import read_json, write_json
from irl_gym.loop.pipeline import recover_and_retrain
from irl_gym.reports.comparison.comparison_page import write_comparison
from irl_gym.reports.page.report import write_report
from irl_gym.reports.terminal_report import print_report
from irl_gym.runs.experiment import Experiment
from irl_gym.runs.metrics_csv import write_metrics_csv
from irl_gym.runs.run import read_run
from irl_gym.runs.scorecard import read_metrics

NAME, HOW = "theirs\x1b[2J\nThe doctor: Healthy.", "by \u202eguess\r"
SPELLED = "theirs\\x1b[2J\\nThe doctor: Healthy.", "by \\u202eguess\\r"


@pytest.fixture
def strange(copied):
    """A run with a row of metrics.json that somebody added."""
    told = read_json(copied / "metrics.json")
    told["policies"][NAME] = {**told["policies"]["retrained"], "how": HOW}
    write_json(copied / "metrics.json", told)
    return with_digests_anew(copied)


def in_terminal(path, to, experiment=None):
    console = Console(width=400, record=True, file=io.StringIO())
    print_report(recover_and_retrain(experiment or asked(), path), console)
    return console.export_text()


def on_page(path, to):
    write_report(read_run(path), to / "page.html")
    return (to / "page.html").read_text()


def in_comparison(path, to):
    write_comparison([read_run(path)] * 2, to / "both.html")
    return (to / "both.html").read_text()


def in_notebook(path, to):
    return read_run(path)._repr_html_()


def in_csv(path, to):
    write_metrics_csv(read_metrics(path / "metrics.json"), to / "a.csv", env=None, config=read_json(path / "config.json"))
    with (to / "a.csv").open(newline="") as file:
        return "\n".join(",".join(row) for row in csv.reader(file))


@pytest.mark.parametrize("shown", [in_terminal, on_page, in_comparison, in_csv, in_notebook])
def test_names_of_a_stranger_s_policies_are_spelled_out(strange, tmp_path, shown):
    said = shown(strange, tmp_path)
    told = " ".join(said.split())  # captions are wrapped
    assert SPELLED[0] in told and (SPELLED[1] in told or shown in (in_csv, in_notebook))
    assert not any(one in said for one in ("\x1b", "\u202e", "\r"))


@pytest.mark.parametrize("shown", [in_terminal, on_page, in_comparison, in_notebook])
def test_what_a_stranger_says_of_policies_is_told_as_a_record(strange, tmp_path, shown):
    said = shown(strange, tmp_path)
    assert "All else is the run's own record, and among it" in html.unescape(said) and "what is said of theirs" in said


def test_of_a_run_without_a_table_that_is_shown_again_all_is_told_as_a_record(policy_run, tmp_path):
    path = shutil.copytree(policy_run("stepped"), tmp_path / "stepped")
    assert "Everything is the run's own record." in in_terminal(path, tmp_path, of_policies("stepped"))


def test_a_run_that_was_just_made_is_not_told_as_a_record(tmp_path):
    made = {"episodes": 2, "retrain": ValueIteration(), "env_kwargs": {"desc": ["SF", "FG"], "is_slippery": False}}
    first, again = (in_terminal(tmp_path / "run", tmp_path, Experiment("FrozenLake-v1", 0.9, **made)) for _ in range(2))
    assert "own record" not in first and "Computed again from its files" in again


def test_a_policy_s_name_is_short(copied, strange):
    told = read_json(strange / "metrics.json")
    told["policies"]["x" * 201] = told["policies"].pop(NAME)
    write_json(strange / "metrics.json", told)
    with pytest.raises(Exception, match=r"metrics\.json cannot be read .*at most 200 characters"):
        read_run(with_digests_anew(strange))


def test_the_doctor_s_answer_is_told_as_a_record_where_the_run_was_kept(copied, finished, tmp_path):
    said = in_terminal(copied, tmp_path)
    assert "The doctor, as recorded when the run was made: " in said
    assert "As recorded when the run was made: " in on_page(finished, tmp_path)
