"""The mends that errors about runs, and where they take place, name are executed, and serve."""

import shlex
from pathlib import Path

import gymnasium
import numpy as np
import pytest
import tyro
from lake_run import COMMAND, asked
from mended import mends, told, unsaid
from models import random_model
from own_learners import Needy
from stable_baselines3 import PPO

from irl_gym.agents.planners import SB3, Agent, ValueIteration
from irl_gym.checks import checked_rng
from irl_gym.commands.arguments import Arguments
from irl_gym.commands.terminal import OPTIONS, check_writable
from irl_gym.features.feature_maps import OneHot
from irl_gym.files.own_files import held
from irl_gym.files.run_folder import read_json, write_json
from irl_gym.learners.linear_programs.trajectory import TrajectoryLP
from irl_gym.learners.problem import Problem
from irl_gym.loop.pipeline import recover_and_retrain
from irl_gym.loop.table_world import TableWorld
from irl_gym.loop.world_choice import place_of
from irl_gym.loop.worlds import SteppedWorld
from irl_gym.runs.choices import parse_keywords
from irl_gym.runs.experiment import Experiment
from irl_gym.runs.identity import NEW_FOLDER, claim
from irl_gym.runs.run import read_run
from irl_gym.tables.counted.counting import Interaction

pytestmark = pytest.mark.usefixtures("unchecked")
LAKE, CAR = gymnasium.make("FrozenLake-v1"), gymnasium.make("MountainCar-v0")
STEPPED = {"learner": TrajectoryLP(OneHot(2))}


# --- experiments and places ---


def asking(**asked):
    return Experiment(**{"env_id": "FrozenLake-v1", "gamma": 0.9} | asked)


def place(root, env=LAKE, **asked):
    return place_of(asking(**asked), env, root, lambda share, told: None)


def stepped(env=CAR):
    return SteppedWorld(env, 0.9, 1, 1, 0)


class Car(gymnasium.Env):
    """Was made by its class."""

    observation_space, action_space = CAR.observation_space, CAR.action_space


def registered():
    gymnasium.register("Car-v0", entry_point=Car, max_episode_steps=9)
    try:
        return stepped(gymnasium.make("Car-v0"))
    finally:
        gymnasium.registry.pop("Car-v0")


def kept_agent(root, agent):
    stepped().keep(agent, root, "agent")
    return True


CASES = [
    # experiments
    ("Name env_id,", lambda _: asking(env_id=None, dataset="me/a-v0", start_seeds=(0,)),
     lambda _: asking(dataset="me/a-v0", start_seeds=(0,))),
    ("or leave them out.", lambda _: asking(env_id=None, dataset="me/a-v0", start_seeds=(0,)),
     lambda _: asking(env_id=None, dataset="me/a-v0")),
    ("Leave expert and epsilon out.", lambda _: asking(dataset="me/a-v0", epsilon=0.1), lambda _: asking(dataset="me/a-v0")),
    ("Leave one out.", lambda _: asking(table=Interaction(9), bins=3), lambda _: asking(bins=3)),
    ("Leave one out.", lambda _: parse_keywords(["a=1", "a=2"]), lambda _: parse_keywords(["a=2"])),
    ("Leave warm_start out.", lambda _: asking(warm_start="clone", retrain=SB3("DQN")), lambda _: asking(retrain=SB3("DQN"))),
    ("Leave epsilon out.", lambda _: asking(epsilon=0.1, learner=Needy("expert")), lambda _: asking(learner=Needy("expert"))),
    ("Leave dataset out, and give env_id.", lambda _: asking(dataset="me/a-v0", learner=Needy("oracle")),
     lambda _: asking(learner=Needy("oracle"))),
    ("--env-id the environment's id without --dataset or --csv.)",
     lambda _: asking(env_id=None, dataset="me/a-v0", learner=Needy("expert")), lambda _: asking(learner=Needy("expert"))),
    ("Give features, such as OneHot(16).", lambda _: asking(learner=Needy("features")),
     lambda _: asking(learner=Needy("features"), features=OneHot(16))),
    *(("Call its `learn` with a Problem of your own.", lambda _, part=part: asking(learner=Needy(part)),
       lambda _, one={part: value}, part=part: Needy(part).learn(Problem.of(random_model(0).mdp, **one), None))
      for part, value in (("also", (Problem.of(random_model(0).mdp),)), ("horizon", 9))),
    # places
    ("Leave bins out.", lambda path: place(path, bins=3), lambda path: isinstance(place(path), TableWorld)),
    ("Register it.", lambda _: stepped(Car()), lambda _: registered()),
    ("expected an SB3 agent, such as ppo.",
     lambda path: place(path, CAR, expert=ValueIteration(), **STEPPED),
     lambda path: isinstance(place(path, CAR, expert=SB3(), **STEPPED), SteppedWorld)),
    ("Or make a table of cells with bins.",
     lambda path: place(path, CAR, expert=ValueIteration(), **STEPPED),
     lambda path: isinstance(place(path, CAR, expert=ValueIteration(), bins=3), TableWorld)),
    ("Use SB3 as planner.",
     lambda path: kept_agent(path, stepped().random),
     lambda path: kept_agent(path, Agent(PPO("MlpPolicy", CAR, device="cpu")))),
    ("Or make a table of cells, if its state can be set",
     lambda path: place(path, CAR), lambda path: isinstance(place(path, CAR, bins=3), TableWorld)),
    ("Or learn from episodes alone, with TrajectoryLP",
     lambda path: place(path, CAR), lambda path: isinstance(place(path, CAR, **STEPPED), SteppedWorld)),
    ("Make one of a seed: `np.random.default_rng(0)`.",
     lambda _: checked_rng(0), lambda _: checked_rng(eval(mends(told(checked_rng, 0))[0], {"np": np}))),
    ("Make it first.",
     lambda path: check_writable(path / "pages" / "page.html"),
     lambda path: (path / "pages").mkdir() is check_writable(path / "pages" / "page.html")),
]  # fmt: skip


@pytest.mark.parametrize(("says", "breaks", "mended"), CASES, ids=[one[0] for one in CASES])
def test_a_mend_that_an_error_about_a_run_names_serves(tmp_path, says, breaks, mended):
    assert says in told(breaks, tmp_path) and mended(tmp_path)


# --- the folder of a finished run ---


def as_told(run):
    """The command of a message: what it asks for."""
    words = shlex.split(told(read_run, run).rpartition(": ")[2])
    return words[:2] == [*COMMAND[:2]] and tyro.cli(Arguments, args=words[2:], config=OPTIONS).out == Path(NEW_FOLDER)


def of_version_2(run):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("irl_gym.runs.identity.FORMAT", "irl_gym.Run/2")
        return read_run(run)


def again(run):
    """The folder is claimed for its run, without the file that says who wrote it."""
    (run / "run.json").unlink()
    claim(run, read_json(run / "config.json"))
    return read_run(run)


def judged_again(run):
    (run / "metrics.json").unlink()
    recover_and_retrain(asked(), run)
    return read_run(run)


def busy(run):
    """Two processes ask for one folder."""
    with held(run, "the first"):
        return recover_and_retrain(asked(), run)


READ = [
    ("wait for it,", "run.json", {}, busy, lambda run: recover_and_retrain(asked(), run)),
    ("or choose another --out.", "run.json", {}, busy, lambda run: claim(run.parent / "another", {}) is None),
    ("Name the --out of a run.", "config.json", None, read_run, lambda run: read_run(run.parent / "whole")),
    ("delete it, and its stage is run again", "metrics.json", {"policies": None}, read_run, judged_again),
    ("which no stage writes again. Make the run again, with another --out: ", "config.json", "{", read_run, as_told),
    ("Upgrade irl_gym.", "run.json", {"format": "irl_gym.Run/2"}, read_run, of_version_2),
    ("If irl_gym made the run, delete that file.", "run.json", {"format": "irl_gym.Run/x"}, read_run, again),
    ("Delete that file.", "run.json", "{", lambda run: claim(run, read_json(run / "config.json")), again),
]


@pytest.mark.parametrize(("says", "name", "change", "reads", "mended"), READ, ids=[one[0] for one in READ])
def test_a_mend_that_the_folder_of_a_run_names_serves(finished, unvouched, says, name, change, reads, mended):
    (unvouched.parent / "whole").symlink_to(finished)  # the same, made again
    if isinstance(change, dict):
        write_json(unvouched / name, read_json(unvouched / name) | change)
    else:
        (unvouched / name).unlink() if change is None else (unvouched / name).write_text(change)
    assert says in told(reads, unvouched) and mended(unvouched)


FILES = [f"{one}.py" for one in ("experiment", "world_choice", "worlds", "run_reader", "runs/run", "identity", "checks",
                                 "terminal", "verified", "pipeline", "closing")]  # fmt: skip
ELSEWHERE = [
    "expected the same files. Choose another --out.",  # test_pipeline_from_data
    "Make one, such as `irl_gym.Experiment('FrozenLake-v1', gamma=0.99)`.",  # test_mends_of_the_facade
    "Wrap a function of observations in `irl_gym.agents.experts.Acting`.",  # test_mends_of_experts
    "Delete it, and it is written again.",  # test_vouched_files
    "The same command continues it: python",  # test_vouched_files, test_runs
    "delete table.npz, expert.npz and reward.npz, and what they hold is made again",  # test_verified
]


def test_every_mend_that_an_error_about_a_run_names_is_executed():
    assert not unsaid([*CASES, *READ, *((one,) for one in ELSEWHERE)], *FILES)
