"""Functions, agents at a temperature, and files of experts."""

import json
import zipfile

import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium import spaces
from stable_baselines3 import A2C, DQN, PPO, SAC

from irl_gym.agents.experts import Acting, SoftAgent, load_expert
from irl_gym.agents.noise import boltzmann
from irl_gym.agents.planners import Agent
from irl_gym.environments.rollouts import run_episodes
from irl_gym.errors import InvalidParameter, InvalidPolicy, NotDiscrete
from irl_gym.mdp.episodes import collect
from irl_gym.mdp.policies import Policy

SMALL = {"policy_kwargs": {"net_arch": []}, "seed": 0, "device": "cpu"}
MADE = {
    "PPO": lambda: PPO("MlpPolicy", "FrozenLake-v1", n_steps=64, batch_size=64, n_epochs=1, **SMALL),
    "DQN": lambda: DQN("MlpPolicy", "FrozenLake-v1", learning_starts=50, buffer_size=500, **SMALL),
    "A2C": lambda: A2C("MlpPolicy", "FrozenLake-v1", **SMALL),
}
NAMES = sorted(MADE)


@pytest.fixture(scope="module")
def zips(tmp_path_factory):
    """A zip of each algorithm, trained for 200 steps, and the agent in it."""
    folder = tmp_path_factory.mktemp("agents")
    kept = {}
    for name, make in MADE.items():
        model = make().learn(200)
        model.save(folder / name)
        kept[name] = folder / f"{name}.zip", Agent(model)
    return kept


def test_acting_asks_the_function_once_an_observation():
    seen = []
    actor = Acting(lambda observation: seen.append(observation) or int(observation) % 4, 4, spaces.Discrete(16))
    actions, state = actor.predict(np.array([3, 4, 9]), state="hidden")
    assert actions.tolist() == [3, 0, 1] and seen == [3, 4, 9] and state == "hidden" and actions.dtype == np.int64


def test_acting_gives_one_action_for_one_observation():
    action, _ = Acting(lambda observation: np.array(1), 2, spaces.Box(-1, 1, (3,))).predict(np.zeros(3), deterministic=True)
    assert action == 1 and np.ndim(action) == 0 and isinstance(Acting(len, 2, spaces.Discrete(2)), Policy)


@pytest.mark.parametrize(
    ("space", "batch", "first"),
    [
        (spaces.Tuple([spaces.Discrete(5), spaces.Discrete(2)]), (np.array([3, 4]), np.array([1, 0])), (3, 1)),
        (spaces.Dict({"at": spaces.Discrete(5)}), {"at": np.array([3, 4])}, {"at": 3}),
    ],
)
def test_acting_takes_batches_apart_as_vector_environments_stack_them(space, batch, first):
    seen = []
    Acting(lambda observation: seen.append(observation) or 0, 2, space).predict(batch)
    assert seen[0] == first and len(seen) == 2


def test_acting_plays_blackjack_alone_and_in_batches():
    env = gym.make("Blackjack-v1")
    actor = Acting.of(lambda hand: int(hand[0] < 17), env)
    for episodes in (list(collect(env, actor, 20)), run_episodes(env, actor, 20, seed=0, most=20)):
        sums = np.concatenate([one.observations[0][:-1] for one in episodes])
        actions = np.concatenate([one.actions for one in episodes])
        np.testing.assert_array_equal(actions, sums < 17)


@pytest.mark.parametrize("action", [4, -1, 1.0, True, "up", None, (1, None), np.array([1])])
def test_acting_names_an_action_that_is_none(action):
    with pytest.raises(InvalidPolicy, match=r"action for observation 7 is .*: expected an integer from 0 to 3") as caught:
        Acting(lambda _: action, 4, spaces.Discrete(16)).predict(7)
    assert repr(action) in str(caught.value)


def test_acting_refuses_what_acts_already(zips, unchecked):
    with pytest.raises(InvalidParameter, match="It is a policy already"):
        Acting(zips["PPO"][1], 4, spaces.Discrete(16))


def test_acting_refuses_continuous_actions():
    with pytest.raises(NotDiscrete, match="the action space is Box"):
        Acting.of(lambda _: 0, gym.make("Pendulum-v1"))


@pytest.mark.parametrize("name", NAMES)
def test_a_soft_agent_draws_the_softmax_of_its_preferences(zips, name):
    soft = SoftAgent(zips[name][1], 0.5)
    expected = boltzmann(soft.preferences(np.array([6])), 0.5)[0]
    actions, _ = soft.predict(np.full(20_000, 6))
    shares = np.bincount(actions, minlength=4) / 20_000
    assert (np.abs(shares - expected) < 4 * np.sqrt(expected / 20_000)).all()


@pytest.mark.parametrize("name", ["PPO", "A2C"])
def test_a_soft_agent_at_one_is_the_agent(zips, name):
    agent = zips[name][1]
    policy = agent.model.policy
    with torch.no_grad():
        own = policy.get_distribution(policy.obs_to_tensor(np.arange(16))[0]).distribution.probs.numpy()
    np.testing.assert_allclose(boltzmann(SoftAgent(agent, 1.0).preferences(np.arange(16)), 1.0), own, rtol=1e-5)


@pytest.mark.parametrize("name", NAMES)
def test_a_soft_agent_at_zero_is_greedy(zips, name):
    agent = zips[name][1]
    expected, _ = agent.predict(np.arange(16), deterministic=True)
    np.testing.assert_array_equal(SoftAgent(agent, 0.0).predict(np.arange(16))[0], expected)


def test_a_soft_agent_at_infinity_is_uniform(zips):
    actions, _ = SoftAgent(zips["DQN"][1], np.inf).predict(np.zeros(20_000, dtype=np.int64))
    assert (np.abs(np.bincount(actions, minlength=4) / 20_000 - 0.25) < 4 * np.sqrt(0.25 / 20_000)).all()


def test_a_soft_agent_draws_the_same_alone_as_in_a_batch_and_when_deterministic(zips):
    batch, _ = SoftAgent(zips["PPO"][1], 1.0, seed=4).predict(np.arange(16))
    alone = SoftAgent(zips["PPO"][1], 1.0, seed=4)
    assert [int(alone.predict(s, deterministic=True)[0]) for s in range(16)] == batch.tolist()


def test_a_soft_agent_refuses_a_table(unchecked):
    with pytest.raises(InvalidParameter, match="agent is an ndarray: expected `Agent"):
        SoftAgent(np.eye(3), 1.0)


def test_a_soft_agent_refuses_continuous_actions():
    with pytest.raises(NotDiscrete, match="the agent's action space is Box"):
        SoftAgent(Agent(PPO("MlpPolicy", "Pendulum-v1", device="cpu")), 1.0)


@pytest.mark.parametrize("name", NAMES)
def test_a_zip_tells_its_algorithm_and_acts_as_it_was_saved(zips, name):
    path, agent = zips[name]
    loaded = load_expert(path)
    assert type(loaded.model).__name__ == name
    np.testing.assert_array_equal(
        loaded.predict(np.arange(16), deterministic=True)[0], agent.predict(np.arange(16), deterministic=True)[0]
    )


def test_a_zip_can_be_named_and_a_wrong_name_is_refused(zips):
    path, _ = zips["PPO"]
    assert type(load_expert(path, "PPO").model) is PPO
    with pytest.raises(InvalidParameter, match="holds no DQN agent"):
        load_expert(path, "DQN")


def test_an_agent_of_another_library_is_refused_unloaded(zips, tmp_path):
    with zipfile.ZipFile(zips["DQN"][0]) as original, zipfile.ZipFile(tmp_path / "qr.zip", "w") as changed:
        settings = json.loads(original.read("data"))
        settings["policy_class"]["__module__"] = "sb3_contrib.qrdqn.policies"
        changed.writestr("data", json.dumps(settings))
    with pytest.raises(InvalidParameter, match="holds no agent of PPO, DQN, A2C: expected one of these"):
        load_expert(tmp_path / "qr.zip")


def test_agents_of_continuous_actions_are_refused(tmp_path):
    PPO("MlpPolicy", "Pendulum-v1", device="cpu").save(tmp_path / "ppo")
    SAC("MlpPolicy", "Pendulum-v1", device="cpu", buffer_size=10, policy_kwargs={"net_arch": [4]}).save(tmp_path / "sac")
    with pytest.raises(NotDiscrete, match="the agent's action space is Box"):
        load_expert(tmp_path / "ppo.zip")
    with pytest.raises(InvalidParameter, match="holds no agent of PPO, DQN, A2C"):
        load_expert(tmp_path / "sac.zip")


UNKNOWN_ROW = np.array([[0.25, 0.75], [np.nan, np.nan]])


@pytest.mark.parametrize("table", [np.array([1, 0, 3]), UNKNOWN_ROW, np.array([[True, False]])])
@pytest.mark.parametrize("key", ["actions", "probabilities"])
def test_a_table_is_read_as_a_run_left_it(tmp_path, table, key):
    np.savez(tmp_path / "expert.npz", **{key: table})
    np.testing.assert_array_equal(load_expert(tmp_path / "expert.npz"), table)


@pytest.mark.parametrize(
    ("table", "says"),
    [
        (np.array([1.0, 2.0]), "shape"),
        (np.array([1, -1]), r"policy\[s=1\] is action -1"),
        (np.array([[0.5, 0.4]]), "sums to 0.9"),
        (np.array([[0.5, np.nan]]), r"policy\[s=0, a=1\] is nan"),
        (np.zeros((2, 2, 2)), "shape"),
        (np.array(3), "shape"),
    ],
)
def test_a_table_that_is_no_policy_is_refused(tmp_path, table, says):
    np.savez(tmp_path / "expert.npz", actions=table)
    with pytest.raises(InvalidPolicy, match=says):
        load_expert(tmp_path / "expert.npz")


def _pickled(path):
    np.savez(path, actions=np.array([{"run": "code"}], dtype=object))


def _other_keys(path):
    np.savez(path, reward=np.zeros(3))


def _other_zip(path):
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("notes.txt", "nothing")


def _broken_settings(path):
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("data", "not json")


@pytest.mark.parametrize(
    ("write", "says"),
    [
        (_pickled, "cannot be read as a table"),
        (_other_keys, r"holds \['reward'\]: expected `actions`"),
        (_other_zip, r"holds \['notes.txt'\]"),
        (_broken_settings, "holds no expert"),
        (lambda path: path.write_text("no zip"), "holds no expert"),
        (lambda path: path.mkdir(), "holds no expert"),
    ],
)
def test_a_file_that_holds_no_expert_is_refused(tmp_path, write, says):
    write(tmp_path / "expert.npz")
    with pytest.raises(InvalidParameter, match=says):
        load_expert(tmp_path / "expert.npz")


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"nobody\.zip does not exist"):
        load_expert(tmp_path / "nobody.zip")
