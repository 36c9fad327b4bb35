"""compare.html in a real browser: two and three runs, of one environment and of several."""

from dataclasses import replace
from pathlib import Path

import pytest
from reports.page.made_runs import section_of, stepped_run, table_run

from irl_gym.errors import InvalidParameter
from irl_gym.reports.comparison.comparison_page import write_comparison
from irl_gym.reports.page.sections.proof import doctor


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("compared")
    return {
        "lake": table_run(folder / "lake", films=False),
        "priced": table_run(folder / "priced", l1=0.3, seed=3, errors=5, films=False),
        "cliff": table_run(folder / "cliff", "CliffWalking-v1", films=False),
        "cart": stepped_run(folder / "<i>cart"),
    }


@pytest.fixture(scope="module")
def pages(runs, tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")
    write_comparison([runs["lake"], runs["priced"]], folder / "two.html")
    write_comparison([runs["lake"], runs["cliff"], runs["cart"]], folder / "three.html")
    return {"two": folder / "two.html", "three": folder / "three.html"}


@pytest.mark.parametrize("which", ["two", "three"])
def test_a_comparison_has_no_errors_and_asks_for_nothing(pages, look, which):
    page = look(pages[which])
    assert page.wrong == [] and all(url.startswith(("file:", "data:", "blob:")) for url in page.asked)
    assert page.evaluate("[...document.querySelectorAll('.plot')].every(one => one.querySelector('.main-svg'))")


@pytest.mark.parametrize("which", ["two", "three"])
def test_a_comparison_fits_a_phone_and_is_small(pages, look, which):
    assert look(pages[which], width=390).evaluate("document.documentElement.scrollWidth") == 390
    assert pages[which].stat().st_size < 8_000_000


def test_each_run_has_a_row_a_curve_and_a_reward(pages, look):
    page = look(pages["three"])
    assert page.locator("#results tbody th").all_inner_texts() == ["run A", "run B", "run C"]
    assert page.locator("#rewards .plot").count() == 3
    assert page.evaluate("document.getElementById('curves').data.map(one => one.name)")[:3] == ["run A", "run B", "run C"]


def test_curves_of_different_environments_are_scores(pages, look):
    assert look(pages["three"]).locator("#curves-title").inner_text() == "Score"
    assert look(pages["two"]).locator("#curves-title").inner_text() == "Discounted value from the start"


def test_only_what_differs_of_the_configurations_is_listed(pages, look):
    assert look(pages["two"]).locator("#differences thead th").all_inner_texts()[1:] == ["learner.l1", "seed"]


def test_arguments_of_one_run_alone_are_one_column(runs, tmp_path):
    lake = runs["lake"]
    write_comparison([lake, replace(lake, config={**lake.config, "env_kwargs": {"desc": ["SG"]}})], tmp_path / "a.html")
    text = (tmp_path / "a.html").read_text()
    assert "Of the configuration 1 entry differs;" in text and '<th scope="col">env_kwargs.desc</th>' in text
    assert '<th scope="row">run A</th><td>not there</td>' in text


def test_the_name_of_a_folder_is_never_markup(pages, look):
    assert "<i>cart" in look(pages["three"]).locator("header").inner_text()


def test_the_same_runs_make_the_same_bytes(pages, runs, tmp_path):
    write_comparison([runs["lake"], runs["priced"]], tmp_path / "again.html")
    assert (tmp_path / "again.html").read_bytes() == pages["two"].read_bytes()


@pytest.mark.parametrize("n", [0, 1, 27])
def test_a_comparison_of_too_few_or_too_many_is_refused(runs, tmp_path, n):
    with pytest.raises(InvalidParameter, match=f"runs has {n}"):
        write_comparison([runs["lake"]] * n, tmp_path / "none.html")


def with_doctor(run, diagnosis):
    return replace(run, diagnosis=diagnosis)


HEALTHY = {"answer": "healthy", "why": None, "examined": "Examined: it.", "findings": []}
RECORDED = "As recorded when each run was made. "
UNSEEN = {**HEALTHY, "answer": "not examined", "why": "it is gone"}


@pytest.mark.parametrize(
    ("diagnoses", "told"),
    [
        ([None, None], "Runs A, B: Not looked at, by the earlier version of irl_gym that made it."),
        ([HEALTHY, UNSEEN], f"{RECORDED}Run A: Healthy. Run B: Not examined: it is gone."),
        ([HEALTHY, HEALTHY], f"{RECORDED}Runs A, B: Healthy."),
    ],
)
def test_the_doctor_s_answers_are_told_with_their_runs(runs, tmp_path, diagnoses, told):
    write_comparison([with_doctor(runs["lake"], one) for one in diagnoses], tmp_path / "a.html")
    text = (tmp_path / "a.html").read_text()
    assert f'<p class="lead">{told}</p>' in text


def test_the_doctor_says_of_a_run_what_its_own_page_says(runs, tmp_path):
    found = {"name": "few-episodes", "sentence": "Tied in {where}.", "mend": "More episodes.", "flags": ["--episodes"]}
    found |= {"states": [1], "actions": [0]}
    ill = with_doctor(runs["lake"], {**HEALTHY, "answer": "findings", "findings": [found]})
    write_comparison([ill, runs["priced"]], tmp_path / "a.html")
    text = (tmp_path / "a.html").read_text()
    (own,) = section_of(doctor, ill).shown["findings"]
    assert f"<h3>run A: {own['name']}</h3>" in text and own["sentence"] in text and own["mend"] in text
    assert own["sentence"].endswith("(row 0, column 1; left).") and "--episodes" in own["mend"]


def test_what_a_learner_recorded_is_never_told_in_place_of_what_is_computed(runs, tmp_path):
    forged = {"label": "expert optimal under it", "sentence": "FORGED", "mood": "good"}
    held = runs["lake"].certificate
    proof = {**held["proof"], "facts": [*held["proof"]["facts"], forged]}
    write_comparison([replace(runs["lake"], certificate={**held, "proof": proof}), runs["priced"]], tmp_path / "a.html")
    text = (tmp_path / "a.html").read_text()
    assert "expert optimal under it, as its learner recorded" in text and "yes: the best policy earns at most" in text


def test_a_run_in_the_folder_that_one_is_in_has_that_folders_name(runs, tmp_path, monkeypatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    write_comparison([replace(runs["lake"], path=Path(".")), runs["priced"]], tmp_path / "a.html")
    assert "seed 0 (here)" in (tmp_path / "a.html").read_text()


def test_runs_of_one_environment_are_not_ranked_when_their_tables_differ(runs, tmp_path):
    lake = runs["lake"]
    write_comparison([lake, replace(lake, config={**lake.config, "bins": 9})], tmp_path / "a.html")
    assert "The environments differ" in (tmp_path / "a.html").read_text()
