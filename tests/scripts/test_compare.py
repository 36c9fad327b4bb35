"""The script as a person runs it, by subprocess."""

import json
import shutil

import pytest
from forgetting import without_digests


@pytest.fixture(scope="module")
def finished(process, planned, tmp_path_factory):
    cwd = tmp_path_factory.mktemp("script")
    shutil.copytree(planned / "plain", cwd / "plain")
    made = process(
        "recover_and_retrain", "--episodes", "5", "--retrain", "value-iteration", "--l1", "0.5", "--out", "priced", cwd=cwd
    )
    assert made.returncode == 0, made.stderr
    return cwd


def test_two_runs_make_one_page(script, finished):
    made = script("compare", "plain", "priced", "--out", "both.html", cwd=finished)
    assert made.returncode == 0, made.stderr
    text = (finished / "both.html").read_text()
    assert "2 runs side by side" in text and "learner.l1" in text and "2 runs side by side" in made.stdout


def test_one_run_is_refused(script, finished):
    made = script("compare", "plain", cwd=finished)
    assert made.returncode == 2 and "InvalidParameter: runs has 1 folder, plain: expected two or more" in made.stderr


def test_a_page_in_a_folder_that_does_not_exist_is_refused(script, finished):
    made = script("compare", "plain", "priced", "--out", "none/both.html", cwd=finished)
    assert made.returncode == 2 and "there is no folder none" in made.stderr and "Traceback" not in made.stderr


def test_a_folder_that_is_no_run_is_named(script, finished):
    made = script("compare", "plain", "nowhere", cwd=finished)
    assert made.returncode == 2 and "RunIncomplete: nowhere" in made.stderr and "Traceback" not in made.stderr


def test_the_one_damaged_run_of_many_is_named_alone(script, finished):
    shutil.copytree(finished / "plain", finished / "damaged", dirs_exist_ok=True)
    (without_digests(finished / "damaged") / "metrics.json").write_text(
        '{"policies": [], "table": {"states": 16}, "reward": "good"}'
    )
    made = script("compare", "plain", "priced", "damaged", cwd=finished)
    assert made.returncode == 2 and made.stderr.startswith(
        "RunIncomplete: damaged is incomplete: metrics.json cannot be read"
    ), made.stderr


def test_json_that_is_nested_too_deeply_gets_one_clear_line(script, finished):
    shutil.copytree(finished / "plain", finished / "deep", dirs_exist_ok=True)
    (without_digests(finished / "deep") / "certificate.json").write_text('{"a":' * 100_000)
    made = script("compare", "plain", "deep", cwd=finished)
    assert made.returncode == 2 and made.stderr.startswith("RunIncomplete: deep is incomplete: certificate.json cannot be read")
    assert made.stderr.count("\n") == 1


def test_seeds_of_one_setting_are_told_together(script, finished):
    for seed in (0, 1):
        shutil.copytree(finished / "plain", finished / f"seed{seed}", dirs_exist_ok=True)
        config = without_digests(finished / f"seed{seed}") / "config.json"
        config.write_text(json.dumps({**json.loads(config.read_text()), "seed": seed}))
    made = script("compare", "seed0", "seed1", cwd=finished)
    line, *cautions, wrote = made.stdout.splitlines()
    assert [one.partition(":")[0] for one in cautions] == ["seed0", "seed1"] and "Nothing vouches for" in cautions[0]
    assert line.startswith("runs A, B, mean over 2 seeds: score 1.000 (too few to say), mean return 0.")
    judged = "good (1.000 of value, 1.000 of mean return)"
    assert line.endswith(f"; {judged}; clone: score 1.000 (too few to say), {judged}")
    assert wrote.startswith("Wrote compare.html")


def test_runs_that_are_no_seeds_of_one_setting_are_told_apart(script, finished):
    made = script("compare", "plain", "priced", "--out", "both.html", cwd=finished)
    assert made.stdout == "Wrote both.html: 2 runs side by side.\n"
