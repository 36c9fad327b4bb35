"""The script as a person runs it, by subprocess."""

import json
import shutil
from types import FunctionType

import pytest
from forgetting import without_digests


@pytest.fixture
def copied(planned, tmp_path):
    shutil.copytree(planned / "plain", tmp_path / "run")
    return tmp_path


def test_a_page_that_is_written_again_is_the_run_s_own(script, planned, tmp_path):
    made = script("report", "--run", planned / "plain", "--out", tmp_path / "again.html", cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    assert "Wrote" in made.stdout and made.stderr == ""
    assert (tmp_path / "again.html").read_bytes() == (planned / "plain" / "report.html").read_bytes()


def test_the_page_lies_in_the_run_s_folder_unless_asked_otherwise(script, copied):
    (copied / "run" / "report.html").unlink()
    made = script("report", "--run", "run", cwd=copied)
    assert made.returncode == 0 and (copied / "run" / "report.html").stat().st_size > 1_000_000, made.stderr


def test_a_page_names_no_folder_that_the_user_did_not_type(planned):
    assert str(planned) not in (planned / "plain" / "report.html").read_text()


def test_a_folder_that_is_no_run_gets_one_clear_line(script, tmp_path):
    made = script("report", "--run", ".", cwd=tmp_path)
    assert made.returncode == 2 and made.stderr.startswith("RunIncomplete") and "Traceback" not in made.stderr


@pytest.mark.parametrize("name", ["report", "doctor"])
def test_a_run_of_another_format_gets_one_clear_line(script, copied, name):
    held = without_digests(copied / "run") / "certificate.json"
    told = json.loads(held.read_text())
    terms = {**told["proof"]["terms"], "margin": "wide", "margin_cap": [], "states": "all"}
    held.write_text(json.dumps({**told, "proof": {**told["proof"], "terms": terms}}))
    (copied / "run" / "metrics.json").write_text(json.dumps({"policies": [], "table": {"states": 16}, "reward": "good"}))
    made = script(name, "--run", "run", cwd=copied)
    assert "Traceback" not in made.stderr and made.stderr.count("\n") <= 1
    assert made.returncode == 2 and made.stderr.startswith(
        "RunIncomplete: run is incomplete: metrics.json cannot be read (DamagedFile: its policies is []"
    )


@pytest.mark.parametrize(
    ("name", "arguments", "place"),
    [
        ("report", ("--run", "run"), "irl_gym.reports.page.report.write_report"),
        ("doctor", ("--run", "run"), "irl_gym.runs.diagnosed.diagnose"),
        ("compare", ("run", "again"), "irl_gym.reports.comparison.comparison_page.write_comparison"),
        ("doctor", ("--run", "run"), "irl_gym.runs.run.claims"),
    ],
)
def test_a_defect_is_called_one_and_is_told_with_its_traceback(script, copied, monkeypatch, name, arguments, place):
    broken = FunctionType((lambda *_: {}["policies"]).__code__, {"__name__": "irl_gym.broken"})
    monkeypatch.setattr(place, broken)
    shutil.copytree(copied / "run", copied / "again")
    made = script(name, *arguments, cwd=copied)
    told = (
        "This is a defect of irl_gym, not of your files: KeyError: 'policies'. Please report it with this traceback:\nTraceback"
    )
    assert made.returncode == 70 and made.stderr.startswith(told) and "in <lambda>" in made.stderr


def test_a_page_that_cannot_be_written_gets_one_clear_line(script, planned, tmp_path):
    made = script("report", "--run", planned / "plain", "--out", tmp_path / "none" / "a.html", cwd=tmp_path)
    assert made.returncode == 2 and f"there is no folder {tmp_path / 'none'}" in made.stderr and "Traceback" not in made.stderr


def test_a_folder_of_the_page_s_own_name_gets_one_clear_line_and_leaves_nothing(script, copied):
    (copied / "run" / "report.html").unlink()
    (copied / "run" / "report.html").mkdir()
    made = script("report", "--run", "run", cwd=copied)
    assert made.returncode == 2 and "report.html is a folder: expected a file" in made.stderr and made.stderr.count("\n") == 1
    assert not list((copied / "run").glob(".*.tmp"))
