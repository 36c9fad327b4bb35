"""An expert that was trained under VecNormalize sees what it saw; one without its statistics is noticed."""

import base64
import collections
import json
import os
import pickle
import zipfile

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from stable_baselines3 import PPO
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from irl_gym.agents.expert_files import FromFile
from irl_gym.agents.experts import SoftAgent, load_expert, training_of
from irl_gym.agents.planners import load_agent
from irl_gym.agents.shown_observations import read_statistics
from irl_gym.commands.arguments import Arguments, Demonstrations
from irl_gym.commands.demonstrating.demonstrators import Recording
from irl_gym.errors import InvalidParameter
from irl_gym.judging.diagnoses.case import Case
from irl_gym.judging.diagnoses.truth import blind_expert

SHORT = {"n_steps": 64, "batch_size": 64, "n_epochs": 1, "device": "cpu", "seed": 0}


class Parts(gym.Env):
    """Observes a dictionary of two arrays, far from 0."""

    observation_space = spaces.Dict(a=spaces.Box(0, 99, (2,)), b=spaces.Box(0, 99, (1,)))
    action_space = spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.observation_space.seed(seed)
        return self.observation_space.sample(), {}

    def step(self, action):
        return self.observation_space.sample(), 1.0, bool(self.np_random.random() < 0.2), False, {}


def trained(folder, make, policy="MlpPolicy", **how):
    """A short training under VecNormalize: agent.zip, vecnormalize.pkl, and both in memory."""
    venv = VecNormalize(DummyVecEnv([lambda: Monitor(make())]), **how)
    venv.seed(0)
    model = PPO(policy, venv, **SHORT).learn(128)
    model.save(folder / "agent.zip")
    venv.save(folder / "vecnormalize.pkl")
    return model, venv


@pytest.fixture(scope="module")
def cart(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cart")
    return folder, *trained(folder, lambda: gym.make("CartPole-v1"))


OBSERVATIONS = np.random.default_rng(0).normal(0, 2, (50, 4)).astype(np.float32)


def same(agent, model, venv, observations):
    wanted = model.predict(venv.normalize_obs(observations), deterministic=True)[0]
    np.testing.assert_array_equal(agent.predict(observations, deterministic=True)[0], wanted)


def test_an_agent_is_shown_what_its_training_showed(cart):
    folder, model, venv = cart
    agent = load_expert(folder / "agent.zip", normalize=folder / "vecnormalize.pkl")
    same(agent, model, venv, OBSERVATIONS)
    np.testing.assert_array_equal(agent.shown(OBSERVATIONS[0]), venv.normalize_obs(OBSERVATIONS[0]))


def test_dictionaries_are_normalised_by_their_parts(tmp_path):
    model, venv = trained(tmp_path, Parts, "MultiInputPolicy", norm_obs_keys=["a"], clip_obs=1.0)
    agent = load_expert(tmp_path / "agent.zip", normalize=tmp_path / "vecnormalize.pkl")
    batch = {"a": np.random.default_rng(0).uniform(0, 99, (20, 2)), "b": np.random.default_rng(1).uniform(0, 99, (20, 1))}
    same(agent, model, venv, batch)


def test_a_soft_agent_prefers_by_what_it_was_shown(cart):
    folder, model, venv = cart
    soft = SoftAgent(load_expert(folder / "agent.zip", normalize=folder / "vecnormalize.pkl"), 0.0)
    wanted = model.predict(venv.normalize_obs(OBSERVATIONS), deterministic=True)[0]
    np.testing.assert_array_equal(soft.preferences(OBSERVATIONS).argmax(axis=1), wanted)


def test_statistics_written_by_hand_are_the_same(cart, tmp_path):
    folder, model, venv = cart
    venv_ = venv  # as the message calls it
    np.savez(tmp_path / "s.npz", mean=venv_.obs_rms.mean, var=venv_.obs_rms.var, clip=venv_.clip_obs, epsilon=venv_.epsilon)
    same(load_expert(folder / "agent.zip", normalize=tmp_path / "s.npz"), model, venv, OBSERVATIONS)


def test_an_agent_that_is_kept_takes_its_statistics_along(cart, tmp_path):
    folder, model, venv = cart
    load_expert(folder / "agent.zip", normalize=folder / "vecnormalize.pkl").save(tmp_path / "kept.zip")
    same(load_agent(tmp_path / "kept.zip", "PPO"), model, venv, OBSERVATIONS)


# --- refusals ---


class Command:
    def __reduce__(self):
        return os.system, ("touch called",)


@pytest.mark.parametrize("content", [Command(), {"obs_rms": Command()}, [1, 2], "text"])
def test_a_file_that_is_no_vecnormalize_is_refused_and_not_run(content, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "v.pkl").write_bytes(pickle.dumps(content))
    with pytest.raises(
        InvalidParameter, match=r"holds no statistics .* Nothing in it was run\. Write .* np\.savez\('statistics"
    ):
        read_statistics(tmp_path / "v.pkl")
    assert not (tmp_path / "called").exists()


def test_statistics_of_rewards_alone_are_refused(tmp_path):
    trained(tmp_path, lambda: gym.make("CartPole-v1"), norm_obs=False)
    with pytest.raises(InvalidParameter, match="it did not normalise observations"):
        read_statistics(tmp_path / "vecnormalize.pkl")


def test_statistics_of_another_agent_are_refused(cart, tmp_path):
    np.savez(tmp_path / "s.npz", mean=np.zeros(3), var=np.ones(3), clip=10.0, epsilon=1e-8)
    with pytest.raises(InvalidParameter, match=r"statistics are of observations \(3,\): expected those of Box"):
        load_expert(cart[0] / "agent.zip", normalize=tmp_path / "s.npz")


@pytest.mark.parametrize("change", [{"mean": np.full(4, np.nan)}, {"var": -np.ones(4)}, {"clip": 0.0}, {"var": np.ones(3)}])
def test_statistics_that_cannot_be_are_refused(tmp_path, change):
    np.savez(tmp_path / "s.npz", **({"mean": np.zeros(4), "var": np.ones(4), "clip": 10.0, "epsilon": 1e-8} | change))
    with pytest.raises(InvalidParameter, match="expected finite means and variances"):
        read_statistics(tmp_path / "s.npz")


def test_a_file_that_is_not_there_is_refused(cart):
    with pytest.raises(InvalidParameter, match=r"gone\.pkl', which is no file: expected what VecNormalize's"):
        FromFile.at(str(cart[0] / "agent.zip"), "gone.pkl")


def test_statistics_beside_a_table_of_actions_are_refused(cart, tmp_path):
    np.savez(tmp_path / "table.npz", actions=np.zeros(4, int))
    with pytest.raises(InvalidParameter, match="holds a table of actions: expected an agent's zip beside statistics"):
        load_expert(tmp_path / "table.npz", normalize=cart[0] / "vecnormalize.pkl")


def test_statistics_of_an_expert_without_a_file_are_refused():
    with pytest.raises(InvalidParameter, match=r"expert_normalize is 'v\.pkl', but expert is ppo"):
        Arguments(demonstrations=Demonstrations(expert="ppo", expert_normalize="v.pkl")).experiment()


# --- an agent without its statistics ---


@pytest.mark.parametrize("how", [None, {}, {"norm_obs": False}])
def test_a_zip_of_ppo_says_whether_it_was_under_vecnormalize(tmp_path, how):
    if how is None:
        PPO("MlpPolicy", "CartPole-v1", **SHORT).learn(128).save(tmp_path / "agent.zip")
    else:
        trained(tmp_path, lambda: gym.make("CartPole-v1"), **how)
    assert training_of(tmp_path / "agent.zip").normalised == (how is not None)


def test_a_zip_says_what_its_agent_returned_in_training(cart):
    folder, model, _ = cart
    assert training_of(folder / "agent.zip").returns == tuple(one["r"] for one in model.ep_info_buffer)


@pytest.mark.parametrize("returns", [(1.0, np.nan), (np.inf,), (1e308, 1e308)])
def test_returns_without_a_mean_are_none(tmp_path, returns):
    noted = base64.b64encode(pickle.dumps(collections.deque({"r": one} for one in returns))).decode()
    told = {"observation_space": {":type:": "box.Box'>"}, "ep_info_buffer": {":serialized:": noted}}
    with zipfile.ZipFile(tmp_path / "agent.zip", "w") as archive:
        archive.writestr("data", json.dumps(told))
    assert FromFile(str(tmp_path / "agent.zip")).trained() == {}


def test_an_expert_says_what_a_doctor_needs(cart):
    folder, model, _ = cart
    told = FromFile.at(str(folder / "agent.zip")).trained()
    assert told == {"trained_return": pytest.approx(np.mean([one["r"] for one in model.ep_info_buffer])), "vecnormalize": True}
    assert "vecnormalize" not in FromFile.at(str(folder / "agent.zip"), str(folder / "vecnormalize.pkl")).trained()


def judged(here, **told):
    rows = {name: {"mean_return": mean, "return_high": mean + 10} for name, mean in (("expert", here), ("random", 20.0))}
    return blind_expert(Case(judged={"policies": rows, "demonstrations": told}))


@pytest.mark.parametrize(
    ("here", "told", "said"),
    [
        (110.0, {"trained_return": 245.0}, "The expert returns 110 here, but returned 245"),
        (240.0, {"trained_return": 245.0}, None),
        (500.0, {"trained_return": 245.0}, None),
        (110.0, {"trained_return": 245.0, "episodes_only": True}, None),
        (110.0, {"trained_return": -3.0}, None),
        (110.0, {}, None),
    ],
)
def test_the_doctor_notices_an_expert_that_returns_far_less_than_in_training(here, told, said):
    found = judged(here, **told)
    assert (found is None) if said is None else found.sentence.startswith(said) and found.flags == ("--expert-normalize",)


# --- where it is asked for ---


def test_the_command_line_asks_for_statistics(cart):
    folder = cart[0]
    shown = Demonstrations(expert=str(folder / "agent.zip"), expert_normalize=str(folder / "vecnormalize.pkl"))
    assert Arguments(demonstrations=shown).experiment().expert.normalize == str(folder / "vecnormalize.pkl")


def test_a_run_knows_its_statistics_again(cart, tmp_path):
    folder = cart[0]
    (tmp_path / "v.pkl").write_bytes((folder / "vecnormalize.pkl").read_bytes())
    one = FromFile.at(str(folder / "agent.zip"), str(tmp_path / "v.pkl"))
    (tmp_path / "v.pkl").write_bytes(b"others")
    with pytest.raises(InvalidParameter, match="not the file that it was"):
        FromFile(one.path, one.sha256, one.normalize)


def test_an_export_shows_its_expert_what_its_training_showed(cart, tmp_path):
    folder, model, venv = cart
    recording = Recording(str(folder / "agent.zip"), 0.99, expert_normalize=str(folder / "vecnormalize.pkl"))
    episode = next(recording.demonstrator(gym.make("CartPole-v1"), tmp_path).episodes(0))
    wanted = model.predict(venv.normalize_obs(episode.observations[:-1]), deterministic=True)[0]
    np.testing.assert_array_equal(episode.actions, wanted)


@pytest.mark.parametrize("change", [{"clip": np.zeros(3)}, {"mean": np.array("x")}])
def test_statistics_that_are_no_numbers_are_refused(tmp_path, change):
    arrays = {"mean": np.zeros(1), "var": np.ones(1), "clip": np.array(10.0), "epsilon": np.array(1e-8)}
    np.savez(tmp_path / "statistics.npz", **arrays | change)
    with pytest.raises(InvalidParameter, match="holds no such numbers"):
        read_statistics(tmp_path / "statistics.npz")
