"""Training that is broken off goes on from its checkpoint: in the same bits on a table, and elsewhere says that it is not."""

import json
from functools import reduce

import gymnasium as gym
import numpy as np
import pytest
import torch
from stable_baselines3.common.env_util import make_vec_env

import irl_gym.agents.checkpoints as checkpoints
from irl_gym.agents.checkpoints import Checkpoint
from irl_gym.agents.planners import SB3
from irl_gym.environments.rewarded_vec_env import normalised
from irl_gym.environments.tabular_vec_env import TabularVecEnv
from irl_gym.errors import RunConflict
from irl_gym.tables.tabulate import tabulate

TOTAL = 1_500
SOONER = {
    "PPO": {"n_steps": 16, "batch_size": 64, "n_epochs": 2}, "A2C": {},
    "DQN": {"learning_starts": 100, "buffer_size": 500, "gradient_steps": 1, "batch_size": 32},
}  # fmt: skip


class BrokenOff(Exception):
    """What ends a training here."""


def trained(env, algorithm, checkpoint, *, until=None, seed=3):
    """An agent, and the steps at which it was reported; broken off at the first report at or after `until`."""
    reported = []

    def report(steps, _):
        reported.append(steps)
        if until is not None and steps >= until:
            raise BrokenOff

    planner = SB3(algorithm, total_timesteps=TOTAL, hyperparameters=SOONER[algorithm])
    return planner.plan(env, gamma=0.9, seed=seed, progress=report, interval=50, checkpoint=checkpoint), reported


def lake(lake_table, scaled=False):
    env = TabularVecEnv(lake_table.mdp, lake_table.reward, num_envs=4, max_episode_steps=30, seed=3)
    return normalised(env, 0.9) if scaled else env


@pytest.fixture(scope="module")
def lake_table():
    return tabulate(gym.make("FrozenLake-v1"), gamma=0.9, check_steps=0)


def broken_off(make, algorithm, path, until):
    with pytest.raises(BrokenOff):
        trained(make(), algorithm, Checkpoint(path, "it"), until=until)
    return Checkpoint(path, "it")


def same(one, other):
    ours, theirs = (agent.model.get_parameters()["policy"] for agent in (one, other))
    return all(torch.equal(ours[name], theirs[name]) for name in ours)


@pytest.mark.parametrize(("algorithm", "scaled"), [("PPO", False), ("PPO", True), ("A2C", False), ("DQN", False)])
def test_training_on_a_table_that_goes_on_ends_in_the_same_bits(tmp_path, lake_table, algorithm, scaled):
    in_one_go, all_reported = trained(lake(lake_table, scaled), algorithm, None)
    kept = broken_off(lambda: lake(lake_table, scaled), algorithm, tmp_path / "kept.npz", 900)
    gone_on, reported = trained(lake(lake_table, scaled), algorithm, kept)
    assert same(in_one_go, gone_on) and kept.resumed == [] and reported == all_reported[-len(reported) :]
    assert 900 - 0.1 * TOTAL <= kept.went_on <= 900


def test_training_that_goes_on_draws_what_follows_and_not_what_was_drawn(tmp_path, lake_table):
    """The states of the generators matter: with others the very same checkpoint ends elsewhere."""
    in_one_go, _ = trained(lake(lake_table), "PPO", None)
    kept = broken_off(lambda: lake(lake_table), "PPO", tmp_path / "kept.npz", 900)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(torch, "set_rng_state", lambda state: None)
        gone_on, _ = trained(lake(lake_table), "PPO", kept)
    assert not same(in_one_go, gone_on)


def test_training_that_was_broken_off_after_its_last_step_takes_no_step_again(tmp_path, lake_table):
    path = tmp_path / "kept.npz"
    agent, _ = trained(lake(lake_table), "PPO", Checkpoint(path, "it"))
    again, reported = trained(lake(lake_table), "PPO", Checkpoint(path, "it"))
    assert same(agent, again) and reported == [agent.model.num_timesteps]


def test_training_in_an_environment_that_is_stepped_says_where_it_was_resumed(tmp_path):
    def cart():
        return normalised(make_vec_env("CartPole-v1", 4, seed=3), 0.9)

    kept = broken_off(cart, "PPO", tmp_path / "kept.npz", 500)
    agent, _ = trained(cart(), "PPO", kept)
    assert kept.resumed == [kept.went_on] and 350 <= kept.went_on <= 564 and agent.model.num_timesteps >= TOTAL
    kept = broken_off(cart, "PPO", tmp_path / "twice.npz", 500)
    with pytest.raises(BrokenOff):
        trained(cart(), "PPO", kept, until=1_000)
    again = Checkpoint(tmp_path / "twice.npz", "it")
    trained(cart(), "PPO", again)
    assert again.resumed == [kept.went_on, again.went_on]


def test_a_replay_buffer_that_is_too_large_is_kept_in_part_and_that_is_said(tmp_path, lake_table, monkeypatch):
    monkeypatch.setattr(checkpoints, "MOST_REPLAYED", 4_000)
    kept = broken_off(lambda: lake(lake_table), "DQN", tmp_path / "kept.npz", 900)
    agent, _ = trained(lake(lake_table), "DQN", kept)
    with np.load(tmp_path / "kept.npz") as found:
        assert sum(found[name].nbytes for name in found if name.startswith("replay/")) <= 4_000
    assert kept.resumed == [kept.went_on] and agent.model.num_timesteps >= TOTAL


@pytest.mark.parametrize("of", ["another", "it"])
def test_a_checkpoint_of_something_else_or_of_another_version_is_not_gone_on_with(tmp_path, lake_table, of, monkeypatch):
    broken_off(lambda: lake(lake_table), "PPO", tmp_path / "kept.npz", 900)
    if of == "it":
        monkeypatch.setattr(checkpoints.importlib.metadata, "version", lambda name: "0.0")
    kept = Checkpoint(tmp_path / "kept.npz", of)
    _, reported = trained(lake(lake_table), "PPO", kept)
    assert kept.went_on is None and reported[0] == 4


def test_a_checkpoint_holds_numbers_and_text_alone(tmp_path, lake_table):
    broken_off(lambda: lake(lake_table), "DQN", tmp_path / "kept.npz", 900)
    with np.load(tmp_path / "kept.npz", allow_pickle=False) as found:
        assert {found[name].dtype.kind for name in found} <= set("biufU")


def edited(path, change):
    """Change what a checkpoint tells beside its arrays."""
    with np.load(path) as found:
        arrays = dict(found)
    told = json.loads(str(arrays["told"]))
    change(told)
    np.savez(path, **arrays | {"told": np.array(json.dumps(told))})


def test_a_checkpoint_sets_its_counters_and_nothing_else_that_it_names(tmp_path, lake_table):
    path = tmp_path / "kept.npz"
    broken_off(lambda: lake(lake_table), "PPO", path, 900)
    edited(path, lambda told: told["counters"].update(gamma=0.1, policy="mine"))
    gone_on, _ = trained(lake(lake_table), "PPO", Checkpoint(path, "it"))
    assert same(gone_on, trained(lake(lake_table), "PPO", None)[0]) and gone_on.model.gamma != 0.1


@pytest.fixture(scope="module")
def left(lake_table, tmp_path_factory):
    """The checkpoint of a training that was broken off, by its algorithm."""
    found = {}
    for algorithm in ("PPO", "DQN"):
        path = tmp_path_factory.mktemp("left") / "kept.npz"
        broken_off(lambda named=algorithm: lake(lake_table, named == "PPO"), algorithm, path, 900)
        found[algorithm] = path.read_bytes()
    return found


FORGED = {
    "counters.num_timesteps": ["many", -4, True, 10**400, 0.5], "counters.exploration_rate": [float("nan"), 10**400],
    "counters._n_updates": [-1, None], "numpy.2": [10**6, -1, 625], "numpy.1": [[0] * 9], "numpy.4": [float("nan")],
    "torch": [[10**400], [0] * 9], "actions": [{}, "PCG64"], "report_at": ["soon", -1], "resumed": [["then"], 7],
    "replay": [[501, False], [-1, True], [10**400, False], [7, False]], "whole": ["yes"],
}  # fmt: skip
"""Entries that a checkpoint tells beside its arrays."""
CHANGED = {
    "model/weights/policy/action_net.weight": ["nan", "long", "huge"], "model/weights/policy/q_net.q_net.0.weight": ["nan"],
    "model/weights/policy.optimizer/0/exp_avg": ["nan", "long", "gone"],
    "model/weights/policy.optimizer/0/exp_avg_sq": ["negative"], "model/weights/policy.optimizer/0/step": ["long", "text"],
    "model/world/rows": ["long", "huge", "negative", "end"], "model/world/elapsed": ["huge", "negative"],
    "model/world/returns": ["nan"], "model/world/generator": ["long"], "model/scale/var": ["negative", "nan"],
    "model/scale/returns": ["long"], "model/episodes": ["nan", "flat"], "replay/actions": ["huge", "negative", "long"],
    "replay/observations": ["huge", "negative"], "replay/next_observations": ["negative", "gone"], "replay/rewards": ["nan"],
}  # fmt: skip
"""Arrays of a checkpoint."""
HOW = {
    "nan": lambda one: np.full_like(one, np.nan), "long": lambda one: np.concatenate([np.atleast_1d(one)] * 2),
    "huge": lambda one: np.full_like(one, 10**16 if one.dtype.kind in "iu" else 1e30), "negative": lambda one: -1 - abs(one),
    "text": lambda one: np.array("many"), "flat": np.ravel, "end": lambda one: np.full_like(one, 15),
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "value"), [(name, one) for parts in (FORGED, CHANGED) for name, each in parts.items() for one in each],
    ids=lambda one: str(one)[:40],
)  # fmt: skip
def test_what_no_training_leaves_is_named_before_a_step_is_made(tmp_path, lake_table, left, name, value):
    """SB3, torch and NumPy take it as it is; NumPy's old generator reads beyond its memory where it is said to stand there."""
    algorithm = "DQN" if any(word in name for word in ("replay", "whole", "q_net", "exploration")) else "PPO"
    path = tmp_path / "kept.npz"
    path.write_bytes(left[algorithm])
    with np.load(path) as found:
        arrays = dict(found)
    if name in CHANGED:
        one = arrays.pop(name)
        arrays |= {} if value == "gone" else {name: HOW[value](one)}
    else:
        told = json.loads(str(arrays["told"]))
        *where, last = (int(part) if part.isdecimal() else part for part in name.split("."))
        reduce(lambda one, key: one[key], where, told)[last] = value
        arrays["told"] = np.array(json.dumps(told))
    np.savez(path, **arrays)
    with pytest.raises(RunConflict, match=r"kept.npz cannot be read .* Delete it, and its stage is run again"):
        trained(lake(lake_table, algorithm == "PPO"), algorithm, Checkpoint(path, "it"), until=0)


@pytest.mark.parametrize("damage", ["cut", "weights"])
def test_a_damaged_checkpoint_is_named(tmp_path, lake_table, damage):
    path = tmp_path / "kept.npz"
    broken_off(lambda: lake(lake_table), "PPO", path, 900)
    if damage == "cut":
        path.write_bytes(path.read_bytes()[:-100])
    else:
        with np.load(path) as found:
            np.savez(path, **{name: found[name] for name in found if not name.endswith("action_net.weight")})
    with pytest.raises(RunConflict, match=r"kept.npz cannot be read .* Delete it, and its stage is run again"):
        trained(lake(lake_table), "PPO", Checkpoint(path, "it"))
    path.unlink()
    assert trained(lake(lake_table), "PPO", Checkpoint(path, "it"))[0].model.num_timesteps >= TOTAL
