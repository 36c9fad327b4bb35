"""SeededStarts makes the layouts that resets draw a finite set."""

import copy
import pickle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env

from irl_gym.environments.seeded_starts import SeededStarts
from irl_gym.errors import InvalidParameter


class Layouts(gym.Env):
    """Draws a layout of 1000 at reset and shows it; each step shows a number drawn then."""

    observation_space, action_space = spaces.Discrete(1000), spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return int(self.np_random.integers(1000)), {"options": options}

    def step(self, action):
        return int(self.np_random.integers(1000)), 0.0, False, False, {}


def layout_of(seed):
    return Layouts().reset(seed=seed)[0]


def episodes(env, n=4, seed=None):
    """Observations of n episodes of three steps; the first is seeded."""
    return [
        [env.reset(seed=seed if i == 0 else None)[0], *(env.step(0)[0] for _ in range(3))] for i in range(n)
    ]  # fmt: skip


def test_one_seed_is_one_layout():
    env = SeededStarts(Layouts(), [5])
    assert {env.reset()[0] for _ in range(5)} == {layout_of(5)}


def test_the_default_is_the_layout_of_seed_0():
    assert SeededStarts(Layouts()).reset()[0] == layout_of(0)


def test_each_seed_is_as_likely():
    env = SeededStarts(Layouts(), [1, 2, 3])
    starts = [env.reset(seed=0 if i == 0 else None)[0] for i in range(3000)]
    counts = [starts.count(layout_of(seed)) for seed in (1, 2, 3)]
    assert sum(counts) == 3000 and np.ptp(counts) < 150  # 5 standard deviations of a difference


def test_the_same_seed_gives_the_same_episodes():
    env, again = (SeededStarts(Layouts(), [1, 2, 3]) for _ in range(2))
    assert episodes(env, seed=7) == episodes(again, seed=7)


def test_another_seed_gives_other_steps_in_the_same_layout():
    env = SeededStarts(Layouts(), [1])
    (first,), (second,) = episodes(env, 1, seed=7), episodes(env, 1, seed=8)
    assert first[0] == second[0] and first[1:] != second[1:]


def test_steps_are_not_tied_to_the_layout():
    first, second = episodes(SeededStarts(Layouts(), [1]), 2, seed=7)
    assert first[0] == second[0] and first[1:] != second[1:]


def test_the_generator_in_force_is_put_back():
    env = SeededStarts(Layouts(), [1])
    before = env.unwrapped.np_random = np.random.default_rng(3)
    env.reset()
    assert env.unwrapped.np_random is before


def test_a_layout_takes_nothing_from_the_generator_in_force():
    env = SeededStarts(Layouts(), [1, 2])
    env.unwrapped.np_random = np.random.default_rng(3)
    env.reset()
    assert env.step(0)[0] == np.random.default_rng(3).integers(1000)


@pytest.mark.parametrize("seeds", [[4], [4, 5, 6]])
def test_the_choice_is_one_draw_of_the_chooser(seeds):
    env = SeededStarts(Layouts(), seeds)
    env.chooser, reference = np.random.default_rng(3), np.random.default_rng(3)
    env.reset()
    if len(seeds) > 1:
        reference.integers(len(seeds))
    assert env.chooser.bit_generator.state == reference.bit_generator.state


def test_options_are_passed_on():
    assert SeededStarts(Layouts()).reset(options={"a": 1})[1] == {"options": {"a": 1}}


def test_the_spec_of_a_wrapped_environment_makes_it_again():
    env = SeededStarts(gym.make("Taxi-v4"), [3, 1, 4])
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert again.get_wrapper_attr("seeds") == (3, 1, 4) and episodes(again, seed=2) == episodes(env, seed=2)


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["deepcopy", "pickle"])
def test_a_copy_goes_on_the_same(copied):
    env = SeededStarts(Layouts(), [1, 2, 3])
    env.reset(seed=0)
    again = copied(env)
    assert episodes(env) == episodes(again)


@pytest.mark.filterwarnings("ignore:.*is different from the unwrapped version")  # it is a wrapper
def test_gymnasium_finds_nothing_wrong():
    check_env(SeededStarts(gym.make("Taxi-v4", disable_env_checker=True).unwrapped, [3, 1, 4]), skip_render_check=True)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("seeds", "message"),
    [
        ([], "seeds is empty: expected at least one"),
        ([0, -1], r"seeds\[1\] is -1: expected a whole number from 0"),
        ([0.5], r"seeds\[0\] is 0.5"),
        ([True], r"seeds\[0\] is True"),
        ("12", "seeds is '12': expected a list"),
        (3, "seeds is 3: expected a list"),
    ],
)
def test_seeds_are_refused_when_they_are_not_whole_numbers_from_0(seeds, message):
    with pytest.raises(InvalidParameter, match=message):
        SeededStarts(Layouts(), seeds)


@pytest.mark.usefixtures("unchecked")
def test_an_array_of_seeds_is_a_list_of_them():
    assert SeededStarts(Layouts(), np.array([2, 3])).seeds == (2, 3)


def test_a_negative_seed_of_a_reset_is_refused():
    with pytest.raises(InvalidParameter, match=r"-1: expected a whole number from 0"):
        SeededStarts(Layouts()).reset(seed=-1)


def test_a_seed_in_no_list_is_refused(unchecked):
    with pytest.raises(InvalidParameter, match=r"seeds is array\(3\): expected a list"):
        SeededStarts(Layouts(), np.array(3))  # type: ignore[arg-type]


def test_the_seed_of_a_reset_is_called_so():
    with pytest.raises(InvalidParameter, match=r"^seed is -1: expected a whole number from 0"):
        SeededStarts(Layouts(), [3, 4]).reset(seed=-1)
