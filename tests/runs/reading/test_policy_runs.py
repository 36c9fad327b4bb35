"""Runs of learners that give a policy: it is read, checked and judged again, or learned again where no file keeps it."""

import shutil

import numpy as np
import pytest
from forgetting import with_digests_anew
from lake_run import of_policies

from irl_gym.errors import RunIncomplete
from irl_gym.files.run_folder import read_json, write_json
from irl_gym.loop.pipeline import recover_and_retrain
from irl_gym.mdp.policies import load_actions
from irl_gym.runs.run import read_run

ROWS = {"policy": ["clone", "expert", "learned", "random"], "both": ["clone", "expert", "learned", "random", "retrained"]}


@pytest.fixture
def changed(policy_run, tmp_path):
    """A copy of a run in which the learner's policy is another, with digests made anew."""

    def made(kind, change):
        path = shutil.copytree(policy_run(kind), tmp_path / kind)
        np.savez(path / "learned_policy.npz", actions=change(load_actions(path / "learned_policy.npz")))
        return with_digests_anew(path)

    return made


@pytest.mark.parametrize("kind", ROWS)
def test_the_policy_of_a_learner_is_read_and_judged_again(policy_run, kind):
    run = read_run(policy_run(kind))
    assert sorted(run.metrics["policies"]) == ROWS[kind] and run.judged_again and "what is said of" not in run.whose
    assert np.array_equal(run.agents["learned"], load_actions(run.path / "learned_policy.npz"))
    assert ("the worst tie" in run.whose) is (kind == "both")


@pytest.mark.parametrize("kind", ROWS)
def test_a_policy_that_was_swapped_is_named_and_made_again(changed, policy_run, kind):
    path = changed(kind, lambda found: np.roll(found, 1, axis=1))
    with pytest.raises(RunIncomplete, match=r"as learned_policy\.npz gives it; delete learned_policy\.npz and metrics\.json, "):
        read_run(path)
    for name in ("learned_policy.npz", "metrics.json"):
        (path / name).unlink()
    recover_and_retrain(of_policies(kind), path)
    assert np.array_equal(read_run(path).agents["learned"], read_run(policy_run(kind)).agents["learned"])


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda found: found[:-1], r"has shape \(15, 4\), but the table asks for"),
        (lambda found: found * 0.5, "sums to 0.5"),
        (lambda found: found - 1.0, "a probability is at least 0"),
        (lambda found: np.full_like(found, np.inf), "cannot be read"),
        (lambda found: np.where(np.arange(16)[:, None] == 3, np.nan, found), "says nothing of state 3, and"),
        (lambda found: np.full(16, 4), "has action 4 of 4"),
    ],
)
def test_a_policy_that_is_none_of_the_table_is_refused(changed, change, told):
    with pytest.raises(RunIncomplete, match=rf"learned_policy\.npz .*{told}.*; delete it, and its stage is run again"):
        read_run(changed("policy", change))


def test_metrics_that_hide_the_policy_are_refused_and_made_again(policy_run, tmp_path):
    path = shutil.copytree(policy_run("both"), tmp_path / "both")
    told = read_json(path / "metrics.json")
    del told["policies"]["learned"]
    write_json(path / "metrics.json", told)
    with pytest.raises(RunIncomplete, match=r"whether a policy was learned; delete metrics\.json, and it is made again"):
        read_run(with_digests_anew(path))
    (path / "metrics.json").unlink()
    recover_and_retrain(of_policies("both"), path)
    assert read_run(path).metrics == read_run(policy_run("both")).metrics


@pytest.mark.parametrize("kind", ["policy", "stepped"])
def test_a_share_of_return_is_worked_out_from_the_mean_returns(policy_run, tmp_path, kind):
    path = shutil.copytree(policy_run(kind), tmp_path / kind)
    told = read_json(path / "metrics.json")
    told["policies"]["learned"]["return_share"] = 7.0
    write_json(path / "metrics.json", told)
    assert read_run(with_digests_anew(path)).metrics == read_run(policy_run(kind)).metrics


# --- without a table ---


def test_a_policy_of_observations_is_judged_by_episodes_though_no_file_keeps_it(policy_run):
    run = read_run(policy_run("stepped"))
    row = run.metrics["policies"]["learned"]
    assert run.stages["reward"]["files"] == ["certificate.json"] and run.films["agent"].steps
    assert row["mean_return"] == pytest.approx(50, abs=5) and row["how"] == "learned by Pusher"


def test_a_policy_that_no_file_keeps_is_learned_again_where_a_run_is_continued(policy_run, tmp_path):
    path = shutil.copytree(policy_run("stepped"), tmp_path / "stepped")
    before = (path / "metrics.json").read_bytes()
    (path / "metrics.json").unlink()
    recover_and_retrain(of_policies("stepped"), path)
    assert (path / "metrics.json").read_bytes() == before
