import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers import RecordEpisodeStatistics, TimeLimit
from tiny_env import TableEnv, both_ways, coin

from irl_gym.environments.learned_reward import LearnedReward
from irl_gym.errors import (
    InvalidDiscount,
    InvalidMDP,
    InvalidParameter,
    InvalidReward,
    NotDiscrete,
    NotTabular,
    UnknownEnvironment,
)
from irl_gym.mdp.planning.dynamic_programming import policy_iteration
from irl_gym.tables.tabulate import make, tabulate


def table_of(env, **kwargs):
    return tabulate(env, gamma=0.9, check_steps=0, **kwargs)


@pytest.mark.parametrize(
    ("name", "size"),
    [
        ("FrozenLake 4x4 slippery", (16, 4)),
        ("FrozenLake 4x4", (16, 4)),
        ("FrozenLake 8x8 slippery", (64, 4)),
        ("FrozenLake 8x8", (64, 4)),
        ("CliffWalking", (48, 4)),
        ("CliffWalking slippery", (48, 4)),
        ("Taxi", (500, 6)),
    ],
)
def test_tabulate_gives_gymnasium_tables_their_size(toy_text, name, size):
    mdp = toy_text(name).mdp
    assert (mdp.n_states, mdp.n_actions) == size


@pytest.mark.parametrize(
    ("name", "terminal"),
    [("FrozenLake 4x4 slippery", [5, 7, 11, 12, 15]), ("CliffWalking", [47]), ("CliffWalking slippery", [47])],
)
def test_tabulate_makes_states_terminal_that_end_episodes(toy_text, name, terminal):
    assert np.flatnonzero(toy_text(name).mdp.terminal).tolist() == terminal


def test_tabulate_makes_the_four_delivered_states_of_taxi_terminal(toy_text):
    table = toy_text("Taxi")
    decode = gym.make("Taxi-v4").unwrapped.decode
    delivered = [tuple(int(part) for part in decode(s)) for s in np.flatnonzero(table.mdp.terminal)]
    assert delivered == [(0, 0, 0, 0), (0, 4, 1, 1), (4, 0, 2, 2), (4, 3, 3, 3)]


def test_tabulate_splits_no_state_of_taxi(toy_text):
    assert toy_text("Taxi").evidence.split == 0


@pytest.mark.parametrize(("name", "merged"), [("FrozenLake 4x4 slippery", True), ("FrozenLake 4x4", False)])
def test_tabulate_counts_successors_that_stood_twice(toy_text, name, merged):
    assert (toy_text(name).evidence.merged > 0) == merged


def test_tabulate_adds_up_duplicate_successors(toy_text):
    corner = toy_text("FrozenLake 4x4 slippery").mdp.P[[0]].todense().ravel()  # left of the corner: the wall, twice
    assert corner[0] == pytest.approx(2 / 3) and corner[4] == pytest.approx(1 / 3)


def test_tabulate_averages_the_reward_over_successors():
    table = table_of(TableEnv(coin(0.25, win=4.0, lose=-1.0), [1, 0]))
    assert table.reward.values[0, 0] == pytest.approx(0.25 * 4 - 0.75)


def test_tabulate_knows_how_far_a_reward_strays_from_its_mean():
    table = table_of(TableEnv(coin(0.25, win=4.0, lose=0.0), [1, 0]))
    assert table.payments.deviation[0, 0] == pytest.approx(4 * np.sqrt(0.25 * 0.75))


def test_tabulate_pays_nothing_in_terminal_states(toy_text):
    table = toy_text("Taxi")
    assert (table.reward.values[table.mdp.terminal] == 0).all()


def test_tabulate_starts_where_the_environment_does(toy_text):
    np.testing.assert_array_equal(toy_text("Taxi").mdp.d0, gym.make("Taxi-v4").unwrapped.initial_state_distrib)


def test_tabulate_leaves_out_lines_without_probability():
    P = coin()
    P[0][0].append((0.0, 1, 99.0, False))
    assert table_of(TableEnv(P, [1, 0])).evidence.split == 0


def test_tabulate_splits_a_state_entered_both_ways():
    table = table_of(TableEnv(both_ways(), [1, 0, 0]))
    assert table.evidence.split == 1 and np.flatnonzero(table.mdp.terminal).tolist() == [2, 3]


def test_tabulate_gives_a_split_state_two_rows():
    states = table_of(TableEnv(both_ways(), [1, 0, 0])).states
    assert (states.encode(1), states.encode(1, terminated=True), states.decode(3)) == (1, 3, 1)


def test_tabulate_values_a_split_state_by_the_way_it_was_entered():
    table = table_of(TableEnv(both_ways(), [1, 0, 0]))
    solution = policy_iteration(table.mdp, table.reward.values)
    np.testing.assert_allclose(solution.V, [5.0, 0.9 * 5, 0, 0])  # end at once with 5; from 1 back to 0 rather than end with 2


def test_tabulate_checks_a_split_state_against_steps():
    assert tabulate(TableEnv(both_ways(), [1, 0, 0]), gamma=0.9, check_steps=500).evidence.check.steps == 500


def test_tabulate_reads_a_custom_map():
    env = gym.make("FrozenLake-v1", desc=["SFH", "FFG"], is_slippery=False)
    mdp = table_of(env).mdp
    assert mdp.n_states == 6 and np.flatnonzero(mdp.terminal).tolist() == [2, 5]


def test_tabulate_reads_a_rainy_taxi():
    evidence = tabulate(gym.make("Taxi-v4", is_rainy=True), gamma=0.9).evidence
    assert evidence.merged > 0 and evidence.check.p_value > 1e-6


@pytest.mark.parametrize("env_id", ["FrozenLake-v1", "CliffWalking-v1", "CliffWalkingSlippery-v1", "Taxi-v4"])
def test_tabulate_agrees_with_the_steps_of_gymnasium(env_id):
    check = tabulate(gym.make(env_id), gamma=0.9, check_steps=5000, seed=1).evidence.check
    assert check.steps == 5000 and check.p_value > 1e-6


@pytest.mark.parametrize("wrap", [RecordEpisodeStatistics, lambda env: TimeLimit(env, 1)])
def test_tabulate_looks_through_wrappers(wrap):
    plain, wrapped = table_of(TableEnv(coin(), [1, 0])), table_of(wrap(TableEnv(coin(), [1, 0])))
    assert (plain.mdp.P != wrapped.mdp.P).nnz == 0 and (plain.reward.values == wrapped.reward.values).all()


@pytest.mark.parametrize("steps", [-1, 1.5, float("nan"), "10"])
def test_tabulate_refuses_a_number_of_steps_that_is_none(steps, unchecked):
    with pytest.raises(InvalidParameter, match="check_steps is"):
        tabulate(TableEnv(coin(), [1, 0]), gamma=0.9, check_steps=steps)


def test_tabulate_takes_a_seed_of_numpy(unchecked):
    assert tabulate(TableEnv(coin(), [1, 0]), gamma=0.9, seed=np.int64(3)).evidence.check is not None


def test_tabulate_gives_the_reward_that_a_wrapper_pays():
    learned = np.array([3.0, 5.0])
    found = tabulate(TimeLimit(LearnedReward(TableEnv(coin(), [1, 0]), learned), 9), gamma=0.9)
    np.testing.assert_allclose(found.reward.values, [[4.0], [0.0]])


def test_tabulate_refuses_a_learned_reward_that_does_not_know_the_copies():
    env = TableEnv(both_ways(), [1, 0, 0])
    with pytest.raises(InvalidReward, match=r"has 3 states: expected 4"):
        tabulate(LearnedReward(env, np.zeros(3)), gamma=0.9)


@pytest.mark.parametrize("wrong", ["FrozenLake-v1", None])
def test_tabulate_refuses_what_is_no_environment(wrong, unchecked):
    with pytest.raises(InvalidParameter, match="expected an environment"):
        tabulate(wrong, gamma=0.9)


def test_tabulate_refuses_a_state_without_lines_where_episodes_come():
    with pytest.raises(NotTabular, match=r"no line for \(s=0, a=0\)"):
        table_of(TableEnv([[[]], [[(1.0, 1, 0.0, True)]]], [1, 0]))


def test_tabulate_lets_terminal_states_be_without_lines():
    found = table_of(TableEnv([[[(1.0, 1, 1.0, True)]], [[]]], [1, 0]))
    assert found.mdp.terminal.tolist() == [False, True]


@pytest.mark.parametrize("start", [[1.0], [1.0, 0, 0]])
def test_tabulate_refuses_a_start_of_another_length(start):
    with pytest.raises(InvalidMDP, match="initial_state_distrib has shape"):
        table_of(TableEnv(coin(), start, truth_start=[1, 0]))


def test_tabulate_leaves_the_environment_as_it_was():
    env = gym.make("FrozenLake-v1")
    env.reset(seed=3)
    before = (env.unwrapped.s, env.unwrapped.np_random.bit_generator.state)
    tabulate(env, gamma=0.9, check_steps=100)
    assert (env.unwrapped.s, env.unwrapped.np_random.bit_generator.state) == before


@pytest.mark.parametrize("gamma", [0.0, 1.0, 2.0])
def test_tabulate_refuses_a_discount_outside_0_and_1(gamma):
    with pytest.raises(InvalidDiscount, match=f"gamma is {gamma}"):
        tabulate(TableEnv(coin(), [1, 0]), gamma=gamma)


@pytest.mark.parametrize(("env_id", "offender"), [("MountainCarContinuous-v0", "action space"), ("CartPole-v1", "Box")])
def test_tabulate_refuses_a_continuous_space(env_id, offender):
    with pytest.raises(NotDiscrete, match=offender):
        table_of(gym.make(env_id))


def test_tabulate_says_what_is_missing():
    with pytest.raises(NotTabular, match="Reveal"):
        table_of(gym.make("Blackjack-v1"))


@pytest.mark.parametrize(
    ("env_id", "closest"),
    [("FrozenLak-v1", "FrozenLake-v1"), ("Taxi-v99", "Taxi-v4"), ("CliffWalkin-v1", "CliffWalking-v1")],
)
def test_make_offers_the_closest_names_when_an_id_is_unknown(env_id, closest):
    with pytest.raises(UnknownEnvironment, match=f"environment '{env_id}' is not registered.*closest are .*{closest}"):
        make(env_id)


@pytest.mark.filterwarnings("ignore:.*out of date:DeprecationWarning")
def test_make_offers_the_newer_version_when_an_id_is_deprecated():
    with pytest.raises(UnknownEnvironment, match=r"FrozenLake-v0.*closest are .*FrozenLake-v1"):
        make("FrozenLake-v0")


def test_make_refuses_a_module_that_does_not_exist():
    with pytest.raises(UnknownEnvironment, match="no_such_module:Foo-v0"):
        make("no_such_module:Foo-v0")


def test_make_passes_arguments_on():
    assert make("FrozenLake-v1", map_name="8x8").observation_space.n == 64


def test_make_refuses_text_where_true_or_false_is_expected():
    with pytest.raises(InvalidParameter, match=r"is_slippery is 'flase': expected true or false"):
        make("FrozenLake-v1", is_slippery="flase")


def test_make_lists_the_arguments_when_one_is_unknown():
    with pytest.raises(InvalidParameter, match=r"takes no argument 'fickle'.*fickle_passenger"):
        make("Taxi-v4", fickle=True)
