"""The Python of a page makes the experiment again, and says where it cannot."""

from dataclasses import replace

import numpy as np
import pytest
from reports.page.made_runs import section_of, stepped_run

from irl_gym.agents.planners import SB3, ValueIteration
from irl_gym.features.bases import Fourier, Polynomial, RadialBasis
from irl_gym.features.feature_maps import Functions, OneHot, Unravel
from irl_gym.learners.linear_programs.feature import FeatureLP
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.learners.linear_programs.trajectory import TrajectoryLP
from irl_gym.reports.page.python_code import missing, python_lines
from irl_gym.reports.page.sections.asked import differing, reproduce
from irl_gym.runs.experiment import Experiment
from irl_gym.tables.counted.counting import Counting, Interaction
from irl_gym.tables.enumeration.table import Enumeration

SMALL, DIGITS = np.arange(6.0).reshape(3, 2), Unravel((2, 3))
EXPERIMENTS = {
    "plain": Experiment("FrozenLake-v1", 0.9),
    "priced": Experiment("FrozenLake-v1", 0.9, learner=FiniteLP(l1=0.5, margin_cap=None, reward_on="state-action"), seed=3),
    "table of features": Experiment("X-v0", 0.9, learner=FeatureLP(SMALL, S_0=[0, 2]), table=Enumeration(max_states=9)),
    "one-hot": Experiment("X-v0", 0.9, learner=TrajectoryLP(OneHot(16), l1=0.1), inner=ValueIteration(preference=(1, 0))),
    "radial": Experiment("X-v0", 0.9, learner=TrajectoryLP(RadialBasis(SMALL, np.array([0.5, np.inf]), DIGITS), max_rounds=4)),
    "bases": Experiment("X-v0", 0.9, learner=FeatureLP(Fourier([0, 0], [1, 2])), expert=SB3("DQN", 5, {"type": "x"})),
    "counted": Experiment("X-v0", 0.9, table=Interaction(50, Counting(0.5), seed=2), learner=FeatureLP(Polynomial([0], [1]))),
    "own words": Experiment("X-v0", 0.9, {"type": "x", "learner": {"type": "SB3"}, "coordinates": "y"}),
    "cells": Experiment("X-v0", 0.9, bins=(4, 5), samples=2, reveal={"type": 3}, start_seeds=(1, 2), shaping=False),
    "dataset": Experiment(None, 0.9, dataset="a/b-v0", eval_episodes=7),
}  # fmt: skip


def made_again(config):
    """The experiment that the lines make, which are not run to their end."""
    known: dict = {}
    exec(python_lines(config).rpartition("report = ")[0], known)
    return known["asked"]


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_the_lines_make_the_same_experiment(name):
    config = EXPERIMENTS[name].to_json()
    assert missing(config) == [] and made_again(config).to_json() == config


def test_a_class_is_imported_from_its_own_module():
    lines = python_lines(EXPERIMENTS["one-hot"].to_json()).splitlines()
    assert (
        "from irl_gym.features.feature_maps import OneHot" in lines
        and "from irl_gym.learners.linear_programs.trajectory import TrajectoryLP" in lines
    )


def test_the_type_of_an_argument_is_no_class():
    told = dict(differing(EXPERIMENTS["own words"].to_json()))
    assert told["env_kwargs"]["type"] == "x"


def test_settings_left_as_they_are_are_not_listed():
    told = dict(differing(Experiment("X-v0", 0.9, retrain=SB3(total_timesteps=9), table=Interaction()).to_json()))
    assert {key: told[key] for key in told if key.startswith(("retrain", "table"))} == {
        "retrain": "SB3", "retrain.total_timesteps": 9, "table": "Interaction",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("asked", "absent"),
    [
        (Experiment("X-v0", 0.9, learner=FeatureLP(np.ones((40, 3)))), "learner.features.values, an array of 40 x 3 numbers"),
        (Experiment("X-v0", 0.9, {"map": np.zeros(99)}), "env_kwargs.map, an array of 99 numbers"),
        (Experiment("X-v0", 0.9, learner=FeatureLP(Functions(np.sin, 2))), "learner.features.function, which is sin"),
        (Experiment("X-v0", 0.9, learner=TrajectoryLP(RadialBasis(SMALL, 1.0, np.abs))), "learner.features.coordinates, which"),
    ],
)  # fmt: skip
def test_what_a_configuration_does_not_hold_is_named(tmp_path, asked, absent):
    (found,) = missing(asked.to_json())
    section = section_of(reproduce, replace(stepped_run(tmp_path), config=asked.to_json()))
    assert found.startswith(absent) and absent in section.lead and "cannot make it again" in section.lead
    assert "=..." in section.shown["command"] or ": ..." in section.shown["command"]
    compile(section.shown["command"], "lines", "exec")


def test_a_learner_of_the_users_own_is_named():
    config = {**Experiment("X-v0", 0.9).to_json(), "learner": {"type": "Own", "strength": 3}}
    assert missing(config) == ["learner, an Own"] and "learner=...," in python_lines(config)


def test_a_run_from_python_says_so(tmp_path):
    assert section_of(reproduce, stepped_run(tmp_path)).lead.startswith("The run was started from Python. These lines")


def test_a_run_of_an_earlier_version_does_not_say_that_it_was_started_from_python(tmp_path):
    lead = section_of(reproduce, replace(stepped_run(tmp_path), version={})).lead
    assert "started from Python" not in lead and "An earlier version of irl_gym made the run" in lead


def test_keys_of_a_strangers_configuration_are_not_written_as_python():
    config = Experiment("X-v0", 0.9, learner=FiniteLP(l1=2.0)).to_json()
    config = {"x=print(1) or 1, y": 2, **config, "learner": {**config["learner"], "l1=print(1), r_max": 3}}
    assert "print" not in python_lines(config) and "l1=2.0" in python_lines(config)


def test_a_command_of_another_program_is_shown_as_one(tmp_path):
    run = stepped_run(tmp_path)
    theirs = replace(run, version={**run.version, "command": ["rm", "-rf", "all"]})
    assert "another program than irl_gym" in section_of(reproduce, theirs).lead
    assert "another program" not in section_of(reproduce, run).lead
