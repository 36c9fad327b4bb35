"""What is measured, and what is judged, is told in one place: added from outside, it is in all that people read."""

import io
import json
import re
import shutil
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from forgetting import with_digests_anew
from lake_run import LAKE, asked
from rich.console import Console

from irl_gym.files.run_folder import read_json, write_json
from irl_gym.judging import measures
from irl_gym.judging.evaluation import evaluate
from irl_gym.judging.measures import Measure, explained, shown
from irl_gym.judging.scores import agent_of, others
from irl_gym.judging.shares import judgements
from irl_gym.loop.pipeline import recover_and_retrain
from irl_gym.loop.worlds import TableWorld
from irl_gym.reports.comparison.comparison_page import write_comparison
from irl_gym.reports.page.report import write_report
from irl_gym.reports.terminal_report import print_report
from irl_gym.runs.metrics_csv import write_metrics_csv
from irl_gym.runs.run import read_run
from irl_gym.runs.summary import Report
from irl_gym.written import number

TWICE = Measure(("twice",), "twice the value", "the value two times", number, lambda one: (2 * one.value,))
LEAST = Measure(("least",), "least paid", "what it pays at the least", number, lambda one: (float(one.learned.values.min()),))
LENGTH = Measure(
    ("length",), "length", "mean steps of its episodes", number, lambda one: (float(np.mean([*map(len, one.episodes)])),),
    asked=lambda one: not one.reference, sampled=True,
)  # fmt: skip
PLACES = ("metrics.json", "metrics.csv", "terminal", "page", "comparison")


def all_places(run, folder):
    """What each place says of a run."""
    folder.mkdir()
    write_json(folder / "metrics.json", run.metrics)
    write_metrics_csv(run.metrics, folder / "metrics.csv", env=run.env_id, config=run.config)
    write_report(run, folder / "page")
    write_comparison([run, replace(run, config={**run.config, "gamma": 0.5})], folder / "comparison")
    console = Console(file=io.StringIO(), width=250, force_terminal=True, color_system="standard")
    print_report(Report(run.path, run.metrics, run.certificate, run.stages, run.config, {}), console)
    plain = " ".join(re.sub(r"\x1b\[[0-9;]*m", "", console.file.getvalue()).split())
    (folder / "terminal").write_text(plain + console.file.getvalue())
    return {place: (folder / place).read_text() for place in PLACES}


@pytest.fixture(scope="module")
def measured(finished, tmp_path_factory):
    """A finished run whose metrics are made again with three more measures, and what each place then says."""
    folder = tmp_path_factory.mktemp("measured")
    out = shutil.copytree(finished, folder / "run")
    for name in ("metrics.json", "metrics.csv", "report.html"):
        (out / name).unlink()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(measures, "POLICIES", (*measures.POLICIES, TWICE, LENGTH))
        patch.setattr(measures, "REWARDS", (*measures.REWARDS, LEAST))
        recover_and_retrain(asked(), out)
        run = read_run(out)
        told = all_places(run, folder / "places")
        told |= {"metrics.csv": (out / "metrics.csv").read_text(), "page": (out / "report.html").read_text()}
        write_json(out / "metrics.json", edited(run.metrics))
        again = read_run(with_digests_anew(out))
    return run, told, again


def edited(metrics):
    """Metrics in which somebody changed what the measures found."""
    rows = {name: {**row, "twice": 7.0} for name, row in metrics["policies"].items()}
    return {**metrics, "policies": rows, "reward": {**metrics["reward"], "least": 7.0}}


WORDS = {
    "metrics.json": ('"twice": ', '"least": ', '"length": '), "metrics.csv": ("retrained,twice,", "reward,least,"),
    "terminal": ("twice the value: the value two times.", "least paid", "length: mean steps"),
    "page": ("<th scope=\"col\">twice the value</th>", "<dt>least paid</dt>", "Least paid: what it pays at the least."),
    "comparison": ("twice the value, retrained agent", "twice the value, expert", "least paid", "length, retrained agent",
                   "Twice the value: the value two times."),
}  # fmt: skip


@pytest.mark.parametrize("place", PLACES)
def test_a_measure_that_is_added_to_the_list_is_shown_in(measured, place):
    _, told, _ = measured
    assert [words for words in WORDS[place] if words not in told[place]] == []


def test_a_measure_that_is_added_has_its_number_of_each_policy_that_it_is_asked_of(measured):
    run, *_ = measured
    rows = run.metrics["policies"]
    assert all(row["twice"] == 2 * row["value"] for row in rows.values())
    assert [name for name, row in rows.items() if "length" in row] == ["clone", "retrained"] and rows["retrained"][
        "length"
    ] >= 1
    assert run.metrics["reward"]["least"] == run.tabular.values.min()


def test_a_measure_is_computed_again_when_a_run_is_read_unless_it_rests_on_episodes(measured):
    run, _, again = measured
    assert again.metrics == run.metrics


def test_no_two_measures_write_one_key_and_each_is_explained(finished):
    metrics = read_json(finished / "metrics.json")
    for listed in (measures.POLICIES, measures.REWARDS):
        keys = [key for one in listed for key in one.keys]
        assert len(set(keys)) == len(keys) and all(one.heading and one.explanation(metrics) for one in listed)


def test_what_no_policy_has_is_no_column():
    assert [one.keys[0] for one in shown(measures.POLICIES, [{"value": 1.0, "score": None}, {"score": None}])] == ["value"]


def test_measures_of_one_caption_are_explained_together():
    other = replace(TWICE, keys=("again",), heading="again")
    assert explained([TWICE, LEAST, other], {}) == [
        "twice the value, again: the value two times.",
        "least paid: what it pays at the least.",
    ]


def test_a_number_that_was_not_asked_for_is_none_and_one_that_is_not_known_says_so():
    loses = next(one for one in measures.POLICIES if one.keys == ("loses_at_most",))
    assert (loses.text({}), loses.text({"loses_at_most": None})) == ("none", "not known")
    assert shown([loses, TWICE], [{"loses_at_most": None, "twice": None}]) == [loses]


# --- what is judged ---


@pytest.fixture(scope="module")
def four(finished, tmp_path_factory):
    """A finished run in which a fourth policy was judged, which always goes left; and what each place says of it."""
    run = read_run(finished)
    world = TableWorld(gym.make("FrozenLake-v1", **LAKE["env_kwargs"]), run.table, 16, 0)
    how = {name: row["how"] for name, row in run.metrics["policies"].items()}
    made = {"expert": run.expert, "random": world.random, "retrained": run.agent, "cloned": np.zeros_like(run.expert)}
    made["clone"] = run.agents["clone"]
    rows, _ = evaluate(
        {name: (policy, how.get(name, "cloned from 3 episodes")) for name, policy in made.items()}, world, run.table, None,
        given=None, episodes_only=False, episodes=LAKE["eval_episodes"], seed=0,
    )  # fmt: skip
    judged = replace(run, metrics={**run.metrics, "policies": json.loads(json.dumps(rows))})
    return run, judged, all_places(judged, tmp_path_factory.mktemp("four") / "places")


def test_a_judgement_is_a_function_of_table_policies_and_episodes(four):
    run, judged, _ = four
    assert {name: judged.metrics["policies"][name] for name in run.metrics["policies"]} == run.metrics["policies"]


FOURTH = {
    "metrics.json": ('"cloned": {', '"how": "cloned from 3 episodes"'), "metrics.csv": ("cloned,value,0.0", "cloned,score,"),
    "terminal": ("│ cloned", "cloned: cloned from 3 episodes.", "\x1b[31m-0.013\x1b", "cloned: not good (-0.013 of value"),
    "page": ("cloned, cloned from 3 episodes</th>", "Beside it, the policy cloned (cloned from 3 episodes) has a score of -",
             "cloned: not good (-0.013 of value"),
    "comparison": ("score, cloned", "value, cloned", "how it came about, cloned", "cloned, judged by the worse share"),
}  # fmt: skip


@pytest.mark.parametrize("place", PLACES)
def test_a_fourth_policy_is_shown_with_how_it_came_about_in(four, place):
    *_, told = four
    assert [words for words in FOURTH[place] if words not in told[place]] == []


def test_a_run_with_a_fourth_policy_is_read_with_it(four, copied):
    _, judged, _ = four
    write_json(copied / "metrics.json", judged.metrics)
    run = read_run(with_digests_anew(copied))
    assert run.metrics["policies"] == judged.metrics["policies"]
    assert run.whose.endswith("All else is the run's own record, and among it what is said of cloned.")


def test_how_a_policy_came_about_follows_from_the_stages(finished):
    rows = read_run(finished).metrics["policies"]
    assert {name: row["how"] for name, row in rows.items()} == {
        "expert": "planned by value iteration", "random": "uniformly random actions", "retrained": "trained by PPO",
        "clone": "cloned from 60 steps; 5 of 11 states never seen; the learner had the expert's whole policy",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("names", "agent"),
    [(["cloned", "expert", "random", "retrained"], "retrained"), (["expert", "cloned", "random", "soft"], "cloned")],
)
def test_the_retrained_agent_is_spoken_of_or_else_the_first_that_is_no_reference(names, agent):
    assert agent_of(names) == agent and "expert" not in others(names)


def test_a_run_without_an_agent_that_was_retrained_speaks_of_another(four):
    _, judged, _ = four
    rows = {name: row for name, row in judged.metrics["policies"].items() if name != "retrained"}
    assert judgements(rows, judged.metrics["table"]).startswith("not good (-0.013 of value")
