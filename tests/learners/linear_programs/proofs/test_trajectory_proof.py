"""What TrajectoryLP refuses, how its outcome reads and is kept, and the bars of the issue on tables."""

import json
import pickle
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest

from irl_gym.agents.planners import SB3, ValueIteration, tabular_actions
from irl_gym.agents.simulator import Simulator
from irl_gym.environments.rollouts import run_episodes
from irl_gym.errors import InvalidDemonstrations, InvalidFeatures, InvalidParameter
from irl_gym.features.bases import RadialBasis
from irl_gym.features.feature_maps import OneHot
from irl_gym.judging.metrics import normalised_score, policy_value, random_value
from irl_gym.learners.base import Proof
from irl_gym.learners.linear_programs.trajectory import TrajectoryLP
from irl_gym.mdp.episodes import Episode
from irl_gym.tables.tabulate import tabulate


@pytest.fixture(scope="module")
def world():
    return Simulator(gym.make("CliffWalking-v1"), ValueIteration(), 0.9)


@pytest.fixture(scope="module")
def episodes(world):
    return run_episodes(world.env, ValueIteration().plan(world.env, gamma=0.9), 5, most=100)


@pytest.fixture(scope="module")
def result(world, episodes):
    return TrajectoryLP(OneHot(48), trajectories=50).fit(world, episodes)


def test_the_reward_leads_to_the_goal_by_the_shortest_way(world, result):
    table = world.known
    value = policy_value(table.mdp, table.reward, tabular_actions(result.policy, table.states))
    assert value == pytest.approx(-(1 - 0.9**13) / 0.1)


def test_the_reward_is_proved(result):
    assert isinstance(result.proof, Proof) and result.proof.expert_optimal and not result.proof.degenerate


def test_the_result_survives_pickle(result):
    again = pickle.loads(pickle.dumps(result))
    assert again.proof.to_json() == result.proof.to_json() and again.stats == result.stats


def test_the_proof_is_json(result):
    told = json.loads(json.dumps(result.proof.to_json()))
    assert told["distance"] == result.proof.distance and told["gaps"] == result.proof.gaps.tolist()
    assert {"expert_optimal", "duality_gap", "degenerate", "truncation", "horizon", "rank"} <= set(told)


def test_a_record_is_json_when_one_episode_tells_no_error(world, episodes):
    one = TrajectoryLP(OneHot(48), trajectories=50, max_rounds=2).fit(world, episodes[:1])
    record = one.record()
    assert np.isnan(one.stats["regret_error"]) and record["stats"]["regret_error"] is None
    assert record["stats"]["rounds"][0]["regret_error"] is None and json.loads(json.dumps(record, allow_nan=False)) == record


def test_sampled_values_are_compared_as_they_are_when_one_episode_tells_no_error(result):
    unsure = replace(result.proof, gaps=np.ones(1), gap_errors=np.full(1, np.nan), regret_error=np.nan, regret=-0.5)
    assert unsure.expert_optimal and not replace(unsure, regret=0.5).expert_optimal


@pytest.mark.parametrize("word", ["expert best by its episodes   yes", "distance to the expert", "cut after 44 steps", "rank"])
def test_the_proof_reads_as_a_page(result, word):
    assert word in str(result.proof)


@pytest.mark.parametrize(
    ("error", "words"),
    [(0.2, "gains 0.5 over the expert; standard error 0.2"), (np.nan, "gains 0.5 over the expert; one episode tells no noise")],
)
def test_an_expert_that_is_beaten_is_told_with_the_noise(result, error, words):
    first = replace(result.proof, regret=0.5, regret_error=error).facts()[0]
    assert first.sentence == f"no: the policy planned for it {words}" and first.mood == "bad"


def test_the_best_round_is_told_where_it_was_chosen(result):
    told = {one.label: one.sentence for one in result.facts()}
    assert told["best round"].startswith(f"{result.stats['best_round']} of {len(result.stats['rounds'])}, by its policy's")
    assert all(one.label != "best round" for one in replace(result.proof, rounds=None).facts())


def test_the_reward_notes_its_learner_and_the_scaling(result):
    assert result.reward.note == {"learner": "TrajectoryLP", "scaling": "one-hot: 1 in the state, 0 elsewhere"}


# --- refusals ---


def test_no_episode_is_refused(world):
    with pytest.raises(InvalidDemonstrations, match="no episodes"):
        TrajectoryLP(OneHot(48)).fit(world, [])


@pytest.mark.parametrize(
    ("features", "match"),
    [
        (RadialBasis.grid([0, 0], [1, 1], 2), "coordinates"),
        (OneHot(4), "observation"),
        (np.ones((4, 2)), "observation"),
    ],
)
def test_features_of_other_observations_are_refused(world, episodes, features, match):
    with pytest.raises(InvalidFeatures, match=match):
        TrajectoryLP(features).fit(world, episodes)


def test_integer_features_of_coordinates_are_refused():
    cart = gym.make("CartPole-v1")
    one = Episode(np.zeros((2, 4), dtype=np.float32), np.array([0]), np.ones(1), True, False)
    with pytest.raises(InvalidFeatures, match="integers"):
        TrajectoryLP(OneHot(4)).fit(Simulator(cart, SB3(), 0.9), [one])


def test_features_that_are_neither_map_nor_array_are_refused(unchecked):
    with pytest.raises(InvalidFeatures, match="read as numbers"):
        TrajectoryLP("radial")


@pytest.mark.parametrize(
    "wrong",
    [
        {"trajectories": 0}, {"horizon": 0}, {"max_rounds": 0}, {"patience": 0}, {"penalty": 0.5}, {"l1": -1.0}, {"seed": -1},
        {"trajectories": 1.5}, {"l1": float("nan")}, {"time_limit": 0.0}, {"solver": "gurobi"},
    ],
)  # fmt: skip
def test_a_field_outside_its_range_is_refused(wrong, unchecked):
    with pytest.raises(InvalidParameter, match=f"{next(iter(wrong))} is"):
        TrajectoryLP(OneHot(2), **wrong)


# --- the bars of the issue ---


@pytest.fixture(scope="module")
def bars():
    """Worlds and 500 episodes of their experts, made when asked for."""
    made = {}

    def get(env_id, **kwargs):
        if env_id not in made:
            env = gym.make(env_id, **kwargs)
            table = tabulate(env, gamma=0.99, check_steps=0)
            expert = ValueIteration().plan(env, gamma=0.99)
            made[env_id] = Simulator(env, ValueIteration(), 0.99, table), expert, run_episodes(env, expert, 500, seed=12_345)
        return made[env_id]

    return get


def score(world, policy, expert):
    """Where the true value of a policy lies between random actions (0) and the expert (1)."""
    table = world.known
    value, best = (policy_value(table.mdp, table.reward, tabular_actions(one, table.states)) for one in (policy, expert))
    return normalised_score(value, random_value(table.mdp, table.reward), best)


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize(
    ("env_id", "kwargs"), [("FrozenLake-v1", {"map_name": "8x8"}), pytest.param("Taxi-v4", {}, marks=pytest.mark.slow)]
)
def test_500_episodes_are_enough_for_nine_tenths_of_the_expert(bars, env_id, kwargs, seed):
    world, expert, episodes = bars(env_id, **kwargs)
    found = TrajectoryLP(OneHot(int(world.env.observation_space.n)), seed=seed).fit(world, episodes)
    assert score(world, found.policy, expert) >= 0.9
