"""What the page says was asked, why there is no score, and which flags mend."""

from dataclasses import replace

from reports.page.made_runs import section_of, table_run, verdict_of

from irl_gym.reports.page.sections.asked import asked, typed
from irl_gym.reports.page.sections.proof import doctor, finding

SCRIPT = ("irl-gym", "run")


def test_only_what_was_typed_is_listed(tmp_path):
    command = [*SCRIPT, "--env-id", "FrozenLake-v1", "--l1", "0.5", "--env-kwargs", "a=1", "b=2", "--no-shaping", "--out", "x"]
    assert list(typed(command)) == [("--l1", "0.5"), ("--env-kwargs", "a=1 b=2"), ("--no-shaping", "yes")]


def test_flags_with_an_equals_sign_are_read_too():
    assert list(typed([*SCRIPT, "--gamma=0.9", "--out=x", "--seed", "3"])) == [("--gamma", "0.9"), ("--seed", "3")]


def test_flags_with_underscores_are_read_as_the_help_spells_them():
    command = [*SCRIPT, "--env_id", "FrozenLake-v1", "--env_kwargs", "is_slippery=false", "--margin_cap=none", "--out", "x_y"]
    assert list(typed(command)) == [("--env-kwargs", "is_slippery=false"), ("--margin-cap", "none")]


def test_the_bare_command_lists_the_environment_alone(tmp_path):
    run = table_run(tmp_path, films=False)
    bare = replace(run, version={**run.version, "command": [*SCRIPT]})
    assert section_of(asked, bare).shown["lines"] == [("environment", "FrozenLake-v1")]


def test_a_run_from_python_lists_what_differs_from_its_defaults(tmp_path):
    run = table_run(tmp_path, films=False, seed=4)
    lines = dict(section_of(asked, replace(run, version={**run.version, "command": None})).shown["lines"])
    assert lines["seed"] == "4" and lines["gamma"] == "0.9"


def test_the_verdict_says_why_there_is_no_score(tmp_path):
    run = table_run(tmp_path, films=False)
    policies = {name: {**row, "score": None} for name, row in run.metrics["policies"].items()}
    told = verdict_of(replace(run, metrics={**run.metrics, "policies": policies, "score_reason": "two episodes are few"}))
    first = told["questions"][0]
    assert "There is no score, as two episodes are few." in first["sentences"]
    assert first["figures"][0]["note"] == "two episodes are few"


def test_the_doctors_mends_name_their_flags(tmp_path):
    run = table_run(tmp_path, films=False)
    found = {"name": "ties", "sentence": "Tied in {where}.", "mend": "Capped.", "flags": ["--margin-cap auto", "--l1 0"]}
    found |= {"states": [6], "actions": []}
    diagnosis = {"answer": "findings", "why": None, "examined": "", "findings": [found]}
    (told,) = section_of(doctor, replace(run, diagnosis=diagnosis)).shown["findings"]
    assert told["mend"] == "Capped. On the command line: --margin-cap auto, --l1 0."


def test_the_doctors_sentences_name_states_and_actions(tmp_path):
    found = {"name": "ties", "sentence": "Tied in {where}.", "mend": "Cap.", "states": [6], "actions": [2], "flags": []}
    told = finding(found, table_run(tmp_path, films=False).place_name, given=False)
    assert told == {"name": "ties", "sentence": "Tied in s=6 a=2 (row 1, column 2; right).", "mend": "Cap."}
