"""The exact companion of mean returns."""

import gymnasium as gym
import numpy as np
import pytest
from forgetting import with_digests_anew

from irl_gym.files.run_folder import read_json, write_json
from irl_gym.judging.expected_returns import expected_return, expected_told
from irl_gym.mdp.planning.finite_horizon import backward_induction
from irl_gym.runs.run import read_run
from irl_gym.tables.tabulate import tabulate


def played_out(env, actions, limit):
    """The return of every way that an episode can go, by the environment's own P, weighted."""
    P, ways = env.unwrapped.P, {0: 1.0}
    total = 0.0
    for _ in range(limit):
        later = {}
        for s, weight in ways.items():
            for p, t, r, ended in P[s][int(actions[s])]:
                total += weight * p * r
                if not ended:
                    later[t] = later.get(t, 0.0) + weight * p
        ways = later
    return total


@pytest.mark.parametrize("limit", [1, 20, 100])
def test_an_expected_return_is_that_of_all_ways_an_episode_can_go(limit):
    env = gym.make("FrozenLake-v1", is_slippery=True)
    table = tabulate(env, gamma=0.9, check_steps=0)
    actions = np.random.default_rng(1).integers(4, size=table.mdp.n_states)
    assert expected_return(table, actions, limit) == pytest.approx(played_out(env, actions, limit), abs=1e-12)


@pytest.mark.parametrize(("limit", "worth"), [(5, 0.0), (6, 1.0), (8, 1.0)])
def test_the_goal_of_the_lake_is_six_steps_away(limit, worth):
    table = tabulate(gym.make("FrozenLake-v1", is_slippery=False), gamma=0.9, check_steps=0)
    best = backward_induction(table.mdp, table.reward, horizon=limit)
    assert best.V[0, 0] == worth
    assert expected_return(table, best.policy, limit) == worth


def test_a_run_tells_the_expected_return_beside_the_mean_that_estimates_it(finished):
    metrics = read_json(finished / "metrics.json")
    rows = metrics["policies"].values()
    assert all(row["return_low"] - 1e-9 <= row["expected_return"] <= row["return_high"] + 1e-9 for row in rows)
    assert f"within the {metrics['table']['limit']} steps after which" in expected_told(metrics)


def test_an_expected_return_is_computed_again_when_a_run_is_read(copied):
    metrics = read_json(copied / "metrics.json")
    rows = {name: {**row, "expected_return": 7.0} for name, row in metrics["policies"].items()}
    write_json(copied / "metrics.json", {**metrics, "policies": rows})
    again = read_run(with_digests_anew(copied)).metrics["policies"]
    assert again == {name: pytest.approx(row) for name, row in metrics["policies"].items()}
