"""MiniGrid's tasks: the whole state in the observation, fixed layouts, 1 for success."""

import copy
import pickle
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env

import irl_gym_envs
from irl_gym.errors import InvalidInput, InvalidParameter, NotInstalled

LEFT, RIGHT, FORWARD, PICKUP, DROP, TOGGLE, DONE = range(7)
OFTEN_PICKUP = np.array([0.2, 0.2, 0.3, 0.1, 0.08, 0.1, 0.02])
"""Of a random walk that also picks up, drops and toggles."""


def make(task="Empty-5x5", layout=0, **kwargs):
    return gym.make(irl_gym_envs.MINI_GRID, task=task, layout=layout, **kwargs)


def walk(env, actions, seed=0):
    """Rows (observation, action, next observation, reward, terminated) of a walk."""
    rows = []
    before, _ = env.reset(seed=seed)
    for action in actions:
        after, reward, terminated, *_ = env.step(int(action))
        rows.append((before, int(action), after, reward, terminated))
        before = env.reset()[0] if terminated else after
    return rows


def contradictions(task, layout, channels, n=12_000):
    """How many steps of a random walk did otherwise than the same observation and action did before."""
    env = make(task, layout).unwrapped
    actions = np.random.default_rng(0).choice(7, size=n, p=OFTEN_PICKUP)
    known, wrong = {}, 0
    rows = [row for i in range(0, n, 400) for row in walk(env, actions[i : i + 400], seed=i)]
    for before, action, after, reward, terminated in rows:
        outcome = (after[..., :channels].tobytes(), reward, terminated)
        wrong += known.setdefault((before[..., :channels].tobytes(), action), outcome) != outcome
    return wrong


def states(task, layout=0):
    """States that are not terminal, by breadth-first search over copies."""
    env = make(task, layout).unwrapped
    first, _ = env.reset(seed=0)
    seen, border = {first.tobytes()}, [env]
    while border:
        current = border.pop()
        for action in range(7):
            copied = copy.deepcopy(current)
            observation, _, terminated, *_ = copied.step(action)
            if not terminated and observation.tobytes() not in seen:
                seen.add(observation.tobytes())
                border.append(copied)
    return len(seen)


def agent_of(observation):
    """Position of the agent and the four numbers of its cell."""
    ((x, y),) = np.argwhere(observation[..., 0] == 10)
    return (x, y), observation[x, y].tolist()


# --- the state is the observation ---


def test_the_picture_is_minigrids_own():
    from minigrid.wrappers import FullyObsWrapper

    env, own = make("DoorKey-6x6", 3), FullyObsWrapper(gym.make("MiniGrid-DoorKey-6x6-v0"))
    pairs = [(env.reset(seed=0)[0], own.reset(seed=3)[0]["image"])]
    for action in np.random.default_rng(0).integers(0, 7, size=200):
        pairs.append((env.step(int(action))[0], own.step(int(action))[0]["image"]))
    assert all(np.array_equal(ours[..., :3], theirs) for ours, theirs in pairs)


@pytest.mark.parametrize(
    "task", ["DoorKey-5x5", "ObstructedMaze-1Dlh", "PutNear-6x6-N2", "GoToObject-6x6-N2", "RedBlueDoors-6x6"]
)
def test_one_observation_always_goes_on_the_same(task):
    assert contradictions(task, [0, 1, 2, 3, 4], channels=4) == 0


@pytest.mark.parametrize(("task", "layout"), [("ObstructedMaze-1Dlh", 0), ("PutNear-6x6-N2", [0, 1, 2, 3, 4])])
def test_minigrids_full_picture_alone_hides_state(task, layout):
    assert contradictions(task, layout, channels=3) > 0


@pytest.mark.parametrize(("task", "n"), [("Empty-5x5", 32), ("Empty-8x8", 140), ("DoorKey-5x5", 260)])
def test_the_states_are_as_many_as_places_and_things_allow(task, n):
    assert states(task) == n  # Empty: 4 directions in each cell but the goal


def test_what_is_carried_is_shown_in_the_agents_cell():
    env = make("Unlock", 0).unwrapped
    env.reset(seed=0)
    base = env.inner.unwrapped
    before = agent_of(env._observation())[1]
    base.carrying = next(thing for thing in base.grid.grid if thing is not None and thing.type == "key")
    assert (before[3], agent_of(env._observation())[1][3]) == (0, 1)


def test_what_a_box_holds_is_shown_in_its_cell():
    observation, _ = make("ObstructedMaze-1Dlh").reset(seed=0)
    (box,) = observation[observation[..., 0] == 7]
    assert box[3] > 0


def test_layouts_that_differ_in_fixed_cells_are_told_apart_in_the_agents_cell():
    env = make("DoorKey-6x6", [0, 1, 2])
    assert {agent_of(env.reset(seed=seed)[0])[1][3] for seed in range(30)} == {0, 2, 4}  # a key and nothing, times three


def test_starts_in_one_layout_are_of_one_kind():
    env = make("Empty-Random-6x6", list(range(10)))
    cells = [agent_of(env.reset(seed=seed)[0]) for seed in range(30)]
    assert {cell[3] for _, cell in cells} == {0} and len({where for where, _ in cells}) > 3


@pytest.mark.parametrize(
    "task", ["LavaCrossingS9N1", "KeyCorridorS3R1", "Dynamic-Obstacles-5x5", "MultiRoom-N4-S5", "Playground"]
)
def test_observations_are_members_of_the_space(task):
    env = make(task, [0, 1, 2]).unwrapped
    actions = np.random.default_rng(0).integers(0, env.action_space.n, size=500)
    assert all(env.observation_space.contains(row[2]) for row in walk(env, actions))


def test_the_space_is_a_box_of_integers_with_narrow_bounds():
    space = make("DoorKey-6x6").observation_space
    assert space.dtype == np.uint8 and space.high[0, 0].tolist() == [10, 5, 3, 1] and space.low[0, 0].tolist() == [1, 0, 0, 0]


# --- layouts, reward, ends ---


def test_the_layout_is_that_of_minigrids_seed():
    starts = [make("DoorKey-6x6", 7).reset(seed=seed)[0].tobytes() for seed in range(3)]
    other = make("DoorKey-6x6", 8).reset(seed=0)[0].tobytes()
    assert len(set(starts)) == 1 and other != starts[0]


def test_a_list_of_layouts_is_drawn_from():
    env = make("DoorKey-6x6", [7, 8])
    starts = [env.reset(seed=seed)[0][..., :3].tobytes() for seed in range(20)]
    own = {make("DoorKey-6x6", layout).reset(seed=0)[0][..., :3].tobytes() for layout in (7, 8)}
    assert set(starts) == own


def test_the_only_generator_is_the_environments_own():
    env = make("Dynamic-Obstacles-5x5", [0, 1]).unwrapped
    env.reset(seed=0)
    stand_in = env.np_random = np.random.default_rng(5)
    env.reset()
    env.step(0)
    assert env.inner.chooser is stand_in and env.inner.unwrapped.np_random is stand_in


def test_a_layout_makes_no_draw_when_it_is_the_only_one():
    env = make("DoorKey-6x6", 7).unwrapped
    env.reset(seed=0)
    before = copy.deepcopy(env.np_random.bit_generator.state)
    env.reset()
    assert env.np_random.bit_generator.state == before


def test_success_pays_1_however_long_it_took():
    env = make("Empty-5x5")
    env.reset(seed=0)
    ways = [LEFT, RIGHT] * 60 + [FORWARD, FORWARD, RIGHT, FORWARD, FORWARD]
    paid = [env.step(action)[1:4] for action in ways]
    assert paid[-1] == (1.0, True, False) and set(paid[:-1]) == {(0.0, False, False)}


def test_lava_ends_and_pays_nothing():
    rows = walk(make("LavaGapS5").unwrapped, np.random.default_rng(0).choice(3, size=500))
    assert {row[3] for row in rows if row[4]} >= {0.0}  # the goal pays 1


def test_a_collision_keeps_its_price():
    rows = walk(make("Dynamic-Obstacles-5x5").unwrapped, np.random.default_rng(0).integers(0, 3, size=300))
    assert {row[3] for row in rows if row[4]} >= {-1.0}


def test_the_time_limit_is_the_registrations():
    env = make("Empty-5x5")
    env.reset(seed=0)
    truncated = [env.step(LEFT)[3] for _ in range(500)]
    assert truncated == [False] * 499 + [True]


# --- Gymnasium ---


@pytest.mark.filterwarnings("ignore:The system font")  # MiniGrid's window asks pygame for a font by its file's name
@pytest.mark.parametrize("task", ["DoorKey-5x5", "Dynamic-Obstacles-5x5"])
def test_gymnasium_finds_nothing_wrong(task, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    check_env(make(task, [0, 1, 2], disable_env_checker=True).unwrapped)


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["deepcopy", "pickle"])
def test_a_copy_goes_on_the_same(copied):
    env = make("Dynamic-Obstacles-6x6", [0, 1]).unwrapped
    actions = np.random.default_rng(0).integers(0, 3, size=100)
    walk(env, actions)
    again = copied(env)
    rows, copied_rows = ([repr(row) for row in walk(each, actions, seed=None)] for each in (env, again))
    assert rows == copied_rows


def test_the_spec_makes_it_again():
    env = make("DoorKey-5x5", [0, 1])
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    actions = np.random.default_rng(0).integers(0, 7, size=50)
    assert repr(walk(again.unwrapped, actions)) == repr(walk(env.unwrapped, actions))


def test_rendering_is_minigrids():
    env = make("DoorKey-5x5", 0, render_mode="rgb_array")
    own = gym.make("MiniGrid-DoorKey-5x5-v0", render_mode="rgb_array")
    env.reset(seed=0)
    own.reset(seed=0)
    np.testing.assert_array_equal(env.render(), own.render())


def test_rendering_without_a_mode_warns():
    env = make().unwrapped
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="render was called without a render mode"):
        assert env.render() is None


def test_importing_the_package_imports_no_minigrid():
    code = "import irl_gym_envs, irl_gym_envs.mini_grid, sys; sys.exit('minigrid' in sys.modules or 'pygame' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_nothing_is_printed_when_it_is_made():
    code = "import gymnasium as gym; gym.make('irl_gym_envs:irl_gym/MiniGrid-v0').reset(seed=0)"
    ran = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert ran.stdout == ""


# --- errors ---


def test_a_missing_minigrid_is_named_with_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "minigrid", None)
    with pytest.raises(NotInstalled, match=r'pip install "irl_gym\[minigrid\]"'):
        make()


def test_an_unknown_task_is_refused_with_the_closest():
    with pytest.raises(InvalidParameter, match=r"task is 'DoorKey-6': expected a task of MiniGrid.*closest are DoorKey-6x6"):
        make("DoorKey-6")


def test_a_task_with_its_prefix_is_refused_with_its_name():
    with pytest.raises(InvalidParameter, match=r"closest are DoorKey-6x6"):
        make("MiniGrid-DoorKey-6x6-v0")


@pytest.mark.parametrize(("layout", "message"), [([], "seeds is empty"), (-1, "is -1"), ([0, True], "is True")])
def test_layouts_are_refused_when_they_are_no_seeds(layout, message):
    with pytest.raises(InvalidParameter, match=message):
        make("Empty-5x5", layout)


def test_an_unknown_render_mode_is_refused():
    with pytest.raises(InvalidParameter, match="render_mode is 'ascii'"):
        make().unwrapped.__class__(render_mode="ascii")


@pytest.mark.parametrize("action", [7, -1])
def test_an_unknown_action_is_refused(action):
    env = make().unwrapped
    env.reset(seed=0)
    with pytest.raises(InvalidInput, match=r"expected a member of Discrete\(7\)"):
        env.step(action)


def test_a_step_before_reset_is_refused():
    with pytest.raises(InvalidInput, match="call reset first"):
        make().unwrapped.step(0)


def test_the_action_space_is_minigrids():
    assert (make().action_space, make("Dynamic-Obstacles-5x5").action_space) == (spaces.Discrete(7), spaces.Discrete(3))
