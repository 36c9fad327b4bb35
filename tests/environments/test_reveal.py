"""Reveal shows in the observation what an environment hides of its state."""

import copy
import pickle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env

from irl_gym.environments.reveal import Reveal, known_hidden
from irl_gym.errors import InvalidParameter, UnknownObservation
from irl_gym.spaces.states import StateIndex


class Part:
    energy = 0


class Counter(gym.Env):
    """Hides how many steps were taken, which it counts from the first reset."""

    observation_space, action_space = spaces.Discrete(2), spaces.Discrete(2)

    def __init__(self, first=0):
        self.part, self.words, self.ratio, self.first, self.limit = Part(), "many", 0.5, first, 9
        self.last, self.goal, self.bag, self.map = None, (2, 1), {"key": [0, 3]}, np.array([[0, 1], [2, 0]])

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.count, self.odd = self.first, False
        return 0, {}

    def step(self, action):
        self.count, self.odd, self.part.energy = self.count + 1, not self.odd, 3
        self.last = int(action)
        return int(action), 0.0, False, False, {}


def fickle(**kwargs):
    return gym.make("Taxi-v4", fickle_passenger=True, **kwargs)


def walk(env, n=300):
    """Observations of a seeded walk."""
    seen = [env.reset(seed=3)[0]]
    env.action_space.seed(0)
    for _ in range(n):
        observation, _, terminated, truncated, _ = env.step(env.action_space.sample())
        seen.append(observation)
        if terminated or truncated:
            seen.append(env.reset()[0])
    return seen


# --- attributes ---


def test_an_attribute_is_shown_beside_the_observation():
    env = Reveal(Counter(), {"count": 5})
    env.reset(seed=0)
    assert env.step(1)[0] == {"observation": 1, "count": 1}


def test_the_space_has_the_observation_and_the_values():
    env = Reveal(Counter(), {"count": 5})
    assert env.observation_space == spaces.Dict({"observation": spaces.Discrete(2), "count": spaces.Discrete(5)})


def test_a_boolean_is_0_or_1():
    env = Reveal(Counter(), {"odd": 2})
    assert (env.reset()[0]["odd"], env.step(0)[0]["odd"]) == (0, 1)


def test_a_dot_leads_into_an_attribute():
    env = Reveal(Counter(), {"part.energy": 4})
    env.reset()
    assert env.step(0)[0]["part.energy"] == 3


def test_an_attribute_of_a_wrapper_is_shown():
    env = Reveal(gym.wrappers.TimeLimit(Counter(), 7), {"_elapsed_steps": 8})
    env.reset()
    env.step(0)
    assert env.step(0)[0]["_elapsed_steps"] == 2


@pytest.mark.parametrize(
    ("name", "value"), [("goal[1]", 1), ("goal[-2]", 2), ("bag['key'][1]", 3), ("map[1, 0]", 2), ("map[0][1]", 1)]
)
def test_brackets_lead_into_an_attribute(name, value):
    assert Reveal(Counter(), {name: 4}).reset()[0][name] == value


def test_the_name_of_a_wrapper_leads_into_it():
    env = Reveal(gym.wrappers.TimeAwareObservation(fickle(), normalize_time=False), {"TimeAwareObservation.timesteps": 300})
    assert walk(env, 3)[-1]["TimeAwareObservation.timesteps"] == 3


def test_the_place_of_a_value_among_those_listed_is_shown():
    env = Reveal(Counter(), {"last": [None, 0, 1], "words": ["few", "many"]})
    first, second = env.reset()[0], env.step(1)[0]
    assert (first["last"], second["last"], first["words"]) == (0, 2, 1)
    assert env.observation_space["last"] == spaces.Discrete(3)


def test_a_value_that_is_not_listed_is_refused():
    env = Reveal(Counter(), {"last": [None, 0]})
    env.reset()
    with pytest.raises(UnknownObservation, match=r"last is 1: expected one of \[None, 0\]"):
        env.step(1)


@pytest.mark.parametrize("name", ["goal[7]", "bag['lock']", "first[0]", "goal[01]"])
def test_a_part_that_is_not_there_is_refused(name):
    with pytest.raises(InvalidParameter, match="has no part"):
        Reveal(Counter(), {name: 4}).reset()


def test_the_state_index_numbers_what_is_shown():
    env = Reveal(Counter(), {"count": 5, "odd": 2})
    states = StateIndex(env.observation_space)
    env.reset()
    observation = env.step(1)[0]
    assert states.n_states == 20 and states.decode(states.encode(observation)) == observation


def test_reveal_goes_around_reveal():
    env = Reveal(Reveal(Counter(), {"count": 5}), {"odd": 2})
    assert env.reset()[0] == {"observation": {"observation": 0, "count": 0}, "odd": 0}


# --- what is known to be hidden ---


def test_fickle_taxi_hides_the_fickle_step():
    assert known_hidden(fickle()) == {"fickle_step": 2}


@pytest.mark.parametrize("rule", ["natural", "sab"])
def test_blackjack_hides_the_natural(rule):
    assert known_hidden(gym.make("Blackjack-v1", **{rule: True})) == {"natural": 2}


@pytest.mark.parametrize("env_id", ["Taxi-v4", "Blackjack-v1", "FrozenLake-v1"])
def test_nothing_is_known_to_be_hidden_elsewhere(env_id):
    assert known_hidden(gym.make(env_id, **({"sab": False} if env_id == "Blackjack-v1" else {}))) == {}


def test_what_is_shown_is_hidden_no_more():
    assert known_hidden(gym.wrappers.TimeLimit(Reveal(fickle()), 5)) == {}


def test_the_fickle_step_is_shown_by_default():
    env = Reveal(fickle())
    shown = {(env.reset(seed=seed)[0]["fickle_step"], int(env.unwrapped.fickle_step)) for seed in range(20)}
    assert shown == {(0, 0), (1, 1)}


def test_a_natural_is_an_ace_and_a_ten():
    env = Reveal(gym.make("Blackjack-v1", sab=True))
    hands = [(env.reset(seed=seed)[0]["natural"], sorted(env.unwrapped.player) == [1, 10]) for seed in range(200)]
    assert {natural for natural, _ in hands} == {0, 1} and all(natural == is_one for natural, is_one in hands)


def test_a_drawn_21_is_no_natural():
    env = Reveal(gym.make("Blackjack-v1", sab=True))
    env.reset(seed=0)
    env.unwrapped.player = [1, 2, 8]
    assert env.observation((21, 5, 1)) == {"observation": (21, 5, 1), "natural": 0}


def test_the_natural_is_the_hand_not_the_rule():
    env = Reveal(gym.make("Blackjack-v1", natural=True), {"natural": 2})
    assert {env.reset(seed=seed)[0]["natural"] for seed in range(100)} == {0, 1}


def test_a_tuple_inside_is_numbered():
    env = Reveal(gym.make("Blackjack-v1", natural=True))
    states = StateIndex(env.observation_space)
    seen = walk(env)
    assert [states.decode(states.encode(observation)) for observation in seen] == seen


# --- Gymnasium ---


@pytest.mark.parametrize(
    ("env_id", "kwargs"), [("Taxi-v4", {"fickle_passenger": True}), ("Blackjack-v1", {"sab": True, "natural": False})]
)
def test_the_spec_of_a_wrapped_environment_makes_it_again(env_id, kwargs):
    env = Reveal(gym.make(env_id, **kwargs))
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert again.observation_space == env.observation_space and walk(again) == walk(env)


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["deepcopy", "pickle"])
def test_a_copy_shows_the_same(copied):
    env = Reveal(fickle())
    assert walk(copied(env)) == walk(env)


@pytest.mark.filterwarnings("ignore:.*is different from the unwrapped version")  # it is a wrapper
def test_gymnasium_finds_nothing_wrong():
    check_env(Reveal(fickle(disable_env_checker=True).unwrapped), skip_render_check=True)


def test_numpy_counts_are_written_as_json():
    env = Reveal(gym.make("Taxi-v4"), {"s": int(np.int64(500))})
    assert EnvSpec.from_json(env.spec.to_json()).additional_wrappers[-1].kwargs == {"shown": {"s": 500}}


# --- errors ---


def test_an_unknown_attribute_is_refused_with_the_close_names():
    env = Reveal(Counter(), {"counter": 5})
    with pytest.raises(InvalidParameter, match=r"Counter has no attribute 'counter'.*closest to it are count\."):
        env.reset()


def test_an_unknown_part_is_refused_after_the_dot():
    env = Reveal(Counter(), {"part.enery": 5})
    with pytest.raises(InvalidParameter, match="Part has no attribute 'enery'"):
        env.reset()


def test_all_integer_attributes_are_offered_when_none_is_close():
    env = Reveal(Counter(), {"zzz": 5})
    with pytest.raises(InvalidParameter, match="Its integer attributes are count, first, limit, odd"):
        env.reset()


@pytest.mark.parametrize(("name", "kind"), [("words", "str"), ("ratio", "float"), ("reset", "method")])
def test_an_attribute_that_is_no_integer_is_refused(name, kind):
    env = Reveal(Counter(), {name: 5})
    with pytest.raises(InvalidParameter, match=f"a {kind}: expected an integer or a boolean"):
        env.reset()


def test_a_value_that_is_too_large_is_refused_with_the_count_that_holds_it():
    env = Reveal(Counter(), {"count": 1})
    env.reset()
    with pytest.raises(UnknownObservation, match=r"count is 1: expected 0 to 0, as n is 1. Say so with shown=\{'count': 2\}"):
        env.step(0)


def test_a_negative_value_is_refused():
    env = Reveal(Counter(first=-1), {"count": 5})
    with pytest.raises(UnknownObservation, match=r"count is -1: expected 0 to 4.*shown=\{'count': \[-1, 0, 1, 2, 3, 4\]\}"):
        env.reset()


def test_nothing_to_show_is_refused():
    with pytest.raises(InvalidParameter, match="nothing to show of FrozenLakeEnv"):
        Reveal(gym.make("FrozenLake-v1"))


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("shown", "message"),
    [
        ({"count": 0}, r"shown\['count'\] is 0: expected a whole number of at least 1"),
        ({"count": 2.5}, r"shown\['count'\] is 2.5"),
        ({"observation": 2}, "'observation', which is the key"),
        ({3: 2}, "has the name 3"),
        ({"goal[": 2}, r"name 'goal\[': expected an attribute's"),
        ({"goal[f()]": 2}, r"name 'goal\[f\(\)\]'"),
        ({"last": []}, "lists nothing"),
        ({"last": [(1, 2)]}, r"lists \(1, 2\): expected values that are numbers"),
        ({"last": [1, 0, True]}, "lists True twice"),
        (["count"], r"shown is \['count'\]: expected names with their numbers of values"),
    ],
)
def test_shown_is_refused_when_it_cannot_be_right(shown, message):
    with pytest.raises(InvalidParameter, match=message):
        Reveal(Counter(), shown)
