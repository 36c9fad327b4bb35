"""What the terminal says of a run, line by line, from its numbers alone."""

import io
import json

import numpy as np
import pytest
from rich.console import Console

from irl_gym.facts import Fact
from irl_gym.reports.terminal_report import print_report
from irl_gym.runs.identity import ENVIRONMENT
from irl_gym.runs.scorecard import settled_at
from irl_gym.runs.summary import Report

FOUND = {
    "name": "blind-expert", "sentence": "The expert returns 110 here.", "mend": "Give the statistics.", "states": [],
    "actions": [], "flags": [],
}  # fmt: skip
CURVE = np.array([[0.0, 0.0], [64, 0.92], [128, 0.5], [192, 0.95], [256, 0.991], [320, 1.0]])


def doctored(out, *findings, **changes):
    """What the doctor says."""
    answer = "findings" if findings else "healthy"
    told = {"answer": answer, "why": None, "examined": "Examined: it.", "findings": findings} | changes
    (out / "diagnosis.json").write_text(json.dumps(told))


def said(
    out, *, score=1.0, reason=None, share=0.0, config=None, training=None, demonstrations=None, policies=None, coloured=False,
    width=250, facts=((), ()), **reward,
):  # fmt: skip
    """What is printed of a run with these numbers, and these facts of its reward and of its program, on one line."""
    row = {"value": 0.5, "score": score, "mean_return": 0.7, "return_low": 0.6, "return_high": 0.8, "agreement": 1.0}
    told = {"learner": "Any", "worst_tie_regret": 0.0, "worst_tie_regret_share": share} | reward
    kept = ({"facts": [one.to_json() for one in part]} for part in facts)
    metrics = {
        "policies": {name: row | (policies or {}).get(name, {}) for name in ("expert", "random", "retrained")},
        "score_reason": reason, "reward": told,
        "training": training or {"environment_steps": 4096, "steps_to_0.9": 64, "steps_to_0.99": 2048}, "table": {
            "horizon": None, "error": 0.0, "exact": True, "reachable": 11, "actions": 4, "method": "Published."},
        "demonstrations": demonstrations or {
            "given": False, "episodes_only": False, "episodes": 10, "dataset": "lake-v0"},
    }  # fmt: skip
    asked = {"env_id": "Lake-v0", "env_kwargs": {}, "gamma": 0.9, "seed": 0, "start_seeds": [], "dataset": None}
    stages = {"agent": {"seconds": 1.0, "environment_steps": 4096}}
    out.mkdir(parents=True, exist_ok=True)
    if not (out / "diagnosis.json").exists():
        doctored(out)
    console = Console(file=io.StringIO(), width=width, force_terminal=coloured, color_system="standard" if coloured else None)
    print_report(
        Report(out, metrics, dict(zip(("optimality", "proof"), kept, strict=True)), stages, asked | (config or {}), {}), console
    )
    return " ".join(console.file.getvalue().split())


def test_the_agent_is_timed_to_nearly_the_whole_score(tmp_path):
    assert "(score 0.99 or more after 2,048)" in said(tmp_path)


def test_an_agent_that_did_not_stay_there_is_told(tmp_path):
    training = {"environment_steps": 4096, "steps_to_0.9": 64, "steps_to_0.99": None}
    assert "(did not stay at score 0.99)" in said(tmp_path, training=training)


def test_nothing_is_said_of_scores_when_there_is_none(tmp_path):
    text = said(tmp_path, score=None, reason="the world ended", share=None)
    assert "There is no score: the world ended." in text and "score 0.99" not in text
    assert "worst-tie regret │ not known, as there is no score" in text


def test_a_run_of_an_earlier_version_has_the_reason_of_its_time(tmp_path):
    assert "There is no score: the expert earns no more than random actions." in said(tmp_path, score=None, share=None)


@pytest.mark.parametrize(
    ("only", "told"),
    [(False, "one of the expert's actions, or an optimal one where it is optimal."), (True, "an optimal action.")],
)
def test_agreement_is_told_as_it_is_counted(tmp_path, only, told):
    demonstrations = {"given": False, "episodes_only": only, "episodes": 10, "dataset": "lake-v0"}
    assert f"agreement: share of states with {told}" in said(tmp_path, demonstrations=demonstrations)


def test_facts_of_the_reward_stand_before_those_of_its_program_whoever_learned_it(tmp_path):
    facts = (Fact("tied", "in 1 state"),), (Fact("dice", "thrown once"),)
    assert "tied │ in 1 state" in (text := said(tmp_path, facts=facts)) and text.index("tied") < text.index(
        "dice │ thrown once"
    )


def test_a_fact_has_the_colour_of_its_mood(tmp_path):
    assert "\x1b[31min 1 state" in said(tmp_path, facts=((Fact("violated", "in 1 state", "bad"),), ()), coloured=True)


def test_a_healthy_run_is_called_so(tmp_path):
    text = said(tmp_path)
    assert "The doctor: Healthy. Open" in text


def test_an_unhealthy_run_names_the_doctor(tmp_path):
    doctored(tmp_path, FOUND)
    assert f"The doctor: 1 finding. This command tells them, with mends: irl-gym doctor --run {tmp_path}" in said(tmp_path)


def test_a_run_that_could_not_be_examined_is_not_called_healthy(tmp_path):
    doctored(tmp_path, answer="not examined", why="it is gone")
    text = said(tmp_path)
    assert "The doctor: Not examined: it is gone. Open" in text and "ealthy" not in text


def test_what_a_dataset_lacks_is_told_with_its_count(tmp_path):
    lost = {"given": True, "episodes_only": True, "episodes": 1200, "dataset": "me/log-v0", "dropped": 1000, "steps_cut": 17}
    told = "Of the 1,200 episodes learned from: 1,000 episodes whose last action was dropped in the import"
    text = said(tmp_path, demonstrations=lost)
    assert told in text and "17 steps cut off after an end." in text
    text = said(tmp_path, demonstrations=lost | {"episodes": 1, "dropped": 1, "steps_cut": 1})
    assert "Of the 1 episode learned from: 1 episode whose last" in text and "1 step cut off after an end." in text


def test_what_is_wrong_with_the_given_expert_is_told_at_once(tmp_path):
    doctored(tmp_path, FOUND)
    assert "Warning: The expert returns 110 here. Give the statistics." in said(tmp_path)


def test_a_dataset_is_told_with_its_environment(tmp_path):
    (tmp_path / ENVIRONMENT).write_text(json.dumps({"id": "Lake-v0", "observations": "{}", "actions": []}))
    assert said(tmp_path, config={"env_id": None, "dataset": "me/two-v0"}).startswith("Lake-v0, the environment of me/two-v0;")


@pytest.mark.parametrize(("good", "steps"), [(0.9, 192), (0.99, 256), (0.4, 64)])
def test_a_curve_has_settled_after_the_last_time_that_it_was_below(good, steps):
    assert settled_at(CURVE, 0.0, 1.0, good) == steps


def test_a_curve_that_ends_below_has_not_settled():
    assert settled_at(CURVE[:3], 0.0, 1.0) is None


def test_the_distance_of_the_rewards_is_told_where_it_is_known(tmp_path):
    text = said(tmp_path, starc=0.684, epic=0.706)
    assert "STARC distance │ 0.68" in text and "EPIC distance │ 0.71" in text
    both = "STARC distance, EPIC distance: between the learned reward and the true one: 0 ranks all policies alike"
    assert both in text
    assert "EPIC" not in said(tmp_path, starc=0.5, epic=None)
    assert "STARC" not in said(tmp_path)


TAXI = {
    "expert": {"mean_return": 7.8, "return_low": 7.4, "return_high": 8.2},
    "random": {"mean_return": -770.0, "return_low": -785.0, "return_high": -755.0},
    "retrained": {"score": 0.82, "mean_return": -139.0, "return_low": -155.0, "return_high": -123.0},
}


def test_the_agent_is_judged_by_the_worse_of_score_and_mean_return(tmp_path):
    assert "judged: not good (0.820 of value, 0.811 of mean return)." in said(tmp_path, policies=TAXI)
    lucky = TAXI | {"retrained": TAXI["retrained"] | {"score": 0.99}}
    assert "judged: not good (0.990 of value, 0.811 of mean return)." in said(tmp_path, policies=lucky)


def test_training_more_is_advised_when_the_mean_return_alone_falls_short(tmp_path):
    lucky = TAXI | {"retrained": TAXI["retrained"] | {"score": 0.99}}
    text = said(tmp_path, policies=lucky, share=0.01)
    assert "best under the reward has a score of at least 0.990: try more --total-timesteps" in text
    assert "try more" not in said(tmp_path, policies=lucky, share=0.2)


@pytest.mark.parametrize("score", [0.82, 0.99])
def test_score_and_mean_return_have_the_colour_of_the_worse(tmp_path, score):
    policies = TAXI | {"retrained": TAXI["retrained"] | {"score": score}}
    text = said(tmp_path, policies=policies, coloured=True)
    assert f"\x1b[31m{score:.3f}\x1b" in text and "\x1b[31m-139 (-155 to -123)\x1b" in text


def test_no_word_of_a_heading_is_cut_when_the_terminal_is_narrow(tmp_path):
    row = {"value": 0.4146, "score": 0.9996, "expected_return": 0.001742, "return_share": 0.927}
    policies = dict.fromkeys(("expert", "random", "retrained"), row)
    assert "agreement" in said(tmp_path, policies=policies, width=75).split("expert:")[0]


@pytest.mark.parametrize("name", ["a[/b]", "a[red]b", "a:warning:b", "a[link=x]b[/link]"])
def test_names_are_printed_as_they_are_and_never_read_as_markup(tmp_path, name):
    policies = {"expert": {"score": None}, "random": {"score": None}, "retrained": {"score": None}}
    text = said(
        tmp_path / name, score=None, share=None, reason=f"of {name}", policies=policies,
        facts=((), (Fact("status", f"it is {name}"),)), config={"env_kwargs": {"map": name}, "dataset": name},
    )  # fmt: skip
    assert f"/{name}: reward, certificate" in text and f"/{name}/report.html in a browser" in text
    assert f"(map={name})" in text and f"There is no score: of {name}." in text
