"""The closed loop, on small budgets: what it leaves, that it continues, and that the same seed gives the same bytes."""

import json

import gymnasium as gym
import minari
import numpy as np
import pytest

from irl_gym.agents.planners import SB3, ValueIteration, load_agent
from irl_gym.demonstrations.datasets import minari_root
from irl_gym.environments.learned_reward import LearnedReward
from irl_gym.errors import DegenerateExpert, InvalidParameter, NotDiscrete, RunConflict, UnknownEnvironment
from irl_gym.judging.distances import epic, starc
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.loop.loop import Loop
from irl_gym.loop.pipeline import recover_and_retrain
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.shaping import ExpectedAdvantage, ShapedReward
from irl_gym.runs.experiment import Experiment
from irl_gym.tables.tabulate import tabulate

FILES = (
    "config.json", "expert.npz", "reward.npz", "reward_shaped.npz", "certificate.json", "agent.zip", "agent_policy.npz",
    "clone_policy.npz", "learning_curve.csv", "metrics.json",
    "figures/rewards.png", "figures/values.png", "figures/policies.png", "figures/learning_curve.png",
)  # fmt: skip
SMALL = {"episodes": 20, "eval_episodes": 20, "num_envs": 16, "env_kwargs": {"is_slippery": False}}


def small(**kwargs):
    return Experiment("FrozenLake-v1", 0.99, **{"retrain": SB3(total_timesteps=30_000), **SMALL, **kwargs})


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    return recover_and_retrain(small(), tmp_path_factory.mktemp("loop") / "run")


@pytest.fixture(scope="module")
def continued(tmp_path_factory):
    """The same run, stopped after three stages and continued, and when its reward was written."""
    out = tmp_path_factory.mktemp("continued") / "run"
    first = Loop(small(), out)
    for stage in ("expert", "demonstrations", "reward"):
        first.stage(stage)
    kept = (out / "reward.npz").stat().st_mtime_ns
    return recover_and_retrain(small(), out), kept


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    """A run whose agent is planned, and the share that each stage was told last."""
    seen = {}
    asked = small(retrain=ValueIteration(), shaping=False)
    made = recover_and_retrain(asked, tmp_path_factory.mktemp("planned"), lambda stage, share, _: seen.update({stage: share}))
    return made, seen


@pytest.mark.parametrize("name", FILES)
def test_a_run_leaves(report, name):
    assert (report.out / name).stat().st_size > 0


def test_a_run_leaves_what_its_own_agent_is_paid(report):
    reward, table = (
        TabularReward.load(report.out / "reward.npz"),
        tabulate(gym.make("FrozenLake-v1", is_slippery=False), gamma=0.99),
    )
    paid = ShapedReward.load(report.out / "reward_shaped.npz")
    clip = json.loads((report.out / "certificate.json").read_text())["proof"]["terms"]["margin_cap"]
    assert np.array_equal(paid.values, ExpectedAdvantage(clip).apply(reward, table.mdp).values)


def test_an_environment_pays_the_shaped_reward_of_a_run(report):
    env = LearnedReward(gym.make("FrozenLake-v1", is_slippery=False), report.out / "reward_shaped.npz")
    env.reset(seed=0)
    expert = np.load(report.out / "expert.npz")["actions"]
    assert env.step(int(expert[0]))[1] == 0


def test_a_run_leaves_nothing_half_written(report):
    assert not [path for path in report.out.rglob("*") if ".tmp" in path.name or path.name == ".lock"]


def test_a_run_leaves_a_dataset_that_plain_minari_opens(report):
    with minari_root(report.out / "dataset"):
        dataset = minari.load_dataset("irl_gym/frozenlake-v1-expert-v0")
        assert (dataset.total_episodes, dataset.recover_environment().spec.id) == (20, "FrozenLake-v1")


def test_the_retrained_agent_is_as_good_as_the_expert(report):
    assert report.metrics["policies"]["retrained"]["score"] > 0.95


def test_the_scale_of_the_score_is_set_by_random_and_expert(report):
    policies = report.metrics["policies"]
    for share in ("score", "return_share"):
        assert (policies["random"][share], policies["expert"][share]) == (0.0, 1.0)


def test_the_share_of_the_mean_return_is_in_the_metrics_and_in_their_csv(report):
    mean = {name: row["mean_return"] for name, row in report.metrics["policies"].items()}
    share = (mean["retrained"] - mean["random"]) / (mean["expert"] - mean["random"])
    assert report.metrics["policies"]["retrained"]["return_share"] == pytest.approx(share)
    rows = [line.split(",") for line in (report.out / "metrics.csv").read_text().splitlines()]
    assert [float(row[-1]) for row in rows if row[-3:-1] == ["retrained", "return_share"]] == [pytest.approx(share)]


def test_the_distances_of_the_rewards_are_those_where_episodes_go(report):
    """FrozenLake 4x4 has no cell that no episode visits."""
    table = Loop(small(), report.out).world.table
    learned, told = TabularReward.load(report.out / "reward.npz"), report.metrics["reward"]
    assert table.mdp.reachable.all()
    assert told["starc"] == pytest.approx(starc(table.mdp, table.reward, learned)) and 0 < told["starc"] < 1
    assert told["epic"] == pytest.approx(epic(table.mdp, table.reward, learned)) and 0 < told["epic"] < 1


def test_the_expert_agrees_with_its_own_set(report):
    assert report.metrics["policies"]["expert"]["agreement"] == 1.0


def test_mean_returns_lie_in_their_intervals(report):
    for row in report.metrics["policies"].values():
        assert row["return_low"] is not None and row["return_low"] <= row["mean_return"] <= row["return_high"]


def test_the_agent_saved_is_the_agent_judged(report):
    agent = load_agent(report.out / "agent.zip", "PPO")
    actions, _ = agent.predict(np.arange(16), deterministic=True)
    assert np.array_equal(actions, np.load(report.out / "agent_policy.npz")["actions"])


def test_the_certificate_is_that_of_the_reward(report):
    reward = TabularReward.load(report.out / "reward.npz")
    assert report.certificate["optimality"]["expert_optimal"] and reward.values.shape == (16,)


def test_the_same_seed_gives_the_same_bytes(report, continued):
    again, _ = continued
    names = [name for name in FILES if name != "agent.zip"]  # a zip holds the time it was made
    data = "dataset/irl_gym/frozenlake-v1-expert-v0/data/main_data.hdf5"
    differing = [name for name in [*names, data] if (report.out / name).read_bytes() != (again.out / name).read_bytes()]
    assert differing == []


def test_a_finished_run_is_read_not_run_again(report):
    before = {path: path.stat().st_mtime_ns for path in report.out.rglob("*")}
    assert recover_and_retrain(small(), report.out).metrics == report.metrics
    assert {path: path.stat().st_mtime_ns for path in report.out.rglob("*")} == before


def test_a_run_that_stopped_continues_after_its_last_stage(report, continued):
    again, kept = continued
    assert (again.out / "reward.npz").stat().st_mtime_ns == kept
    assert again.metrics == report.metrics


def test_another_experiment_in_the_same_folder_is_refused(report):
    with pytest.raises(RunConflict, match="seed is 0, this one's is 1"):
        recover_and_retrain(small(seed=1), report.out)


def test_progress_reaches_the_end_of_each_stage(planned):
    _, seen = planned
    assert set(seen) == {
        "table",
        "expert",
        "demonstrations",
        "reward",
        "agent",
        "clone",
        "metrics",
        "figures",
        "record",
        "ambiguity",
        "report",
    }
    assert set(seen.values()) == {1.0}


def test_a_planner_on_the_recovered_reward_is_optimal(planned):
    made, _ = planned
    assert made.metrics["policies"]["retrained"]["score"] == pytest.approx(1.0)


@pytest.mark.usefixtures("without_figures")
def test_an_sb3_expert_can_demonstrate(tmp_path):
    made = recover_and_retrain(small(expert=SB3(total_timesteps=30_000), retrain=ValueIteration()), tmp_path)
    assert made.metrics["policies"]["retrained"]["value"] == pytest.approx(made.metrics["policies"]["expert"]["value"])


@pytest.mark.usefixtures("without_figures")
def test_an_environment_that_pays_by_luck_is_stepped(tmp_path):
    made = recover_and_retrain(
        Experiment("CliffWalkingSlippery-v1", 0.99, episodes=5, eval_episodes=5, retrain=ValueIteration(),
                   learner=FiniteLP(reward_on="state-action")), tmp_path,
    )  # fmt: skip
    assert made.metrics["policies"]["retrained"]["score"] == pytest.approx(1.0)


@pytest.mark.usefixtures("without_figures")
def test_our_own_environments_work_by_module_and_id(tmp_path):
    asked = Experiment("irl_gym_envs:irl_gym/GridWorld-v0", 0.9, episodes=5, eval_episodes=5, retrain=ValueIteration())
    assert recover_and_retrain(asked, tmp_path).metrics["policies"]["retrained"]["score"] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("env_id", "error", "match"),
    [("FrozenLaek-v1", UnknownEnvironment, "FrozenLake-v1"), ("CartPole-v1", NotDiscrete, "floats")],
)
def test_an_environment_that_cannot_be_used_is_refused_before_anything_is_written(tmp_path, env_id, error, match):
    with pytest.raises(error, match=match):
        recover_and_retrain(Experiment(env_id, 0.99), tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_an_expert_that_no_reward_explains_stops_the_run_with_its_reason(tmp_path):
    corridor = {"size": [1, 2], "slip": 1.0, "goals": [[0, 1]], "start": [0, 0], "terminal_goal": False}
    asked = Experiment("irl_gym_envs:irl_gym/GridWorld-v0", 0.9, env_kwargs=corridor, episodes=1)
    with pytest.raises(DegenerateExpert, match="state-action"):
        recover_and_retrain(asked, tmp_path)


@pytest.mark.parametrize("wrong", [{"episodes": 0}, {"num_envs": 0}, {"eval_episodes": -1}])
def test_an_experiment_refuses_nothing_to_do(wrong):
    with pytest.raises(InvalidParameter, match=next(iter(wrong))):
        small(**wrong)


def test_the_configuration_is_json():
    assert json.loads(json.dumps(small().to_json()))["learner"]["type"] == "FiniteLP"
