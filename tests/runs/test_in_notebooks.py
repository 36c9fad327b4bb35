"""What a notebook shows of a run: the page's first answer and every policy, in plain HTML of one screen."""

import re
from html.parser import HTMLParser

import pytest
from lake_run import asked

from irl_gym.files.run_folder import read_json
from irl_gym.judging.shares import WELL, judged
from irl_gym.loop.pipeline import recover_and_retrain
from irl_gym.runs.run import read_run
from irl_gym.runs.summary import LONG, MOST, Report

EVIL = "<script>alert(1)</script><img src='https://x.invalid/a.png'><a href=\"javascript:b()\">$\\href{c}{d}$"
TAGS = {"div", "p", "b", "table", "tr", "th", "td"}


class Tags(HTMLParser):
    """Tags, attributes and cells of a text."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.attributes, self.rows = set(), [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        self.attributes += attrs
        if tag == "tr":
            self.rows.append([])

    def handle_data(self, data):
        if self.rows:
            self.rows[-1].append(data)


def report_of(path, metrics=None, config=None, whose=None):
    read = {name: read_json(path / f"{name}.json") for name in ("metrics", "certificate", "config")}
    return Report(path, metrics or read["metrics"], read["certificate"], {}, config or read["config"], {}, whose)


@pytest.fixture
def evil(copied):
    """What a run says whose every text is a stranger's."""
    metrics, config = (read_json(copied / f"{name}.json") for name in ("metrics", "config"))
    metrics["policies"] |= {f"{EVIL}{n}": metrics["policies"]["retrained"] for n in range(40)}
    metrics["reward"]["learner"] = EVIL
    return report_of(copied, metrics, config | {"env_id": EVIL * 1000, "env_kwargs": {EVIL: EVIL}}, EVIL)._repr_html_()


def test_the_page_s_first_answer_is_the_notebook_s(finished):
    run = read_run(finished)
    answer = WELL[judged(run.metrics["policies"], run.metrics["table"]).mood]
    for shown in (run, report_of(finished)):
        assert f"Does the agent do as well as the expert? <b>{answer}</b>" in shown._repr_html_()
    assert answer in (finished / "report.html").read_text()


def test_of_a_policy_the_question_is_asked_as_on_the_page(policy_run):
    assert "Does the policy do as well as the expert?" in read_run(policy_run("policy"))._repr_html_()


def test_environment_learner_and_page_are_named(finished):
    said = read_run(finished)._repr_html_()
    assert "FrozenLake-v1" in said and "FiniteLP" in said and str(finished / "report.html") in said


def test_a_page_that_is_missing_is_not_named(copied):
    (copied / "report.html").unlink()
    said = read_run(copied)._repr_html_()
    assert "report.html" not in said and f"Kept in {copied}" in said


def test_every_policy_has_a_row_with_its_numbers(finished):
    run = read_run(finished)
    heads, *rows = Tags(run._repr_html_()).rows
    assert heads[:4] == ["policy", "value", "score", "mean return (95 %)"]
    assert [row[0] for row in rows] == ["expert", "random", "clone", "retrained agent"]
    assert all(row[5].endswith("\N{NO-BREAK SPACE}%") for row in rows)  # agreement
    assert [float(row[1]) for row in rows] == pytest.approx(
        [one["value"] for one in run.metrics["policies"].values()], abs=1e-3
    )


def test_a_stranger_s_texts_make_no_tags_and_lead_nowhere(evil):
    found = Tags(evil)
    assert found.tags <= TAGS and "&lt;script&gt;" in evil
    assert found.attributes == [("class", "tex2jax_ignore mathjax_ignore")]  # nothing to load, and no formula


def test_what_a_terminal_or_an_eye_obeys_is_spelled_out(copied):
    config = read_json(copied / "config.json") | {"env_id": "Lake\x1b[2J\u202e\n-v1"}
    assert r"Lake\x1b[2J\u202e\n-v1" in report_of(copied, config=config)._repr_html_()


def test_a_stranger_s_run_takes_one_screen(evil):
    assert evil.count("<tr>") == 1 + MOST and "more policies are in metrics.json" in evil
    assert max(map(len, re.findall(r">([^<]+)<", evil))) < 10 * LONG


def test_a_run_shown_again_says_whose_word_it_is(copied):
    assert "Computed again from its files" in recover_and_retrain(asked(), copied)._repr_html_()
