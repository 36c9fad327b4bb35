"""Sections that lack what they need: in their place stands why, or nothing where nothing is missed."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest
from reports.page.made_runs import NO_CURVE, stepped_run, table_run

from irl_gym.reports.page import report
from irl_gym.reports.page.contents import RunContents
from irl_gym.reports.page.report import sections_of
from irl_gym.reports.page.sections.absent import LACKS
from irl_gym.reports.page.sections.section import Section

WHY = {"ambiguity": {name: f"of {name}" for name in ("no_path", "no_widths")}}
WITHOUT = {
    "learned": ({"learned": None}, "rewards", "The learner gives a policy and no reward. So nobody was retrained"),
    "curve": ({"curve": NO_CURVE}, "learning", "No agent was trained step by step"),
    "films": ({"films": {}}, "episodes", "No episode of this run was filmed."),
    "lambda_path": ({"lambda_path": None}, "lambda", "was not worked out for this run. Of no_path."),
    "widths": ({"widths": None}, "widths", "was not worked out for this run. Of no_widths."),
    "diagnosis": ({"diagnosis": None}, "doctor", "The doctor did not look at this run: an earlier version of irl_gym made it."),
    "told_of_table": ({}, "table", "There is no table: the environment was stepped"),
}  # fmt: skip


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return replace(table_run(tmp_path_factory.mktemp("run"), films=False), stages=WHY)


@pytest.mark.parametrize("need", LACKS)
def test_a_section_that_is_absent_says_why(run, tmp_path, need):
    changes, name, told = WITHOUT[need]
    of = stepped_run(tmp_path) if need == "told_of_table" else replace(run, **changes)
    (section,) = (one for one in sections_of(RunContents(of), of) if one.name == name)
    assert told in section.lead and not section.panels and not section.shown


def test_what_goes_with_a_reward_is_said_to_be_absent_once(run):
    without = replace(run, learned=None, curve=NO_CURVE, lambda_path=None, widths=None, films={})
    names = [one.name for one in sections_of(RunContents(without), without)]
    assert names[:5] == ["summary", "rewards", "values", "policies", "episodes"]


def test_a_run_without_a_table_has_no_sections_of_states(tmp_path):
    of = stepped_run(tmp_path)
    names = [one.name for one in sections_of(RunContents(of), of)]
    assert names == [
        "summary", "rewards", "learning", "episodes", "certificate", "doctor", "table", "stages", "asked", "reproduce",
    ]  # fmt: skip


def test_a_section_that_is_added_to_the_list_is_shown_with_what_it_needs(run, monkeypatch):
    def weather(config: Mapping[str, Any], actions: tuple[str, ...]) -> Section:
        return Section("weather", "Weather", f"gamma {config['gamma']}, {len(actions)} actions")

    monkeypatch.setattr(report, "SECTIONS", (*report.SECTIONS, weather))
    *_, last = sections_of(RunContents(run), run)
    assert (last.name, last.lead) == ("weather", f"gamma {run.config['gamma']}, 4 actions")
