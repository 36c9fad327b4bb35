"""Behaviour cloning by a network: of every kind of space, stopped in time, and gone on from by PPO."""

import json
from itertools import count

import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium import spaces
from stable_baselines3 import PPO

from irl_gym.agents.neural_clone import NeuralClone
from irl_gym.agents.planners import SB3, tabular_actions
from irl_gym.environments.tabular_vec_env import TabularVecEnv
from irl_gym.errors import InvalidDemonstrations, InvalidParameter, SolverTimeout
from irl_gym.judging.metrics import policy_value
from irl_gym.learners.problem import Problem, Spaces
from irl_gym.mdp.episodes import Episode, collect_from_table
from irl_gym.mdp.planning.dynamic_programming import policy_iteration
from irl_gym.programs import deadline
from irl_gym.spaces.states import StateIndex

POINTS = np.random.default_rng(0).uniform(-1, 1, (1_500, 2)).astype(np.float32)
PLANE, SIDES = spaces.Box(-1, 1, (2,)), (POINTS[:, 0] > POINTS[:, 1]).astype(int)
LENGTHS = [15] * 100
FEW = NeuralClone(net_arch=(32,), epochs=30, learning_rate=0.01)
QUICK = NeuralClone(net_arch=(4,), epochs=2)


def wrong(found, seen, taken):
    return np.mean(np.abs(found.policy.predict(seen, deterministic=True)[0] - taken))


def test_a_rule_of_observations_is_learned_and_told_of_steps_that_were_held_out():
    found = FEW.fit(POINTS, SIDES, PLANE, spaces.Discrete(2), lengths=LENGTHS)
    assert wrong(found, POINTS, SIDES) < 0.05 and found.proof.held_out_error < 0.05
    assert found.proof.steps == 1_350 and found.proof.held_out == 150
    assert "150 steps: its action is another in" in found.facts()[-1].sentence


def test_continuous_actions_are_learned():
    pulls = np.clip(0.5 * POINTS[:, :1] - 0.3 * POINTS[:, 1:], -1, 1)
    found = FEW.fit(POINTS, pulls, PLANE, spaces.Box(-1, 1, (1,)), lengths=LENGTHS)
    assert wrong(found, POINTS, pulls) < 0.1 and "away on average" in found.facts()[-1].sentence


def test_several_numbers_as_an_action_and_parts_as_an_observation_are_learned():
    seen = {"plane": POINTS, "side": SIDES[:, None].astype(np.float32)}
    space = spaces.Dict({"plane": PLANE, "side": spaces.Box(0, 1, (1,))})
    taken = np.stack([SIDES, 2 * (POINTS[:, 0] > 0)], axis=1)
    found = FEW.fit(seen, taken, space, spaces.MultiDiscrete([2, 3]), lengths=LENGTHS)
    assert wrong(found, seen, taken) < 0.1


@pytest.mark.parametrize(
    ("shape", "reader"), [((36, 40, 3), "NatureCNN"), ((3, 36, 40), "NatureCNN"), ((20, 20, 3), "FlattenExtractor")]
)
def test_images_are_learned_by_convolutions_where_these_can_read_them(shape, reader):
    light = np.repeat([0, 255], 20).astype(np.uint8)
    seen = np.broadcast_to(light.reshape(40, 1, 1, 1), (40, *shape)).copy()
    space = spaces.Box(0, 255, shape, np.uint8)
    found = NeuralClone(epochs=5, batch_size=8, held_out=0.0).fit(seen, light // 255, space, spaces.Discrete(2))
    assert type(found.policy.model.policy.features_extractor).__name__ == reader
    assert wrong(found, seen, light // 255) == 0


def test_several_switches_as_an_action_are_learned():
    taken = np.stack([SIDES, POINTS[:, 0] > 0], axis=1).astype(np.int8)
    found = FEW.fit(POINTS, taken, PLANE, spaces.MultiBinary(2), lengths=LENGTHS)
    assert wrong(found, POINTS, taken) < 0.1


def test_a_rare_action_is_balanced():
    rare = (np.random.default_rng(1).random(1_500) < 0.2).astype(int)  # of which observations say nothing
    chosen = {
        how: NeuralClone(net_arch=(), epochs=5, weights=how).fit(POINTS, rare, PLANE, spaces.Discrete(2)).policy
        for how in ("equal", "balanced")
    }
    shares = {how: float(_probabilities(policy)[:, 1].mean()) for how, policy in chosen.items()}
    assert shares["equal"] == pytest.approx(0.2, abs=0.06) and shares["balanced"] == pytest.approx(0.5, abs=0.06)


def _probabilities(policy):
    seen, _ = policy.model.policy.obs_to_tensor(POINTS)
    with torch.no_grad():
        return policy.model.policy.get_distribution(seen).distribution.probs.numpy()


def test_training_ends_where_what_is_held_out_is_not_learned_and_keeps_the_best_epoch():
    chance, told = np.random.default_rng(1).integers(2, size=1_500), []
    learner = NeuralClone(net_arch=(64,), epochs=200, patience=3, learning_rate=0.01)
    found = learner.fit(POINTS, chance, PLANE, spaces.Discrete(2), lengths=LENGTHS, on_epoch=lambda *one: told.append(one))
    held_out = [judged for _, _, judged in told]
    assert found.proof.epochs == len(told) < 200 and found.proof.kept == 1 + int(np.argmin(held_out))
    assert found.proof.held_out_loss == pytest.approx(min(held_out), abs=1e-6)


def test_nothing_is_known_of_other_steps_where_nothing_is_held_out():
    found = NeuralClone(net_arch=(4,), epochs=2, held_out=0.0).fit(POINTS, SIDES, PLANE, spaces.Discrete(2))
    assert found.proof.held_out == 0 and found.proof.kept == 2 and found.facts()[-1].mood == "open"
    assert json.loads(json.dumps(found.proof.to_json(), allow_nan=False))["held_out_loss"] is None


def test_the_same_seed_gives_the_same_network():
    one, other = (QUICK.fit(POINTS, SIDES, PLANE, spaces.Discrete(2), rng=np.random.default_rng(5)) for _ in range(2))
    assert one.proof == other.proof


def test_losses_are_logged(tmp_path):
    QUICK.fit(POINTS, SIDES, PLANE, spaces.Discrete(2), log=tmp_path / "log")
    assert [one.name[:6] for one in (tmp_path / "log").iterdir()] == ["events"]


@pytest.mark.parametrize("env_id", ["CartPole-v1", "Pendulum-v1"])
def test_ppo_goes_on_from_the_zip_of_a_clone(env_id, tmp_path):
    env = gym.make(env_id)
    seen = np.random.default_rng(0).normal(size=(200, *env.observation_space.shape)).astype(np.float32)
    taken = np.clip(seen[:, 2:3], -1, 1) if env_id == "Pendulum-v1" else (seen[:, 2] > 0).astype(int)
    found = QUICK.fit(seen, taken, env.observation_space, env.action_space)
    found.policy.save(tmp_path / "clone.zip")
    model = PPO.load(tmp_path / "clone.zip", env=env, device="cpu", n_steps=64, batch_size=64)
    np.testing.assert_array_equal(model.predict(seen, deterministic=True)[0], found.policy.predict(seen, deterministic=True)[0])
    assert model.learn(64).num_timesteps == 64


def test_ppo_begins_as_a_clone_of_the_demonstrations_where_it_is_warmed(toy_text):
    table = toy_text("FrozenLake 4x4")
    expert = policy_iteration(table.mdp, table.reward).policy
    paid = table.payments.entries
    episodes = [*collect_from_table(table.mdp, paid, table.states, expert, 5, max_episode_steps=100)]
    problem, told = Problem.of(table, demonstrations=episodes), []
    env = TabularVecEnv(table.mdp, table.reward, num_envs=4, states=table.states)
    SB3(total_timesteps=32, hyperparameters={"n_steps": 8, "batch_size": 32}).plan(
        env,
        gamma=0.99,
        progress=lambda steps, policy: told.append(
            policy_value(table.mdp, table.reward, tabular_actions(policy, table.states))
        ),
        start=lambda model: NeuralClone().learn(problem, np.random.default_rng(0), model=model),
    )
    assert told[0] == pytest.approx(policy_value(table.mdp, table.reward, expert))


def test_rows_of_the_table_are_shown_where_observations_have_parts():
    states = StateIndex(spaces.Tuple((spaces.Discrete(2), spaces.Discrete(2))))
    rows = np.tile([0, 1, 2, 3], 10)
    episode = Episode(states.decode_batch(np.append(rows, 0)), rows % 2, np.zeros(40), False, True)
    problem = Problem(Spaces(states.space, spaces.Discrete(2), states), demonstrations=[episode, episode])
    found = NeuralClone(epochs=30).learn(problem, np.random.default_rng(0))
    assert found.policy.predict(states.decode_batch(np.arange(4)), deterministic=True)[0].tolist() == [0, 1, 0, 1]


def test_a_limit_of_time_ends_the_training(monkeypatch):
    monkeypatch.setattr(deadline.time, "monotonic", map(float, count()).__next__)  # a second passes whenever it is asked
    epochs = []
    with pytest.raises(SolverTimeout, match=r"no answer in 60\.0 s"):
        slow = NeuralClone(net_arch=(4,), epochs=10_000, patience=10_000, time_limit=60.0)
        slow.fit(POINTS, SIDES, PLANE, spaces.Discrete(2), on_epoch=lambda *told: epochs.append(told))
    assert 0 < len(epochs) <= 60 / (1_350 // 128)


@pytest.mark.parametrize(
    ("made", "error", "told"),
    [
        (lambda: NeuralClone(time_limit=0.0), InvalidParameter, "time_limit is 0.0: expected seconds above 0, or None"),
        (lambda: NeuralClone(epochs=0), InvalidParameter, "epochs is 0: expected a whole number of at least 1"),
        (lambda: NeuralClone(net_arch=(0,)), InvalidParameter, "net_arch is 0: expected sizes of at least 1"),
        (lambda: NeuralClone(held_out=1.0), InvalidParameter, "held_out is 1.0: expected a share of at least 0, below 1"),
        (lambda: NeuralClone(learning_rate=0.0), InvalidParameter, "learning_rate is 0.0: expected a number above 0"),
        (lambda: NeuralClone(weights="all"), InvalidParameter, "weights is 'all': expected 'equal' or 'balanced'"),
        (lambda: NeuralClone(device="abacus"), InvalidParameter, "device is 'abacus': expected a name that torch knows"),
        (lambda: QUICK.fit(POINTS, SIDES + 1, PLANE, spaces.Discrete(2)), InvalidDemonstrations, r"action \d is 2: expected"),
        (lambda: QUICK.fit(POINTS, POINTS * np.nan, PLANE, PLANE), InvalidDemonstrations, r"action 0 is \[nan nan\]"),
        (lambda: QUICK.fit(POINTS, SIDES, PLANE, PLANE), InvalidDemonstrations, "action 0 is .*: expected one of Box"),
        (lambda: QUICK.fit(POINTS[:9], SIDES, PLANE, spaces.Discrete(2)), InvalidDemonstrations, r"1500 actions of \[9\]"),
        (lambda: QUICK.fit(POINTS, SIDES, PLANE, spaces.Discrete(2), lengths=[3]), InvalidDemonstrations, "add up to 3"),
        (lambda: NeuralClone(weights="balanced").fit(POINTS, POINTS, PLANE, PLANE), InvalidParameter, "expected Discrete"),
    ],
)  # fmt: skip
def test_what_cannot_be_cloned_is_refused(made, error, told, unchecked):
    with pytest.raises(error, match=told):
        made()
