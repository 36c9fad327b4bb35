"""LearnedReward pays the learned reward and changes nothing else."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec
from tiny_env import TableEnv, both_ways

from irl_gym.environments.learned_reward import LearnedReward
from irl_gym.errors import InvalidFeatures, InvalidReward, NotDiscrete, UnknownObservation
from irl_gym.features.bases import RadialBasis
from irl_gym.features.feature_maps import Functions, OneHot, Unravel
from irl_gym.features.linear_reward import LinearReward
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.mdp.planning.dynamic_programming import policy_iteration
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.shaping import ShapedReward
from irl_gym.spaces.listed_states import ListedStates
from irl_gym.spaces.states import StateIndex
from irl_gym.tables.tabulate import tabulate

REWARD = TabularReward(np.arange(16, dtype=float))


def walk(env, n=60):
    """Observations, ends and rewards of a seeded walk."""
    rows = [env.reset(seed=3)[0]]
    env.action_space.seed(0)
    for _ in range(n):
        *row, info = env.step(env.action_space.sample())
        rows.append((*row, info.get("true_reward")))
        if row[2] or row[3]:
            rows.append(env.reset()[0])
    return rows


@pytest.fixture
def pair():
    return walk(gym.make("FrozenLake-v1")), walk(LearnedReward(gym.make("FrozenLake-v1"), REWARD))


def steps(rows):
    return [row for row in rows if isinstance(row, tuple)]


def test_everything_but_the_reward_is_unchanged(pair):
    plain, learned = map(steps, pair)
    assert [(o, te, tr) for o, _, te, tr, _ in plain] == [(o, te, tr) for o, _, te, tr, _ in learned]


def test_the_true_reward_is_in_info(pair):
    plain, learned = map(steps, pair)
    assert [row[1] for row in plain] == [row[4] for row in learned]


def test_a_state_reward_is_paid_on_arrival(pair):
    assert all(row[1] == row[0] for row in steps(pair[1]))


def test_a_step_reward_is_paid_for_state_and_action():
    values = np.random.default_rng(0).normal(size=(16, 4))
    env = LearnedReward(gym.make("FrozenLake-v1"), TabularReward(values))
    s, _ = env.reset(seed=0)
    assert env.step(2)[1] == values[s, 2]


def test_a_terminal_copy_gets_its_own_reward():
    env = TableEnv(both_ways(), [1, 0, 0])
    found = tabulate(env, gamma=0.9, check_steps=0)
    wrapped = LearnedReward(env, TabularReward(np.array([0.0, 1.0, 2.0, 7.0])), found.states)
    wrapped.reset(seed=0)
    assert wrapped.step(1)[1] == 7.0


def test_the_spec_of_a_wrapped_environment_makes_it_again(tmp_path):
    REWARD.save(tmp_path / "reward.npz")
    env = LearnedReward(gym.make("FrozenLake-v1"), str(tmp_path / "reward.npz"))
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert walk(again) == walk(env)


def test_the_spec_of_a_wrapped_environment_makes_it_again_with_a_reward_in_memory():
    env = LearnedReward(gym.make("FrozenLake-v1"), REWARD)
    assert walk(gym.make(env.spec)) == walk(env)


def test_an_array_is_a_reward():
    env = LearnedReward(gym.make("FrozenLake-v1"), REWARD.values)
    assert walk(env) == walk(LearnedReward(gym.make("FrozenLake-v1"), REWARD))


def test_a_reward_for_another_number_of_actions_is_refused():
    with pytest.raises(InvalidReward, match="2 actions"):
        LearnedReward(gym.make("FrozenLake-v1"), np.zeros((16, 2)))


def test_an_observation_outside_the_index_is_refused():
    states = ListedStates(spaces.Discrete(16), np.array([[0], [1], [5]]))
    env = LearnedReward(gym.make("FrozenLake-v1", is_slippery=False), TabularReward(np.zeros(3)), states)
    env.reset(seed=0)
    with pytest.raises(UnknownObservation, match="4"):
        env.step(1)


def test_a_reward_for_another_number_of_states_is_refused():
    with pytest.raises(InvalidReward, match="5 states"):
        LearnedReward(gym.make("FrozenLake-v1"), TabularReward(np.zeros(5)))


def test_a_continuous_environment_is_refused():
    with pytest.raises(NotDiscrete, match="floats"):
        LearnedReward(gym.make("CartPole-v1"), REWARD)


# --- rewards that are linear in features ---

CELLS = LinearReward(np.array([1.0, -2.0, 0.5, 3.0]), RadialBasis.grid([0, 0], [3, 3], 2, coordinates=Unravel((4, 4))))
UPRIGHT = LinearReward(np.array([-1.0, 2.0]), RadialBasis(np.array([[0.0] * 4, [1.0] * 4]), np.array([1.0, np.inf, 0.2, 1.0])))


def test_a_linear_reward_of_a_box_is_paid_on_arrival():
    rows = walk(LearnedReward(gym.make("CartPole-v1"), UPRIGHT))
    arrivals = np.array([row[0] for row in steps(rows)])
    np.testing.assert_allclose([row[1] for row in steps(rows)], UPRIGHT.features(arrivals) @ UPRIGHT.alpha)


def test_a_linear_reward_is_paid_on_the_arrival_that_terminates():
    (end, *_) = [row for row in steps(walk(LearnedReward(gym.make("CartPole-v1"), UPRIGHT))) if row[2]]
    assert end[1] == pytest.approx(UPRIGHT.of(end[0][None])[0]) and end[4] == 1.0


def test_a_linear_reward_is_of_the_observations_of_a_discrete_space():
    rows = steps(walk(LearnedReward(gym.make("FrozenLake-v1"), CELLS)))
    np.testing.assert_allclose([row[1] for row in rows], CELLS.of(np.array([row[0] for row in rows])))


class Parts(gym.Env):
    """Shows a number and a point, in a dict or in a tuple; always the same after a step."""

    action_space, observation_space = spaces.Discrete(2), spaces.Discrete(1)

    def __init__(self, show):
        self.show = show

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return self.show(0, np.zeros(2)), {}

    def step(self, action):
        return self.show(2, np.array([0.25, 0.5])), 0.0, False, False, {}


@pytest.mark.parametrize("show", [lambda a, b: {"a": a, "b": b}, lambda a, b: (a, b)], ids=["dict", "tuple"])
def test_a_linear_reward_of_dicts_and_tuples_takes_them(show):
    phi = Functions(lambda batch: np.column_stack(list(batch.values()) if isinstance(batch, dict) else batch), 3)
    env = LearnedReward(Parts(show), LinearReward(np.array([1.0, 2.0, 4.0]), phi))
    env.reset(seed=0)
    assert env.step(0)[1] == 4.5


def test_a_linear_reward_is_of_rows_when_states_are_given():
    table = TableEnv(both_ways(), [1, 0, 0])
    found = tabulate(table, gamma=0.9, check_steps=0)
    env = LearnedReward(table, LinearReward(np.array([0.0, 1.0, 2.0, 7.0]), OneHot(4)), found.states)
    env.reset(seed=0)
    assert env.step(1)[1] == 7.0  # the terminal copy, which no observation tells from state 1


def test_a_linear_reward_of_states_is_what_its_table_is():
    states = StateIndex(spaces.Discrete(16))
    learned = (LearnedReward(gym.make("FrozenLake-v1"), r, states) for r in (CELLS, CELLS.tabular(states)))
    linear, table = ([row[1] for row in steps(walk(env))] for env in learned)
    np.testing.assert_allclose(linear, table, atol=1e-15)


def test_a_linear_reward_is_read_from_a_path(tmp_path):
    UPRIGHT.save(tmp_path / "reward.npz")
    env = LearnedReward(gym.make("CartPole-v1"), tmp_path / "reward.npz")
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert repr(walk(again)) == repr(walk(env)) == repr(walk(LearnedReward(gym.make("CartPole-v1"), UPRIGHT)))


def test_a_linear_reward_of_other_observations_is_refused_when_it_is_paid():
    env = LearnedReward(gym.make("CartPole-v1"), CELLS)
    env.reset(seed=0)
    with pytest.raises(InvalidFeatures, match="these features are of integers"):
        env.step(0)


@pytest.mark.parametrize("states", [None, StateIndex(spaces.Discrete(16))])
def test_tabulate_gives_the_linear_reward_that_is_paid(states):
    found = tabulate(LearnedReward(gym.make("FrozenLake-v1"), CELLS, states), gamma=0.99)
    np.testing.assert_allclose(found.reward.values, CELLS.tabular(16).expected(found.mdp), atol=1e-12)


def test_tabulate_gives_a_linear_reward_of_rows_its_terminal_copies():
    table = TableEnv(both_ways(), [1, 0, 0])
    plain = tabulate(table, gamma=0.9, check_steps=0)
    reward = LinearReward(np.array([0.0, 1.0, 2.0, 7.0]), OneHot(4))
    found = tabulate(LearnedReward(table, reward, plain.states), gamma=0.9, check_steps=0)
    np.testing.assert_allclose(found.reward.values, reward.tabular(4).expected(plain.mdp), atol=1e-12)


# --- shaping ---

LAKE = {"is_slippery": False, "max_episode_steps": 9}


@pytest.fixture(scope="module")
def lake():
    return tabulate(gym.make("FrozenLake-v1", **LAKE), gamma=0.9)


@pytest.fixture(scope="module")
def outcome(lake):
    return FiniteLP().fit(lake.mdp, policy_iteration(lake.mdp, lake.reward).policy)


def test_shaping_pays_the_expected_advantage(lake, outcome):
    env = LearnedReward(gym.make("FrozenLake-v1", **LAKE), outcome, shaping=lake)
    expected = ShapedReward.of(outcome.reward, lake.mdp).values
    at, _ = env.reset(seed=0)
    for action in (2, 0, 1, 1, 2):
        following, paid, *_ = env.step(action)
        assert paid == expected[at, action]
        at = following


def test_shaping_keeps_what_the_reward_itself_pays_in_info(lake, outcome):
    env = LearnedReward(gym.make("FrozenLake-v1", **LAKE), outcome, shaping=lake)
    env.reset(seed=0)
    following, *_, info = env.step(1)
    assert (info["learned_reward"], info["true_reward"]) == (outcome.reward.values[following], 0.0)


def test_without_shaping_an_outcome_pays_its_reward_as_it_is(outcome):
    made = [LearnedReward(gym.make("FrozenLake-v1"), one) for one in (outcome, outcome.reward)]
    assert walk(made[0]) == walk(made[1])


def test_a_bare_mdp_shapes_as_its_table_does(lake, outcome):
    made = [LearnedReward(gym.make("FrozenLake-v1", **LAKE), outcome, shaping=one) for one in (lake.mdp, lake)]
    assert walk(made[0]) == walk(made[1])


def test_a_shaped_reward_of_a_file_is_paid(lake, outcome, tmp_path):
    ShapedReward.of(outcome.reward, lake.mdp).save(tmp_path / "shaped.npz")
    made = [LearnedReward(gym.make("FrozenLake-v1", **LAKE), tmp_path / "shaped.npz"),
            LearnedReward(gym.make("FrozenLake-v1", **LAKE), outcome, shaping=lake)]  # fmt: skip
    assert walk(made[0]) == walk(made[1])


def test_a_linear_reward_is_shaped_as_its_table(lake):
    made = [LearnedReward(gym.make("FrozenLake-v1", **LAKE), one, shaping=lake) for one in (CELLS, CELLS.tabular(lake.states))]
    assert walk(made[0]) == walk(made[1])


def test_shaping_numbers_terminal_copies_by_the_table():
    env = TableEnv(both_ways(), [1, 0, 0])
    found = tabulate(env, gamma=0.9, check_steps=0)
    wrapped = LearnedReward(env, TabularReward(np.array([0.0, 1.0, 2.0, 7.0])), shaping=found)
    wrapped.reset(seed=0)
    assert wrapped.step(1)[-1]["learned_reward"] == 7.0


def test_a_table_of_another_environment_is_refused(lake, outcome):
    with pytest.raises(InvalidReward, match=r"Discrete\(16\).*Discrete\(48\)"):
        LearnedReward(gym.make("CliffWalking-v1"), outcome, shaping=lake)
