"""What publishes no table, or is wrapped, is enumerated."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.wrappers import NormalizeReward, RepeatAction, TransformReward
from tiny_env import TableEnv, coin

from irl_gym.environments.learned_reward import LearnedReward
from irl_gym.environments.seeded_starts import SeededStarts
from irl_gym.errors import HiddenState, NotTabular
from irl_gym.mdp.rewards import TabularReward
from irl_gym.tables.enumeration.table import Enumeration
from irl_gym.tables.tabulate import tabulate


def table_of(env, **kwargs):
    return tabulate(env, gamma=0.9, check_steps=0, **kwargs)


class NoStart(TableEnv):
    """Publishes a table, but not where it starts."""

    def __init__(self, P):
        super().__init__(P, None, truth_start=[1, 0])


class PairsObserved(gym.ObservationWrapper):
    """Shows a state as a pair."""

    def __init__(self, env):
        super().__init__(env)
        self.observation_space = spaces.Tuple([spaces.Discrete(2), env.observation_space])

    def observation(self, observation):
        return 1, observation


class Negated(gym.Wrapper):
    def step(self, action):
        observation, reward, *rest = super().step(action)
        return observation, -reward, *rest


@pytest.mark.parametrize("wrap", [lambda env: TransformReward(env, lambda reward: -reward), Negated])
def test_tabulate_takes_wrappers_that_change_the_reward_for_a_part_of_the_environment(wrap):
    plain, wrapped = table_of(TableEnv(coin(), [1, 0])), table_of(wrap(TableEnv(coin(), [1, 0])))
    assert wrapped.reward.values[0] == pytest.approx(-plain.reward.values[0])


def test_tabulate_takes_a_wrapper_that_repeats_actions_for_a_part_of_the_environment():
    table = table_of(RepeatAction(gym.make("FrozenLake-v1", is_slippery=False), 2))
    assert table.states.decode(int(table.mdp.P[[table.states.encode(0) * 4 + 2]].indices[0])) == 2


def test_tabulate_refuses_a_reward_that_depends_on_what_was_paid_before():
    with pytest.raises(HiddenState, match=r"NormalizeReward\."):
        table_of(NormalizeReward(gym.make("FrozenLake-v1", is_slippery=False)))


def test_tabulate_refuses_a_wrapper_around_a_learned_reward_that_changes_it():
    env = LearnedReward(TableEnv(coin(), [1, 0]), TabularReward(np.zeros(2)))
    with pytest.raises(NotTabular, match="the wrapper Negated around LearnedReward"):
        table_of(Negated(env))


@pytest.mark.parametrize("env", [NoStart(coin()), PairsObserved(TableEnv(coin(), [1, 0]))], ids=["no start", "pairs"])
def test_tabulate_enumerates_what_publishes_half_a_table(env):
    table = table_of(env)
    assert "Enumeration of 1 state" in table.evidence.method
    assert (table.mdp.P.toarray()[:1].tolist(), table.mdp.d0.tolist()) == ([[0.5, 0.5]], [1.0, 0.0])


def test_tabulate_enumerates_in_any_case_when_asked():
    assert "Enumeration" in tabulate(gym.make("FrozenLake-v1"), gamma=0.9, by=Enumeration(), check_steps=500).evidence.method


def test_tabulate_tells_how_far_an_enumeration_is():
    told = []
    tabulate(gym.make("FrozenLake-v1"), gamma=0.9, by=Enumeration(), check_steps=0, progress=lambda *pair: told.append(pair))
    assert told[-1] == (11, 11)


def test_tabulate_takes_seeded_starts_for_a_part_of_the_environment():
    table = table_of(SeededStarts(gym.make("FrozenLake-v1"), (0, 1)))
    assert table.evidence.exact and table.mdp.d0[table.states.encode(0)] == 1


class Cells(gym.ObservationWrapper):
    """MountainCar, seen in 20 x 20 cells."""

    def __init__(self):
        super().__init__(gym.make("MountainCar-v0"))
        self.observation_space = spaces.MultiDiscrete([20, 20])

    def observation(self, observation):
        return np.clip((observation + np.array([1.2, 0.07])) / [1.8, 0.14] * 20, 0, 19).astype(np.int64)


def test_tabulate_finds_the_continuous_state_that_cells_hide_though_starts_are_counted():
    with pytest.raises(HiddenState, match=r"state\[0\].*discretize"):
        table_of(Cells())


def test_the_evidence_reads_as_lines():
    told = str(tabulate(gym.make("FrozenLake-v1"), gamma=0.9, check_steps=500).evidence).splitlines()
    assert told[1] == "exact                    yes" and told[3].startswith("checked against env.step 500 steps")
