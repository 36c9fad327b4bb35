import gymnasium as gym
import numpy as np
import pytest
from counted import counted, episode
from gymnasium import spaces

from irl_gym.errors import InvalidDemonstrations, NotDiscrete, UnknownObservation
from irl_gym.tables.counted import step_counts
from irl_gym.tables.counted.counting import Counting, interact


@pytest.mark.parametrize(
    ("space", "observations"),
    [
        (spaces.Discrete(4, start=3), np.array([3, 6, 4])),
        (spaces.Tuple((spaces.Discrete(3), spaces.MultiBinary(2))), (np.array([0, 2, 1]), np.array([[0, 1], [1, 1], [0, 0]]))),
        (spaces.Dict(a=spaces.Discrete(3), b=spaces.MultiDiscrete([2, 2])),
         {"a": np.array([0, 2, 1]), "b": np.array([[0, 1], [1, 1], [0, 0]])}),
        (spaces.Box(0, 255, (5, 5, 3), np.uint8), np.arange(3 * 75).reshape(3, 5, 5, 3).astype(np.uint8)),
    ],
    ids=["Discrete from 3", "Tuple", "Dict", "Box"],
)  # fmt: skip
def test_counting_takes_any_observations_made_of_integers(space, observations):
    one = episode(observations, [0, 1])
    table = Counting().table([one], space, 2, gamma=0.9)
    rows = one.rows(table.states)
    assert sorted(rows) == [0, 1, 2] and table.mdp.P[[rows[0] * 2, rows[1] * 2 + 1], rows[1:]].tolist() == [1, 1]


def test_counts_do_not_depend_on_the_blocks_in_which_they_are_read(monkeypatch):
    env = gym.make("FrozenLake-v1")
    episodes = list(interact(env, 2000, seed=1))
    whole = Counting(prior=0.1).table(episodes, env.observation_space, 4, gamma=0.9)
    monkeypatch.setattr(step_counts, "BLOCK", 7)
    parts = Counting(prior=0.1).table(iter(episodes), env.observation_space, 4, gamma=0.9)
    assert (whole.mdp.P != parts.mdp.P).nnz == 0 and (whole.states.numbers == parts.states.numbers).all()


@pytest.mark.parametrize(
    ("episodes", "error", "message"),
    [
        ([], InvalidDemonstrations, "there are no episodes"),
        ([episode([0, 1], [0]), episode([0, 0, 1], [0, 7])], InvalidDemonstrations, "episode 1, step 1 takes action 7"),
        ([episode([0, 1], [0], [np.nan])], InvalidDemonstrations, "episode 0, step 0 pays nan"),
        ([episode([0, 1], [0], [1e200])], InvalidDemonstrations, r"pays 1e\+200: expected a finite reward, 1e\+150 at most"),
        ([episode([0, 1], np.array([2**63], np.uint64))], InvalidDemonstrations, "episode 0, step 0 takes action"),
        ([episode([0, 1], [0]), episode([0, 9], [0])], UnknownObservation, "in episode 1, observation 9 is outside"),
        ([episode([0, 1], [0]), episode([0.0, 1.0], [0])], UnknownObservation, "in episode 1, .*float64"),
    ],
    ids=["none", "action", "reward", "large reward", "large action", "outside", "floats"],
)
def test_counting_refuses_episodes_that_cannot_be(episodes, error, message):
    with pytest.raises(error, match=message):
        counted(episodes)


def test_counting_refuses_observations_that_are_not_integers():
    with pytest.raises(NotDiscrete, match="discretize"):
        Counting().table([episode([0, 1], [0])], spaces.Box(0, 1, (1,)), 2, gamma=0.9)
