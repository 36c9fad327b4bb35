"""What the page says of states is what the run's numbers say."""

from dataclasses import replace

import numpy as np
import pytest
from reports.page.made_runs import scene_of, section_of, table_run

from irl_gym.judging.metrics import agreement, optimal_actions, policy_value
from irl_gym.reports.page.sections.compared import policies
from irl_gym.reports.page.sections.training import widths


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return table_run(tmp_path_factory.mktemp("run"), errors=3, films=False)


def deviating(scene):
    return scene.deviates(scene.agents["retrained"])


def share(scene):
    return 1 - deviating(scene).sum() / scene.acting.sum()


def test_the_share_of_states_that_agree_is_the_agreement_of_the_metrics(run):
    scene = scene_of(run)
    assert share(scene) == pytest.approx(run.metrics["policies"]["retrained"]["agreement"]) and deviating(scene).any()
    assert "the retrained agent takes an optimal action." in policies(scene).lead


def test_an_agent_of_a_poor_expert_is_judged_by_what_that_does(run):
    poor = np.where(np.arange(16) == 14, 0, run.expert)  # beside the goal it turns away
    scene = scene_of(replace(run, expert=poor))
    own = np.eye(4, dtype=bool)[poor]
    assert share(scene) == pytest.approx(agreement(scene.mdp, run.agent, own)) and np.array_equal(scene.good, own)
    assert "takes one of the expert's actions." in policies(scene).lead


def test_an_expert_that_errs_or_is_known_by_data_is_no_judge(run):
    told = {**run.metrics, "demonstrations": {**run.metrics["demonstrations"], "episodes_only": True}}
    scene = scene_of(replace(run, expert=np.full((16, 4), np.nan), metrics=told))
    assert np.array_equal(scene.good, optimal_actions(scene.mdp, scene.table.reward))


def test_what_a_state_loses_is_0_where_the_agent_acts_best(run):
    scene = scene_of(replace(run, agents={"retrained": run.expert}))
    np.testing.assert_allclose(scene.lost(scene.agents["retrained"]), 0, atol=1e-12)
    assert float(scene.mdp.d0 @ scene.best.V) == pytest.approx(policy_value(scene.mdp, scene.table.reward, run.expert))


def test_widths_of_steps_are_those_of_the_expert_s_step(run):
    width = np.where(scene_of(run).acting[:, None], np.arange(64.0).reshape(16, 4), np.nan)
    section = section_of(widths, replace(run, widths={"low": -width, "high": width * 0, "width": width}))
    drawn = np.array(section.panels[0].figure.data[1].z, dtype=float).ravel()
    shown = ~np.isnan(drawn)
    np.testing.assert_array_equal(drawn[shown], width[np.arange(16), run.expert][shown])
    assert shown.sum() == 11 and "the step which the expert takes" in section.panels[0].caption
