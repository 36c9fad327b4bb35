import threading

import gymnasium as gym
import pytest
from gymnasium import spaces
from gymnasium.envs.toy_text.frozen_lake import FrozenLakeEnv
from tiny_env import TableEnv, both_ways, coin, lottery

from irl_gym.errors import NotTabular, TableMismatch
from irl_gym.tables.tabulate import tabulate


def check(env, steps=2000, seed=0):
    return tabulate(env, gamma=0.9, check_steps=steps, seed=seed).evidence.check


@pytest.mark.parametrize("table", [coin(0.3, win=2.0, lose=-1.0), coin(1.0)], ids=["toss", "certain"])
def test_self_check_passes_an_honest_environment(table):
    assert check(TableEnv(table, [1, 0])).p_value > 1e-6


def test_self_check_counts_the_pairs_it_saw():
    found = check(TableEnv(both_ways(), [1, 0, 0]))
    assert (found.rows_seen, found.rows_total) == (4, 4)


def test_self_check_counts_degrees_of_freedom_of_rows_that_branch():
    assert check(TableEnv(coin(), [1, 0])).degrees == 1


def test_self_check_has_no_degrees_of_freedom_when_all_is_certain():
    found = check(TableEnv(coin(1.0), [1, 0]))
    assert (found.degrees, found.p_value) == (0, 1.0)


def test_self_check_repeats_itself_with_the_same_seed():
    assert check(TableEnv(coin(), [1, 0]), seed=7) == check(TableEnv(coin(), [1, 0]), seed=7)


@pytest.mark.parametrize(
    ("published", "truth", "message"),
    [
        (coin(1.0), coin(0.5), r"took \(s=0, a=0\) to 0, terminated=False: the table allows \[1\] only"),
        (coin(), coin(ends=False), r"to 1 said terminated=False: the table says True"),
        (coin(0.5, win=0.0), coin(0.6, win=0.0), "differ from the table's probabilities: chi-square"),
        (coin(0.5, win=1.0, lose=1.0), coin(0.5, win=3.0, lose=3.0), r"\(s=0, a=0\) to \d paid 3\.0: the table says 1"),
        (lottery(0.5), lottery(0.6), r"paid 0\.\d+ on average: the table says 0\.5"),
        (lottery(0.0), lottery(0.5), r"to 1 paid 1\.0: the table says 0"),
    ],
    ids=["support", "termination", "probability", "reward of a transition", "mean reward", "certain reward"],
)
def test_self_check_catches_an_environment_that_differs_from_its_table(published, truth, message):
    with pytest.raises(TableMismatch, match=message):
        check(TableEnv(published, [1, 0], truth))


def test_self_check_catches_a_start_that_is_more_frequent_than_published():
    two_starts = [coin()[0], coin()[0], [[(1.0, 2, 0.0, True)]]]
    with pytest.raises(TableMismatch, match="chi-square"):
        check(TableEnv(two_starts, [0.5, 0.5, 0], truth_start=[0.99, 0.01, 0]))


def test_self_check_accepts_rewards_that_are_rare():
    for seed in range(10):
        check(TableEnv(lottery(1e-4), [1, 0]), seed=seed)


def test_self_check_begins_anew_where_the_environment_truncates_itself():
    class Impatient(TableEnv):
        def step(self, action):
            *most, _, info = super().step(action)
            return *most, True, info

    assert check(Impatient(coin(), [1, 0])).steps > 0


def test_self_check_catches_a_start_that_differs_from_the_published_one():
    two_starts = [coin()[0], coin()[0], [[(1.0, 2, 0.0, True)]]]
    lying = TableEnv(two_starts, [1, 0, 0], truth_start=[0, 1, 0])
    with pytest.raises(TableMismatch, match="reset began in state 1, which has probability 0"):
        check(lying)


def test_self_check_starts_walks_again_that_never_end():
    stays = [[[(1.0, 1, 0.0, False)], [(1.0, 2, 0.0, False)]], *([[(1.0, s, 0.0, False)]] * 2 for s in (1, 2))]
    found = check(TableEnv(stays, [1, 0, 0]), steps=10_000)
    assert found.rows_seen == found.rows_total == 6


def test_self_check_says_when_an_environment_cannot_be_copied():
    env = TableEnv(coin(), [1, 0])
    env.lock = threading.Lock()
    with pytest.raises(NotTabular, match=r"TableEnv.lock is a lock, which cannot be copied.*check_steps=0"):
        check(env)


def test_self_check_makes_the_environment_again_when_it_has_a_spec():
    env = gym.make("FrozenLake-v1", is_slippery=False)
    env.unwrapped.lock = threading.Lock()
    assert isinstance(env.unwrapped, FrozenLakeEnv) and check(env).degrees == 0


def test_self_check_walks_long_enough_to_meet_a_late_end():
    class Late(TableEnv):
        age = 0

        def reset(self, **kwargs):
            self.age = 0
            return super().reset(**kwargs)

        def step(self, action):
            self.age += 1
            observation, reward, *_ = super().step(action)
            return observation, reward, self.age == 900, False, {}

    with pytest.raises(TableMismatch, match=r"said terminated=True|to 0, terminated=True") as caught:
        check(Late([[[(1.0, 0, 0.0, False)]]], [1]))
    assert "outside the table" in str(caught.value) and "irl_gym.environments.reveal.Reveal" in str(caught.value)


class Lockstep(gym.Env):
    """Goes anywhere by a draw of the kind that random actions are, and draws nothing at reset."""

    observation_space = action_space = spaces.Discrete(4)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return 0, {}

    def step(self, action):
        return int(self.np_random.integers(4)), 0.0, False, False, {}


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_random_actions_are_no_echo_of_the_environments_own_draws(seed):
    assert tabulate(Lockstep(), gamma=0.9, check_steps=4000, seed=seed).evidence.check.p_value > 1e-4
