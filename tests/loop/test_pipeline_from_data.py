"""The loop from a dataset alone with FiniteLP: what it is told of the expert, and values that are cut alike for all."""

import io
import shutil
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from rich.console import Console

from irl_gym.agents.expert_files import FromFile
from irl_gym.agents.planners import ValueIteration
from irl_gym.demonstrations.datasets import read_minari, write_minari
from irl_gym.demonstrations.demonstrated import most_frequent
from irl_gym.errors import DatasetMismatch, InvalidParameter, RunConflict
from irl_gym.files.run_folder import read_json
from irl_gym.judging.metrics import policy_value
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.loop.loop import Loop
from irl_gym.loop.pipeline import recover_and_retrain
from irl_gym.loop.worlds import discounted_mean
from irl_gym.mdp.episodes import Episode, empirical_policy
from irl_gym.mdp.planning.dynamic_programming import policy_iteration
from irl_gym.reports.terminal_report import print_report
from irl_gym.runs.diagnosed import diagnose_run
from irl_gym.runs.experiment import Experiment
from irl_gym.runs.run import read_run
from irl_gym.runs.supply import supplied

DATA = "irl_gym/frozenlake-v1-expert-v0"
GAMMA, LIMIT = 0.95, 20
SOFT = FiniteLP(slack=1.0)
FEW = {"eval_episodes": 400, "retrain": ValueIteration()}
LAKE = {"map_name": "4x4", "max_episode_steps": LIMIT}

pytestmark = pytest.mark.usefixtures("without_figures")


def recorded(out, **asked):
    """A run whose demonstrations the others take; episodes end after 20 steps, so that the cut matters."""
    return recover_and_retrain(Experiment("FrozenLake-v1", GAMMA, LAKE, **FEW, **asked), out)


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    return recorded(tmp_path_factory.mktemp("source") / "run", episodes=400)


@pytest.fixture(scope="module")
def noisy(tmp_path_factory):
    return recorded(tmp_path_factory.mktemp("noisy") / "run", episodes=30, epsilon=0.3, learner=SOFT)


def data_of(report):
    return {"dataset": DATA, "dataset_root": str(report.out / "dataset")}


@pytest.fixture(scope="module")
def from_data(source, tmp_path_factory):
    return recover_and_retrain(
        Experiment(None, GAMMA, learner=SOFT, **data_of(source), **FEW), tmp_path_factory.mktemp("data") / "run"
    )


@pytest.fixture(scope="module")
def from_noise(noisy, tmp_path_factory):
    return recover_and_retrain(
        Experiment(None, GAMMA, learner=SOFT, **data_of(noisy), **FEW), tmp_path_factory.mktemp("noise") / "run"
    )


@pytest.fixture(scope="module")
def two(source, tmp_path_factory):
    """A run from two episodes."""
    root = tmp_path_factory.mktemp("two")
    write_minari(episodes_of(source)[:2], "me/two-v0", gym.make("FrozenLake-v1", **LAKE), root=root, algorithm="two")
    asked = Experiment(None, GAMMA, dataset="me/two-v0", dataset_root=str(root), learner=SOFT, **FEW)
    return recover_and_retrain(asked, root / "run")


@pytest.mark.parametrize("unfinished", ["metrics", "all"])
def test_a_dataset_that_was_swapped_is_named_unless_nothing_was_made_of_it(two, tmp_path, unfinished):
    out, asked = shutil.copytree(two.out, tmp_path / "run"), dict(two.config)
    data = shutil.copytree(two.out.parent / "me", tmp_path / "me")
    experiment = Experiment(None, GAMMA, dataset="me/two-v0", dataset_root=asked["dataset_root"], learner=SOFT, **FEW)
    for kept in (out / ".stages").glob("*.json"):
        if unfinished in ("all", kept.stem) and kept.stem != "start":
            kept.unlink()
    others = [Episode(np.array([0, 4]), np.array([1]), np.zeros(1), False, True)] * 3
    place = Path(asked["dataset_root"]) / "me"
    try:
        shutil.rmtree(place / "two-v0")
        write_minari(others, "me/two-v0", gym.make("FrozenLake-v1", **LAKE), root=place.parent, algorithm="two")
        if unfinished == "all":
            assert recover_and_retrain(experiment, out).metrics["demonstrations"]["episodes"] == 3
            return
        with pytest.raises(RunConflict, match=r"dataset 'me/two-v0' is not the one that stages of .*\. Choose another --out\."):
            recover_and_retrain(experiment, out)
        assert recover_and_retrain(experiment, tmp_path / "another").metrics["demonstrations"]["episodes"] == 3
    finally:
        shutil.rmtree(place)
        shutil.copytree(data, place)


def printed(report):
    console = Console(file=io.StringIO(), width=300)
    print_report(report, console)
    return " ".join(console.file.getvalue().split())


def episodes_of(report):
    return list(read_minari(DATA, root=report.out / "dataset"))


def test_values_are_cut_at_the_time_limit(from_data, source):
    assert (from_data.metrics["table"]["horizon"], source.metrics["table"]["horizon"]) == (LIMIT, None)


def test_the_experts_value_is_the_mean_of_its_episodes_paid_by_the_table(from_data, source, toy_text):
    R = toy_text("FrozenLake 4x4 slippery").reward.values
    paid = [GAMMA ** np.arange(len(one)) @ R[one.observations[:-1], one.actions] for one in episodes_of(source)]
    assert from_data.metrics["policies"]["expert"]["value"] == pytest.approx(np.mean(paid))


def test_the_experts_value_is_near_what_its_episodes_recorded(from_data, source):
    recorded_mean = discounted_mean(episodes_of(source), GAMMA)
    assert from_data.metrics["policies"]["expert"]["value"] == pytest.approx(recorded_mean, abs=0.02)


@pytest.mark.parametrize("policy", ["random", "retrained"])
def test_the_values_of_the_others_are_those_of_episodes_cut_as_the_experts_are(from_data, toy_text, policy):
    table = toy_text("FrozenLake 4x4 slippery")
    actions = np.load(from_data.out / "agent_policy.npz")["actions"] if policy == "retrained" else np.full((16, 4), 0.25)
    expected = policy_value(discounted(table.mdp), table.reward, actions, LIMIT)
    assert from_data.metrics["policies"][policy]["value"] == pytest.approx(expected)
    env, rng, returns = gym.make("FrozenLake-v1", max_episode_steps=LIMIT), np.random.default_rng(0), []
    for seed in range(400):
        at, _ = env.reset(seed=seed)
        step, done, total = 0, False, 0.0
        while not done:
            at, paid, ended, cut, _ = env.step(int(actions[at]) if policy == "retrained" else int(rng.integers(4)))
            total, step, done = total + GAMMA**step * float(paid), step + 1, ended or cut
        returns.append(total)
    assert abs(np.mean(returns) - expected) < 4 * np.std(returns) / np.sqrt(400)


def discounted(mdp):
    return type(mdp)(mdp.P, GAMMA, mdp.d0)


def test_the_agent_is_as_good_as_the_best_within_the_noise_of_the_episodes(from_data, toy_text):
    table = toy_text("FrozenLake 4x4 slippery")
    mdp = discounted(table.mdp)
    best = policy_value(mdp, table.reward, policy_iteration(mdp, table.reward).policy, LIMIT)
    assert from_data.metrics["policies"]["retrained"]["value"] > 0.95 * best


def test_the_expert_that_is_kept_is_what_it_did_most(from_noise, noisy, toy_text):
    kept = np.load(from_noise.out / "expert.npz")["actions"]
    seen = empirical_policy(episodes_of(noisy), toy_text("FrozenLake 4x4 slippery").states, 4)
    np.testing.assert_array_equal(kept, most_frequent(seen))


def test_the_same_is_learned_from_a_noisy_expert_and_from_its_dataset(from_noise, noisy):
    assert from_noise.certificate == noisy.certificate
    assert (from_noise.out / "reward.npz").read_bytes() == (noisy.out / "reward.npz").read_bytes()


def test_the_metrics_count_unknown_and_violated_states(from_noise):
    reward, certificate = from_noise.metrics["reward"], from_noise.certificate["optimality"]
    for key in ("unknown", "violated", "marginless"):
        assert reward[f"{key}_states"] == len(certificate[key])
    assert reward["slack"] == 1.0 and reward["expert_optimal"] == certificate["expert_optimal"]
    assert not (certificate["expert_optimal"] and certificate["violated"])


def test_the_metrics_say_what_was_known_of_the_expert(from_data, source, noisy):
    told = [(one.metrics["demonstrations"]["given"], one.metrics["demonstrations"]["episodes_only"])
            for one in (from_data, source, noisy)]  # fmt: skip
    assert told == [(True, True), (False, False), (False, True)]


def test_the_report_of_a_dataset_says_whose_values_are_cut(from_data):
    console = Console(record=True, width=300, file=io.StringIO())
    print_report(from_data, console)
    text = " ".join(console.export_text().split())
    for words in (f"cut after {LIMIT} steps, the expert's that of its episodes", "with an optimal action", "expert = 1"):
        assert words in text


@pytest.mark.parametrize("learner", [FiniteLP(), FiniteLP(reward_on="state-action"), FiniteLP(unvisited="free", l1="auto")])
def test_every_finite_lp_learns_from_a_dataset(noisy, tmp_path, learner):
    made = recover_and_retrain(Experiment(None, GAMMA, learner=learner, **data_of(noisy), **FEW), tmp_path / "run")
    assert made.metrics["reward"]["status"] == "optimal"


def test_the_same_seed_gives_the_same_bytes(from_noise, noisy, tmp_path):
    again = recover_and_retrain(Experiment(None, GAMMA, learner=SOFT, **data_of(noisy), **FEW), tmp_path / "run")
    for file in ("metrics.json", "certificate.json", "config.json", "reward.npz", "expert.npz"):
        assert (from_noise.out / file).read_bytes() == (again.out / file).read_bytes(), file


def test_an_expert_read_from_a_dataset_cannot_act_where_it_was_not_seen(from_noise, tmp_path):
    table = np.load(from_noise.out / "expert.npz")["actions"]
    table[0] = np.nan
    np.savez(tmp_path / "expert.npz", actions=table)
    asked = Experiment("FrozenLake-v1", GAMMA, expert=FromFile.at(str(tmp_path / "expert.npz")), **FEW)
    with pytest.raises(InvalidParameter, match="An expert read from a dataset cannot act; give the dataset"):
        recover_and_retrain(asked, tmp_path / "run")


def test_a_dataset_of_another_environment_is_refused(source, tmp_path):
    asked = Experiment("FrozenLake-v1", GAMMA, {"map_name": "8x8"}, learner=SOFT, **data_of(source))
    with pytest.raises(DatasetMismatch, match="8x8"):
        Loop(asked, tmp_path / "run").stage("expert")


def without_rewards(report, root, keep):
    """The same dataset as a log has it: no rewards, and as many steps of each episode as `keep` says."""
    env = gym.make("FrozenLake-v1", **LAKE)
    episodes = [
        Episode(one.observations[: n + 1], one.actions[:n], np.zeros(n), one.terminated and n == len(one), n < len(one))
        for one in read_minari(DATA, root=report.out / "dataset")
        if (n := keep(len(one))) > 0
    ]
    write_minari(episodes, "me/log-v0", env, root=root, algorithm="a log")
    return recover_and_retrain(
        Experiment(None, GAMMA, dataset="me/log-v0", dataset_root=str(root), learner=SOFT, **FEW), root / "run"
    )


def test_an_expert_without_recorded_rewards_is_paid_by_the_table(source, from_data, tmp_path):
    paid = without_rewards(source, tmp_path, lambda n: n).metrics["policies"]["expert"]
    assert paid["value"] == pytest.approx(from_data.metrics["policies"]["expert"]["value"], abs=0.03) and paid["score"] == 1


def test_there_is_no_score_when_the_expert_earns_no_more_than_random_actions(source, tmp_path):
    report = without_rewards(source, tmp_path, lambda n: min(n - 1, 2))
    assert [row["score"] for row in report.metrics["policies"].values()] == [None] * 4
    assert report.metrics["reward"]["worst_tie_regret_share"] is None
    console = Console(file=io.StringIO(), width=200)
    print_report(report, console)
    assert "There is no score: the expert earns no more than random actions." in " ".join(console.file.getvalue().split())


def test_two_episodes_make_no_score_and_the_metrics_say_why(two):
    assert [row["score"] for row in two.metrics["policies"].values()] == [None] * 4
    assert two.metrics["expert_value"] == {"episodes": 2, "low": None, "high": None}
    assert "the mean of 2 episodes, too few" in two.metrics["score_reason"]
    assert two.metrics["reward"]["worst_tie_regret_share"] is None


def test_many_episodes_make_a_score_and_the_metrics_hold_the_interval(from_data):
    known, row = from_data.metrics["expert_value"], from_data.metrics["policies"]["expert"]
    assert from_data.metrics["score_reason"] is None and row["score"] == 1 and known["episodes"] == 400
    assert 0 < known["high"] - row["value"] == pytest.approx(row["value"] - known["low"])


def test_the_report_of_two_episodes_says_whose_they_are_and_makes_no_score_of_them(two):
    text = printed(two)
    for words in (
        "expert: known by 2 episodes of the dataset.",
        "There is no score: the expert's value",
        "worst-tie regret │ not known",
        "FrozenLake-v1, ",
    ):
        assert words in text, words
    assert "it gains" not in text and "score 0.99" not in text


def test_the_doctor_finds_that_two_episodes_are_few(two, from_data):
    held = [[one["name"] for one in read_json(made.out / "diagnosis.json")["findings"]] for made in (two, from_data)]
    assert "few-episodes" in held[0] and "few-episodes" not in held[1]
    assert supplied(diagnose_run, read_run(two.out)).to_json() == read_json(two.out / "diagnosis.json")


def test_the_report_counts_what_the_doctor_found(two):
    count = len(read_json(two.out / "diagnosis.json")["findings"])
    told = f"The doctor: {count} findings. This command tells them, with mends: irl-gym doctor --run {two.out}"
    assert count > 1 and told in printed(two)


def test_one_episode_is_all_there_is_where_nothing_is_left_to_chance(tmp_path):
    plain = {"map_name": "4x4", "is_slippery": False}
    first = recover_and_retrain(Experiment("FrozenLake-v1", GAMMA, plain, episodes=1, **FEW), tmp_path / "first")
    asked = Experiment(None, GAMMA, learner=SOFT, dataset=DATA, dataset_root=str(first.out / "dataset"), **FEW)
    made = recover_and_retrain(asked, tmp_path / "run")
    value = made.metrics["policies"]["expert"]["value"]
    assert made.metrics["policies"]["expert"]["score"] == 1 and value == pytest.approx(GAMMA**5)
    assert made.metrics["expert_value"] == {"episodes": 1, "low": value, "high": value}


def test_policies_that_do_the_same_are_judged_by_the_same_episodes(source):
    expert, agent = (np.load(source.out / f"{name}.npz")["actions"] for name in ("expert", "agent_policy"))
    acting = [0, 1, 2, 3, 4, 6, 8, 9, 10, 13, 14]  # the others are holes and the goal
    np.testing.assert_array_equal(expert[acting], agent[acting])
    rows, keys = source.metrics["policies"], ("mean_return", "return_low")
    assert [rows["expert"][key] for key in keys] == [rows["retrained"][key] for key in keys]
