"""physics_of: the world inside an environment does what the environment's step does."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces

from irl_gym.environments.physics import Physics, physics_of
from irl_gym.errors import InvalidParameter, NotDiscrete, NotSettable

CLASSIC = ["MountainCar-v0", "CartPole-v1", "Pendulum-v1", "Acrobot-v1", "MountainCarContinuous-v0"]
TOY_TEXT = ["FrozenLake-v1", "CliffWalking-v1", "Taxi-v4"]
OWN = ["irl_gym_envs:irl_gym/MountainCar-v0", "irl_gym_envs:irl_gym/ContinuousGridWorld-v0"]


def make(env_id, **kwargs):
    env = gym.make(env_id, **kwargs)
    return env if isinstance(env.action_space, spaces.Discrete) else gym.wrappers.DiscretizeAction(env, 5)


class Drift(gym.Env):
    """Keeps its state where it is told to; drifts to the right, with noise, until it is beyond 1."""

    action_space = spaces.Discrete(2, start=5)
    observation_space = spaces.Box(-2.0, 2.0, (1,))

    def __init__(self, kept="state"):
        self.kept = kept

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        setattr(self, self.kept, [0.0])
        return np.zeros(1, dtype=np.float32), {}

    def step(self, action):
        place = getattr(self, self.kept)[0] + 0.1 * (action - 5) + self.np_random.uniform(0, 0.1)
        setattr(self, self.kept, [place])
        return np.array([place], dtype=np.float32), place, place > 1, False, {}


class Getter(Drift):
    """Hides the state, but has methods for it."""

    def __init__(self):
        super().__init__(kept="_hidden")

    def get_state(self):
        return np.array(self._hidden)

    def set_state(self, state):
        self._hidden = state.tolist()


class Shifted(Drift):
    """Observes something else than its state."""

    def reset(self, *, seed=None, options=None):
        return super().reset(seed=seed)[0] + np.float32(1), {}


@pytest.mark.parametrize("env_id", CLASSIC + TOY_TEXT + OWN)
def test_physics_does_what_step_does(env_id):
    env = make(env_id)
    physics = physics_of(env)
    assert isinstance(physics, Physics)
    observation, _ = env.reset(seed=1)
    env.unwrapped.np_random = np.random.default_rng(3)
    rng, twin = np.random.default_rng(0), np.random.default_rng(3)
    for _ in range(60):
        state = physics.coordinates.locate(np.asarray(observation)[None])
        if env_id not in TOY_TEXT:  # as exact as the environment keeps it
            state = np.asarray(env.unwrapped.state, dtype=np.float64)[None]
        action = int(rng.integers(physics.n_actions))
        observation, reward, terminated, truncated, _ = env.step(action)
        moves = physics.transition(state, np.array([action]), twin)
        np.testing.assert_allclose(physics.coordinates.observe(moves.states)[0], observation, rtol=1e-6, atol=1e-6)
        assert (moves.rewards[0], moves.terminated[0]) == (pytest.approx(reward, rel=1e-6), terminated)
        if terminated or truncated:
            observation, _ = env.reset()
            env.unwrapped.np_random, twin = np.random.default_rng(4), np.random.default_rng(4)


@pytest.mark.parametrize("env_id", CLASSIC + TOY_TEXT + OWN)
def test_physics_locates_what_it_observes(env_id):
    coordinates = physics_of(make(env_id)).coordinates
    cells = np.random.default_rng(0).integers(0, 7, size=(50, len(coordinates.names)))
    states = coordinates.low + (cells + 0.5) / 7 * (coordinates.high - coordinates.low)
    if env_id in TOY_TEXT:
        states = np.rint(states)
    np.testing.assert_allclose(coordinates.locate(coordinates.observe(states)), states, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("env_id", [*CLASSIC, *TOY_TEXT, *OWN])
def test_physics_starts_within_the_bounds(env_id):
    physics = physics_of(make(env_id))
    first = physics.start(20, np.random.default_rng(0))
    assert ((first >= physics.coordinates.low) & (first <= physics.coordinates.high)).all()
    np.testing.assert_array_equal(first, physics.start(20, np.random.default_rng(0)))


@pytest.mark.parametrize("env", [Drift(), Getter()], ids=["attribute", "methods"])
def test_physics_sets_the_state_of_a_custom_environment(env):
    physics = physics_of(env)
    moves = physics.transition(np.array([[0.5], [0.99]]), np.array([0, 1]), np.random.default_rng(0))
    noise = np.random.default_rng(0).uniform(0, 0.1, size=2)
    np.testing.assert_allclose(moves.states[:, 0], np.array([0.5, 1.09]) + noise)
    assert moves.terminated.tolist() == [False, True]


def test_physics_noise_is_the_same_when_seeded_the_same():
    physics = physics_of(make("FrozenLake-v1"))
    states, actions = np.full((200, 1), 4.0), np.zeros(200, dtype=int)
    ends = [physics.transition(states, actions, np.random.default_rng(s)).states for s in (0, 0, 1)]
    assert (ends[0] == ends[1]).all() and (ends[0] != ends[2]).any()


def test_physics_leaves_the_environment_alone():
    env = make("CartPole-v1")
    env.reset(seed=0)
    before = env.unwrapped.state.copy()
    physics_of(env).transition(np.ones((3, 4)), np.zeros(3, dtype=int), np.random.default_rng(0))
    np.testing.assert_array_equal(env.unwrapped.state, before)


def test_physics_of_cart_pole_falls_as_often_as_it_is_let_fall():
    physics = physics_of(make("CartPole-v1"))
    moves = physics.transition(np.tile([0.0, 0.0, 0.2, 3.0], (3, 1)), np.ones(3, dtype=int), np.random.default_rng(0))
    assert moves.terminated.all() and moves.rewards.tolist() == [1.0, 1.0, 1.0]


def test_physics_of_pendulum_and_acrobot_have_angles_that_wrap():
    assert physics_of(make("Pendulum-v1")).coordinates.periodic.tolist() == [True, False]
    assert physics_of(make("Acrobot-v1")).coordinates.periodic.tolist() == [True, True, False, False]


@pytest.mark.parametrize("env_id", ["CartPole-v1", OWN[1]])
def test_physics_takes_other_bounds(env_id):
    env = make(env_id)
    name = physics_of(env).coordinates.names[1]
    narrow, wide = physics_of(env, bounds={name: (0.25, 0.5)}), physics_of(env)
    assert (narrow.coordinates.low[1], narrow.coordinates.high[1]) == (0.25, 0.5)
    assert narrow.coordinates.low[0] == wide.coordinates.low[0] and narrow.n_actions == wide.n_actions
    states, actions = narrow.start(5, np.random.default_rng(0)), np.zeros(5, dtype=int)
    moves = [physics.transition(states, actions, np.random.default_rng(1)).states for physics in (narrow, wide)]
    np.testing.assert_array_equal(*moves)


@pytest.mark.parametrize("bounds", [{"speed": (0, 1)}, {"velocity": (1, 0)}, {"velocity": 1}, {"velocity": (0, np.inf)}])
def test_physics_refuses_bad_bounds(bounds, unchecked):
    with pytest.raises(InvalidParameter, match=next(iter(bounds))):
        physics_of(make("CartPole-v1"), bounds=bounds)


def test_physics_asks_for_bounds_when_the_environment_has_none():
    env = Drift()
    env.observation_space = spaces.Box(-np.inf, np.inf, (1,))
    with pytest.raises(InvalidParameter, match=r"x0 goes from -inf to inf.*bounds=\{'x0'"):
        physics_of(env)
    assert physics_of(env, bounds={"x0": (0, 1)}).coordinates.high.tolist() == [1.0]


def test_physics_is_refused_when_the_state_is_hidden():
    with pytest.raises(NotSettable, match="Drift publishes neither `physics`, nor `set_state` and `get_state`"):
        physics_of(Drift(kept="_hidden"))


def test_physics_is_refused_when_the_observation_is_not_the_state():
    with pytest.raises(NotSettable, match=r"observes .* in state"):
        physics_of(Shifted())


def test_physics_is_refused_when_the_state_has_more_coordinates_than_are_shown():
    env = gym.make("Blackjack-v1").unwrapped
    env.state = [0.0]
    with pytest.raises(NotSettable, match="Tuple"):
        physics_of(env)


def test_physics_looks_through_wrappers_that_only_watch():
    env = gym.wrappers.RecordEpisodeStatistics(make("CartPole-v1"))
    assert physics_of(env).n_actions == 2


def test_physics_is_refused_under_wrappers_that_change_the_environment():
    env = gym.wrappers.TransformReward(make("CartPole-v1"), lambda r: 2 * r)
    with pytest.raises(NotSettable, match="TransformReward"):
        physics_of(env)


def test_physics_is_refused_for_continuous_actions():
    with pytest.raises(NotDiscrete, match="DiscretizeAction"):
        physics_of(gym.make("Pendulum-v1"))


def test_physics_is_refused_for_what_is_no_environment(unchecked):
    with pytest.raises(InvalidParameter, match="env is a str"):
        physics_of("CartPole-v1")
