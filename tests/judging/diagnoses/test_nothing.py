"""A reward that says nothing: each sentence has a case, and its mend is tried."""

from dataclasses import replace

import numpy as np
import pytest
from models import paper_grid, random_model, ring
from patients import contradicted, corridor, finding, judged, names, right

from irl_gym.judging.diagnoses.case import Case
from irl_gym.judging.diagnoses.doctor import diagnose
from irl_gym.learners.linear_programs.feature import FeatureLP
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP

GRID = paper_grid()


def test_a_price_above_lambda_0_is_named_with_lambda_0():
    dear = FiniteLP(l1=5.0).fit(GRID.mdp, GRID.expert)
    said = finding("lambda-above-lambda-0", dear, GRID.mdp, GRID.expert)
    assert "l1 is 5" in said.sentence and "lambda_0 is 1.055" in said.sentence


@pytest.mark.parametrize("solver", ["highs", "clarabel"])
@pytest.mark.parametrize("margin_cap", ["auto", None])
def test_a_price_above_lambda_0_is_all_that_is_wrong(margin_cap, solver):
    dear = FiniteLP(l1=500.0, margin_cap=margin_cap, solver=solver).fit(GRID.mdp, GRID.expert)
    assert names(dear, GRID.mdp, GRID.expert) == ("lambda-above-lambda-0",)


def test_lambda_0_is_computed_where_the_certificate_lacks_it():
    dear = FiniteLP(l1=5.0).fit(GRID.mdp, GRID.expert)
    dear = replace(dear, proof=replace(dear.proof, lambda_0=None))
    assert "lambda_0 is 1.055" in finding("lambda-above-lambda-0", dear, GRID.mdp, GRID.expert).sentence


@pytest.mark.parametrize("margin_cap", ["auto", None])
def test_the_first_mend_of_a_price_above_lambda_0_is_healthy(margin_cap):
    found = finding(
        "lambda-above-lambda-0", FiniteLP(l1=5.0, margin_cap=margin_cap).fit(GRID.mdp, GRID.expert), GRID.mdp, GRID.expert
    )
    assert found.mend.startswith('margin_cap="auto" with l1=0.0: solved here') and found.flags == (
        "--margin-cap auto",
        "--l1 0",
    )
    assert names(FiniteLP(margin_cap="auto", l1=0.0).fit(GRID.mdp, GRID.expert), GRID.mdp, GRID.expert) == ()


def test_zero_weights_are_explained_by_their_price():
    dear = FeatureLP(np.eye(25), l1=1e3).fit(GRID.mdp, GRID.expert)
    assert "l1 is 1000" in finding("zero-weights", dear, GRID.mdp, GRID.expert).sentence


def test_random_actions_prefer_nothing():
    anything = np.ones((25, 4), dtype=bool)
    assert "every action in all 24 states" in finding("nothing-to-compare", None, GRID.mdp, anything).sentence


def test_actions_of_the_same_successors_compare_nothing():
    mdp = ring([[1, 1], [0, 0]])
    assert "reward_on" in finding("nothing-to-compare", None, mdp, np.array([0, 0])).mend


def test_a_reward_on_steps_mends_actions_of_the_same_successors():
    mdp, expert = ring([[1, 1], [0, 0]]), np.array([0, 0])
    assert "nothing-to-compare" not in names(FiniteLP(reward_on="state-action").fit(mdp, expert), mdp, expert)


def test_an_expert_that_no_state_reward_explains_is_told():
    assert names(None, contradicted(), np.zeros(4, dtype=int))[0] == "unexplained-expert"


def test_a_reward_on_steps_explains_every_expert():
    mdp, expert = contradicted(), np.zeros(4, dtype=int)
    assert "unexplained-expert" not in names(FiniteLP(reward_on="state-action").fit(mdp, expert), mdp, expert)


def test_an_expert_that_can_be_explained_without_a_reward_is_told():
    assert names(None, GRID.mdp, GRID.expert) == ("no-reward",)


def test_a_zero_reward_without_a_price_is_told():
    assert "zero-reward" in names(judged(GRID.mdp, GRID.expert, np.zeros(25)), GRID.mdp, GRID.expert)


def test_a_constant_reward_where_nothing_ends_is_flat():
    model = random_model(0)
    assert (
        "no state ends" in finding("flat-reward", judged(model.mdp, model.expert, np.ones(7)), model.mdp, model.expert).sentence
    )


def test_a_constant_price_of_steps_is_a_reward_where_episodes_end():
    mdp = corridor(6, 0.9)
    assert names(judged(mdp, right(mdp), -np.ones(6)), mdp, right(mdp)) == ()


def test_the_defaults_mend_a_flat_reward():
    model = random_model(0)
    assert names(FiniteLP().fit(model.mdp, model.expert), model.mdp, model.expert) == ()


@pytest.mark.parametrize("gamma", [1 - 1e-9, 1 - 1e-12])
def test_a_reward_that_drowns_in_rounding_is_not_said_to_pay_alike(gamma):
    model = random_model(0)
    case = Case(mdp=TabularMDP(model.mdp.P, gamma, model.mdp.d0), expert=model.expert, reward=TabularReward(model.R))
    said = {one.name: one.sentence for one in diagnose(case).findings}["flat-reward"]
    assert "No action is certainly better than another" in said and not case.margins.size
