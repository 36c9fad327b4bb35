"""Runs of a learner that gives a policy, side by side and over seeds."""

import pytest

from irl_gym.reports.comparison.comparison_page import lettered, write_comparison
from irl_gym.reports.comparison.pooled import over_seeds, told
from irl_gym.reports.comparison.ranked import sentence
from irl_gym.runs.run import read_run
from irl_gym.runs.supply import supplied


@pytest.fixture(scope="module")
def seeds(policy_run):
    return lettered([read_run(policy_run("policy", seed)) for seed in range(2)])


def test_seeds_of_a_policy_learner_are_one_pool_which_is_called_by_its_policies(seeds):
    found = seeds.pools
    section = over_seeds(found, {"A": "a lake", "B": "a lake"})
    rows = dict(zip(section.shown["headings"], map(list, zip(*section.shown["rows"], strict=True)), strict=True))
    low, high = sorted(run.metrics["policies"]["learned"]["score"] for run in seeds.runs.values())
    assert rows["score of the learner's policies, worst and best seed"] == [f"{low:.3f} and {high:.3f}"]
    assert rows["learner"] == ["own_learners:Copycat"] and rows["seeds"] == ["0, 1"] and not section.panels
    assert not any("worst tie" in name or "retrained" in name for name in rows)
    assert told(found[0]).startswith(f"runs A, B, mean over 2 seeds: score {(low + high) / 2:.3f}")
    assert supplied(sentence, seeds).startswith("Over 2 seeds the learner's policies have a score of ")


def test_a_policy_learner_is_compared_with_one_that_gives_both(policy_run, seeds, look, tmp_path):
    runs = [seeds.runs["A"], read_run(policy_run("both"))]
    write_comparison(runs, tmp_path / "page.html")
    page = look(tmp_path / "page.html")
    assert page.wrong == [] and page.locator("#rewards .plot").count() == 1
    titles = page.locator("#policies h3").all_inner_texts()
    assert titles == ["Runs A, B: learner's policy", "Run B: retrained agent"]  # what several runs share is drawn once
    heads = page.locator("#results thead th").all_inner_texts()
    cells = [one.split("\t") for one in page.locator("#results tbody tr").all_inner_texts()]
    rows = dict(zip(heads, zip(*cells, strict=True), strict=True))
    score = runs[0].metrics["policies"]["learned"]["score"]
    same = dict(zip(*(page.locator(f"#results {part}").all_inner_texts() for part in ("dt", "dd")), strict=True))
    assert same["score, learner's policy"] == f"{score:.3f}"
    assert rows["score, retrained agent"][0] == "not there"
    assert rows["expert optimal under the reward"] == ("not there", "no")
