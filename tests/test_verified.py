"""What is said of an expert under a reward is computed from the files that lie there; what contradicts them is refused."""

import shutil

import numpy as np
import pytest
from forgetting import without_digests

from irl_gym.errors import RunIncomplete
from irl_gym.experiment import Experiment
from irl_gym.linear_reward import load_reward
from irl_gym.page.proof import verdict
from irl_gym.pipeline import recover_and_retrain
from irl_gym.planners import SB3
from irl_gym.rewards import TabularReward
from irl_gym.run_folder import read_json, write_json
from irl_gym.runs import read_run
from irl_gym.worlds import load_actions

LAKE = {"env_kwargs": {"is_slippery": False}, "episodes": 10, "eval_episodes": 10, "num_envs": 16}


def asked(**changes):
    return Experiment("FrozenLake-v1", 0.99, **{"retrain": SB3(total_timesteps=8_192), **LAKE, **changes})


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    out = tmp_path_factory.mktemp("runs") / "lake"
    recover_and_retrain(asked(), out)
    return out


@pytest.fixture(scope="module")
def run(finished):
    return read_run(finished)


@pytest.fixture
def copied(finished, tmp_path):
    return shutil.copytree(finished, tmp_path / "copy")


@pytest.fixture
def unvouched(copied):
    return without_digests(copied)


def negated(path):
    one = load_reward(path / "reward.npz")
    TabularReward(-one.values, one.note).save(path / "reward.npz")


def rolled(path):
    np.savez(path / "expert.npz", actions=np.roll(load_actions(path / "expert.npz"), 1))


def discounted(path):
    with np.load(path / "table.npz") as archive:
        arrays = dict(archive)
    np.savez(path / "table.npz", **{**arrays, "gamma": np.array(0.5)})


@pytest.mark.parametrize(
    ("swap", "found"), [(negated, "as recorded"), (rolled, "as recorded"), (discounted, r"gamma 0\.5: expected 0\.99")]
)
def test_a_run_whose_files_do_not_bear_out_its_record_is_refused(unvouched, swap, found):
    swap(unvouched)
    with pytest.raises(RunIncomplete, match=f"table, expert and reward do not bear out its record: .*{found}"):
        read_run(unvouched)


def test_a_run_with_a_swapped_file_is_made_whole_as_the_error_says(unvouched, finished):
    negated(unvouched)
    for name in ("table.npz", "expert.npz", "reward.npz"):
        (unvouched / name).unlink()
    recover_and_retrain(asked(), unvouched)
    assert read_run(unvouched).recomputed and np.array_equal(
        read_run(unvouched).learned.values, read_run(finished).learned.values
    )


def test_what_is_said_of_the_expert_is_computed_and_not_read(unvouched, run):
    content = read_json(unvouched / "metrics.json")
    write_json(unvouched / "metrics.json", content | {"reward": content["reward"] | {"expert_optimal": False}})
    assert read_run(unvouched).metrics["reward"] == run.metrics["reward"] and run.recomputed


def test_a_record_that_cannot_be_computed_again_is_told_as_one(unvouched):
    content = read_json(unvouched / "metrics.json")
    write_json(unvouched / "metrics.json", content | {"reward": content["reward"] | {"learner": "Theirs"}})
    run = read_run(unvouched)
    assert not run.recomputed and "by the run's own record" in verdict(run)["sentence"]
