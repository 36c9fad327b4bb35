"""The mends that errors about environments name are executed: what stands between backquotes is evaluated, and serves."""

import re
import threading

import gymnasium
import numpy as np
import pytest
from enumeration_envs import Corridor, Shows
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec
from gymnasium.wrappers import StickyAction
from mended import GAMMA, SHOWN, done, error_of, mends, revealed

from irl_gym.demonstrations.minari_files import identity
from irl_gym.environments.reveal import Reveal
from irl_gym.environments.seeded_starts import SeededStarts
from irl_gym.errors import (
    EnvironmentFailed,
    HiddenState,
    InvalidMDP,
    InvalidParameter,
    InvalidPolicy,
    NotCopied,
    NotDiscrete,
    NotTabular,
)
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.loop.world_choice import place_of
from irl_gym.mdp.policies import as_distribution
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.runs.experiment import Experiment
from irl_gym.tables.counted.counting import Interaction
from irl_gym.tables.enumeration.table import Enumeration
from irl_gym.tables.tabulate import make, tabulate

pytestmark = pytest.mark.usefixtures("unchecked")
# --- what is hidden ---


class Goal(Corridor):
    """A goal that each reset draws, of which nothing is shown; a step draws nothing."""

    def reset(self, *, seed=None, options=None):
        result = super().reset(seed=seed)
        self.goal_xy = (0, int(self.np_random.integers(4, 7)))
        return result

    def step(self, action):
        observation, _, done_, *rest = self.moved(int(action))
        return observation, float(observation == self.goal_xy[1]), done_, *rest


def test_a_goal_that_resets_draw_is_sent_to_seeded_starts_first():
    env = Goal()
    message = error_of(env, HiddenState)
    assert "goal_xy[1]: " in message and mends(message)[0].startswith("irl_gym.environments.seeded_starts.SeededStarts")
    assert "no step changes it: fix what they draw, with `" in message and "; or show it in the observation, with `" in message
    table = tabulate(done(mends(message)[0], env), gamma=GAMMA)
    assert table.evidence.exact and table.mdp.n_states == 7


def test_a_goal_that_resets_draw_can_be_revealed_as_the_error_spells_it():
    table = tabulate(revealed(Goal()), gamma=GAMMA)
    assert table.evidence.exact and table.mdp.n_states > 7


class Cached(Corridor):
    """A flag that matters, behind a memo of what was computed."""

    def __init__(self):
        super().__init__()
        self.memo, self.seen, self.flag = {}, [], False

    def reset(self, *, seed=None, options=None):
        self.flag = False
        return super().reset(seed=seed)

    def step(self, action):
        for k in range(44):
            self.memo[self.cell, k] = k
        self.seen.append(action)
        observation, reward, *rest = self.moved(int(action))
        self.flag = self.flag or self.cell == 0
        return observation, reward + self.flag, *rest


def test_a_difference_that_matters_is_not_buried_under_memos():
    message = error_of(Cached(), HiddenState)
    assert re.search(r"Inside, the environment differs in flag: \w+ against \w+ \(\d+ other parts differ, which by", message)
    assert mends(message)[0] == "irl_gym.environments.reveal.Reveal(env, {'flag': 2})"


def test_a_difference_behind_memos_can_be_revealed():
    assert tabulate(revealed(Cached()), gamma=GAMMA).evidence.exact


def test_sticky_actions_are_revealed_though_the_first_is_none():
    table = tabulate(revealed(StickyAction(Corridor(), 0.25)), gamma=GAMMA)
    assert table.evidence.exact


class Clocked(Corridor):
    """Pays in the first steps of an episode only."""

    steps = 0

    def reset(self, *, seed=None, options=None):
        self.steps = 0
        return super().reset(seed=seed)

    def step(self, action):
        self.steps = min(self.steps + 1, 5)
        observation, _, *rest = self.moved(int(action))
        return observation, float(self.steps < 5), *rest


def test_a_counter_can_be_revealed_or_counted_on_average():
    env = Clocked()
    message = error_of(env, HiddenState)
    assert (
        "Show what is hidden in the observation, with `" in message and "; or count what happens on average, with `" in message
    )
    assert tabulate(revealed(env), gamma=GAMMA).evidence.exact
    assert not done(mends(message)[-1], env).evidence.exact


class Drifts(Corridor):
    """A number that steps change, and no integer."""

    def reset(self, *, seed=None, options=None):
        self.drift = 0.0
        return super().reset(seed=seed)

    def step(self, action):
        self.drift = min(self.drift + 0.25, 1.0)
        observation, reward, *rest = self.moved(int(action))
        return observation, reward + (self.drift > 0.6), *rest


def test_a_hidden_float_is_counted_on_average():
    env = Drifts()
    message = error_of(env, HiddenState)
    assert "drift: " in message and not done(mends(message)[-1], env).evidence.exact
    assert "give the environment an integer attribute that says it, and name that, as in `" in message


class Quartered(Drifts):
    """The same, with an integer that says it."""

    @property
    def quarters(self):
        return int(4 * self.drift)


def test_a_hidden_float_is_revealed_by_an_integer_that_says_it():
    assert tabulate(Reveal(Quartered(), {"quarters": 5}), gamma=GAMMA, check_steps=500).evidence.exact


class Cells(gymnasium.ObservationWrapper):
    """MountainCar, seen in 20 x 20 cells."""

    def __init__(self):
        super().__init__(gymnasium.make("MountainCar-v0"))
        self.observation_space = spaces.MultiDiscrete([20, 20])

    def observation(self, observation):
        return np.clip((observation + np.array([1.2, 0.07])) / [1.8, 0.14] * 20, 0, 19).astype(np.int64)


def test_a_continuous_state_that_cells_hide_is_sent_to_cells_of_its_own():
    env = Cells()
    message = error_of(env, HiddenState, by=Enumeration(start_runs=300, runs=50))
    assert "Make cells of the state itself, with `" in message and done(mends(message)[0], env).mdp.n_states >= 400


# --- generators, constructors, rows ---


class Renewing(Corridor):
    """Makes a new generator at each reset."""

    def reset(self, *, seed=None, options=None):
        self.rng = np.random.default_rng(seed)
        return super().reset(seed=seed)

    def step(self, action):
        return self.moved(int(action) if self.rng.random() < 0.8 else 1 - int(action))


def test_an_environment_that_makes_new_generators_is_counted():
    env = Renewing()
    assert done(mends(error_of(env, NotTabular))[0], env).mdp.n_states == 7


def test_a_value_that_a_constructor_does_not_know_is_told_with_those_it_knows():
    with pytest.raises(InvalidParameter, match=r"map_name is '9x9', which FrozenLake-v1 does not know: expected") as caught:
        make("FrozenLake-v1", map_name="9x9")
    for name in re.search(r"one of (.*)\.", str(caught.value))[1].split(", "):
        make("FrozenLake-v1", map_name=name).close()


def test_an_argument_that_is_spelled_out_or_left_out_is_the_same_environment():
    specs = [gymnasium.make("FrozenLake-v1", **given).spec for given in ({}, {"is_slippery": True}, {"map_name": "4x4"})]
    other = gymnasium.make("FrozenLake-v1", is_slippery=False).spec
    assert identity(specs[0]) == identity(specs[1]) == identity(specs[2]) != identity(other)


def test_an_argument_that_is_not_a_number_is_the_same_argument():
    spec = gymnasium.make("FrozenLake-v1").spec
    spec.kwargs["success_rate"] = np.nan
    assert identity(spec) == identity(EnvSpec.from_json(spec.to_json())) != identity(gymnasium.spec("FrozenLake-v1"))


THIRDS = np.full((3, 3), np.float32(1 / 3))


@pytest.mark.parametrize("P", [THIRDS, THIRDS.astype(np.float64)], ids=["float32", "as float64"])
def test_rows_of_single_precision_are_taken_and_sum_to_1(P):
    mdp = TabularMDP(P, GAMMA, np.full(3, np.float32(1 / 3)))
    assert np.abs(mdp.P.sum(axis=1) - 1).max() < 1e-15 and abs(mdp.d0.sum() - 1) < 1e-15


def test_rows_of_a_policy_of_single_precision_are_taken():
    assert np.abs(as_distribution(THIRDS, 3, 3).sum(axis=1) - 1).max() < 1e-15


def test_a_published_table_of_single_precision_is_taken_and_its_evidence_says_so():
    env = gymnasium.make("FrozenLake-v1")
    base = env.unwrapped
    base.P = {s: {a: [(np.float32(p), *rest) for p, *rest in base.P[s][a]] for a in base.P[s]} for s in base.P}
    table = tabulate(env, gamma=GAMMA)
    assert "Rows of single precision, which summed to 1 within 3e-08, were divided by their sums." in table.evidence.method
    assert "single" not in tabulate(gymnasium.make("FrozenLake-v1"), gamma=GAMMA).evidence.method


def test_a_row_that_is_nearly_1_is_told_by_how_much_and_mended_by_its_sum():
    P = np.eye(3) * (1 + 1e-7)
    with pytest.raises(InvalidMDP, match=r"sums to 1\.0000001: each row must sum to 1.*Divide it by its sum"):
        TabularMDP(P, GAMMA, np.eye(3)[0])
    assert TabularMDP(P / P.sum(axis=1, keepdims=True), GAMMA, np.eye(3)[0]).n_states == 3
    with pytest.raises(InvalidMDP, match=r"sums to 1 \+ 2e-10|sums to 1 \+ 4e-09"):
        TabularMDP(np.eye(3) * (1 + 4e-9) * np.float64(1), GAMMA, np.eye(3)[0])
    with pytest.raises(InvalidPolicy, match=r"sums to 1\.0000001"):
        as_distribution(P, 3, 3)


class Raises(Corridor):
    """Cannot be stepped."""

    def step(self, action):
        raise OSError("no such device")


class Locked(Corridor):
    """Cannot be copied."""

    def __init__(self):
        super().__init__()
        self.lock = threading.Lock()


OFFERED = {
    "words": (Shows(*SHOWN["words"]), NotDiscrete, ""),
    "raises": (Raises(), EnvironmentFailed, ""),
    "locked": (Locked(), NotCopied, ""),
    "renewing": (Renewing(), NotTabular, "Or count what random steps do (--table sample)."),
    "clocked": (Clocked(), HiddenState, "--table sample"),
}


@pytest.mark.parametrize("name", OFFERED)
def test_counting_is_offered_by_a_run_where_it_does_not_lead_to_the_same_error(tmp_path, name):
    env, error, says = OFFERED[name]
    with pytest.raises(error) as caught:
        place_of(Experiment("Corridor-v0", GAMMA, learner=FiniteLP()), env, tmp_path, lambda share, told: None)
    assert says in str(caught.value) and bool(says) == ("--table sample" in str(caught.value))
    if says:
        assert tabulate(env, gamma=GAMMA, by=Interaction(500)).mdp.n_states == 7
    else:
        with pytest.raises(error):
            tabulate(env, gamma=GAMMA, by=Interaction(500))


def test_the_layouts_of_one_seed_are_one():
    assert tabulate(SeededStarts(Goal(), (0,)), gamma=GAMMA).evidence.exact
