"""Planners give policies that act, on Gymnasium environments and on tables."""

import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium import spaces
from models import episodic_model
from stable_baselines3.common.vec_env import DummyVecEnv

from irl_gym.agents.planners import SB3, ValueIteration, load_agent, tabular_actions
from irl_gym.environments.learned_reward import LearnedReward
from irl_gym.environments.tabular_vec_env import TabularVecEnv
from irl_gym.errors import InvalidDiscount, InvalidParameter, NotTabular, UnknownObservation
from irl_gym.judging import metrics
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TransitionTable
from irl_gym.spaces.listed_states import ListedStates
from irl_gym.spaces.states import StateIndex
from irl_gym.tables.tabulate import tabulate


@pytest.fixture
def model():
    return episodic_model(0, S=6, A=3)


@pytest.fixture
def vec(model):
    return TabularVecEnv(model.mdp, TabularReward(model.R), num_envs=16, max_episode_steps=50, seed=0)


def test_value_iteration_plans_on_a_gymnasium_environment(toy_text):
    policy = ValueIteration().plan(gym.make("FrozenLake-v1"), gamma=0.99)
    table = toy_text("FrozenLake 4x4 slippery")
    assert metrics.policy_value(table.mdp, table.reward, policy.probabilities) == pytest.approx(0.542, abs=5e-4)


def test_value_iteration_plans_on_a_vector_environment(model, vec):
    policy = ValueIteration().plan(vec, gamma=0.9)
    acting = ~model.mdp.terminal
    assert np.array_equal(tabular_actions(policy, policy.states)[acting], model.expert[acting])


def test_value_iteration_uses_the_discount_asked_for():
    # From state 0: action 0 pays 1 now; action 1 pays 3 two steps later, worth it only to the patient.
    P = np.zeros((8, 4))
    P[0, 3] = P[1, 1] = P[2, 2] = P[3, 2] = P[4, 3] = P[5, 3] = 1
    R = np.zeros((4, 2))
    R[0, 0], R[2] = 1.0, 3.0
    vec = TabularVecEnv(TransitionTable(P, np.eye(4)[0]), TabularReward(R), num_envs=1)
    actions = [tabular_actions((p := ValueIteration().plan(vec, gamma=g)), p.states)[0] for g in (0.5, 0.9)]
    assert actions == [0, 1]


@pytest.mark.parametrize(
    ("space", "one"),
    [
        (spaces.Tuple([spaces.Discrete(2), spaces.Discrete(3)]), (1, 2)),
        (spaces.Dict(a=spaces.Discrete(2), b=spaces.Discrete(3)), {"a": 1, "b": 2}),
        (spaces.Box(np.zeros(2, int), np.array([1, 2]), dtype=np.int64), np.array([1, 2])),
    ],
)
def test_an_agent_trained_on_rows_takes_observations_before_and_after_it_is_saved(model, tmp_path, space, one):
    states = StateIndex(space)
    env = TabularVecEnv(model.mdp, TabularReward(model.R), num_envs=16, states=states, show_rows=True, seed=0)
    agent = SB3(total_timesteps=256).plan(env, gamma=0.9)
    agent.save(tmp_path / "agent.zip")
    rows, _ = agent.model.predict(np.arange(6), deterministic=True)
    for acting in (agent, load_agent(tmp_path / "agent.zip", "PPO", states)):
        assert acting.states is states and np.array_equal(tabular_actions(acting, states), rows)
        assert acting.predict(one, deterministic=True)[0] == rows[5]


def test_an_agent_trained_on_rows_refuses_what_is_no_state(model):
    numbers = np.array([[0, 0], [0, 1], [0, 2], [1, 0], [1, 1], [1, 2]])
    states = ListedStates(spaces.MultiDiscrete([9, 9]), numbers)
    env = TabularVecEnv(model.mdp, TabularReward(model.R), num_envs=16, states=states, show_rows=True, seed=0)
    agent = SB3(total_timesteps=256).plan(env, gamma=0.9)
    with pytest.raises(UnknownObservation, match=r"\[8, 8\] is not a state"):
        agent.predict(np.array([8, 8]))


def test_value_iteration_refuses_a_vector_environment_without_table():
    with pytest.raises(InvalidParameter, match="DummyVecEnv"):
        ValueIteration().plan(DummyVecEnv([lambda: gym.make("FrozenLake-v1")]), gamma=0.9)


def test_value_iteration_refuses_an_environment_without_table():
    with pytest.raises(NotTabular, match="Blackjack"):
        ValueIteration().plan(gym.make("Blackjack-v1"), gamma=0.9)


@pytest.mark.parametrize("algorithm", ["PPO", "A2C", "DQN"])
def test_sb3_learns_a_small_table(model, vec, algorithm):
    agent = SB3(algorithm, 20_000).plan(vec, gamma=0.9, seed=0)
    actions = tabular_actions(agent, StateIndex(spaces.Discrete(6)))
    reward = TabularReward(model.R)
    worst, best = metrics.random_value(model.mdp, reward), metrics.policy_value(model.mdp, reward, model.expert)
    assert metrics.normalised_score(metrics.policy_value(model.mdp, reward, actions), worst, best) > 0.9


def test_sb3_gives_the_same_agent_for_the_same_seed(model):
    def train():
        env = TabularVecEnv(model.mdp, TabularReward(model.R), num_envs=8, max_episode_steps=50, seed=1)
        return SB3("PPO", 2_000).plan(env, gamma=0.9, seed=1).model.get_parameters()["policy"]

    first, second = train(), train()
    assert all(torch.equal(first[name], second[name]) for name in first)


def test_sb3_takes_the_hyperparameters_given(vec):
    assert SB3("PPO", 64, {"n_steps": 4, "batch_size": 64}).plan(vec, gamma=0.9).model.n_steps == 4


def test_sb3_reports_progress_up_to_the_last_step(vec):
    seen = []
    SB3("PPO", 2_000).plan(vec, gamma=0.9, progress=lambda steps, policy: seen.append(steps))
    assert seen == sorted(seen) and seen[-1] >= 2_000


def test_sb3_leaves_torchs_threads_as_they_were(vec):
    before = torch.get_num_threads()
    SB3("PPO", 64).plan(vec, gamma=0.9)
    assert torch.get_num_threads() == before


@pytest.mark.parametrize("verbose", [0, 1])
def test_sb3_makes_no_folder_of_logs_unasked_and_says_what_it_is_asked_to(vec, tmp_path, monkeypatch, capsys, verbose):
    monkeypatch.setenv("SB3_LOGDIR", str(tmp_path / "logs"))  # in place of one in the temporary folder
    SB3(total_timesteps=8, hyperparameters={"verbose": verbose, "n_steps": 8, "n_epochs": 1}).plan(vec, gamma=0.9)
    assert not any(tmp_path.iterdir()) and ("total_timesteps" in capsys.readouterr().out) == bool(verbose)


def test_sb3_trains_on_a_gymnasium_environment_with_its_own_defaults():
    agent = SB3("PPO", 128, {"n_steps": 64}).plan(gym.make("CartPole-v1"), gamma=0.99)
    assert agent.model.policy.net_arch == {"pi": [64, 64], "vf": [64, 64]}


def test_an_agent_acts_the_same_after_saving_and_loading(vec, tmp_path):
    agent = SB3("PPO", 1_000).plan(vec, gamma=0.9)
    agent.save(tmp_path / "agent.zip")
    states = StateIndex(spaces.Discrete(6))
    again = load_agent(tmp_path / "agent.zip", "PPO")
    assert np.array_equal(tabular_actions(agent, states), tabular_actions(again, states))


@pytest.mark.parametrize("make", [lambda: SB3("SAC"), lambda: load_agent(__file__, "SAC")])  # pyright: ignore
@pytest.mark.usefixtures("unchecked")
def test_an_unknown_algorithm_is_refused(make):
    with pytest.raises(InvalidParameter, match=r"'SAC'.*PPO"):
        make()


def test_sb3_refuses_to_train_for_no_steps():
    with pytest.raises(InvalidParameter, match="total_timesteps is 0"):
        SB3("PPO", 0)


def test_value_iteration_plans_for_the_reward_that_a_wrapper_pays():
    hole = np.zeros(16)
    hole[5] = 1.0
    learned = LearnedReward(gym.make("FrozenLake-v1", is_slippery=False), hole)
    policy = ValueIteration().plan(learned, gamma=0.9)
    s, row = 0, []
    for _ in range(2):
        s = tabulate(learned, gamma=0.9).mdp.P.indices[s * 4 + tabular_actions(policy, policy.states)[s]]
        row.append(int(s))
    assert row[-1] == 5


@pytest.mark.parametrize("copies", [1, 7, 33, 64, 100, 512])
def test_ppo_splits_a_rollout_into_few_batches_of_one_size(model, copies):
    env = TabularVecEnv(model.mdp, TabularReward(model.R), num_envs=copies, max_episode_steps=50, seed=0)
    trained = SB3("PPO", 1).plan(env, gamma=0.9).model
    rollout = trained.n_steps * copies
    assert rollout % trained.batch_size == 0 and rollout // trained.batch_size <= 16


def test_sb3_refuses_an_unknown_hyperparameter(vec):
    with pytest.raises(InvalidParameter, match="no hyper-parameter 'lr'"):
        SB3("PPO", 64, {"lr": 1e-3}).plan(vec, gamma=0.9)


def test_sb3_refuses_a_discount_outside_the_interval(vec):
    with pytest.raises(InvalidDiscount, match="gamma is 2"):
        SB3("PPO", 64).plan(vec, gamma=2.0)


def test_load_agent_refuses_a_file_that_holds_none(tmp_path):
    (tmp_path / "agent.zip").write_text("not a zip")
    with pytest.raises(InvalidParameter, match=r"agent\.zip holds no PPO agent"):
        load_agent(tmp_path / "agent.zip", "PPO")


def test_load_agent_names_the_file_that_is_missing(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"nothing\.zip does not exist"):
        load_agent(tmp_path / "nothing.zip", "PPO")


def test_planners_are_hashable():
    assert hash(SB3()) == hash(SB3()) and hash(ValueIteration()) == hash(ValueIteration())
