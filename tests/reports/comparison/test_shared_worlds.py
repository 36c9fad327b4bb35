"""Which runs share a world, and which a scale: only these are ranked."""

from dataclasses import replace

import numpy as np
import pytest
from reports.page.made_runs import stepped_run, table_run

from irl_gym.judging.curves import Curve
from irl_gym.reports.comparison.compared_runs import lettered
from irl_gym.reports.comparison.ranked import learning, sentence
from irl_gym.reports.comparison.shared_worlds import agree
from irl_gym.runs.supply import supplied


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    return table_run(tmp_path_factory.mktemp("lake"), errors=3, films=False)


def with_config(run, **changes):
    return replace(run, config={**run.config, **changes})


def worth(run, policy, value):
    policies = {**run.metrics["policies"], policy: {**run.metrics["policies"][policy], "value": value}}
    return replace(run, metrics={**run.metrics, "policies": policies})


def levels(section):
    return {one.name.rpartition(" ")[0]: one for one in section.panels[0].figure.data if one.line.dash in ("dash", "dot")}


@pytest.mark.parametrize(
    "changes",
    [
        {"gamma": 0.5}, {"env_kwargs": {"map_name": "8x8"}}, {"start_seeds": [3]}, {"reveal": {"lives": 3}}, {"bins": 9},
        {"samples": 5}, {"table": {"type": "Interaction", "steps": 9, "seed": 0}}, {"env_id": None, "dataset": "a/b-v0"},
    ],
)  # fmt: skip
def test_a_world_is_another_when_anything_is_made_otherwise(lake, changes):
    assert not lettered([lake, with_config(lake, **changes)]).same_world


def test_two_datasets_environments_are_two_worlds(lake):
    assert not lettered([with_config(lake, env_id=None, dataset=f"{name}-v0") for name in "AB"]).same_world


@pytest.mark.parametrize("changes", [{"seed": 5}, {"learner": {"type": "FeatureLP"}}, {"dataset": "a/b-v0"}, {"episodes": 3}])
def test_a_world_is_the_same_when_only_who_learns_there_differs(lake, changes):
    assert lettered([lake, with_config(lake, **changes)]).same_world


def test_a_world_is_the_same_when_only_the_seed_of_its_table_differs(lake):
    sampled = [with_config(lake, table={"type": "Interaction", "steps": 9, "seed": seed}, seed=seed) for seed in (0, 1)]
    assert lettered(sampled).same_world


def test_worlds_of_one_id_are_told_apart(lake):
    assert lettered([lake, with_config(lake, bins=9, gamma=0.5)]).places == {
        "A": "FrozenLake-v1 (gamma=0.9)",
        "B": "FrozenLake-v1 (gamma=0.5, bins=9)",
    }


@pytest.mark.parametrize(
    ("values", "same"),
    [([1.0, 1.0 + 1e-9], True), ([1.0, 1.001], False), ([0.0, 0.0], True), ([None, None], True), ([None, 1.0], False)],
)
def test_values_agree_but_for_rounding(values, same):
    assert agree(dict(zip("AB", values, strict=True))) is same


@pytest.mark.parametrize("policy", ["expert", "random"])
def test_no_run_is_best_when_scores_are_not_on_one_scale(lake, policy):
    named = lettered([lake, worth(with_config(lake, episodes=3), policy, 0.123)])
    words = supplied(sentence, named)
    assert not named.same_scale and named.same_world
    assert "best" not in words and "its own expert" in words and "not worth the same" in words


def test_the_best_run_is_named_when_scores_are_on_one_scale(lake, tmp_path):
    better = table_run(tmp_path, errors=0, films=False)
    assert "The retrained agent of run B has the best score" in supplied(sentence, lettered([lake, better]))


def test_each_curve_has_its_own_expert_when_experts_differ(lake):
    found = supplied(learning, lettered([lake, worth(lake, "expert", 0.9)]))
    assert list(levels(found)) == ["expert of run A", "expert of run B", "random"]
    own = levels(found)["expert of run B"]
    curve = next(one for one in found.panels[0].figure.data if one.name == "run B")
    assert own.y[0] == 0.9 and own.line.color == curve.line.color
    assert "where they differ each run's in its own colour" in found.panels[0].caption


def test_curves_have_one_level_when_experts_agree(lake):
    found = supplied(learning, lettered([lake, lake]))
    assert list(levels(found)) == ["expert", "random"] and "own colour" not in found.panels[0].caption


def test_curves_of_two_worlds_are_scores(lake, tmp_path):
    found = supplied(learning, lettered([lake, stepped_run(tmp_path)]))
    assert found.panels[0].title == "Score" and [one.y[0] for one in levels(found).values()] == [1.0, 0.0]


def test_a_run_without_a_curve_is_named_beside_the_curves(lake):
    planned = replace(lake, curve=Curve(*np.zeros((5, 0))))
    found = supplied(learning, lettered([lake, planned]))
    assert found.lead.endswith("Without a curve, as nobody was trained step by step, or without a score: B.")
    assert "Without a curve" not in supplied(learning, lettered([lake, lake])).lead
