"""DAgger in the class of a network, of observations that nobody numbers."""

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3 import PPO

from irl_gym.agents.neural_clone import NeuralClone
from irl_gym.agents.planners import SB3, Agent
from irl_gym.agents.simulator import Simulator
from irl_gym.errors import InvalidPolicy, NotDiscrete
from irl_gym.learners.interactive.dagger import DAgger
from irl_gym.learners.problem import Oracle, Problem, Spaces
from irl_gym.mdp.planning.dynamic_programming import policy_iteration
from irl_gym.mdp.policies import TabularPolicy, as_distribution

SMALL = NeuralClone(net_arch=(16,), epochs=20, learning_rate=0.01, held_out=0.0)


@pytest.fixture(scope="module")
def pole():
    return gym.make("CartPole-v1", max_episode_steps=60)


def balance(seen, info):
    """What keeps a pole upright for a while."""
    return int(seen[2] + 0.3 * seen[3] > 0)


def balancing(pole, oracle):
    return Problem(Spaces(pole.observation_space, pole.action_space), oracle=oracle, environment=Simulator(pole, SB3(), 0.99))


def test_a_network_learns_from_labels_where_there_is_no_table(pole, tmp_path, monkeypatch):
    """And none of its rounds is trained again where it was."""
    learner = DAgger(rounds=2, learner=SMALL, episodes=3)

    def learned():
        return learner.learn(balancing(pole, Oracle(balance)), np.random.default_rng(0), tmp_path)

    found = learned()
    assert isinstance(found.policy, Agent) and found.proof.steps == found.proof.queries == sum(map(len, found.labelled))
    assert found.proof.labelled is None and found.proof.odds is None and found.proof.mistakes < 0.25
    seen = np.concatenate([one.observations[:-1] for one in found.labelled])
    said = np.concatenate([one.labels for one in found.labelled])
    assert (found.policy.predict(seen, deterministic=True)[0] == said).mean() > 0.8
    assert found.facts()[1].sentence.startswith(f"asked {found.proof.queries} times, over 2 rounds")
    monkeypatch.setattr(NeuralClone, "fit", None)
    again = learned()
    for name, one in SMALL.arrays(found.policy).items():
        np.testing.assert_array_equal(SMALL.arrays(again.policy)[name], one)
    assert again.stats == found.stats


def test_an_agent_of_sb3_teaches_a_network(pole):
    model = PPO("MlpPolicy", pole, n_steps=8, batch_size=8, seed=0, device="cpu")
    found = DAgger(rounds=2, learner=SMALL, episodes=2).learn(balancing(pole, Oracle(model)), np.random.default_rng(0))
    seen, said = found.labelled[0].observations[:-1], found.labelled[0].labels
    np.testing.assert_array_equal(model.predict(seen, deterministic=True)[0], said)


def test_on_a_table_a_network_is_judged_exactly(toy_text):
    table = toy_text("FrozenLake 4x4 slippery")
    expert = policy_iteration(table.mdp, table.reward).policy
    known = Problem.of(table, oracle=Oracle(TabularPolicy(as_distribution(expert, 16, 4), table.states)), reward=table.reward)
    learner = DAgger(rounds=3, learner=NeuralClone(epochs=30, held_out=0.0), episodes=20, ask="unseen")
    found = learner.learn(known, np.random.default_rng(0))
    assert found.proof.odds == pytest.approx(0.0, abs=1e-12) and found.proof.labelled == found.proof.queries <= 11


def test_states_without_numbers_are_not_known_to_be_unseen(pole):
    with pytest.raises(NotDiscrete):
        DAgger(learner=SMALL, episodes=1, ask="unseen").learn(balancing(pole, Oracle(balance)), np.random.default_rng(0))


def test_a_bad_answer_is_told_with_the_query_and_the_observation(pole):
    with pytest.raises(InvalidPolicy, match=r"answer to query 1, observation \[.*\], is 7: expected an action, .* 0 to 1"):
        DAgger(rounds=1, learner=SMALL, episodes=1).learn(balancing(pole, Oracle(lambda *seen: 7)), np.random.default_rng(0))
