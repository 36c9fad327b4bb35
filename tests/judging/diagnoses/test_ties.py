"""Actions that the reward leaves as good as the expert's, or better."""

from dataclasses import replace

import numpy as np
import pytest
from certified import both
from models import paper_grid
from patients import finding, judged, names, partly_contradicted

from irl_gym.judging.diagnoses.findings import told_finding
from irl_gym.learners.linear_programs.feature import FeatureLP
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.mdp.optimality import certify
from irl_gym.mdp.planning.dynamic_programming import policy_iteration
from irl_gym.mdp.tabular_mdp import TabularMDP

GRID = paper_grid()
CAPPED = ("--margin-cap auto", "--l1 0")
ZERO = np.zeros(5, dtype=int)


def lake(toy_text, name="FrozenLake 4x4 slippery"):
    table = toy_text(name)
    return table.mdp, policy_iteration(table.mdp, table.reward).policy, table.reward


def test_an_expert_that_is_not_optimal_is_told_with_states_and_actions():
    said = finding("expert-not-optimal", judged(GRID.mdp, GRID.expert, -GRID.R), GRID.mdp, GRID.expert)
    assert said.states.size == len(said.actions) > 0 and f"s={said.states[0]} a={said.actions[0]}" in told_finding(
        said.to_json()
    )


def test_the_defaults_mend_an_expert_that_is_not_optimal():
    assert "FiniteLP()" in finding("expert-not-optimal", judged(GRID.mdp, GRID.expert, -GRID.R), GRID.mdp, GRID.expert).mend
    assert names(FiniteLP().fit(GRID.mdp, GRID.expert), GRID.mdp, GRID.expert) == ()


def test_violations_that_slack_bought_are_told_as_possible_errors():
    table = partly_contradicted()
    result = FiniteLP(slack=10.0).fit(table, ZERO, visits=np.array([99.0, 99.0, 99.0, 1.0, 99.0]))
    said = finding("expert-not-optimal", result, table, ZERO)
    assert said.states.tolist() == [3] and "the expert's errors" in said.mend and said.flags == ("--slack 100",)


def test_ties_that_another_reward_breaks_are_told(toy_text):
    mdp, expert, _ = lake(toy_text)
    said = finding("avoidable-ties", FiniteLP(margin_cap=None).fit(mdp, expert), mdp, expert)
    assert 'margin_cap="auto"' in said.mend and said.states.size


def test_a_mend_of_ties_is_not_what_the_run_has(toy_text):
    mdp, expert, _ = lake(toy_text)
    free, best = FiniteLP(margin_cap=None).fit(mdp, expert), FiniteLP().fit(mdp, expert)
    soft = replace(free, proof=replace(free.proof, slack=1.0))
    same = replace(best, reward=free.reward)
    said = [finding("avoidable-ties", one, mdp, expert) for one in (free, soft, same)]
    assert [one.flags for one in said] == [CAPPED, ("--slack none", *CAPPED), ()]
    assert "same settings" in said[2].mend


def test_a_cap_on_margins_mends_avoidable_ties(toy_text):
    mdp, expert, true = lake(toy_text)
    assert names(FiniteLP(margin_cap="auto").fit(mdp, expert), mdp, expert, true=true) == ()


def test_ties_that_no_state_reward_breaks_are_told():
    mdp = partly_contradicted()
    said = finding("unbreakable-ties", FiniteLP().fit(mdp, ZERO), mdp, ZERO)
    assert said.states.tolist() == [0, 3] and said.actions == (1, 1)


def test_ties_that_only_other_features_break_ask_for_features():
    A, B, C, D = np.eye(4)
    mdp = TabularMDP.from_dense(np.array([[B, C, D], [B, B, B], [C, C, C], [D, D, D]]), 0.9, A)
    found = FeatureLP(np.array([[0.0], [0.0], [0.0], [1.0]]), margin_cap="auto").fit(mdp, ZERO[:4])
    said = finding("avoidable-ties", found, mdp, ZERO[:4])
    assert found.proof.unbreakable_rows.tolist() == [[0, 1]] and both(found, mdp, ZERO[:4]).margin[0] > 0
    assert (said.states.tolist(), said.actions) == ([0], (1,)) and said.flags == ("--features",)


def test_a_reward_on_steps_mends_unbreakable_ties():
    mdp = partly_contradicted()
    assert names(FiniteLP(reward_on="state-action").fit(mdp, ZERO), mdp, ZERO) == ()


def test_actions_of_the_same_successors_are_told_where_they_cost_more(toy_text):
    mdp, expert, true = lake(toy_text, "CliffWalking slippery")
    said = finding("same-successors", FiniteLP().fit(mdp, expert), mdp, expert, true=true)
    assert set(said.states.tolist()) == {36} and "not the same true reward" in said.sentence


def test_a_reward_on_steps_mends_the_same_successors(toy_text):
    mdp, expert, true = lake(toy_text, "CliffWalking slippery")
    assert names(FiniteLP(reward_on="state-action").fit(mdp, expert), mdp, expert, true=true) == ()


def test_actions_of_the_same_successors_and_the_same_true_reward_are_no_finding(toy_text):
    mdp, expert, _ = lake(toy_text, "CliffWalking slippery")
    same = np.zeros(mdp.n_states)
    assert "same-successors" not in names(FiniteLP().fit(mdp, expert), mdp, expert, true=same)


@pytest.mark.parametrize("known", [25, 20])
@pytest.mark.parametrize("mixing", [False, True])
def test_the_doctor_calls_those_states_violated_that_the_certificate_does(known, mixing):
    reward = np.random.default_rng(7).normal(size=25)
    expert = np.eye(4)[GRID.expert].astype(float)
    expert[3] = [0.5, 0.5, 0, 0] if mixing else expert[3]
    expert[known:] = np.nan
    found = certify(GRID.mdp, expert, reward)
    said = finding("expert-not-optimal", judged(GRID.mdp, expert, reward), GRID.mdp, expert)
    assert sorted(set(said.states.tolist())) == found.violated.tolist()
    assert dict((one.label, one.sentence) for one in found.facts())["violated"] in said.sentence
