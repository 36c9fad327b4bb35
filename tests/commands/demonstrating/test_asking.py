"""A person as oracle, whose keyboard is a script."""

import io
import shlex
import signal
import sys

import numpy as np
import pytest

from irl_gym.commands.door import main
from irl_gym.demonstrations.datasets import load_minari

LAKE = ("play", "--as-oracle", "--env-kwargs", "is_slippery=false", "--episodes", "1", "--rounds", "2")
WAY = "ddsssd"
"""Over the lake without slips: 0, 1, 2, 6, 10, 14, 15."""


@pytest.fixture
def typed(monkeypatch, capsys, tmp_path, unchecked):
    """The command with these keys: its exit code, and what it says."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "data"))
    before = {one: signal.getsignal(one) for one in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}

    def run(keys, *more):
        monkeypatch.setattr(sys, "stdin", io.StringIO(keys))
        code = main([*LAKE, *more])
        return code, capsys.readouterr().out

    yield run
    for one, handler in before.items():
        signal.signal(one, handler)


def files(folder):
    left = {one.relative_to(folder).as_posix(): one for one in folder.rglob("*") if one.is_file()}
    return {name: one.read_bytes() for name, one in left.items()}


def test_who_watches_lets_the_learner_act_and_takes_over(typed, tmp_path):
    code, said = typed(f"{WAY}\n...s..\ns..\n", "--out", "here")
    assert code == 0, said
    assert "The learner is about to do: right." in said and "asked 7 times, in 6 states, over 2 rounds" in said
    assert main(shlex.split(said.splitlines()[-1])[1:]) == 0  # what acts as it learned
    policy = np.load(tmp_path / "here/policy.npz")["probabilities"]
    assert policy[[0, 1, 2, 6, 10, 14]].argmax(axis=1).tolist() == [2, 2, 1, 1, 1, 2]
    first, second = load_minari("irl_gym/frozenlake-v1-labels-v0", root=tmp_path / "here/labels").iterate_episodes()
    assert first.infos["labelled"].tolist() == [True] * 6 + [False]
    assert second.infos["labelled"].tolist() == [False] * 3 + [True, False, False, False]


def test_who_is_asked_at_each_step_is_asked_once_a_state(typed, tmp_path):
    code, said = typed(f"{WAY}\n", "--out", "here", "--labels", "own")
    assert code == 0 and "asked 6 times, in 6 states" in said, said


@pytest.mark.parametrize("labels", ["own", "gated"])
@pytest.mark.parametrize("cut", [2, 8])
def test_a_keyboard_that_is_closed_in_the_middle_loses_nothing(typed, tmp_path, labels, cut):
    keys = {"gated": f"{WAY}...s..", "own": WAY}[labels]
    cut = min(cut, len(keys) - 1)
    code, said = typed(keys[:cut], "--labels", labels, "--out", "parts")
    assert code == 1 and f"Answers that are kept in parts: {min(cut, 6)}. The same command goes on." in said
    code, said = typed(keys[cut:], "--labels", labels, "--out", "parts")
    assert code == 0, said
    assert typed(keys, "--labels", labels, "--out", "whole")[0] == 0
    assert files(tmp_path / "parts") == files(tmp_path / "whole")


def test_the_same_command_after_the_end_asks_nobody(typed, tmp_path):
    assert typed(f"{WAY}......")[0] == 0
    (out,) = (tmp_path / "runs").iterdir()
    assert out.name.startswith("frozenlake-v1-asked-")
    before = files(out)
    assert typed("")[0] == 0 and files(out) == before


def test_help_and_strange_keys_are_told_and_q_leaves(typed):
    code, said = typed("?zdq", "--out", "here")
    assert code == 1 and said.count("it may (enter .)") >= 2 and "'z' is no key here" in said
    assert "Answers that are kept in here: 1." in said


def test_a_network_learns_from_a_person_where_nothing_is_numbered(typed, tmp_path, monkeypatch):
    from irl_gym.commands.demonstrating import asking

    monkeypatch.setattr(asking, "step_limit", lambda env: 5)
    small = asking.NeuralClone(net_arch=(4,), epochs=2, held_out=0.0)
    monkeypatch.setattr(asking, "NeuralClone", lambda held_out: small)
    code, said = typed("01010" + ".....", "--env-id", "CartPole-v1", "--env-kwargs", "--out", "here")
    assert code == 0 and (tmp_path / "here/policy.zip").exists() and "asked 5 times, over 2 rounds" in said, said
