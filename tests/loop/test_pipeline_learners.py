"""The loop with features and with trajectories: from a table, from steps, from cells, and from a dataset alone."""

import io
import json
import re
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from rich.console import Console

from irl_gym.agents.planners import FOR_CONTROL, SB3, ValueIteration
from irl_gym.demonstrations.datasets import read_minari, write_minari
from irl_gym.environments.rollouts import run_episodes
from irl_gym.errors import DatasetMismatch, DatasetMissing
from irl_gym.features.feature_maps import OneHot
from irl_gym.features.linear_reward import LinearReward
from irl_gym.learners.linear_programs.feature import FeatureLP
from irl_gym.learners.linear_programs.trajectory import TrajectoryLP
from irl_gym.loop.loop import MAKERS, Loop
from irl_gym.loop.pipeline import recover_and_retrain
from irl_gym.reports.terminal_report import print_report
from irl_gym.runs.diagnosed import diagnose_run
from irl_gym.runs.experiment import Experiment
from irl_gym.runs.named_parts import features_named
from irl_gym.runs.run import read_run
from irl_gym.runs.supply import supplied

LAKE_DATA, CAR_DATA, CART_DATA = (f"irl_gym/{name}-expert-v0" for name in ("frozenlake-v1", "mountaincar-v0", "cartpole-v1"))
FEW = {"eval_episodes": 20, "retrain": ValueIteration()}
SHORT = SB3(total_timesteps=64, hyperparameters={"n_steps": 8, "batch_size": 64})
CARTS = {"eval_episodes": 10, "retrain": SHORT, "inner": SHORT}
CART, CAR = gym.make("CartPole-v1"), gym.make("MountainCar-v0")


def cap_lp(features=None):
    return FeatureLP(features or OneHot(16), margin_cap="auto")


def rounds(features=None, max_rounds=20, trajectories=300):
    return TrajectoryLP(features or OneHot(16), max_rounds=max_rounds, trajectories=trajectories)


CELLS = features_named("radial", CAR, size=5)
BALL = features_named("radial", CART, size=3)


def experiments(root):
    """Every way to use the two learners, by name; those from datasets take what another run recorded."""
    lake, car, cart = (str(root / name / "dataset") for name in ("table, features", "cells, features", "steps, trajectories"))
    lakes, cars, carts = ({"dataset": d, "dataset_root": r} for d, r in ((LAKE_DATA, lake), (CAR_DATA, car), (CART_DATA, cart)))
    return {
        "table, features": Experiment("FrozenLake-v1", 0.99, episodes=200, learner=cap_lp(), **FEW),
        "table, trajectories": Experiment("FrozenLake-v1", 0.99, episodes=200, learner=rounds(), **FEW),
        "cells, features": Experiment("MountainCar-v0", 0.99, bins=20, episodes=30, learner=cap_lp(CELLS), **FEW),
        "cells, trajectories": Experiment(
            "MountainCar-v0", 0.99, bins=20, episodes=20, learner=rounds(CELLS, 3, 50), **FEW
        ),
        "steps, trajectories": Experiment(
            "CartPole-v1", 0.99, {"max_episode_steps": 50}, expert=SHORT, episodes=10, learner=rounds(BALL, 1, 50), **CARTS
        ),
        "dataset, features": Experiment(None, 0.99, learner=cap_lp(), **lakes, **FEW),
        "dataset, trajectories": Experiment(None, 0.99, learner=rounds(), **lakes, **FEW),
        "dataset, cells": Experiment(None, 0.99, bins=20, learner=cap_lp(CELLS), **cars, **FEW),
        "dataset, steps": Experiment(None, 0.99, learner=rounds(BALL, 1, 50), **carts, **CARTS),
    }  # fmt: skip


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Reports by name; each run is made once, when it is asked for, and after the one whose dataset it takes."""
    root = tmp_path_factory.mktemp("runs")
    asked, made = experiments(root), {}

    def get(name):
        needed = {"dataset, features": "table, features", "dataset, trajectories": "table, features",
                  "dataset, cells": "cells, features", "dataset, steps": "steps, trajectories"}  # fmt: skip
        if name in needed:
            get(needed[name])
        if name not in made:
            made[name] = recover_and_retrain(asked[name], root / name)
        return made[name]

    get.experiments = asked
    return get


NAMES = tuple(experiments(Path()))
DATA = tuple(name for name in NAMES if name.startswith("dataset"))
STEPPED = ("steps, trajectories", "dataset, steps")
TRAJECTORIES = ("table, trajectories", "cells, trajectories", "dataset, trajectories", *STEPPED)


# --- what a run leaves and finds ---


def test_a_run_of_cells_is_read_without_making_its_environment(runs, monkeypatch):
    out = runs("cells, features").out
    monkeypatch.setattr(gym, "make", None)
    run = read_run(out)
    assert run.table.states.bins == (20, 20) and run.state_name(0) and run.tabular.values.shape == (run.table.mdp.n_states,)


@pytest.mark.parametrize("name", NAMES)
def test_a_run_leaves_its_files(runs, name):
    agent = {"agent.zip", "clone.zip"} if name in STEPPED else {"agent_policy.npz", "clone_policy.npz"}
    expert = set() if name in STEPPED and name in DATA else {"expert.zip"} if name in STEPPED else {"expert.npz"}
    left = {path.name for path in runs(name).out.iterdir()}
    assert {
        "config.json",
        "reward.npz",
        "certificate.json",
        "learning_curve.csv",
        "metrics.json",
        "figures",
    } | agent | expert <= left
    assert ("dataset" in left) == (name not in DATA)


@pytest.mark.parametrize("name", NAMES)
def test_a_run_draws_its_figures(runs, name):
    drawn = {path.name for path in (runs(name).out / "figures").iterdir()}
    expected = {"returns.png", "learning_curve.png"} if name in STEPPED else {"rewards.png", "values.png", "policies.png"}
    assert drawn >= expected


@pytest.mark.parametrize("name", NAMES)
def test_the_metrics_have_the_documented_keys(runs, name):
    metrics = runs(name).metrics
    assert set(metrics) == {"policies", "score_reason", "expert_value", "reward", "training", "demonstrations", "table"}
    own = {"learned"} if name in TRAJECTORIES else set()
    assert set(metrics["policies"]) == {"expert", "random", "clone", "retrained"} | own
    row = {"how", "value", "score", "mean_return", "return_low", "return_high", "return_share", "agreement"}
    row |= {"expected_return"} if metrics["table"] is not None and metrics["table"]["exact"] else set()
    assert all(set(one) == row for one in metrics["policies"].values())
    assert (metrics["table"] is None) == (name in STEPPED) and metrics["demonstrations"]["given"] == (name in DATA)


@pytest.mark.parametrize("name", NAMES)
def test_a_run_tells_what_the_doctor_finds_in_its_folder(runs, name):
    told = json.loads((runs(name).out / "diagnosis.json").read_text())
    assert [one["name"] for one in told["findings"]] == list(supplied(diagnose_run, read_run(runs(name).out)).names)


@pytest.mark.parametrize("name", NAMES)
def test_the_metrics_count_what_the_certificate_lists(runs, name):
    reward, certificate = runs(name).metrics["reward"], runs(name).certificate
    assert not any(isinstance(value, list) for value in reward.values())
    assert reward["objective"] == certificate["proof"]["terms"]["objective"]
    assert (certificate["optimality"] is None) == (name in STEPPED)
    assert ("best_round" in reward) == (name in TRAJECTORIES) and ("worst_tie_regret" in reward) == (name not in STEPPED)


@pytest.mark.parametrize("name", ["table, features", "dataset, features", "cells, features", "dataset, cells"])
def test_an_agent_is_as_good_as_the_expert_when_the_cap_leaves_no_ties(runs, name):
    assert runs(name).metrics["policies"]["retrained"]["score"] > 0.95


@pytest.mark.parametrize("name", ["table, trajectories", "dataset, trajectories", "cells, trajectories"])
def test_an_agent_is_nearly_as_good_as_the_expert_whose_trajectories_were_seen(runs, name):
    assert runs(name).metrics["policies"]["retrained"]["score"] > 0.9


@pytest.mark.parametrize("name", NAMES)
def test_the_reward_is_of_observations(runs, name):
    reward = LinearReward.load(runs(name).out / "reward.npz")
    space = {"FrozenLake-v1": gym.make("FrozenLake-v1"), "CartPole-v1": CART}.get(runs.experiments[name].env_id, None)
    assert np.isfinite(reward.alpha).all() and (space is None or reward.of(np.array([space.reset(seed=0)[0]])).shape == (1,))


def test_a_dataset_settles_the_expert_where_it_was_seen_only(runs):
    kept = np.load(runs("dataset, features").out / "expert.npz")["actions"]
    seen = np.zeros(16, dtype=bool)
    for episode in read_minari(LAKE_DATA, root=runs("table, features").out / "dataset"):
        seen[episode.observations[:-1]] = True
    assert np.array_equal(~np.isnan(kept).any(axis=1), seen)


def test_the_experts_value_is_that_of_its_episodes_paid_by_the_table_when_only_these_are_known(runs, toy_text):
    episodes = list(read_minari(LAKE_DATA, root=runs("table, features").out / "dataset"))
    R = toy_text("FrozenLake 4x4 slippery").reward.values
    mean = np.mean([0.99 ** np.arange(len(one)) @ R[one.observations[:-1], one.actions] for one in episodes])
    assert runs("dataset, features").metrics["policies"]["expert"]["value"] == pytest.approx(mean)


# --- again ---


@pytest.mark.parametrize("name", ["table, trajectories", "dataset, features", "dataset, cells", "steps, trajectories"])
def test_the_same_seed_gives_the_same_bytes(runs, name, tmp_path, monkeypatch):
    first = runs(name)
    monkeypatch.setitem(MAKERS, "figures", ())
    again = recover_and_retrain(runs.experiments[name], tmp_path)
    for file in ("metrics.json", "certificate.json", "config.json", "reward.npz", "learning_curve.csv"):
        assert (first.out / file).read_bytes() == (again.out / file).read_bytes(), file


@pytest.mark.parametrize("name", ["dataset, trajectories", "steps, trajectories"])
def test_a_run_continues_after_its_last_stage(runs, name, tmp_path, monkeypatch):
    first = runs(name)
    monkeypatch.setitem(MAKERS, "figures", ())
    loop = Loop(runs.experiments[name], tmp_path)
    for stage in ("expert", "demonstrations", "reward"):
        loop.stage(stage)
    kept = (tmp_path / "reward.npz").stat().st_mtime_ns
    again = recover_and_retrain(runs.experiments[name], tmp_path)
    assert (tmp_path / "reward.npz").stat().st_mtime_ns == kept and again.metrics == first.metrics


# --- the report ---

COMMON = ("features", "score")
SAID = {
    "table, features": (
        *COMMON,
        "expert optimal under it",
        "rank",
        "sample",
        "margin cap",
        "worst-tie regret",
        "exact, discounted",
    ),
    "table, trajectories": (
        *COMMON,
        "expert optimal under it",
        "expert best by its episodes",
        "best round",
        "distance",
        "cut after",
        "noise alone makes about",
    ),
    "cells, features": (*COMMON, "computed on a table that is an estimate"),
    "steps, trajectories": (*COMMON, "expert best by its episodes", "mean of episodes", "best round"),
    "dataset, features": (*COMMON, "the expert's that of its episodes"),
}


@pytest.mark.parametrize("name", SAID)
def test_the_report_says(runs, name):
    console = Console(record=True, width=160, file=io.StringIO())
    print_report(runs(name), console)
    text = " ".join(console.export_text().split())  # captions are wrapped
    assert [word for word in SAID[name] if not re.search(word, text)] == []


# --- refusals ---


def test_a_dataset_that_is_missing_is_refused_with_those_that_are_there(runs, tmp_path):
    root = runs("table, features").out / "dataset"
    with pytest.raises(DatasetMissing, match=f"'lake-v0' is not under .* Name one of these: {LAKE_DATA}"):
        recover_and_retrain(
            Experiment(None, 0.99, dataset="lake-v0", dataset_root=str(root), learner=rounds()), tmp_path / "run"
        )
    assert not (tmp_path / "run").exists()


def test_a_dataset_of_another_environment_is_refused(runs, tmp_path):
    root = str(runs("table, features").out / "dataset")
    asked = Experiment(
        "FrozenLake-v1", 0.99, {"map_name": "8x8"}, dataset=LAKE_DATA, dataset_root=root, learner=rounds(OneHot(64))
    )
    with pytest.raises(DatasetMismatch, match="8x8"):
        recover_and_retrain(asked, tmp_path)


# --- the bar of the issue ---


@pytest.mark.slow
@pytest.mark.parametrize("name", ["radial"])
def test_cart_pole_is_balanced_for_400_steps_from_a_dataset_alone(tmp_path, name):
    from stable_baselines3.common.env_util import make_vec_env

    expert = FOR_CONTROL.plan(make_vec_env("CartPole-v1", 8, seed=0), gamma=0.99)
    write_minari(run_episodes(CART, expert, 100, seed=1), "cart/expert-v0", CART, root=tmp_path, algorithm="PPO")
    learner = TrajectoryLP(features_named(name, CART), max_rounds=3)
    asked = Experiment(None, 0.99, dataset="cart/expert-v0", dataset_root=str(tmp_path), learner=learner)
    made = recover_and_retrain(asked, tmp_path / "run")
    print(json.dumps(made.metrics["policies"]))
    assert made.metrics["policies"]["retrained"]["mean_return"] >= 400
