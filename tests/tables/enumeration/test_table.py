"""Enumeration finds the tables that are known, and some that nobody has published."""

import gymnasium as gym
import jaxtyping
import numpy as np
import pytest
from enumeration_envs import Corridor, Lamps
from gymnasium import spaces
from gymnasium.envs.toy_text.blackjack import BlackjackEnv

from irl_gym.environments.reveal import Reveal
from irl_gym.errors import HiddenState, InvalidParameter
from irl_gym.mdp.planning.dynamic_programming import policy_iteration
from irl_gym.tables.blackjack import blackjack_table
from irl_gym.tables.enumeration.table import Enumeration
from irl_gym.tables.published_table import published_table
from irl_gym.tables.tabulate import tabulate

pytestmark = pytest.mark.usefixtures("unchecked")  # annotations are checked a million times here, and in the other files

PUBLISHED = {
    "FrozenLake 4x4": ("FrozenLake-v1", {"is_slippery": False}),
    "FrozenLake 4x4 slippery": ("FrozenLake-v1", {}),
    "FrozenLake 8x8": ("FrozenLake-v1", {"map_name": "8x8", "is_slippery": False}),
    "FrozenLake 8x8 slippery": ("FrozenLake-v1", {"map_name": "8x8"}),
    "CliffWalking": ("CliffWalking-v1", {}),
    "CliffWalking slippery": ("CliffWalkingSlippery-v1", {}),
    "Taxi": ("Taxi-v4", {}),
    "rainy Taxi": ("Taxi-v4", {"is_rainy": True}),
    "GridWorld": ("irl_gym_envs:irl_gym/GridWorld-v0", {}),
    "FourRooms": ("irl_gym_envs:irl_gym/FourRooms-v0", {}),
}


def table_of(env, **limits):
    return Enumeration(**limits).table(env, 0.99)


def assert_same_mdp(found, known, rounding=1e-15):
    """The same states, support, probabilities, first states and rewards, on what is reachable."""
    reachable = np.flatnonzero(known.mdp.reachable)
    part = known.mdp.restrict(reachable)
    terminal = found.mdp.terminal
    rows = [known.states.encode(found.states.decode(i), terminated=bool(terminal[i])) for i in range(found.mdp.n_states)]
    assert sorted(rows) == reachable.tolist()
    order = np.argsort(rows)
    same = found.mdp.restrict(order)
    assert np.array_equal(same.P.indptr, part.P.indptr) and np.array_equal(same.P.indices, part.P.indices)
    assert np.abs(same.P.data - part.P.data).max() < rounding
    assert np.abs(same.d0 - part.d0).max() < 1e-15
    assert found.reward.values[order] == pytest.approx(known.reward.values[reachable], rel=1e-15, abs=100 * rounding)
    assert np.array_equal(same.terminal, part.terminal)


@pytest.mark.parametrize("name", PUBLISHED)
def test_enumeration_finds_the_table_that_an_environment_publishes(name):
    env_id, kwargs = PUBLISHED[name]
    env = gym.make(env_id, **kwargs)
    known = published_table(env, 0.99)
    assert known is not None
    # Ours draw from sums over many rows of their table: their rounding is that of numbers as large as the number of rows.
    seen = {"revisits": 0} if env_id == "Taxi-v4" else {}  # what is hidden is looked for in smaller ones
    assert_same_mdp(table_of(env, **seen), known, 1e-13 if "irl_gym" in env_id else 1e-15)


def test_enumeration_of_draws_is_exact_and_says_so():
    evidence = table_of(gym.make("FrozenLake-v1")).evidence
    assert evidence.exact and evidence.error == 0 and "every outcome of its draws" in evidence.method


def test_enumeration_leaves_the_environment_as_it_is():
    env = gym.make("FrozenLake-v1")
    env.reset(seed=3)
    before = env.unwrapped.s, env.unwrapped.np_random.bit_generator.state
    table_of(env)
    assert (env.unwrapped.s, env.unwrapped.np_random.bit_generator.state) == before


class Dealt(gym.ObservationWrapper):
    """Begins with 16 against a 10, and shows the dealer's other card too."""

    def __init__(self, env):
        super().__init__(env)
        self.observation_space = spaces.Tuple([*env.observation_space.spaces, spaces.Discrete(11)])

    def reset(self, *, seed=None, options=None):
        self.env.reset(seed=seed)
        base = self.env.unwrapped
        base.player, base.dealer = [10, 6], [10, base.dealer[1]]
        return self.observation(base._get_obs()), {}

    def observation(self, observation):
        return (*observation, self.env.unwrapped.dealer[1])


def test_enumeration_of_blackjack_with_the_dealer_shown_agrees_with_the_table_of_its_deck():
    known = blackjack_table(gym.make("Blackjack-v1", sab=False, natural=False), 0.99)
    assert known is not None
    found = table_of(Dealt(BlackjackEnv(sab=False, natural=False)), revisits=0)
    rows = [found.states.encode((16, 10, 0, card)) for card in range(1, 11)]  # resets are counted: four cards and a suit
    chances = np.array([1 / 13] * 9 + [4 / 13])
    row = known.states.encode((16, 10, 0))
    assert chances @ found.reward.values[rows] == pytest.approx(known.reward.values[row], abs=1e-12)


def test_enumeration_of_fickle_taxi_says_what_to_reveal():
    with pytest.raises(HiddenState, match=r"hides part of the state.*fickle_step: True against False.*Reveal\(env\)"):
        table_of(gym.make("Taxi-v4", fickle_passenger=True))


@pytest.fixture(scope="module")
def fickle():
    jaxtyping.config.update("jaxtyping_disable", True)
    env = Reveal(gym.make("Taxi-v4", fickle_passenger=True))
    return env, table_of(env, revisits=0)


@pytest.mark.slow
def test_nothing_is_hidden_in_the_revealed_fickle_taxi(fickle):
    env, table = fickle
    assert np.array_equal(table_of(env).mdp.P.data, table.mdp.P.data)


def test_enumeration_of_revealed_fickle_taxi_has_the_change_of_mind(fickle):
    """One row by hand: with the passenger aboard, a first move changes the destination to one of the other three."""
    env, table = fickle
    base = env.unwrapped
    row = table.states.encode({"observation": base.encode(0, 0, 4, 1), "fickle_step": 1})
    successors = table.mdp.P[[row * 6]].toarray()[0]  # action 0: south
    seen = {table.states.decode(s)["observation"]: p for s, p in enumerate(successors) if p}
    assert seen == pytest.approx({base.encode(1, 0, 4, goal): 1 / 3 for goal in (0, 2, 3)}, abs=1e-15)


def test_enumeration_of_revealed_fickle_taxi_has_the_chance_of_a_fickle_passenger(fickle):
    _, table = fickle
    starts = np.flatnonzero(table.mdp.d0)
    fickle_starts = [row for row in starts if table.states.decode(row)["fickle_step"]]
    assert table.mdp.d0[fickle_starts].sum() == pytest.approx(0.3, abs=1e-12)


def test_enumeration_of_revealed_fickle_taxi_predicts_what_its_optimal_policy_earns(fickle):
    env, table = fickle
    optimum = policy_iteration(table.mdp, table.reward.values)
    returns = []
    for episode in range(1000):
        observation, _ = env.reset(seed=episode)
        total, weight, ended, truncated = 0.0, 1.0, False, False
        while not (ended or truncated):
            action = int(optimum.policy[table.states.encode(observation)])
            observation, reward, ended, truncated, _ = env.step(action)
            total, weight = total + weight * reward, weight * 0.99
        assert ended
        returns.append(total)
    assert abs(np.mean(returns) - table.mdp.d0 @ optimum.V) < 3.5 * np.std(returns) / np.sqrt(len(returns))


def test_enumeration_of_a_users_own_environment_is_right_by_hand():
    table = tabulate(Lamps(), gamma=0.9, check_steps=2000)
    row = table.states.encode((1, np.array([0, 1], dtype=np.int8)))
    successors = table.mdp.P[[row * 2 + 1]].toarray()[0]
    on = table.states.encode((1, np.array([1, 1], dtype=np.int8)), terminated=True)
    assert successors[on] == 0.75 and successors[row] == 0.25 and table.reward.values[row, 1] == 0.75


def test_enumeration_of_a_users_own_environment_finds_every_state():
    assert table_of(Lamps()).mdp.n_states == 3 * 3 + 2  # three places with up to one lamp; two in which the second went on


class TwoEnds(Corridor):
    """The last cell is an end by a step to the right, and a cell like others by a jump of action 2."""

    def __init__(self):
        super().__init__()
        self.action_space = spaces.Discrete(3, start=4)

    def step(self, action):
        if action < 6:
            return self.moved(int(action) - 4)
        self.cell = self.n - 1
        return self.cell, 0.5, False, False, {}


def test_enumeration_splits_a_state_that_is_an_end_and_none():
    table = table_of(TwoEnds())
    assert table.mdp.n_states == 8 and table.states.terminal_copies == {6: 7} and table.evidence.split == 1


def test_enumeration_counts_actions_from_0_wherever_they_start():
    table = table_of(TwoEnds())
    assert table.mdp.P[[3 * 3 + 2]].toarray()[0, 6] == 1 and table.reward.values[3].tolist() == [0, 0, 0.5]


@pytest.mark.parametrize(("task", "states"), [("Empty-5x5", 8 * 4 + 2), ("DoorKey-5x5", 270)])
def test_enumeration_of_mini_grid_finds_as_many_states_as_ever(task, states):
    table = tabulate(gym.make("irl_gym_envs:irl_gym/MiniGrid-v0", task=task), gamma=0.99, check_steps=2000)
    assert table.mdp.n_states == states


@pytest.mark.slow
@pytest.mark.parametrize("task", ["FourRooms", "DoorKey-6x6"])
def test_enumeration_of_larger_mini_grids_is_not_contradicted_by_steps(task):
    table = tabulate(gym.make("irl_gym_envs:irl_gym/MiniGrid-v0", task=task), gamma=0.99, check_steps=10_000)
    assert table.evidence.check.steps == 10_000


def test_enumeration_of_mini_grids_own_environment_names_its_step_count():
    wrappers = pytest.importorskip("minigrid.wrappers")
    with pytest.raises(HiddenState, match="step_count"):
        table_of(wrappers.ImgObsWrapper(wrappers.FullyObsWrapper(gym.make("MiniGrid-Empty-5x5-v0"))))


def test_enumeration_refuses_a_checkpoint_that_is_no_path():
    with pytest.raises(InvalidParameter, match="checkpoint is 3: expected the path of a file"):
        Enumeration(checkpoint=3)  # pyright: ignore


def test_enumeration_refuses_a_checkpoint_in_a_folder_that_is_not_there(tmp_path):
    with pytest.raises(InvalidParameter, match="expected a file in a folder that exists"):
        table_of(Corridor(), checkpoint=tmp_path / "none" / "search.npz")
