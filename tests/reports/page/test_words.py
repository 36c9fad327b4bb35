"""What the page says in words: of margins, deviations, sizes, states and scores."""

from dataclasses import replace

import numpy as np
import pytest
from reports.page.made_runs import scene_of, section_of, stepped_run, table_run, verdict_of

from irl_gym.judging.scores import score_of
from irl_gym.reports.comparison.compared_runs import lettered
from irl_gym.reports.comparison.comparison_page import write_comparison
from irl_gym.reports.page.sections.absent import absent
from irl_gym.reports.page.sections.compared import policies, values
from irl_gym.reports.page.sections.episodes import episodes
from irl_gym.reports.page.sections.judged import distances, policies_table
from irl_gym.reports.page.sections.proof import doctor, proved
from irl_gym.reports.page.sections.slider import lambda_slider
from irl_gym.reports.page.sections.training import widths
from irl_gym.runs.identity import into_folder
from irl_gym.written import aligned, percent, state_called


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    return table_run(tmp_path_factory.mktemp("lake"), errors=3)


@pytest.fixture(scope="module")
def cards(tmp_path_factory):
    return table_run(tmp_path_factory.mktemp("cards"), "Blackjack-v1", errors=20, films=False, sab=False)


def test_the_feasible_set_is_told_with_its_margin(lake):
    lead = section_of(widths, lake).lead
    assert "within +-1" in lead and f"at least {lake.certificate['proof']['terms']['margin_cap']:.4f}" in lead


def test_the_margin_has_no_number_where_the_run_had_another_cap(lake):
    other = {**lake.config, "learner": {**lake.config["learner"], "margin_cap": None}}
    lead = section_of(widths, replace(lake, config=other)).lead
    assert "at least half the largest that all states can have at once" in lead


def test_only_cells_are_shaded(lake, cards):
    assert "cell is shaded" in policies(scene_of(lake)).lead
    assert "cell" not in policies(scene_of(cards)).lead and "listed below" in policies(scene_of(cards)).lead


def test_a_deviation_says_what_is_lost_by_it_and_from_there_on(lake):
    scene = scene_of(lake)
    lost, behind = (of(scene.agents["retrained"]) for of in (scene.lost, scene.behind))
    assert (behind >= lost - 1e-12).all() and (behind > lost + 1e-9).any()
    assert all({"lost", "behind"} <= set(row) for row in policies(scene).shown["tables"][0]["rows"])


def test_the_order_of_states_is_a_number(cards):
    caption = values(scene_of(cards)).panels[-1].caption
    assert "Where the cloud rises" in caption and "Rank correlation: " in caption


@pytest.mark.parametrize("need", ["widths", "lambda_path"])
def test_what_is_too_large_is_told_in_a_sentence(need):
    told = {"ambiguity": {"no_ambiguity": "there are 900 states to act in: it is worked out for at most 500"}}
    lead = absent(need, told, rewarded=True).lead
    assert "was not worked out for this run. There are 900 states to act in" in lead and lead.endswith("at most 500.")


def test_the_slider_calls_states_as_figures_do(lake):
    rewards = np.zeros_like(lake.lambda_path["rewards"])
    rewards[0, [4, 14]] = 0.5
    data = section_of(lambda_slider, replace(lake, lambda_path={**lake.lambda_path, "rewards": rewards})).script["slider"]
    assert "the reward of (row 1, column 0) and (row 3, column 2) becomes 0; " in data["pieces"][1]["change"]


@pytest.mark.parametrize(
    ("answer", "why", "told"), [("healthy", None, "Healthy."), ("not examined", "it is gone", "Not examined: it is gone.")]
)
def test_a_doctor_without_findings_says_what_was_examined(lake, answer, why, told):
    found = section_of(
        doctor, lake, diagnosis={"answer": answer, "why": why, "findings": [], "examined": "Examined: 53 states."}
    )
    assert found.lead == f"As recorded when the run was made: {told} Examined: 53 states."


def test_the_worst_tie_says_of_what_it_loses(lake):
    told = {**lake.metrics, "reward": {**lake.metrics["reward"], "worst_tie_regret_share": 1.023}}
    sentences = verdict_of(replace(lake, metrics=told))["questions"][1]["sentences"]
    assert (
        "The unluckiest policy that is best under it would lose 102.3\u00a0% of what the expert has over random actions."
        in sentences
    )


def test_a_score_has_one_form(lake):
    score = score_of(lake.metrics["policies"]["retrained"]["score"])
    rows = {row[0].partition(",")[0]: row for row in policies_table(lake.metrics).shown["rows"]}
    assert verdict_of(lake)["questions"][0]["figures"][0]["value"] == score and score in rows["retrained agent"]


def test_the_certificate_tells_the_facts_of_the_reward_and_those_of_its_program(lake):
    of_reward, of_program = section_of(proved, lake).shown["parts"]
    assert of_reward["title"] == "Of the reward: computed again for this page"
    assert of_program["title"] == "Of the learner: the run's own record"
    assert dict(of_program["lines"])["objective of the program"].endswith("to rounding the best possible")
    assert dict(of_reward["lines"])["expert optimal under it"].startswith("yes")


def test_facts_are_text_and_never_markup(lake, tmp_path):
    forged = {"label": "<b>tied</b>", "sentence": "<script>alert(1)</script>", "mood": "bad"}
    held = {**lake.certificate, "proof": {**lake.certificate["proof"], "facts": [forged]}}
    write_comparison([replace(lake, certificate=held), lake], tmp_path / "two.html")
    text = (tmp_path / "two.html").read_text()
    assert "&lt;script&gt;alert(1)" in text and "<script>alert(1)" not in text and "<b>tied" not in text


def test_why_there_are_no_pictures_is_a_sentence(lake):
    film = replace(lake.films["agent"], without_frames="the environment draws none")
    section = episodes({"agent": film}, None, {"retrained": {}})
    assert section.shown["players"][0]["why"] == "The environment draws none."


@pytest.mark.parametrize("out", [["--out", "runs/a"], ["--out=runs/a"], []])
def test_the_command_makes_the_run_in_a_new_folder(out):
    command = ["python", "x.py", *out, "--seed", "1"]
    assert into_folder(command) == ["python", "x.py", "--seed", "1", "--out", "runs/again"]


@pytest.mark.parametrize(
    ("score", "text"), [(1.0, "1.000"), (0.99996, "above 0.999"), (0.984, "0.984"), (-0.0001, "0.000"), (None, "none")]
)
def test_only_a_score_of_one_reads_so(score, text):
    assert score_of(score) == text


def test_nothing_missing_is_all_that_reads_as_a_hundred():
    assert (percent(0.9999), percent(1 - 1e-9)) == ("over 99.9\u00a0%", "100.0\u00a0%")


def test_numbers_of_a_column_have_the_same_decimals():
    assert aligned(np.array([0.0115, 4e-5, 1e-6, 0.0])) == ["0.01150", "0.00004", "below 0.00001", "0"]


@pytest.mark.parametrize(
    ("name", "told"), [("40", "state 40"), ("(4, 0)", "(4, 0)"), ("20 against 3, natural 0", "20 against 3, no natural")]
)
def test_a_state_is_called_by_more_than_a_number(name, told):
    assert state_called(name) == told


def test_lakes_of_two_maps_are_told_apart(lake, tmp_path):
    small = table_run(tmp_path / "small", map_name="4x4", films=False)
    plain = replace(lake, config={**lake.config, "env_kwargs": {}})
    assert lettered([plain, small]).places == {"A": "FrozenLake-v1 (no arguments)", "B": "FrozenLake-v1 (map_name=4x4)"}
    assert lettered([small, small]).places == dict.fromkeys("AB", "FrozenLake-v1 (map_name=4x4)")


def test_a_long_argument_is_told_only_where_runs_differ_in_it(lake):
    drawn = replace(lake, config={**lake.config, "env_kwargs": {"desc": ["SFFFFFFF", "FFFFFFFG"]}})
    assert lettered([drawn, drawn]).places == dict.fromkeys("AB", "FrozenLake-v1")
    assert lettered([drawn, lake]).places["A"] == 'FrozenLake-v1 (desc=["SFFFFFFF", "FFFFFFFG"])'


def test_no_agent_is_best_across_environments(lake, tmp_path):
    write_comparison([lake, stepped_run(tmp_path / "cart")], tmp_path / "mixed.html")
    text = (tmp_path / "mixed.html").read_text()
    assert "best score" not in text and "The environments differ" in text and "Of B all of it is the record." in text
    assert "<td></td>" not in text and "<td>null</td>" not in text and "<td>not there</td>" in text


def test_the_distance_of_the_rewards_is_told_where_it_is_known(lake):
    told = replace(lake, metrics={**lake.metrics, "reward": {**lake.metrics["reward"], "starc": 0.684, "epic": None}})
    found = distances(told.metrics).shown
    assert ("STARC distance", "0.68") in found["lines"] and "EPIC" not in str(found)
    assert "STARC distance: between the learned reward and the true one: 0 ranks all policies alike" in found["note"]
    assert "distance" not in str(distances(lake.metrics).shown)
