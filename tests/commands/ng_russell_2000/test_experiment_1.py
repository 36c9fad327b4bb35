"""Experiment 1 of the paper: figure 2 and lambda_0."""

import numpy as np
import pytest

from irl_gym.commands.ng_russell_2000.experiment_1 import PRINTED, Experiment1
from irl_gym.mdp.planning.dynamic_programming import policy_iteration


@pytest.fixture(scope="module")
def outcome():
    return Experiment1().run()


def test_experiment_1_meets_every_bar(outcome):
    assert [one.what for one in outcome.checks if one.verdict is False] == []


def test_experiment_1_gives_the_printed_panel_of_figure_2(outcome):
    np.testing.assert_allclose(outcome.panels[0], PRINTED, atol=0.0015)


def test_experiment_1_with_the_price_of_figure_2_leaves_little_but_the_goal(outcome):
    _, penalised = outcome.panels
    assert penalised[0, 4] == pytest.approx(1) and np.abs(penalised[outcome.true == 0]).max() < 0.12


def test_experiment_1_only_one_way_to_break_ties_gives_the_printed_panel(outcome):
    assert outcome.alternatives["of these, such that give the printed panel"] == 1


@pytest.mark.parametrize("panel", [0, 1])
def test_experiment_1_the_expert_is_optimal_for_both_rewards(outcome, panel):
    mdp = outcome.table.mdp
    Q = policy_iteration(mdp, (mdp.P @ outcome.panels[panel].ravel()).reshape(25, 4)).Q
    acting = ~mdp.terminal
    assert (Q.max(axis=1) - Q[np.arange(25), outcome.expert] < 1e-6)[acting].all()


def test_experiment_1_another_price_is_solved_for_that_price():
    found = Experiment1(l1=0.5).run()
    assert found.penalised.proof.l1 == 0.5 and found.settings.l1 == 0.5


def test_experiment_1_reports_its_progress():
    shares = []
    Experiment1().run(shares.append)
    assert shares == sorted(shares) and shares[-1] == 1.0
