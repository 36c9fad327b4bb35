"""What is wrong under the true reward."""

import numpy as np
from models import paper_grid
from patients import corridor, finding, judged, names, right

from irl_gym.judging.diagnoses.case import Case
from irl_gym.judging.diagnoses.doctor import diagnose, doctor
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.mdp.planning.dynamic_programming import policy_iteration
from irl_gym.mdp.tabular_mdp import TabularMDP

GRID = paper_grid()


def test_the_worst_tie_is_told_with_what_it_loses(toy_text):
    table = toy_text("FrozenLake 4x4 slippery")
    expert = policy_iteration(table.mdp, table.reward).policy
    said = finding("worst-tie", FiniteLP(margin_cap=None).fit(table.mdp, expert), table.mdp, expert, true=table.reward)
    assert "the expert 0.542" in said.sentence and said.states.size == len(said.actions) > 0


def test_an_expert_worse_than_random_is_told():
    worst = policy_iteration(GRID.mdp, -GRID.step_reward).policy
    assert "expert-worse-than-random" in names(FiniteLP().fit(GRID.mdp, worst), GRID.mdp, worst, true=GRID.R)


def test_an_expert_that_could_earn_more_is_told_with_the_states_it_loses_in():
    mdp = corridor(6, 0.9)
    lingers = np.full((6, 2), 0.5)
    lingers[[0, 1, 2, 4]] = [0, 1]
    said = finding("expert-suboptimal", None, mdp, lingers, true=np.eye(6)[5])
    assert said.states.tolist() == [3]


def test_a_better_expert_mends_both():
    assert names(FiniteLP().fit(GRID.mdp, GRID.expert), GRID.mdp, GRID.expert, true=GRID.R) == ()


def test_an_expert_that_enters_states_where_it_is_not_known_has_no_value():
    mdp = corridor(6, 0.9)
    partly = np.full((6, 2), np.nan)
    partly[0] = [1, 0]
    partly[1] = [0, 1]
    found = names(judged(mdp, partly, np.eye(6)[5]), mdp, partly, true=np.eye(6)[5])
    assert "expert-worse-than-random" in found  # it stays in 0, where it is known
    partly[0] = [0, 1]
    assert "expert-worse-than-random" not in names(judged(mdp, partly, np.eye(6)[5]), mdp, partly, true=np.eye(6)[5])


def test_a_true_reward_of_0_blames_nobody(toy_text):
    mdp = toy_text("FrozenLake 4x4 slippery").mdp
    expert = policy_iteration(mdp, toy_text("FrozenLake 4x4 slippery").reward).policy
    assert names(FiniteLP().fit(mdp, expert), mdp, expert, true=np.zeros(mdp.n_states)) == ()


def test_the_expert_s_own_actions_are_no_ties_when_it_is_known_in_part(toy_text):
    table = toy_text("FrozenLake 4x4 slippery")
    seen = np.eye(4)[policy_iteration(table.mdp, table.reward).policy]
    seen[13], seen[6] = np.eye(4)[0], np.nan  # an error, and a state where it was never seen
    result = FiniteLP(slack=1.0).fit(table.mdp, seen)
    told = {one.name: one for one in doctor(result, table.mdp, seen, true=table.reward).findings}
    assert told.keys() == {"expert-suboptimal", "unvisited-states"} and 13 in told["expert-suboptimal"].states


def test_actions_that_the_expert_mixes_are_blamed_on_it():
    P = np.eye(5)[np.array([[1, 2], [3, 4], [3, 4], [3, 3], [4, 4]])]
    P[3:] = 0
    mdp, mixed = TabularMDP.from_dense(P, 0.9, np.eye(5)[0]), np.eye(2)[[0, 0, 0, 0, 0]]
    mixed[0] = [0.98, 0.02]  # so rarely that it is not poor itself; the reward ties 1 and 2, which are not as good
    made = doctor(judged(mdp, mixed, [0, 0.5, 0.5, 1, 0]), mdp, mixed, true=np.eye(5)[1])
    (said,) = [one for one in made.findings if one.name == "expert-suboptimal"]
    assert "worst-tie" not in made.names and said.states.tolist() == [0] and said.actions == (1,)


def test_the_mend_of_the_worst_tie_is_not_what_the_run_has(toy_text):
    table = toy_text("FrozenLake 4x4 slippery")
    mixed = np.eye(4)[policy_iteration(table.mdp, table.reward).policy]
    mixed[0], mixed[4] = [0.5, 0, 0.5, 0], [0.5, 0.5, 0, 0]
    result = FiniteLP(slack=10.0).fit(table.mdp, mixed)
    said = finding("worst-tie", result, table.mdp, mixed, true=table.reward)
    assert said.flags == ("--reward-on state-action", "--slack none") and "margin_cap" not in said.mend


def test_the_expert_of_a_corridor_is_healthy_under_its_goal():
    mdp = corridor(6, 0.9)
    assert names(judged(mdp, right(mdp), np.eye(6)[5]), mdp, right(mdp), true=np.eye(6)[5]) == ()


def _judged(value, low, high, name="expert"):
    told = {"sampled_value": (low + high) / 2, "sampled_low": low, "sampled_high": high}
    rows = {"expert": {"value": value}, "random": {"value": 0.0}, "retrained": {"value": value}}
    rows |= {name: {"value": value, **told}}
    return diagnose(Case(judged={"policies": rows}, claims={"gaps": []})).names


def test_a_counted_table_that_episodes_do_not_confirm_is_told():
    assert "table-not-confirmed" in _judged(1.0, 0.7, 0.9)


def test_the_clone_of_a_run_tells_the_doctor_nothing():
    assert "table-not-confirmed" not in _judged(1.0, 0.7, 0.9, "clone")


def test_a_counted_table_that_is_off_by_noise_is_not_told():
    assert "table-not-confirmed" not in _judged(1.0, 0.7, 0.99)
