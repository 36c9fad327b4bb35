"""The doctor: no false alarm on the environments of the first issue, and what a diagnosis is."""

import json

import gymnasium as gym
import numpy as np
import pytest
from conftest import KWARGS
from hypothesis import given
from models import models, paper_grid
from patients import judged, names, sampled

from irl_gym.errors import InvalidMDP, InvalidParameter, InvalidReward
from irl_gym.judging.diagnoses import case, evidence
from irl_gym.judging.diagnoses.doctor import CHECKS, Diagnosis, Finding, doctor
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.mdp.planning.dynamic_programming import policy_iteration
from irl_gym.mdp.rewards import TabularReward

GRID = paper_grid()


@pytest.mark.parametrize("name", [one for one in KWARGS if one != "CliffWalking slippery"])
def test_the_default_learner_is_healthy(toy_text, name):
    table = toy_text(name)
    expert = policy_iteration(table.mdp, table.reward).policy
    result = FiniteLP(report_lambda_0=True).fit(table.mdp, expert)
    assert doctor(result, table.mdp, expert, true=table.reward).healthy and doctor(result, table.mdp, expert).healthy


def test_slippery_cliff_walking_is_told_what_no_state_reward_can_say(toy_text):
    table = toy_text("CliffWalking slippery")
    expert = policy_iteration(table.mdp, table.reward).policy
    found = names(FiniteLP().fit(table.mdp, expert), table.mdp, expert, true=table.reward)
    assert found == ("worst-tie", "same-successors")


def test_slippery_cliff_walking_is_healthy_with_a_reward_on_steps(toy_text):
    table = toy_text("CliffWalking slippery")
    expert = policy_iteration(table.mdp, table.reward).policy
    result = FiniteLP(reward_on="state-action").fit(table.mdp, expert)
    assert doctor(result, table.mdp, expert, true=table.reward).healthy


@given(models())
def test_the_default_learner_is_healthy_on_random_tables(model):
    result = FiniteLP().fit(model.mdp, model.expert)
    assert doctor(result, model.mdp, model.expert, true=model.step_reward).healthy


def test_a_diagnosis_reads_as_sentences_with_their_mends():
    text = str(doctor(FiniteLP(l1=5.0).fit(GRID.mdp, GRID.expert), GRID.mdp, GRID.expert))
    assert text.startswith("1 finding. Examined: 24 states of 4 actions each, gamma 0.9. Not examined, of ")
    assert "not known.\n1. The reward is zero" in text
    assert '\n   Mend: margin_cap="auto" with l1=0.0' in text


def test_a_healthy_diagnosis_says_what_was_examined():
    text = str(doctor(FiniteLP().fit(GRID.mdp, GRID.expert), GRID.mdp, GRID.expert))
    assert text.startswith("Healthy. Examined: 24 states") and "in 24 of 24" in text


def test_questions_that_cannot_be_asked_are_counted_with_why():
    said = doctor(FiniteLP().fit(GRID.mdp, GRID.expert), GRID.mdp, GRID.expert).examined
    assert said.endswith(
        f" Not examined, of {len(CHECKS)} questions: 5, as no finished run judged it; 2, as the true reward is not known."
    )


def test_questions_that_take_programs_are_not_asked_of_a_large_table(monkeypatch):
    monkeypatch.setattr(case, "SMALL", 3)
    monkeypatch.setattr(evidence, "SMALL", 3)
    made = doctor(FiniteLP().fit(GRID.mdp, GRID.expert), GRID.mdp, GRID.expert, true=GRID.R)
    assert made.healthy and "3, as programs are solved again for at most 3 reachable states" in made.examined


def test_a_reward_without_a_table_is_as_healthy_as_its_certificate():
    made = doctor(sampled(), None, None)
    table = sum(bool(set(needs) & {"expert", "reward", "true", "programs"}) for needs in CHECKS.values())
    assert made.healthy and made.examined.startswith("Examined: what the learner proved.")
    assert f"{table}, as there is no table" in made.examined


@pytest.mark.parametrize("R", [-GRID.R, np.zeros(25)])
def test_a_reward_whose_certificate_shows_nothing_is_not_called_healthy_without_a_table(R):
    made = doctor(judged(GRID.mdp, GRID.expert, R), None, None)
    assert made.answer == "not examined" and "no certificate by which the expert is best" in str(made)


def test_a_reward_whose_expert_is_not_known_is_not_called_healthy():
    made = doctor(FiniteLP().fit(GRID.mdp, GRID.expert), GRID.mdp, None)
    assert made.answer == "not examined" and not made.healthy
    assert str(made).startswith("Not examined: the expert is known in no state in which it acts. Examined: ")


def test_a_diagnosis_is_json():
    made = doctor(judged(GRID.mdp, GRID.expert, -GRID.R), GRID.mdp, GRID.expert).to_json()
    assert json.loads(json.dumps(made, allow_nan=False)) == made and made["findings"][0]["states"]


def test_a_finding_keeps_the_flags_of_its_mend():
    assert Finding("name", "This.", "That.", flags=("--l1 0",)).to_json()["flags"] == ["--l1 0"]


def test_long_lists_of_states_are_cut_and_counted():
    made = doctor(judged(GRID.mdp, GRID.expert, -GRID.R), GRID.mdp, GRID.expert)
    assert " more" in str(made)


def test_every_check_has_its_own_words():
    assert len({check.__doc__ for check in CHECKS}) == len(CHECKS) and all(check.__doc__ for check in CHECKS)


def test_a_finding_of_the_whole_table_names_no_state():
    assert Finding("name", "This.", "That.").states.size == 0 and Diagnosis((), "").healthy


@pytest.mark.parametrize("wrong", [1, np.ones(24), "reward"])
def test_something_else_than_a_reward_is_refused(unchecked, wrong):
    with pytest.raises(InvalidReward, match="the reward"):
        doctor(wrong, GRID.mdp, GRID.expert)


@pytest.mark.parametrize("kind", [np.asarray, TabularReward])
def test_a_reward_from_elsewhere_is_judged_by_its_values(kind):
    learned = FiniteLP().fit(GRID.mdp, GRID.expert).reward.values
    assert doctor(kind(learned), GRID.mdp, GRID.expert).healthy
    assert "expert-not-optimal" in doctor(kind(-learned), GRID.mdp, GRID.expert).names
    assert doctor(kind(np.zeros(25)), GRID.mdp, GRID.expert).names == ("zero-reward",)


def test_a_reward_from_elsewhere_needs_a_table():
    with pytest.raises(InvalidParameter, match="result is an ndarray, a reward without a proof, and mdp is None"):
        doctor(np.zeros(25), None, None)


def test_something_else_than_a_table_is_refused(unchecked):
    with pytest.raises(InvalidMDP, match="tabulate"):
        doctor(None, gym.make("FrozenLake-v1"), GRID.expert)


def test_neither_a_result_nor_a_table_is_refused():
    with pytest.raises(InvalidParameter, match="expected a result, a table, or both"):
        doctor(None, None, None)


def test_a_true_reward_of_another_table_is_refused():
    with pytest.raises(InvalidReward, match="another table"):
        doctor(None, GRID.mdp, GRID.expert, true=np.ones(3))
