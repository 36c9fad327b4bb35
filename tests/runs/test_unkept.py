"""Environments made with arrays and objects, or whose `close` raises: the run goes on, and what it leaves out is said."""

from functools import partial

import gymnasium as gym
import numpy as np
import pandas as pd
import pytest
import scipy.sparse as sp
from gymnasium import spaces
from reports.page.made_runs import section_of

from irl_gym.agents.planners import ValueIteration
from irl_gym.agents.simulator import Simulator
from irl_gym.commands.demonstrating.demonstrators import Recording
from irl_gym.commands.demonstrating.keyboard import controls_of
from irl_gym.commands.demonstrating.playing import Play, learn_command, write_played
from irl_gym.demonstrations.datasets import load_minari
from irl_gym.demonstrations.minari_files import unkept
from irl_gym.environments.closing import close
from irl_gym.errors import RunConflict
from irl_gym.features.feature_maps import OneHot
from irl_gym.features.linear_reward import LinearReward
from irl_gym.files.run_folder import read_json
from irl_gym.loop.loop import Loop
from irl_gym.loop.pipeline import recover_and_retrain
from irl_gym.reports.page.python_code import missing, python_lines
from irl_gym.reports.page.sections.asked import asked
from irl_gym.reports.terminal_report import render
from irl_gym.runs.experiment import Experiment, as_config
from irl_gym.runs.run import read_run

FEW = {"episodes": 5, "eval_episodes": 5, "retrain": ValueIteration()}


class Thing:
    """What has no text of its own."""

    def __init__(self, size=3):
        self.size = size


class Locked:
    def __reduce__(self):
        raise TypeError("not to be pickled")


class Corridor(gym.Env):
    """Five cells; what it is made with makes no difference, and it does not close."""

    def __init__(self, grid=None, thing=None):
        self.observation_space, self.action_space = spaces.Discrete(5), spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.cell = 0
        return 0, {}

    def step(self, action):
        self.cell = max(0, min(4, self.cell + (1 if action else -1)))
        return self.cell, float(self.cell == 4), self.cell == 4, False, {}

    def close(self):
        raise RuntimeError("it does not close")


@pytest.fixture(scope="module", autouse=True)
def registered():
    for name, kwargs in (("Plain-v0", {}), ("Filled-v0", {"grid": np.ones((50, 5), np.int8), "thing": Thing()})):
        gym.register(name, Corridor, kwargs=kwargs, max_episode_steps=20)
    yield
    del gym.registry["Plain-v0"], gym.registry["Filled-v0"]


@pytest.fixture(scope="module")
def filled(registered, without_figures, tmp_path_factory):
    """A run of an environment that was registered with an array and an object."""
    return recover_and_retrain(Experiment("Filled-v0", 0.9, **FEW), tmp_path_factory.mktemp("runs") / "filled")


def test_a_run_goes_on_without_a_spec_and_says_so(filled):
    told = filled.stages["demonstrations"]["no_environment"]
    assert told.startswith("The dataset does not say that it was recorded in Filled-v0: the spec is no json")
    dataset = load_minari(filled.stages["demonstrations"]["dataset_id"], root=filled.out / "dataset")
    assert dataset.env_spec is None and told in dataset.storage.metadata["description"]
    assert ("demonstrations", told) in section_of(asked, read_run(filled.out)).shown["lines"]
    assert told in [str(part) for part in render(filled)]


def test_what_an_environment_was_registered_with_is_recorded_by_digests(filled):
    told = read_json(filled.out / "environment.json")["kwargs"]
    assert told["grid"] == as_config(np.ones((50, 5), np.int8)) and told["grid"]["array"] == [50, 5]
    assert told["thing"]["object"].endswith("Thing") and len(told["thing"]["sha256"]) == 16


@pytest.mark.parametrize(("kwargs", "kept"), [({}, True), ({"grid": np.ones(3)}, False), ({"thing": len}, False)])
def test_a_dataset_can_say_where_it_was_recorded_if_that_is_json(kwargs, kept):
    assert (unkept(gym.make("Plain-v0", **kwargs).spec) is None) is kept


def test_a_run_with_an_object_is_continued_with_one_like_it_and_not_with_another(tmp_path):
    run = [Experiment("Plain-v0", 0.9, {"thing": Thing(size)}, **FEW) for size in (3, 3, 4)]
    Loop(run[0], tmp_path).stage("expert")
    assert Loop(run[1], tmp_path).stage("expert")["kept"]
    with pytest.raises(RunConflict, match=r"env_kwargs\.thing\.sha256"):
        Loop(run[2], tmp_path)


@pytest.mark.parametrize(
    ("value", "told"),
    [
        (float("inf"), {"float": "inf"}), (np.array([1.0, np.nan]), [1.0, {"float": "nan"}]), ({3, 1}, [1, 3]),
        (Locked(), {"object": f"{__name__}.Locked", "sha256": None}), (np.int8(3), 3),
    ],
)  # fmt: skip
def test_what_json_does_not_hold_is_described(value, told):
    assert as_config(value) == told


def test_arrays_of_objects_are_told_apart_by_what_they_hold():
    some, others = (np.array([Thing(size) for _ in range(99)], dtype=object) for size in (3, 4))
    again = np.array([Thing(3) for _ in range(99)], dtype=object)
    assert as_config(some) == as_config(again) != as_config(others)


def table(middle):
    return pd.DataFrame({"a": [0] * 500 + [middle] + [0] * 500})


@pytest.mark.parametrize(
    "make",
    [
        table, lambda n: sp.csr_array(np.diag(np.arange(1, 100.0) + n * (np.arange(99) == 50))), np.random.default_rng,
        lambda n: partial(int, str(n)), lambda n: spaces.Box(np.array([0, n]), 9, dtype=np.int64),
    ],
    ids=["table", "sparse matrix", "generator", "partial function", "space"],
)  # fmt: skip
def test_objects_whose_text_leaves_something_out_are_told_apart(make):
    assert as_config(make(2)) == as_config(make(2)) != as_config(make(3))


def test_an_object_that_has_no_text_is_described():
    assert as_config(Untold())["object"].endswith("Untold")


class Untold:
    def __repr__(self):
        raise RuntimeError("it says nothing")


def test_lines_of_python_say_which_object_is_missing():
    config = Experiment("Plain-v0", 0.9, {"thing": [1, Thing()], "cap": float("inf")}).to_json()
    assert missing(config) == [f"env_kwargs.thing[1], a {__name__}.Thing"]
    assert "env_kwargs={'thing': [1, ...], 'cap': float('inf')}" in python_lines(config)


def test_a_close_that_raises_ends_nothing_where_copies_are_trained(unchecked):
    planned = object()
    planner = type("Planner", (), {"plan": lambda *args, **kwargs: planned})()
    reward = LinearReward(np.ones(5), OneHot(5))
    assert Simulator(gym.make("Plain-v0"), planner, 0.9).plan(reward) is planned


def test_what_did_not_close_is_not_asked_again():
    vector = gym.vector.SyncVectorEnv([lambda: gym.make("Plain-v0")])
    close(vector)
    assert vector.closed


class OwnClosed(Corridor):
    """Says itself whether it is closed."""

    @property
    def closed(self):
        raise OSError("nobody knows")


def test_what_an_environment_calls_closed_itself_is_not_touched():
    assert close(OwnClosed()) is None


def test_an_export_knows_an_environment_by_what_it_was_made_with():
    plans = [Recording("random", 0.9).plan(gym.make("Plain-v0", thing=Thing(size)))["environment"] for size in (3, 3, 4)]
    assert plans[0] == plans[1] != plans[2] and plans[0]["kwargs"]["thing"]["object"].endswith("Thing")


def test_a_game_is_written_and_its_command_names_the_environment(tmp_path):
    env = gym.make("Filled-v0")
    play = Play(env, controls_of(env), 1, keep_unfinished=True)
    play.start()
    play.press("0")
    play.stop()
    assert "no json" in write_played(play, "me/filled-v0", env, str(tmp_path)).storage.metadata["description"]
    assert "--env-id Filled-v0" in learn_command("me/filled-v0", None, "Filled-v0")
