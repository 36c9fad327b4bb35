"""The first screen: three questions with answers that are computed, or say whose record they are; and what to do next."""

from dataclasses import replace

import numpy as np
import pytest
from reports.page.made_runs import section_of, stepped_run, table_run, verdict_of

from irl_gym.mdp.rewards import TabularReward
from irl_gym.reports.page.report import write_report
from irl_gym.reports.page.sections.compared import rewards
from irl_gym.runs.run import read_run

HEALTHY = {"answer": "healthy", "why": None, "examined": "Examined: it.", "findings": []}
NOBODY = {"answer": "not examined", "why": "it is gone", "examined": "", "findings": []}


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    run = table_run(tmp_path_factory.mktemp("lake"), errors=0, films=False)
    return replace(run, diagnosis=HEALTHY, recomputed=True)


def with_reward(run, **changes):
    return replace(run, metrics={**run.metrics, "reward": {**run.metrics["reward"], **changes}})


def found(*flags, name="ties"):
    told = {"name": name, "sentence": "Tied in {where}.", "mend": "Capped.", "states": [6], "actions": [2]}
    return {**HEALTHY, "answer": "findings", "findings": [{**told, "flags": [*flags]}]}


def trusted(run):
    return verdict_of(run)["questions"][1]


@pytest.mark.parametrize(
    ("changes", "answer"),
    [
        ({}, "Yes"), ({"worst_tie_regret_share": 0.2}, "With care"), ({"worst_tie_regret_share": None}, "With care"),
        ({"unsettled_states": 2}, "With care"), ({"expert_optimal": None}, "Not decided"), ({"expert_optimal": False}, "No"),
        ({"degenerate": True}, "No"),
    ],
)  # fmt: skip
def test_a_reward_is_trusted_only_where_nothing_is_against_it(lake, changes, answer):
    settled = {"worst_tie_regret_share": 0.0, "expert_optimal": True, "degenerate": False}
    assert trusted(with_reward(lake, **{**settled, **changes}))["answer"] == answer


@pytest.mark.parametrize("diagnosis", [None, NOBODY, found("--l1 0")])
def test_a_reward_that_the_doctor_did_not_find_healthy_is_trusted_with_care(lake, diagnosis):
    sure = with_reward(lake, worst_tie_regret_share=0.0, expert_optimal=True, degenerate=False)
    assert trusted(replace(sure, diagnosis=diagnosis))["answer"] == "With care"


def test_a_reward_on_an_estimated_table_is_trusted_with_care(lake):
    sure = with_reward(lake, worst_tie_regret_share=0.0, expert_optimal=True, degenerate=False)
    table = {**sure.metrics["table"], "exact": False, "counted": True}
    assert trusted(replace(sure, metrics={**sure.metrics, "table": table}))["answer"] == "With care"


def test_what_the_page_did_not_compute_is_the_record_of_the_run(lake):
    (first, *_), (other, *_) = (trusted(replace(lake, recomputed=again))["sentences"] for again in (True, False))
    assert other == first.replace(".", ", by the run's own record.")


def test_without_a_table_it_is_not_decided_whether_the_reward_is_to_be_trusted(tmp_path):
    told = trusted(stepped_run(tmp_path))
    assert told["answer"] == "Not decided" and told["sentences"][1].startswith("By its learner's own record, ")


def test_the_first_screen_is_the_top_of_the_page_and_fits_both_widths(lake, look, tmp_path):
    write_report(lake, tmp_path / "page.html")
    for width in (1280, 390):
        page = look(tmp_path / "page.html", width=width)
        asked = page.locator(".question h3").all_inner_texts()
        assert asked == ["Does the agent do as well as the expert?", "Is the reward to be trusted?", "What next?"]
        if width == 1280:
            assert page.locator(".question").last.bounding_box()["y"] < 844


# --- why a goal may earn less than a hole ---


def test_a_goal_that_has_less_than_a_hole_is_explained_where_it_is_so(lake):
    mdp, values = lake.table.mdp, np.zeros(lake.table.mdp.n_states)
    goal = int(np.argmax((mdp.P.T @ lake.table.reward.expected(mdp).ravel()) * mdp.terminal))
    hole = int(np.flatnonzero(mdp.terminal & (np.arange(mdp.n_states) != goal))[0])
    values[hole] = 0.5
    odd = with_reward(replace(lake, learned=TabularReward(values)), expert_optimal=True, degenerate=False)
    assert "has 0.5. That is no fault: a reward says which actions are best" in section_of(rewards, odd).lead
    values[goal] = 0.75
    usual = replace(odd, learned=TabularReward(values))
    assert "no fault" not in section_of(rewards, usual).lead


def test_a_goal_is_not_explained_by_a_reward_that_does_not_explain_the_expert(lake):
    odd = with_reward(replace(lake, learned=TabularReward(np.linspace(1, 0, lake.table.mdp.n_states))), expert_optimal=False)
    assert "no fault" not in section_of(rewards, odd).lead


def test_a_learner_of_a_policy_is_asked_of_its_policy(policy_run):
    told = verdict_of(read_run(policy_run("policy")))
    questions = [one["question"] for one in told["questions"]]
    assert questions == ["Does the policy do as well as the expert?", "Is the policy to be trusted?"]
    assert "without a reward" in told["about"]
