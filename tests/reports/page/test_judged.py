"""A score stands beside its mean return, in one size and in the colour of the worse of the two."""

from dataclasses import replace

import pytest
from reports.page.made_runs import table_run, verdict_of

from irl_gym.reports.comparison.compared_runs import lettered
from irl_gym.reports.comparison.comparison_page import write_comparison
from irl_gym.reports.comparison.ranked import sentence
from irl_gym.reports.page.report import write_report
from irl_gym.reports.page.sections.judged import policies_table
from irl_gym.runs.supply import supplied

TAXI = {"retrained": (0.82, -139.0, 16.0), "expert": (1.0, 7.8, 0.4), "random": (0.0, -770.0, 15.0)}
CART = {"retrained": (0.977, 425.0, 17.0), "expert": (1.0, 500.0, None), "random": (0.0, 22.0, 1.5)}
GREAT = CART | {"retrained": (0.977, 475.0, 10.0)}
DOUBTFUL = CART | {"retrained": (0.977, 450.0, 17.0)}


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    return table_run(tmp_path_factory.mktemp("lake"), errors=1, films=False)


def earning(run, numbers, **metrics):
    """A run whose policies have these scores and mean returns, with half-widths."""
    policies = {
        name: run.metrics["policies"][name]
        | {"score": score, "mean_return": mean, "return_low": half and mean - half, "return_high": half and mean + half}
        for name, (score, mean, half) in numbers.items()
    }
    return replace(run, metrics={**run.metrics, "policies": policies, **metrics})


@pytest.mark.parametrize(
    ("numbers", "mood"),
    [(TAXI, "bad"), (CART, "bad"), (GREAT, "good"), (DOUBTFUL, "open")],
    ids=["taxi", "cart", "great", "open"],
)
def test_score_and_mean_return_have_the_colour_of_the_worse(lake, numbers, mood):
    told = verdict_of(earning(lake, numbers))["questions"][0]
    assert {told["mood"], *(one["mood"] for one in told["figures"])} == {mood}


def test_the_mean_return_says_what_random_actions_and_the_expert_return(lake):
    told = verdict_of(earning(lake, TAXI))["questions"][0]
    assert told["figures"][1]["value"] == "-139"
    assert told["figures"][1]["note"] == "95 %: -155 to -123; random actions have -770, the expert 7.8"
    assert told["answer"] == "No" and told["sentences"][0].endswith(
        "earns -139 an episode on average, the expert 7.8, random actions -770."
    )
    note = policies_table(earning(lake, TAXI).metrics).shown["note"]
    assert "How score and mean return are coloured: not good (0.820 of value, 0.811 of mean return)." in note


def test_a_mean_return_of_too_few_says_so(lake):
    equal = CART | {"retrained": (1.0, 500.0, None)}
    assert verdict_of(earning(lake, equal))["questions"][0]["figures"][1]["note"].startswith(
        "too few to say how surely; random actions have 22"
    )


def test_a_mean_return_without_a_score_is_shown_without_a_judgement(lake):
    told = verdict_of(earning(lake, CART | {"retrained": (None, 425.0, 17.0)}))["questions"][0]
    assert [one["mood"] for one in told["figures"]] == ["plain", "plain"] and told["figures"][1]["value"] == "425"
    assert told["answer"] == "Not judged" and told["sentences"][1].startswith("There is no score, as ")


def test_a_run_whose_rows_have_no_returns_shows_without_them(lake):
    policies = {name: {"value": row["value"], "score": row["score"]} for name, row in lake.metrics["policies"].items()}
    told = verdict_of(replace(lake, metrics={**lake.metrics, "policies": policies}))["questions"][0]
    assert told["figures"][1]["value"] == "not known" and told["figures"][1]["note"] == "not recorded in this version"


def test_both_are_of_one_size_and_colour_on_the_page(lake, look, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "cart.html"
    write_report(earning(lake, CART), path)
    for width in (1280, 390):
        style = "node => [getComputedStyle(node).fontSize, getComputedStyle(node).color]"
        page = look(path, width=width)
        (size, colour), second, third, *_ = [one.evaluate(style) for one in page.locator(".verdict strong").all()]
        assert second == [size, colour] and third[0] == size and third[1] != colour
        assert page.evaluate("document.documentElement.scrollWidth") == width
    assert "0.843 of mean return" in page.locator("#summary .note").inner_text()


def test_a_comparison_tells_mean_returns_beside_scores(lake, tmp_path):
    runs = [earning(lake, TAXI), earning(lake, TAXI | {"retrained": (0.8, -120.0, 16.0)})]
    words = supplied(sentence, lettered(runs))
    assert "run A has the best score, 0.820 with mean return -139" in words
    assert "run B the worst, 0.800 with mean return -120. The highest mean return is that of run B, -120." in words
    assert words.endswith("by mean return random actions have -770, the expert 7.8.")
    write_comparison(runs, tmp_path / "both.html")
    assert "<td>not good (0.820 of value, 0.811 of mean return)</td>" in (tmp_path / "both.html").read_text()


def test_agents_of_one_score_are_not_called_equally_good(lake):
    runs = [earning(lake, CART), earning(lake, GREAT)]
    assert "have one score, 0.977, and mean return 425 to 475" in supplied(sentence, lettered(runs))


def test_each_run_has_its_own_scale_of_returns_where_environments_differ(lake):
    other = earning(lake, CART)
    runs = [earning(lake, TAXI), replace(other, config={**other.config, "gamma": 0.5})]
    words = supplied(sentence, lettered(runs))
    assert "run A 0.820 with mean return -139 (random actions have -770, the expert 7.8)" in words
