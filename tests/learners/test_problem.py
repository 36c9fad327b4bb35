import dataclasses

import models
import numpy as np
import pytest
from gymnasium import spaces

from irl_gym.errors import InvalidDiscount, InvalidFeatures, InvalidParameter, InvalidPolicy, InvalidReward, MissingPart
from irl_gym.learners.needs import PARTS, TO_GET, Needs
from irl_gym.learners.problem import Oracle, Problem, Spaces
from irl_gym.mdp.episodes import Episode
from irl_gym.mdp.planning.dynamic_programming import value_iteration
from irl_gym.mdp.policies import TabularPolicy
from irl_gym.mdp.rewards import TabularReward
from irl_gym.spaces.states import StateIndex


@pytest.fixture(scope="module")
def grid():
    return models.paper_grid()


def episode(rows, actions):
    return Episode(np.array(rows), np.array(actions), np.zeros(len(actions)), terminated=False, truncated=True)


@pytest.mark.parametrize(
    ("required", "column"),
    [
        (("demonstrations",), "passive"),
        (("expert or demonstrations", "gamma"), "passive"),
        (("dynamics", "expert or demonstrations"), "active"),
        (("environment", "demonstrations"), "active"),
        (("environment or dynamics", "demonstrations"), "active"),
        (("environment", "oracle"), "interactive"),
        (("oracle",), "interactive"),
    ],
)
def test_needs_give_the_column_of_table_1(required, column):
    assert Needs(required).column == column


def test_what_is_only_optional_does_not_decide_the_column():
    assert Needs(("demonstrations",), ("environment", "oracle")).column == "passive"


def test_every_part_of_a_problem_can_be_needed_and_told_how_to_get():
    assert {*PARTS} == {one.name for one in dataclasses.fields(Problem)} - {"spaces"} == {*TO_GET}


@pytest.mark.parametrize(
    ("required", "told"),
    [(("dynamic",), "'dynamic': expected one of"), (("expert", "expert or demonstrations"), "'expert' twice")],
)
def test_needs_of_something_else_are_refused(required, told):
    with pytest.raises(InvalidParameter, match=told):
        Needs(required)


def test_a_missing_part_is_named_with_what_there_is_and_how_to_get_it(grid):
    with pytest.raises(
        MissingPart, match=r"Needs needs expert or demonstrations, and the problem has dynamics, gamma: .*read_minari"
    ):
        needs = Needs(("dynamics", "expert or demonstrations"))
        needs.of(Problem.of(grid.mdp), needs)


def test_one_of_two_parts_is_enough(grid):
    needs = Needs(("dynamics", "expert or demonstrations"))
    problem = Problem.of(grid.mdp, demonstrations=[episode([0, 1], [1])])
    assert needs.of(problem, needs).demonstrations is problem.demonstrations


def test_what_is_not_needed_is_taken_away(grid):
    problem = Problem.of(grid.mdp, expert=grid.expert, demonstrations=[episode([0, 1], [1])], horizon=7)
    left = Needs(("dynamics", "expert")).of(problem, None)
    assert left.expert is problem.expert and left.demonstrations is None and left.horizon is None


def test_the_discount_is_that_of_whichever_part_has_one(grid):
    here = Spaces(spaces.Discrete(3), spaces.Discrete(2))
    assert Problem.of(grid.mdp).discount == grid.mdp.gamma
    assert Problem(here, gamma=0.5).discount == 0.5
    assert Problem(here).discount is None


def test_a_learner_that_needs_a_discount_gets_that_of_a_part_which_it_does_not_need(grid):
    left = Needs(("demonstrations", "gamma")).of(Problem.of(grid.mdp, demonstrations=[episode([0, 1], [1])]), None)
    assert left.dynamics is None and left.gamma == grid.mdp.gamma


def test_two_discounts_are_refused(grid):
    with pytest.raises(InvalidParameter, match=r"several discounts, 0.9 \(dynamics\), 0.5 \(gamma\)"):
        Problem.of(grid.mdp, gamma=0.5)


@pytest.mark.parametrize(("part", "error"), [({"gamma": 1.0}, InvalidDiscount), ({"horizon": 0}, InvalidParameter)])
def test_a_part_outside_its_range_is_refused(part, error):
    with pytest.raises(error):
        Problem(Spaces(spaces.Discrete(3), spaces.Discrete(2)), **part)


@pytest.mark.parametrize(
    ("part", "error", "told"),
    [
        ({"expert": np.zeros(3, dtype=int)}, InvalidPolicy, r"policy has shape \(3,\).*Give one entry for each state"),
        ({"expert": np.full(16, 9)}, InvalidPolicy, r"is action 9: expected an action from 0 to 3"),
        ({"reward": TabularReward(np.zeros(3))}, InvalidReward, r"shape \(3,\): expected .*another table's"),
        ({"features": np.eye(3)}, InvalidFeatures, r"of 3 states: expected 16, one row of phi a state"),
    ],
)
def test_a_part_of_another_table_is_refused(part, error, told):
    model = models.random_model(0, S=16, A=4)
    with pytest.raises(error, match=told):
        Problem.of(model.mdp, **part)


@pytest.mark.parametrize(("states", "actions"), [(5, 3), (7, 2)])
def test_spaces_of_another_table_are_refused(states, actions):
    mdp = models.random_model(0).mdp
    with pytest.raises(InvalidParameter, match=r"s are numbered by Discrete\(.\), and the table has ."):
        Problem(Spaces(spaces.Discrete(states), spaces.Discrete(actions)), dynamics=mdp)


def test_the_policy_is_the_experts_where_it_is_known(grid):
    problem = Problem.of(grid.mdp, expert=grid.expert, demonstrations=[episode([0, 1], [1])])
    assert problem.policy is problem.expert and problem.visits is None


def test_the_policy_is_what_episodes_show_where_they_are_all_that_is_known(grid):
    problem = Problem.of(grid.mdp, demonstrations=[episode([0, 1, 0], [1, 2]), episode([0, 3], [1])])
    assert problem.policy[0].tolist() == [0, 1, 0, 0] and np.isnan(problem.policy[3]).all()
    assert problem.visits is not None and problem.visits[:2].tolist() == [2, 1]


def test_a_problem_on_a_tabulation_has_its_numbering_and_not_its_reward(toy_text):
    table = toy_text("FrozenLake 4x4")
    problem = Problem.of(table)
    assert problem.spaces.states is table.states and problem.reward is None


def test_an_oracle_counts_what_it_is_asked(grid):
    actions = value_iteration(grid.mdp, TabularReward(grid.R)).policy
    oracle = Oracle(TabularPolicy(np.eye(grid.mdp.n_actions)[actions], StateIndex(spaces.Discrete(grid.mdp.n_states))))
    assert [oracle.ask(row) for row in (0, 7, 0)] == [actions[0], actions[7], actions[0]] and oracle.queries == 3


@pytest.mark.parametrize("answer", [4, -1, 1.0, True, None, [1, 2], "left"])
def test_an_answer_that_is_no_action_is_told_with_query_and_observation(answer):
    oracle = Oracle(lambda seen, info: answer if seen == 7 else 2)
    assert oracle.ask(3, n_actions=4) == 2
    with pytest.raises(InvalidPolicy, match=r"answer to query 2, observation 7, is .*: expected an action, .* from 0 to 3"):
        oracle.ask(7, n_actions=4)


def test_an_oracle_that_is_a_function_is_told_what_the_environment_tells():
    oracle = Oracle(lambda seen, info: info.get("hint", 0))
    assert [oracle.ask(0, {"hint": np.int64(3)}), oracle.ask(0)] == [3, 0]


def test_an_oracle_of_which_mistakes_are_drawn_answers_as_it_acts():
    states = StateIndex(spaces.Discrete(2))
    drawn = Oracle(TabularPolicy(np.full((2, 2), 0.5), states), deterministic=False)
    assert {drawn.ask(0) for _ in range(30)} == {0, 1}


def test_an_oracle_that_cannot_answer_is_refused(unchecked):
    with pytest.raises(InvalidParameter, match="policy is a list"):
        Oracle([0, 1])  # type: ignore[arg-type]
