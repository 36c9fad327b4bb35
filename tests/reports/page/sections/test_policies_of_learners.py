"""The page of a learner that gives a policy: it is shown state by state, as the expert is."""

import pytest

from irl_gym.mdp.planning.dynamic_programming import policy_evaluation
from irl_gym.reports.page.contents import RunContents
from irl_gym.reports.page.report import write_report
from irl_gym.reports.page.sections.compared import policies, values
from irl_gym.runs.run import read_run

SHOWN = {"policy": ["own"], "both": ["agent", "own"]}


@pytest.mark.parametrize("kind", SHOWN)
def test_the_page_shows_policy_and_values_of_each_judged_policy_as_maps(policy_run, look, tmp_path, kind):
    write_report(read_run(policy_run(kind)), tmp_path / "page.html")
    page = look(tmp_path / "page.html")
    drawn = page.evaluate("[...document.querySelectorAll('.plot')].map(one => one.id)")
    expected = {f"{what}-{who}" for what in ("policy", "value") for who in ("expert", *SHOWN[kind])}
    assert page.wrong == [] and expected <= set(drawn) and ("reward-learned" in drawn) is (kind == "both")
    assert len(page.locator("#policies caption").all_inner_texts()) == len(SHOWN[kind])
    told = page.locator("#rewards .lead").inner_text()
    assert told.startswith("The learner gives a policy and no reward.") is (kind == "policy")
    assert page.locator("#learning").count() == page.locator("#lambda").count() == int(kind == "both")


def test_values_of_the_learner_s_policy_are_those_of_the_true_reward(policy_run):
    scene = RunContents(read_run(policy_run("policy"))).scene
    (name, policy), section = *scene.agents.items(), values(scene)
    V, (panel,) = (
        policy_evaluation(scene.mdp, scene.table.reward, policy),
        (one for one in section.panels if one.name == "value-own"),
    )
    shown = [one for row in panel.figure.data[1].z for one in row if one is not None]
    assert name == "learned" and shown == pytest.approx(V[scene.acting].tolist(), abs=1e-4)
    assert section.lead.endswith("on one scale: where they differ is where the learner's policy falls behind.")


def test_of_a_policy_that_chooses_by_chance_the_likeliest_action_is_judged(policy_run):
    scene = RunContents(read_run(policy_run("policy"))).scene
    n, off = int(scene.acting.sum()), int(scene.deviates(scene.agents["learned"]).sum())
    section = policies(scene)
    assert (
        section.lead.startswith(f"In {n - off} of {n} states (")
        and "policy most likely takes an optimal action." in section.lead
    )
    assert len(section.shown["tables"][0]["rows"]) == off and section.shown["tables"][0]["who"] == "learner's policy"
