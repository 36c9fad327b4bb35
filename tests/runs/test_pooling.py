"""Runs that differ in their seed alone are taken together; nothing else is."""

from dataclasses import replace

import numpy as np
import pytest
from reports.page.made_runs import stepped_run

from irl_gym.intervals import interquartile_mean, iqm_interval
from irl_gym.judging.curves import Curve
from irl_gym.runs.pooling import over_environments, pools

STEPS = np.array([0.0, 30_000, 60_000])


@pytest.fixture
def made(tmp_path):
    """Makes a run of a seed; entries of its configuration, its score and its curve may be given."""
    plain = stepped_run(tmp_path / "run")

    def run(seed, score=0.9, *, value=(20.0, 60.0, 85.0), steps=STEPS, **changes):
        policies = {**plain.metrics["policies"], "retrained": {**plain.metrics["policies"]["retrained"], "score": score}}
        empty = np.full(len(steps), np.nan)
        return replace(
            plain, config={**plain.config, "seed": seed, **changes}, metrics={**plain.metrics, "policies": policies},
            curve=Curve(np.array(steps), np.array(value), empty, empty, empty),
        )  # fmt: skip

    return run


def lettered(*runs):
    return dict(zip("ABCDEFGH", runs, strict=False))


def test_runs_that_differ_in_their_seed_alone_are_one_pool_in_the_order_of_seeds(made):
    (pool,) = pools(lettered(made(2), made(0), made(1)))
    assert list(pool.runs) == ["B", "C", "A"]


def test_runs_whose_learner_and_table_have_the_seed_too_are_one_pool(made):
    def parts(seed):
        return {"learner": {"type": "FeatureLP", "seed": seed}, "table": {"type": "Interaction", "steps": 9, "seed": seed}}

    (pool,) = pools(lettered(*(made(seed, **parts(seed)) for seed in range(3))))
    assert len(pool.runs) == 3


def test_runs_of_different_settings_are_no_pool(made):
    assert pools(lettered(made(0), made(1, gamma=0.5), made(2, learner={"type": "FiniteLP", "l1": 1.0}))) == []


def test_settings_are_pooled_each_for_itself(made):
    found = pools(lettered(made(0), made(0, gamma=0.5), made(1), made(1, gamma=0.5), made(2, episodes=7)))
    assert [list(pool.runs) for pool in found] == [["A", "C"], ["B", "D"]]


def test_of_a_seed_that_is_there_twice_the_first_counts(made):
    (pool,) = pools(lettered(made(0, 0.1), made(1, 0.2), made(0, 0.9)))
    assert list(pool.runs) == ["A", "B"] and pool.scores.tolist() == [0.1, 0.2]


def test_one_seed_is_no_pool(made):
    assert pools(lettered(made(3), made(3))) == []


def test_a_pool_has_no_score_when_one_of_its_runs_has_none(made):
    (pool,) = pools(lettered(made(0), made(1, None), made(2)))
    assert pool.scores is None and pool.score is None and pool.judged.mood == "plain"
    returns = pool.mean_returns["retrained"]
    assert np.isfinite(returns.estimate) and not returns.known


def test_the_score_of_four_seeds_leaves_out_the_best_and_the_worst(made):
    (pool,) = pools(lettered(*(made(seed, score) for seed, score in enumerate([0.0, 0.8, 0.9, 5.0]))))
    assert pool.score.estimate == pytest.approx(0.85) and pool.score.low <= 0.85 <= pool.score.high


def test_pools_of_several_environments_are_averaged_by_what_varies_within_each(made):
    scores = np.array([[0.1, 0.2, 0.3], [0.7, 0.8, 0.9]])
    runs = [made(seed, scores[i, seed], env_id=env_id) for i, env_id in enumerate("XY") for seed in range(3)]
    ((several, score),) = over_environments(pools(lettered(*runs)))
    assert len(several) == 2 and score.estimate == pytest.approx(interquartile_mean(scores))
    assert score == iqm_interval(scores)


def test_pools_with_different_numbers_of_seeds_are_not_averaged(made):
    runs = [made(seed, env_id="X") for seed in range(3)] + [made(seed, env_id="Y") for seed in range(2)]
    assert over_environments(pools(lettered(*runs))) == []


def test_pools_of_different_methods_are_not_averaged(made):
    runs = [made(seed, env_id=env_id, episodes=n) for env_id, n in (("X", 1), ("Y", 2)) for seed in range(2)]
    assert over_environments(pools(lettered(*runs))) == []


def test_pools_without_a_score_are_left_out_of_the_average(made):
    runs = [made(seed, score, env_id=env_id) for env_id, score in (("X", 0.5), ("Y", None), ("Z", 0.7)) for seed in range(2)]
    ((several, score),) = over_environments(pools(lettered(*runs)))
    assert [pool.first.config["env_id"] for pool in several] == ["X", "Z"] and score.estimate == pytest.approx(0.6)
