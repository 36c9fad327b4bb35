"""What the page says in words: of margins, deviations, sizes, states and scores."""

from dataclasses import replace

import numpy as np
import pytest
from page.made_runs import stepped_run, table_run

from irl_gym.claims import into_folder
from irl_gym.page.compared import policies, rewards, values
from irl_gym.page.comparison import write_comparison
from irl_gym.page.episodes import episodes
from irl_gym.page.proof import certificate, doctor, verdict
from irl_gym.page.scene import Scene
from irl_gym.page.slider import lambda_slider
from irl_gym.page.training import widths
from irl_gym.page.worlds import run_places
from irl_gym.page.written import aligned, percent, state_called
from irl_gym.scores import score_of


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    return table_run(tmp_path_factory.mktemp("lake"), errors=3)


@pytest.fixture(scope="module")
def cards(tmp_path_factory):
    return table_run(tmp_path_factory.mktemp("cards"), "Blackjack-v1", errors=20, films=False, sab=False)


def scene_of(run):
    found = Scene.of(run)
    assert found is not None
    return found


def test_the_feasible_set_is_told_with_its_margin(lake):
    lead = widths(scene_of(lake)).lead
    assert "within +-1" in lead and f"at least {lake.certificate['margin_cap']:.4f}" in lead


def test_the_margin_has_no_number_where_the_run_had_another_cap(lake):
    other = {**lake.config, "learner": {**lake.config["learner"], "margin_cap": None}}
    lead = widths(scene_of(replace(lake, config=other))).lead
    assert "at least half the largest that all states can have at once" in lead


def test_only_cells_are_shaded(lake, cards):
    assert "cell is shaded" in policies(scene_of(lake)).lead
    assert "cell" not in policies(scene_of(cards)).lead and "listed below" in policies(scene_of(cards)).lead


def test_a_deviation_says_what_is_lost_by_it_and_from_there_on(lake):
    scene = scene_of(lake)
    assert (scene.behind >= scene.lost - 1e-12).all() and (scene.behind > scene.lost + 1e-9).any()
    assert all({"lost", "behind"} <= set(row) for row in policies(scene).shown["deviations"])


def test_the_order_of_states_is_a_number(cards):
    caption = values(scene_of(cards)).panels[-1].caption
    assert "Where the cloud rises" in caption and "Rank correlation: " in caption


@pytest.mark.parametrize("section", [widths, lambda scene: lambda_slider(scene)[0]])
def test_what_is_too_large_is_told_in_a_sentence(lake, section):
    told = {**lake.stages, "ambiguity": {"no_ambiguity": "there are 900 states to act in: it is worked out for at most 500"}}
    lead = section(scene_of(replace(lake, widths=None, lambda_path=None, stages=told))).lead
    assert "was not worked out for this run. There are 900 states to act in" in lead and lead.endswith("at most 500.")


def test_the_slider_calls_states_as_figures_do(lake):
    path = {**lake.lambda_path, "changes": [{"sentence": "At price 1 the reward of states 4, 14 becomes 0."}] * 7}
    _, data = lambda_slider(scene_of(replace(lake, lambda_path=path)))
    assert data is not None
    assert data["pieces"][0]["change"] == "At price 1 the reward of (row 1, column 0) and (row 3, column 2) becomes 0."


@pytest.mark.parametrize(
    ("answer", "why", "told"), [("healthy", None, "Healthy."), ("not examined", "it is gone", "Not examined: it is gone.")]
)
def test_a_doctor_without_findings_says_what_was_examined(lake, answer, why, told):
    found = doctor(replace(lake, diagnosis={"answer": answer, "why": why, "findings": [], "examined": "Examined: 53 states."}))
    assert found.lead == f"{told} Examined: 53 states."


def test_the_worst_tie_says_of_what_it_loses(lake):
    told = {**lake.metrics, "reward": {**lake.metrics["reward"], "worst_tie_regret_share": 1.023}}
    assert "lose 102.3\u00a0% of what the expert has over random" in verdict(replace(lake, metrics=told))["sentence"]


def test_a_score_has_one_form(lake):
    score = score_of(lake.metrics["policies"]["retrained"]["score"])
    told = verdict(lake)
    assert told["figures"][0]["value"] == score and f"a score of {score} and a mean return of" in told["sentence"]


def test_rounding_is_no_distance_to_the_optimum(lake):
    held = {**lake.certificate, "duality_gap": 1e-15}
    assert dict(certificate(replace(lake, certificate=held)).shown["lines"])["Objective"].endswith(
        "to rounding the best possible"
    )


def test_why_there_are_no_pictures_is_a_sentence(lake):
    film = replace(lake.films["agent"], without_frames="the environment draws none")
    section, _ = episodes(replace(lake, films={"agent": film}), scene_of(lake))
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
    assert run_places({"A": plain, "B": small}) == {"A": "FrozenLake-v1 (no arguments)", "B": "FrozenLake-v1 (map_name=4x4)"}
    assert run_places({"A": small, "B": small}) == dict.fromkeys("AB", "FrozenLake-v1 (map_name=4x4)")


def test_a_long_argument_is_told_only_where_runs_differ_in_it(lake):
    drawn = replace(lake, config={**lake.config, "env_kwargs": {"desc": ["SFFFFFFF", "FFFFFFFG"]}})
    assert run_places({"A": drawn, "B": drawn}) == dict.fromkeys("AB", "FrozenLake-v1")
    assert run_places({"A": drawn, "B": lake})["A"] == 'FrozenLake-v1 (desc=["SFFFFFFF", "FFFFFFFG"])'


def test_no_agent_is_best_across_environments(lake, tmp_path):
    write_comparison([lake, stepped_run(tmp_path / "cart")], tmp_path / "mixed.html")
    text = (tmp_path / "mixed.html").read_text()
    assert "best score" not in text and "The environments differ" in text
    assert "<td></td>" not in text and "<td>null</td>" not in text and "<td>not there</td>" in text


def test_the_distance_of_the_rewards_is_told_where_it_is_known(lake):
    told = replace(lake, metrics={**lake.metrics, "reward": {**lake.metrics["reward"], "starc": 0.684, "epic": None}})
    lead = rewards(told, scene_of(told)).lead
    assert "Between the two STARC's distance is 0.68, where 0 is a reward that ranks all policies alike" in lead
    assert "STARC" not in rewards(lake, scene_of(lake)).lead
