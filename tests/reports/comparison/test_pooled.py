"""Runs over seeds, on the page and in its sentence."""

import re
from dataclasses import replace

import numpy as np
import pytest
from reports.page.made_runs import stepped_run, table_run

from irl_gym.judging.curves import Curve
from irl_gym.mdp.rewards import TabularReward
from irl_gym.reports.comparison.compared_runs import lettered
from irl_gym.reports.comparison.comparison_page import rewards, write_comparison
from irl_gym.reports.comparison.pooled import over_seeds, told
from irl_gym.reports.comparison.ranked import learning, sentence
from irl_gym.runs.pooling import over_seeds as pooled
from irl_gym.runs.supply import supplied


@pytest.fixture(scope="module")
def seeds(tmp_path_factory):
    folder = tmp_path_factory.mktemp("seeds")
    return [table_run(folder / f"lake{seed}", seed=seed, errors=2 + seed, films=False) for seed in range(4)]


@pytest.fixture(scope="module")
def page(seeds, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "seeds.html"
    write_comparison(seeds, path)
    return path


def section_of(runs):
    named = lettered(runs)
    return over_seeds(named.pools, named.places)


def with_metrics(run, policy, **changes):
    policies = {**run.metrics["policies"], policy: {**run.metrics["policies"].get(policy, {}), **changes}}
    return replace(run, metrics={**run.metrics, "policies": policies})


def cells(section):
    heads = section.shown["headings"][1:]
    return {head: [row[1 + i] for row in section.shown["rows"]] for i, head in enumerate(heads)}


def test_seeds_are_a_row_of_a_table_and_a_band_beside_thin_curves(page, look):
    found = look(page)
    assert found.locator("#seeds tbody th").all_inner_texts() == ["runs A, B, C, D"]
    drawn = found.evaluate("document.getElementById('curves').data.map(one => [one.name.split(' ')[0], one.line.width])")
    assert drawn == [["95", 0], *[["one", 1]] * 4, ["runs", 2], ["expert", 2], ["random", 2]]


def test_the_verdict_over_seeds_is_a_mean_with_an_interval(page, look):
    words = look(page).locator(".sentence").inner_text()
    assert words.startswith("Over 4 seeds the retrained agents have a score of") and "the interquartile mean" in words
    assert re.search(
        r"and a mean return [-0-9.]+ \(.* to .*\) where random actions have [0-9.]+, the expert [0-9.]+, each", words
    )
    assert "the expert is 1." in words


def test_a_page_of_seeds_fits_a_phone(page, look):
    assert look(page, width=390).evaluate("document.documentElement.scrollWidth") == 390


def test_of_few_seeds_it_is_the_mean_and_says_so(seeds):
    named = lettered(seeds[:3])
    assert "the mean with its" in supplied(sentence, named)
    assert "Of fewer than 4 seeds nothing is left out" in section_of(seeds[:3]).lead


def test_the_verdict_over_seeds_says_when_each_has_its_own_expert(seeds):
    named = lettered([*seeds[:3], with_metrics(seeds[3], "expert", value=9.0)])
    assert supplied(sentence, named).endswith("By score random actions are 0, the own expert of each is 1.")


def test_runs_of_one_seed_have_no_section(seeds):
    assert section_of([seeds[0], seeds[0]]) is None


def test_a_pool_is_told_in_a_line(seeds):
    (pool,) = lettered(seeds).pools
    whose = "runs A, B, C, D, interquartile mean over 4 seeds: "
    means = r"score [0-9.]+ \(.*\), mean return [-0-9.]+ \(.*\) where random actions have .*, the expert .*"
    assert re.fullmatch(whose + means + r"; left open \(0.685 of value, 0.685 of mean return\)", told(pool))


def test_a_fourth_policy_is_pooled_beside_the_agents(seeds):
    runs = [with_metrics(run, "cloned", **{**run.metrics["policies"]["random"], "score": 0.1}) for run in seeds[:2]]
    (pool,) = lettered(runs).pools
    assert told(pool).endswith("; cloned: score 0.100 (too few to say), not good (0.100 of value, 0.000 of mean return)")
    found = cells(section_of(runs))
    assert found["score of cloned (95 %)"] == ["0.100 (too few to say)"] and "score of the retrained agents (95 %)" in found


def test_a_pool_without_a_score_is_told_in_a_line_and_in_its_table(seeds):
    runs = [with_metrics(seeds[0], "retrained", score=None), *seeds[1:3]]
    (pool,) = lettered(runs).pools
    assert told(pool).startswith("runs A, B, C: no score, since not every one of the 3 seeds has one; mean return ")
    found = cells(section_of(runs))
    assert (found["score of the retrained agents (95 %)"], found["the retrained agents, judged by the worse share"]) == (
        ["none"],
        ["not judged"],
    )


def test_a_pool_is_judged_by_the_worse_of_its_means(seeds):
    paid = {"expert": (500.0, 1.0), "random": (22.0, 0.0), "retrained": (425.0, 0.977)}
    runs = list(seeds[:3])
    for i, run in enumerate(runs):
        for name, (mean, score) in paid.items():
            run = with_metrics(run, name, mean_return=mean + i, score=score + 1e-4 * i)
        runs[i] = run
    found = cells(section_of(runs))
    assert found["the retrained agents, judged by the worse share"] == ["not good (0.977 of value, 0.843 of mean return)"]
    assert found["mean return of random actions and of the expert"] == ["23 and 501"]


def drawn(runs):
    """The lines of the learning curves by name, without what stands behind it."""
    (panel,) = supplied(learning, lettered(runs)).panels
    return {one.name: one for one in panel.figure.data}, panel.caption


def test_the_curve_of_seeds_is_their_mean_at_each_step_with_its_interval(seeds):
    lines, _ = drawn(seeds)
    values = np.stack([run.curve.value for run in seeds])
    assert lines["runs A, B, C, D"].y == pytest.approx([over_steps.estimate for over_steps in map(pooled, values.T)], abs=1e-4)


def test_seeds_whose_curves_have_other_steps_are_drawn_one_by_one(seeds):
    short = Curve(*(getattr(seeds[1].curve, name)[:-1] for name in Curve.__dataclass_fields__))
    lines, caption = drawn([seeds[0], replace(seeds[1], curve=short)])
    assert {"run A", "run B"} <= set(lines) and "95 % interval" not in lines and "shaded" not in caption


def test_pools_whose_experts_differ_have_a_level_each(seeds, tmp_path):
    priced = [
        with_metrics(table_run(tmp_path / str(seed), seed=seed, l1=0.3, films=False), "expert", value=9.0) for seed in (0, 1)
    ]
    lines, caption = drawn([*seeds[:2], *priced])
    levels = [name.rpartition(" ")[0] for name, one in lines.items() if one.line.dash in ("dash", "dot")]
    assert levels == ["expert of runs A, B", "expert of runs C, D", "random"] and "each run's in its own colour" in caption


def test_a_reward_that_several_seeds_learned_is_drawn_once(seeds, page, look):
    titles = look(page).locator("#rewards h3").all_inner_texts()
    assert titles == ["Runs A, B, C, D: FrozenLake-v1"]
    other = replace(seeds[1], learned=TabularReward(2 * seeds[1].learned.values))
    assert len(supplied(rewards, lettered([seeds[0], other])).panels) == 2


def test_environments_are_taken_together_by_their_scores(seeds, tmp_path):
    carts = [stepped_run(tmp_path / "cart", seed=seed) for seed in range(2)]
    same = {name: seeds[0].config[name] for name in ("gamma", "learner")}
    alike = [replace(run, config={**run.config, **same}) for run in carts]
    assert "Over the 2 environments of runs A, B; runs C, D the score is" in section_of([*seeds[:2], *alike]).lead
