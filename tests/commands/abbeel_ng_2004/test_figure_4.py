"""The cloning curves of Abbeel & Ng (2004): the world by its definition, and the curves on a small one."""

import json
from dataclasses import replace

import numpy as np
import pytest

from irl_gym.commands.abbeel_ng_2004.figure_4 import ACTION, CURVES, DISTRIBUTION, MIMIC, PUBLISHED, Figure4, Outcome4
from irl_gym.commands.abbeel_ng_2004.gridworld import Gridworld
from irl_gym.commands.abbeel_ng_2004.reproduction import command
from irl_gym.files.run_folder import read_json

SMALL = Figure4(Gridworld(side=16, block=4), instances=2, sizes=(1, 10, 2_000), steps=50)


@pytest.fixture(scope="module")
def small():
    return SMALL.run()


def test_the_world_moves_as_chosen_or_at_random_and_stays_at_its_edge():
    P = Gridworld(side=4, block=2).mdp().P.toarray().reshape(16, 4, 16)
    np.testing.assert_allclose(P[0, 1, [0, 1, 4]], [0.15, 0.775, 0.075])  # right, from the upper left corner
    np.testing.assert_allclose(P[5, 2, [1, 6, 9, 4]], [0.075, 0.075, 0.775, 0.075])  # down, from inside


def test_macrocells_are_square_blocks():
    np.testing.assert_array_equal(
        Gridworld(side=4, block=2).cells.reshape(4, 4), [[0, 0, 1, 1], [0, 0, 1, 1], [2, 2, 3, 3], [2, 2, 3, 3]]
    )


@pytest.mark.parametrize("seed", range(5))
def test_rewards_are_few_and_add_up_to_one(seed):
    w = Gridworld().weights(np.random.default_rng(seed))
    assert w.shape == (64,) and w.sum() == pytest.approx(1) and 2 <= np.count_nonzero(w) <= 20


def test_who_mimics_whatever_is_shown_ends_as_the_expert_and_no_macrocell_does(small):
    ends = dict(zip(CURVES, small.means[:, -1], strict=True))
    assert ends[MIMIC] == pytest.approx(1, abs=1e-3) and ends[ACTION] < 0.99 and ends[DISTRIBUTION] < 0.99


def test_no_clone_is_worth_more_than_the_expert(small):
    assert small.shares.shape == (2, 3, 3) and (small.shares <= 1 + 1e-9).all()


def test_the_same_seed_gives_the_same_curves(small):
    assert json.dumps(SMALL.run().to_json()) == json.dumps(small.to_json())
    assert replace(SMALL, seed=1).run().to_json()["curves"] != small.to_json()["curves"]


def test_a_curve_is_judged_where_the_papers_was_read_off():
    shares = np.full((2, 3, 4), 0.5)
    checks = Outcome4(Figure4(sizes=(1, 10, 100, 1_000)), shares).checks
    judged = [one for one in checks if one.verdict is not None]
    assert len(judged) == sum(map(len, PUBLISHED.values())) == 10
    assert [one.what for one in judged if one.verdict] == [f"{MIMIC}, 100 shown"]


def test_the_command_prints_writes_and_draws(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(Figure4, "quick", lambda: replace(SMALL, within=1.0))
    assert command(["--quick", "--figure", "4", "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr()
    assert "Every verdict is yes." in said.out and "mimic the expert, 10 shown" in said.out and "figure 4: done" in said.err
    assert {one.name for one in (tmp_path / "out").iterdir()} == {"figure_4.png", "abbeel_ng_2004.json", "timings.json"}
    found = read_json(tmp_path / "out" / "abbeel_ng_2004.json")
    assert found["figure_4"]["curves"].keys() == {*CURVES} and "seconds" not in json.dumps(found)


def test_a_verdict_that_is_no_is_an_exit_code(monkeypatch, tmp_path):
    monkeypatch.setattr(Figure4, "quick", lambda: replace(SMALL, within=1e-6))
    assert command(["--quick", "--out", str(tmp_path)]) == 1


def test_a_mistake_is_one_line(tmp_path, capsys):
    assert command(["--seed", "-1", "--out", str(tmp_path)]) == 2
    assert "seed is -1: expected at least 0." in capsys.readouterr().err


@pytest.mark.slow
def test_figure_4_is_within_its_bars_but_for_what_two_draws_of_twenty_instances_differ_by():
    found = Figure4().run()
    apart = 2 * np.sqrt(2) * found.errors.max()
    assert [one.what for one in found.checks if one.verdict is False and abs(one.deviation) > apart] == []
    assert sum(one.verdict is False for one in found.checks) <= 1
