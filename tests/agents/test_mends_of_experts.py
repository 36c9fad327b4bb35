"""The mends that errors about experts, their files and their noise name are executed, and serve."""

import re
import zipfile
from types import SimpleNamespace

import gymnasium
import numpy as np
import pytest
from enumeration_envs import Corridor
from gymnasium import spaces
from mended import told, unsaid
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from irl_gym.agents.experts import Acting, SoftAgent, load_expert
from irl_gym.agents.noise import Noisy, boltzmann, noisy
from irl_gym.agents.planners import Agent
from irl_gym.agents.shown_observations import BY_HAND, Normaliser, read_statistics
from irl_gym.demonstrations.datasets import read_minari, write_minari
from irl_gym.loop.worlds import SteppedWorld
from irl_gym.mdp.episodes import collect
from irl_gym.mdp.policies import Policy
from irl_gym.spaces.states import StateIndex

pytestmark = pytest.mark.usefixtures("unchecked")
LAKE, CART = gymnasium.make("FrozenLake-v1"), gymnasium.make("CartPole-v1")
SMALL = {"policy_kwargs": {"net_arch": []}, "seed": 0, "device": "cpu"}
MODEL = PPO("MlpPolicy", LAKE, n_steps=64, batch_size=64, n_epochs=1, **SMALL)


class FromOne(Corridor):
    """Counts its actions from 1."""

    action_space = spaces.Discrete(2, start=1)


STEPPED = SteppedWorld(LAKE, 0.99, 2, 20, 0)


def right(observation):
    return 1


def acted(action, env=None):
    policy = Acting.of(lambda _: action, FromOne() if env is None else env)
    return policy.predict(policy.space.sample())


def saved(root):
    MODEL.save(root / "agent.zip")
    return root / "agent.zip"


def of_another_library(root):
    """A zip whose settings say that other code made it."""
    with zipfile.ZipFile(saved(root)) as whole, zipfile.ZipFile(root / "other.zip", "w") as changed:
        for one in whole.namelist():
            changed.writestr(
                one, whole.read(one).replace(b"stable_baselines3.common.policies", b"sb3_contrib.ppo_mask.policies")
            )
    return root / "other.zip"


def recorded(root):
    """Episodes of whatever has `predict`."""
    other = SimpleNamespace(predict=lambda observation, *_, **__: (np.int64(1), None))
    assert isinstance(other, Policy)
    write_minari(collect(LAKE, other, 3), "me/lake-v0", LAKE, root=root, algorithm="other")
    return len(list(read_minari("me/lake-v0", root=root))) == 3


def beside_a_table(root, **given):
    np.savez(root / "expert.npz", actions=np.zeros(16, int))
    return load_expert(root / "expert.npz", **given).shape == (16,)


def parameters(root):
    """What torch writes in place of what SB3 does."""
    with zipfile.ZipFile(root / "agent.zip", "w") as archive:
        archive.writestr("policy.pth", b"")
    return load_expert(root / "agent.zip")


def shown(root):
    """An agent whose file beside it is damaged."""
    path = root / "agent.zip"
    Agent(MODEL, StateIndex(spaces.Discrete(16, start=5))).save(path)
    return path


def damaged(root):
    path = shown(root)
    (root / "agent.shown.npz").write_text("nothing")
    return load_expert(path)


def statistics(root, norm_obs=True):
    """Of a VecNormalize, as it saves them."""
    venv = VecNormalize(DummyVecEnv([lambda: CART]), norm_obs=norm_obs)
    venv.reset()
    venv.save(root / "vecnormalize.pkl")
    return venv


def by_hand(root, told=None):
    """What is written as an error says."""
    venv = statistics(root)
    code = BY_HAND if told is None else re.search(r"np\.savez\(.*\)", told)[0]
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(root)
        eval(code, {"np": np, "venv": venv})
    return read_statistics(root / "statistics.npz").mean[""].shape == (4,)


def rewards_alone(root):
    statistics(root, norm_obs=False)
    return read_statistics(root / "vecnormalize.pkl")


def impossible(_):
    return Normaliser({"": np.zeros(4)}, {"": -np.ones(4)}, 10.0, 1e-8)


def without_a_clip(root):
    np.savez(root / "statistics.npz", mean=np.zeros(4), var=np.ones(4))
    return read_statistics(root / "statistics.npz")


CASES = [
    # experts
    ("It is a policy already.",
     lambda _: Acting(Agent(MODEL), 4, LAKE.observation_space), lambda _: Agent(MODEL).predict(np.int64(3))),
    ("Give a function.", lambda _: Acting(1, 4, LAKE.observation_space), lambda _: Acting(right, 4, LAKE.observation_space)),
    ("Use `Acting.of`.", lambda _: Acting(right, 4, 16), lambda _: Acting.of(right, LAKE)),
    ("Actions count from 0, whatever number the action space starts at.", lambda _: acted(2), lambda _: acted(1)),
    ("For tables there is `boltzmann`.",
     lambda _: SoftAgent(np.eye(3), 1.0), lambda _: boltzmann(np.eye(3), 1.0).shape == (3, 3)),
    ("Leave them out.", lambda root: beside_a_table(root, normalize="vecnormalize.pkl"), beside_a_table),
    ("Save it with `model.save`.", parameters, lambda root: MODEL.save(root / "saved.zip") or load_expert(root / "saved.zip")),
    ("An agent of another library is a policy as it is, since it has `predict`: give its episodes (`collect`, `write_minari`).",
     lambda root: load_expert(of_another_library(root)), recorded),
    ("If it is one of these after all, name its algorithm.",
     lambda root: load_expert(of_another_library(root)), lambda root: load_expert(of_another_library(root), "PPO")),
    ("Name that.", lambda root: load_expert(saved(root), "DQN"), lambda root: load_expert(saved(root), "PPO")),
    # noise
    ("Give one entry for each state.", lambda _: noisy(np.int64(1), 0.1, 2), lambda _: noisy(np.ones(3, int), 0.1, 2)),
    ("Give n_actions.", lambda _: noisy(np.ones(3, int), 0.1), lambda _: noisy(np.ones(3, int), 0.1, 2)),
    ("Use `noisy` for tables,", lambda _: Noisy(np.eye(3), 0.1, 3), lambda _: noisy(np.eye(3), 0.1)),
    ("and wrap a function in `Acting`.", lambda _: Noisy(right, 0.1, 4), lambda _: Noisy(Acting.of(right, LAKE), 0.1, 4)),
    # policies of learners
    ("Wrap a function of observations in `irl_gym.agents.experts.Acting`.",
     lambda _: STEPPED.can_keep(right), lambda _: STEPPED.can_keep(Acting.of(right, LAKE)) is False),
    # shown
    ("Write it again.", damaged, lambda root: load_expert(shown(root))),
    ("Write them with np.savez('statistics.npz', ",
     impossible,
     lambda root: by_hand(root, told(impossible, root))),
    ("expected numbers written with np.savez(", without_a_clip, lambda root: by_hand(root, told(without_a_clip, root))),
    ("Nothing in it was run. Write them as numbers: np.savez(",
     rewards_alone, lambda root: by_hand(root, told(rewards_alone, root))),
]  # fmt: skip
FILES = [f"{one}.py" for one in ("experts", "noise", "shown_observations", "demonstrators", "planners", "pickles")]


@pytest.mark.parametrize(("says", "breaks", "mended"), CASES, ids=[one[0] for one in CASES])
def test_a_mend_that_an_error_about_experts_names_serves(tmp_path, says, breaks, mended):
    assert says in told(breaks, tmp_path)
    served = mended(tmp_path)
    assert served is not None and served is not False


def test_every_mend_that_an_error_about_experts_names_is_executed():
    assert not unsaid(CASES, *FILES)
