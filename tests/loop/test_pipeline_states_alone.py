"""The loop from a dataset of states alone: what is inferred, what is said of it, and what is read again."""

import json

import gymnasium as gym
import numpy as np
import pytest

from irl_gym.agents.planners import ValueIteration
from irl_gym.demonstrations.datasets import write_minari
from irl_gym.demonstrations.inferred import without_actions
from irl_gym.errors import InvalidDemonstrations
from irl_gym.learners.cloning.clone import Clone
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.learners.registry import learner_of
from irl_gym.loop.loop import MAKERS, Loop
from irl_gym.loop.pipeline import recover_and_retrain
from irl_gym.mdp.episodes import Episode, collect_from_table
from irl_gym.mdp.planning.dynamic_programming import policy_iteration
from irl_gym.runs.experiment import Experiment
from irl_gym.runs.run import read_run

ID, FEW = "me/states-v0", {"eval_episodes": 50, "retrain": ValueIteration()}


@pytest.fixture(scope="module")
def root(toy_text, tmp_path_factory):
    """A folder with 200 episodes of the expert of the slippery lake, as they are and without their actions."""
    folder, table = tmp_path_factory.mktemp("states"), toy_text("FrozenLake 4x4 slippery")
    best = policy_iteration(table.mdp, table.reward).policy
    drawn = [*collect_from_table(table.mdp, table.payments.entries, table.states, best, 200, seed=0, max_episode_steps=100)]
    for name, episodes in ((ID, without_actions(drawn)), ("me/whole-v0", drawn)):
        write_minari(episodes, name, gym.make("FrozenLake-v1"), root=folder, algorithm="a table")
    return folder


def asked(root, learner, dataset=ID):
    return Experiment(None, 0.99, dataset=dataset, dataset_root=str(root), learner=learner, **FEW)


@pytest.fixture(scope="module")
def runs(root, tmp_path_factory):
    """A run of either dataset."""
    out = tmp_path_factory.mktemp("runs")
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(MAKERS, "figures", ())
        made = (recover_and_retrain(asked(root, FiniteLP(slack=1.0), one), out / one) for one in (ID, "me/whole-v0"))
        return tuple(made)


def test_a_reward_from_states_alone_is_as_good_as_one_from_actions(runs):
    scores = [one.metrics["policies"]["retrained"]["score"] for one in runs]
    assert scores[0] == pytest.approx(scores[1], abs=0.01)


def test_the_expert_of_states_alone_is_worth_what_its_episodes_are(runs):
    values = [one.metrics["policies"]["expert"]["value"] for one in runs]
    assert values[0] == pytest.approx(values[1], abs=0.02)


def test_a_run_says_that_actions_were_inferred(runs):
    alone, whole = ([fact["label"] for fact in one.certificate["proof"]["facts"]] for one in runs)
    assert "actions inferred" in alone and "actions inferred" not in whole
    taken = [fact["sentence"] for fact in runs[0].certificate["optimality"]["facts"] if fact["label"].startswith("taken for")]
    assert taken == ["the most likely actions, inferred from the states of its episodes"]
    assert runs[0].metrics["policies"]["expert"]["how"] == "known by 200 episodes of the dataset, of states alone"
    assert runs[0].metrics["demonstrations"]["given"]


def test_a_run_of_states_alone_is_read_as_it_was_recorded(runs):
    again = read_run(runs[0].out)
    assert again.metrics["policies"] == runs[0].metrics["policies"]
    assert again.certificate["optimality"]["facts"] == runs[0].certificate["optimality"]["facts"]


def test_the_film_of_states_alone_has_no_actions(runs):
    film = json.loads((runs[0].out / "films/expert.json").read_text())
    assert {one["action"] for one in film["steps"]} == {None}
    assert film["without_frames"] == "the dataset does not say which actions were taken"


def test_a_clone_of_states_alone_is_a_run_too(root, tmp_path):
    loop = Loop(asked(root, Clone()), tmp_path / "run")
    assert loop.stage("reward")["policy"] and loop.outcome.inferred is not None
    assert np.isfinite(loop.learned_policy).all()


def test_a_run_of_a_learner_that_needs_actions_says_so(root, tmp_path):
    loop = Loop(asked(root, learner_of("neural-clone", {})), tmp_path / "run")
    with pytest.raises(InvalidDemonstrations, match="NeuralClone needs actions, and episode 0 has only states"):
        loop.stage("reward")


def test_states_that_no_action_joins_are_refused_on_an_exact_table(root, tmp_path):
    jumps = [Episode(np.array([0, 15]), None, np.zeros(1), True, False)]
    write_minari(jumps, "me/jumps-v0", gym.make("FrozenLake-v1"), root=tmp_path, algorithm="x")
    with pytest.raises(
        InvalidDemonstrations, match=r"episode 0, step 0 leads from 0 to 15, and no action of the environment does"
    ):
        _ = Loop(asked(tmp_path, Clone(), "me/jumps-v0"), tmp_path / "run").demonstrations
