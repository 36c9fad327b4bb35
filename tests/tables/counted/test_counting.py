import subprocess
import sys
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from counted import counted, dense, episode
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st
from tiny_env import TableEnv, both_ways, lottery

from irl_gym.demonstrations.datasets import read_minari, write_minari
from irl_gym.errors import InvalidDemonstrations, InvalidDiscount, InvalidParameter, NotDiscrete, NotTabular
from irl_gym.tables.counted import counting
from irl_gym.tables.counted.counting import Counting, Interaction, interact
from irl_gym.tables.tabulate import tabulate

LAKE = "FrozenLake-v1"


def test_evidence_says_what_was_counted():
    evidence = counted([episode([0, 1], [0]), episode([0, 1], [0])]).table.evidence
    assert "2 steps in 2 episodes, which visit 1 of 2 pairs" in evidence.method and not evidence.exact


def test_counted_rows_are_shares():
    found = counted([episode([0, 1], [0]), episode([0, 2], [0]), episode([0, 2], [0])], n_actions=1)
    np.testing.assert_allclose(dense(found)[0, 0], [0, 1 / 3, 2 / 3])


def test_counted_start_is_the_share_of_episodes():
    found = counted([episode([0, 1], [0]), episode([2, 1], [0]), episode([2, 1], [0])])
    np.testing.assert_allclose(found.table.mdp.d0, [1 / 3, 0, 2 / 3])


def test_counted_states_are_those_that_occur():
    found = counted([episode([3, 1, 3], [0, 1])])
    assert [found.table.states.decode(row) for row in range(2)] == [1, 3]


def test_state_is_terminal_when_it_is_entered_with_terminated_only():
    assert counted([episode([0, 1], [0])]).table.mdp.terminal.tolist() == [False, True]


def test_state_at_the_end_of_a_cut_episode_is_not_terminal():
    assert not counted([episode([0, 1], [0], terminated=False)]).table.mdp.terminal.any()


def test_state_entered_both_ways_gets_a_terminal_copy():
    env = TableEnv(both_ways(), [1, 0, 0])
    exact = tabulate(env, gamma=0.9, check_steps=0)
    found = Counting().count(interact(env, 500, seed=0), env.observation_space, 2, gamma=0.9)
    assert found.table.states.terminal_copies == {1: 3} and (found.table.mdp.P != exact.mdp.P).nnz == 0


def test_terminal_copy_is_also_of_a_state_that_is_only_cut_or_ended_at():
    found = counted([episode([0, 1], [0]), episode([0, 1], [0], terminated=False)])
    np.testing.assert_allclose(dense(found)[0, 0], [0, 0.5, 0.5])


def test_unvisited_pairs_lead_to_themselves_by_default_and_pay_the_least_seen():
    found = counted([episode([0, 1, 2], [0, 0], [-3, 1])])
    assert dense(found)[0, 1].tolist() == [1, 0, 0] and found.table.reward.values[0].tolist() == [-3, -3]


def test_unvisited_pairs_lead_anywhere_that_is_not_terminal_when_uniform():
    assert dense(counted([episode([0, 1, 2], [0, 0])], unvisited="uniform"))[1, 1].tolist() == [0.5, 0.5, 0]


def test_unvisited_pairs_are_refused_by_name():
    with pytest.raises(InvalidDemonstrations, match=r"3 of 4 pairs .* the first \(s=0, a=1\) with observation 2"):
        counted([episode([2, 3], [0], terminated=False)], unvisited="refuse")


def test_refusing_accepts_episodes_that_visit_every_pair():
    found = counted([episode([0, 1], [0]), episode([0, 1], [1])], unvisited="refuse")
    assert not found.counts.invented.any()


def test_uniform_rows_that_do_not_fit_are_refused(monkeypatch):
    monkeypatch.setattr(counting, "MOST_ENTRIES", 3)
    with pytest.raises(InvalidParameter, match="2 rows of 2 entries"):
        counted([episode([0, 1, 2], [0, 0])], unvisited="uniform")


def test_payments_have_no_entries_where_a_transition_paid_differently():
    env = TableEnv(lottery(0.5), [1, 0])
    payments = Counting().table(interact(env, 4000, seed=0), env.observation_space, 1, gamma=0.9).payments
    assert payments.entries is None
    assert payments.mean[0, 0] == pytest.approx(0.5, abs=0.05) and payments.deviation[0, 0] == pytest.approx(0.5, abs=0.01)


def test_payments_that_are_certain_are_exact():
    payments = counted([episode([0, 1], [0], [0.1])] * 1000).table.payments
    assert (payments.mean[0, 0], payments.deviation[0, 0], payments.largest) == (0.1, 0, 0.1)


def test_counting_reads_a_minari_dataset(tmp_path):
    env = gym.make(LAKE)
    episodes = list(interact(env, 300, seed=0))
    write_minari(episodes, "lake/random-v0", env, root=tmp_path, algorithm="random")
    stored = Counting().table(read_minari("lake/random-v0", root=tmp_path), env.observation_space, 4, gamma=0.9)
    direct = Counting().table(episodes, env.observation_space, 4, gamma=0.9)
    assert (stored.mdp.P != direct.mdp.P).nnz == 0


def test_same_seed_gives_the_same_table():
    one, two = (Counting().table(interact(gym.make(LAKE), 1000, seed=3), spaces.Discrete(16), 4, gamma=0.9) for _ in "ab")
    assert (one.mdp.P.data == two.mdp.P.data).all() and (one.reward.values == two.reward.values).all()


walks = st.lists(
    st.tuples(st.lists(st.integers(0, 3), min_size=2, max_size=6), st.integers(0, 1), st.booleans()), min_size=1, max_size=8
)


@given(walks, st.sampled_from([0.0, 0.3]), st.sampled_from(["self-loop", "uniform"]))
def test_counted_rows_are_distributions_but_for_terminal_states(drawn, prior, unvisited):
    episodes = [episode(seen, [action] * (len(seen) - 1), terminated=ends) for seen, action, ends in drawn]
    found = counted(episodes, prior=prior, unvisited=unvisited)
    sums = found.table.mdp.P.sum(axis=1).reshape(-1, 2)
    np.testing.assert_allclose(sums, np.where(found.table.mdp.terminal, 0.0, 1.0)[:, None] * np.ones(2), atol=1e-12)
    assert (found.counts.successors.indices == found.table.mdp.P.indices).all()
    assert found.counts.visits.sum() == found.counts.successors.data.sum() == sum(map(len, episodes))


def test_counting_refuses_a_discount_of_one():
    with pytest.raises(InvalidDiscount):
        Counting().table([episode([0, 1], [0])], spaces.Discrete(2), 2, gamma=1.0)


@pytest.mark.parametrize("settings", [{"prior": -1.0}, {"prior": np.inf}, {"unvisited": "ignore"}])
def test_counting_refuses_settings_that_mean_nothing(settings, unchecked):
    with pytest.raises(InvalidParameter):
        Counting(**settings)


def test_interact_makes_as_many_steps_as_asked():
    episodes = list(interact(gym.make(LAKE), 1000, seed=0))
    assert sum(map(len, episodes)) == 1000 and all(one.terminated or one.truncated for one in episodes)


def test_interact_cuts_the_last_episode_where_the_steps_are_up():
    (one,) = interact(gym.make("CliffWalking-v1"), 5, seed=0)
    assert (len(one), one.terminated, one.truncated) == (5, False, True)


def test_interact_cuts_episodes_where_there_is_no_time_limit():
    endless = TableEnv([[[(1.0, 0, 0.0, False)]]], [1])
    assert [len(one) for one in interact(endless, 1200, seed=0)] == [500, 500, 200]


def test_interact_keeps_the_time_limit_of_the_environment():
    lengths = [len(one) for one in interact(gym.make("Taxi-v4"), 600, seed=0)]
    assert lengths == [200, 200, 200]


def test_interact_takes_every_action_about_equally_often():
    actions = np.concatenate([one.actions for one in interact(gym.make(LAKE), 4000, seed=0)])
    assert np.abs(np.bincount(actions, minlength=4) / 4000 - 0.25).max() < 0.03


def test_interact_follows_a_policy_counted_from_zero():
    class Right:
        def predict(self, observation, state=None, episode_start=None, deterministic=False):
            return np.array(1), state

    class Shifted(gym.ActionWrapper):
        action_space = spaces.Discrete(2, start=5)

        def action(self, action):
            assert action == 6
            return 2

    env = Shifted(gym.make(LAKE, is_slippery=False))
    (one,) = interact(env, 4, seed=0, policy=Right())
    assert one.observations.tolist() == [0, 1, 2, 3, 3] and one.actions.tolist() == [1, 1, 1, 1]


def test_interact_seeds_the_first_reset_only():
    assert [one.seed for one in interact(gym.make(LAKE), 30, seed=7)][:2] == [7, None]


def test_interact_refuses_continuous_actions():
    with pytest.raises(NotDiscrete, match="Box"):
        interact(gym.make("Pendulum-v1"), 10, seed=0)


@pytest.mark.parametrize(("steps", "seed"), [(0, 0), (10, -1)])
def test_interact_refuses_counts_that_mean_nothing(steps, seed):
    with pytest.raises(InvalidParameter):
        interact(gym.make(LAKE), steps, seed=seed)


class Raises(TableEnv):
    def step(self, action):
        raise RuntimeError("the floor is gone")


class OldStep(TableEnv):
    def step(self, action):
        return super().step(action)[:4]


class Nowhere(TableEnv):
    def reset(self, **kwargs):
        raise RuntimeError("nobody at home")


@pytest.mark.parametrize(("kind", "message"), [(Raises, "floor is gone"), (OldStep, "unpack"), (Nowhere, "nobody at home")])
def test_interaction_tells_an_error_of_the_environment_as_its_own(kind, message):
    with pytest.raises(NotTabular, match=rf"the environment raised \w+ \(.*{message}"):
        Interaction(steps=10).table(kind(both_ways(), [1, 0, 0]), 0.9)


def test_error_of_a_counted_table_covers_its_first_states():
    def starts(number):  # a state that is visited often, begun in by chance
        return [episode([k % 10, *[k % 10] * 999], [0] * 999, terminated=False) for k in range(number)]

    few, many = (counted(starts(n), 10, n_actions=1).table.evidence.error for n in (10, 200))
    assert few == pytest.approx(np.sqrt(np.log(2 * 10 / 0.05) / 20)) and many < few / 2


@pytest.mark.slow
def test_a_million_steps_of_frozen_lake_are_counted_in_350_yards():
    script = """
import time
import gymnasium as gym
from irl_gym.tables.counted.counting import Counting, Interaction, interact
from yardstick import yard
env, begin = gym.make("FrozenLake-v1"), time.process_time()
table = Counting().table(interact(env, 1_000_000, seed=0), env.observation_space, 4, gamma=0.99)
print((time.process_time() - begin) / yard(), table.mdp.n_states)
"""
    run = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True, cwd=Path(__file__).parents[2]
    )  # no annotations checked
    yards, states = run.stdout.split()
    assert float(yards) < 350 and states == "16"
