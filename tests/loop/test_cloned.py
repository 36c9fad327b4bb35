"""A run sets a clone of its demonstrations beside what was learned."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from lake_run import asked, of_policies

from irl_gym.demonstrations.datasets import read_minari
from irl_gym.errors import InvalidDemonstrations
from irl_gym.files.run_folder import read_json
from irl_gym.learners.cloning.clone import Clone
from irl_gym.loop.loop import MAKERS
from irl_gym.loop.pipeline import recover_and_retrain
from irl_gym.loop.worlds import COPYING, copier
from irl_gym.mdp.episodes import empirical_policy
from irl_gym.mdp.policies import as_distribution
from irl_gym.reports.comparison.comparison_page import write_comparison
from irl_gym.runs.run import read_run


def forgotten(folder, *names):
    """A folder whose stages from the clone on are to be made again."""
    for name in ("clone", "metrics", "record", "ambiguity", "report", *names):
        (folder / ".stages" / f"{name}.json").unlink()
    return folder


def test_the_clone_is_that_of_the_demonstrations_of_the_run(finished):
    run = read_run(finished)
    episodes = read_minari(run.metrics["demonstrations"]["dataset"], root=finished / "dataset")
    A = run.table.mdp.n_actions
    clone = Clone().fit(empirical_policy(list(episodes), run.table.states, A), run.table.mdp)
    assert np.array_equal(as_distribution(run.agents["clone"], run.table.mdp.n_states, A), clone.policy)
    assert run.metrics["policies"]["clone"]["how"].startswith(clone.proof.brief)


def test_a_clone_says_how_many_steps_it_saw_and_what_it_never_saw(finished, policy_run):
    told = {path: read_json(path / "metrics.json")["policies"]["clone"]["how"] for path in (finished, policy_run("policy"))}
    brief = "cloned from 60 steps; 5 of 11 states never seen"
    assert [*told.values()] == [f"{brief}; the learner had the expert's whole policy", brief]


def test_a_clone_beside_the_clone_is_not_made(tmp_path, monkeypatch):
    monkeypatch.setitem(MAKERS, "figures", ())
    made = recover_and_retrain(asked(learner=Clone()), tmp_path)
    assert [*made.metrics["policies"]] == ["expert", "random", "learned"] and not [*tmp_path.glob("clone*")]
    assert "opying the demonstrations" not in (tmp_path / "report.html").read_text()


def test_a_clone_that_cannot_be_made_does_not_stop_the_run_and_the_page_says_why(copied, monkeypatch):
    def refuse(*_):
        raise InvalidDemonstrations("nobody saw them. Look.")

    monkeypatch.setattr(Clone, "learn", refuse)
    (copied / "clone_policy.npz").unlink()
    recover_and_retrain(asked(), forgotten(copied))
    run = read_run(copied)
    assert "clone" not in run.metrics["policies"] | run.agents
    told = "The demonstrations could not be copied, to compare with: InvalidDemonstrations: nobody saw them. Look."
    assert told in (copied / "report.html").read_text()


def test_a_network_that_copies_leaves_the_same_bytes_and_says_how_far_it_is(policy_run, tmp_path):
    first, shares = policy_run("stepped"), []
    out = forgotten(Path(shutil.copytree(first, tmp_path / "again")))
    recover_and_retrain(of_policies("stepped"), out, lambda stage, share, _: stage == "clone" and shares.append(share))
    assert (out / "metrics.json").read_bytes() == (first / "metrics.json").read_bytes()
    told = shares[: shares.index(1.0)]
    assert len(told) > 5 and told == sorted(told)
    assert "by a network, in" in read_run(out).metrics["policies"]["clone"]["how"]


@pytest.mark.parametrize("steps", [1, 500, 50_000, 1_000_000, 30_000_000])
def test_the_minibatches_of_a_copy_are_bounded(steps):
    found = copier(steps)
    assert 1 <= found.epochs * (steps / found.batch_size) <= COPYING + 1 or found.epochs in (1, 100)
    assert steps / found.batch_size <= COPYING + 1


def test_page_terminal_and_comparison_say_whether_copying_does_as_well(finished, tmp_path):
    page, run = (finished / "report.html").read_text(), read_run(finished)
    assert "clone, cloned from 60 steps" in page and "Copying the demonstrations does as well here" in page
    write_comparison([run, run], tmp_path / "compare.html")
    told = (tmp_path / "compare.html").read_text()
    words = (
        "does copying the demonstrations do as well?",
        "score, clone",
        "mean return (95 %), clone",
        "how it came about, clone",
    )
    assert [one for one in words if one not in told] == []
    assert [*(finished / "metrics.csv").read_text().split(",clone,score,")][1:] != []
