"""Logs without their last observations: every action is learned from, and nothing is made of what it led to."""

import gymnasium as gym
import numpy as np
import pandas as pd
import pytest
from gymnasium import spaces

from irl_gym.agents.planners import ValueIteration
from irl_gym.demonstrations.datasets import read_minari, write_minari
from irl_gym.demonstrations.endings import in_table
from irl_gym.demonstrations.imports.frames import from_frame
from irl_gym.demonstrations.shards import Shards
from irl_gym.errors import InvalidDemonstrations
from irl_gym.features.feature_maps import OneHot
from irl_gym.features.feature_sums import discounted_sums
from irl_gym.judging.diagnoses.case import Case
from irl_gym.judging.diagnoses.unseen import unseen_ends
from irl_gym.judging.distances.transitions import Transitions
from irl_gym.learners.linear_programs.estimates import usable
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.loop.loop import MAKERS
from irl_gym.loop.pipeline import recover_and_retrain
from irl_gym.mdp.episodes import Episode, collect_from_table, empirical_policy
from irl_gym.mdp.planning.dynamic_programming import policy_iteration
from irl_gym.runs.diagnosed import diagnose_run
from irl_gym.runs.experiment import Experiment
from irl_gym.runs.run import read_run
from irl_gym.runs.supply import supplied
from irl_gym.tables.counted.counting import Counting

ID = "me/log-v0"


def one(observations=(0, 4, 4), actions=(1, 1), ending="unseen", terminated=True):
    return Episode(np.array(observations), np.array(actions), np.ones(len(actions)), terminated, not terminated, None, ending)


# --- what counts ---


def test_every_pair_counts_for_a_policy(toy_text):
    counts = empirical_policy([one()], toy_text("FrozenLake 4x4").states, 4).counts
    assert (counts[0, 1], counts[4, 1], counts.sum()) == (1, 1, 2)


def test_a_step_whose_successor_was_not_recorded_is_no_step_of_a_table():
    counted = Counting().count([one(), one((0, 0), (2,))], spaces.Discrete(16), 4, gamma=0.9)
    assert counted.counts.visits.sum() == 1
    assert not counted.table.mdp.terminal[counted.table.states.encode(4)]


def test_episodes_without_any_known_step_make_no_table():
    with pytest.raises(InvalidDemonstrations, match="none of the 1 episodes has a step whose successor was recorded"):
        Counting().count([one((0, 0), (2,))], spaces.Discrete(16), 4, gamma=0.9)


def test_sums_of_features_end_with_the_last_state_that_was_seen():
    np.testing.assert_allclose(discounted_sums([one()], OneHot(16), 0.5)[0], np.eye(16)[0] + 0.5 * np.eye(16)[4])


def test_an_episode_without_its_last_observation_was_cut_for_a_learner_of_trajectories():
    taken = usable([one(), one((0, 0), (2,))], 10, None)
    assert [(len(each), each.terminated) for each in taken.episodes] == [(1, False)] and taken.dropped == 1


def test_transitions_leave_out_what_was_not_recorded():
    assert Transitions.from_episodes([one(), one((0, 1, 2), (2, 2), "seen")]).next_observations.tolist() == [4, 1, 2]


@pytest.mark.parametrize("data_format", ["hdf5", "arrow"])
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_dataset_keeps_how_episodes_end(tmp_path, data_format):
    episodes = [one(), one(ending="dropped", terminated=False), one((0, 4, 8), ending="seen")]
    given = {"observation_space": spaces.Discrete(16), "action_space": spaces.Discrete(4)}
    write_minari(episodes, ID, None, root=tmp_path, algorithm="a log", data_format=data_format, **given)
    assert [(each.ending, each.terminated) for each in read_minari(ID, root=tmp_path)] == [
        ("unseen", True), ("dropped", False), ("seen", True),
    ]  # fmt: skip


def test_shards_keep_how_episodes_end(tmp_path):
    shards = Shards(tmp_path / "shards", spaces.Discrete(16))
    shards.append([one(), one((0, 4, 8), ending="seen")])
    assert [each.ending for each in Shards(tmp_path / "shards", spaces.Discrete(16))] == ["unseen", "seen"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"ending": "guess"}, "ending is 'guess'"),
        ({"terminated": np.array([False, True])}, r"terminated is array\(.* of the last"),
    ],
)
def test_an_episode_that_does_not_say_how_it_ends_is_refused(change, message, unchecked):
    with pytest.raises(InvalidDemonstrations, match=message):
        Episode(**{"observations": np.array([0, 1]), "actions": np.array([1]), "rewards": np.zeros(1), "terminated": True,
                   "truncated": False, **change})  # fmt: skip


# --- what a table knows ---


def followed(toy_text, name, episode):
    table = toy_text(name)
    return next(in_table([episode], table.mdp, table.states, "refuse"))


def test_the_only_successor_of_an_exact_table_is_taken(toy_text):
    whole = followed(toy_text, "FrozenLake 4x4", one((8, 9, 10, 14, 14), (2, 2, 1, 2)))
    assert (whole.observations.tolist(), whole.terminated, whole.ending) == ([8, 9, 10, 14, 15], True, "followed")


def test_a_successor_that_is_one_of_several_is_not_made_up(toy_text):
    assert followed(toy_text, "FrozenLake 4x4 slippery", one()).ending == "unseen"


@pytest.mark.parametrize(("claims", "said"), [({"gaps": [1.0]}, True), ({}, False)])
def test_a_learner_that_needs_last_observations_is_said_to_lack_them(claims, said):
    found = unseen_ends(Case(claims=claims, judged={"demonstrations": {"unseen": 2, "episodes": 5}}))
    assert (found is not None) == said and (found is None or found.sentence.startswith("2 of 5 episodes do not say"))


# --- the loop ---


@pytest.fixture(scope="module")
def log(tmp_path_factory, toy_text):
    """Taxi's best policy as a CSV file with episode, observation and action, and nothing else."""
    table = toy_text("Taxi")
    best = policy_iteration(table.mdp, table.reward).policy
    drawn = collect_from_table(table.mdp, table.payments.entries, table.states, best, 300, seed=0, max_episode_steps=200)
    rows = [
        (i, o, a)
        for i, each in enumerate(drawn)
        for o, a in zip(each.observations.tolist(), each.actions.tolist(), strict=False)
    ]
    path = tmp_path_factory.mktemp("log") / "taxi.csv"
    pd.DataFrame(rows, columns=["episode", "observation", "action"]).to_csv(path, index=False)
    return path


def run_of(log, root, learner=None, **how):
    env = gym.make("Taxi-v4")
    write_minari(from_frame(log, step=None, env=env, **how), ID, env, root=root, algorithm="a log")
    asked = Experiment(
        None, 0.99, dataset=ID, dataset_root=str(root), learner=learner or FiniteLP(slack=1.0), retrain=ValueIteration(),
        eval_episodes=100,
    )  # fmt: skip
    return recover_and_retrain(asked, root / "run")


@pytest.fixture(autouse=True)
def no_figures(monkeypatch):
    """They take longer than all else here; other tests draw them."""
    monkeypatch.setitem(MAKERS, "figures", ())


def test_a_log_of_taxi_without_next_observations_teaches_the_drop_off(log, tmp_path):
    report = run_of(log, tmp_path)
    rows = report.metrics["policies"]
    assert rows["expert"]["mean_return"] > 7 and rows["retrained"]["mean_return"] > 7
    assert report.metrics["demonstrations"]["followed"] == 300
    assert not {"dropped-actions", "unseen-ends"} & set(supplied(diagnose_run, read_run(report.out)).names)


@pytest.mark.filterwarnings("ignore:the last action of")
def test_a_run_on_a_log_that_lost_its_last_actions_says_so(log, tmp_path):
    report = run_of(log, tmp_path, last="drop")
    assert report.metrics["demonstrations"]["dropped"] == 300
    (found,) = (each for each in supplied(diagnose_run, read_run(report.out)).findings if each.name == "dropped-actions")
    assert "The last action of 300 of 300 episodes was dropped" in found.sentence and "last='keep'" in found.mend
