"""Every finding of the doctor has its mend executed: here, or in the test that is named."""

import ast
from pathlib import Path

import gymnasium
import pytest
from chain_world import Chain
from enumeration_envs import Slippery
from models import paper_grid
from patients import check_mends

from irl_gym.demonstrations.imports import from_arrays
from irl_gym.environments.generative import GenerativeModel
from irl_gym.features.bases import RadialBasis
from irl_gym.features.feature_maps import OneHot
from irl_gym.judging import diagnoses
from irl_gym.judging.diagnoses.case import Case
from irl_gym.judging.diagnoses.doctor import diagnose, doctor
from irl_gym.judging.metrics import policy_value
from irl_gym.learners.linear_programs.feature import FeatureLP
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.learners.linear_programs.trajectory import TrajectoryLP
from irl_gym.mdp.planning.dynamic_programming import policy_iteration
from irl_gym.programs import solvers
from irl_gym.tables.counted.counting import Interaction
from irl_gym.tables.tabulate import tabulate

GRID, LAKE = paper_grid(), gymnasium.make("FrozenLake-v1", is_slippery=False)


class Poor(Chain):
    """Plans for the contrary."""

    def plan(self, reward, *, seed=0):
        return self.policy(-reward.tabular(self.states).values)


class Ahead:
    """Goes where the corner of the continuous grid world is further."""

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        return (observation[:, 0] <= observation[:, 1]).astype(int), state


def trajectories(world=None, expert=100, **how):
    """What the doctor says of TrajectoryLP in a small world."""
    world = Chain() if world is None else world
    learner = TrajectoryLP(OneHot(8), **{"trajectories": 60, "max_rounds": 4} | how)
    return doctor(learner.fit(world, world.expert(expert)), None, None)


def rollouts(samples):
    model = GenerativeModel(gymnasium.make("irl_gym_envs:irl_gym/ContinuousGridWorld-v0"), 0.9)
    return doctor(FeatureLP(RadialBasis.grid([0, 0], [1, 1], 2), S_0=5, samples=samples).fit(model, Ahead()), None, None)


def hobbled(solver):
    """The grid, solved where HiGHS gives no answer."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in {"simplex_iteration_limit": 0, "presolve": "off"}.items():
            patch.setitem(solvers._SOLVERS["highs"].options, name, value)
        return doctor(FiniteLP(solver=solver, margin_cap=None).fit(GRID.mdp, GRID.expert), GRID.mdp, GRID.expert)


def noise(steps):
    table = tabulate(Slippery(n=25), gamma=0.9, by=Interaction(steps), check_steps=0)
    expert = policy_iteration(table.mdp, table.reward).policy
    return doctor(FiniteLP().fit(table.mdp, expert), table.mdp, expert)


def told(**judged):
    return diagnose(Case(judged=judged, claims={"gaps": []}))


def counted(steps):
    """What the best policy earns by a counted table, against episodes, of which the true table knows."""
    table, true = (tabulate(Slippery(), gamma=0.9, by=by, check_steps=0) for by in (Interaction(steps), None))
    best = policy_iteration(true.mdp, true.reward).policy
    same = best[[true.states.encode(table.states.decode(row)) for row in range(table.mdp.n_states)]]
    low = high = policy_value(true.mdp, true.reward, best)
    row = {"value": policy_value(table.mdp, table.reward, same), "sampled_value": low, "sampled_low": low, "sampled_high": high}
    return told(policies={"expert": {"value": low}, "random": {"value": 0.0}, "retrained": row})


def imported(**more):
    """What a run notes of episodes whose last observations were recorded, or not."""
    episodes = from_arrays(**{"observations": [0, 4, 0], "actions": [1, 1, 1], "lengths": [2, 1], "env": LAKE} | more)
    return told(demonstrations={"unseen": sum(one.ending == "unseen" for one in episodes), "episodes": len(episodes)})


CASES = [
    ("noisy-rows", "More samples: four times as many halve the error.", lambda: rollouts(4), lambda: rollouts(16)),
    ("planner-fell-short", "A stronger `inner` planner: more total_timesteps, or ValueIteration() where there is a table.",
     lambda: trajectories(Poor()), lambda: trajectories(Chain())),
    ("expert-beaten", "More rounds (max_rounds, patience),", lambda: trajectories(Chain(4), trajectories=200, max_rounds=1),
     lambda: trajectories(Chain(4), trajectories=200, max_rounds=12)),
    ("too-few-trajectories",
     "More episodes of the expert, and more trajectories a policy: four times as many halve the error.",
     lambda: trajectories(Chain(9), 3, trajectories=2), lambda: trajectories(Chain(9), 48, trajectories=32)),
    ("cut-short", "A longer horizon, and episodes of the expert that last as long or end.",
     lambda: trajectories(horizon=3), lambda: trajectories(horizon=20)),
    ("solver-retried", 'solver="clarabel" asks it first.', lambda: hobbled("highs"), lambda: hobbled("clarabel")),
    ("table-not-confirmed", "More steps to count. If it stays, the observation hides part of the state.",
     lambda: counted(60), lambda: counted(3_000)),
    ("within-sampling-error",
     "More steps to count (`Interaction(steps=...)`, `Enumeration(runs=...)`, episodes): four times as many halve it.",
     lambda: noise(3_200), lambda: noise(25_600)),
    ("unseen-ends", "Give the next observations when they are imported, or a last row without an action (last='row').",
     imported, lambda: imported(next_observations=[4, 8, 1]), 
     lambda: imported(observations=[0, 4, 8, 0, 1], actions=[1, 1, -1, 1, -1], lengths=[3, 2], last="row")),
]  # fmt: skip
ELSEWHERE = {
    "lambda-above-lambda-0": "test_nothing.py: test_the_first_mend_of_a_price_above_lambda_0_is_healthy",
    "zero-weights": "test_mends_of_sentences.py: test_a_mend_that_a_finding_names_serves",
    "nothing-to-compare": "test_nothing.py: test_a_reward_on_steps_mends_actions_of_the_same_successors",
    "unexplained-expert": "test_nothing.py: test_a_reward_on_steps_explains_every_expert",
    "no-reward": "test_nothing.py: test_the_defaults_mend_a_flat_reward",  # which runs the learner
    "zero-reward": "test_nothing.py: test_the_defaults_mend_a_flat_reward",  # by the same defaults
    "flat-reward": "test_nothing.py: test_the_defaults_mend_a_flat_reward",
    "inexpressible": "test_sampled.py: test_one_feature_a_state_mends_features_that_cannot_express",
    "solver-inaccurate": "test_solving.py: test_the_other_solver_mends_an_answer_that_was_short",
    "far-from-optimal": "test_solving.py: test_the_other_solver_mends_an_answer_that_was_short",
    "expert-not-optimal": "test_ties.py: test_the_defaults_mend_an_expert_that_is_not_optimal",
    "avoidable-ties": "test_ties.py: test_a_cap_on_margins_mends_avoidable_ties",
    "worst-tie": "test_ties.py: test_a_cap_on_margins_mends_avoidable_ties",
    "unbreakable-ties": "test_ties.py: test_a_reward_on_steps_mends_unbreakable_ties",
    "same-successors": "test_ties.py: test_a_reward_on_steps_mends_the_same_successors",
    "expert-suboptimal": "test_truth.py: test_a_better_expert_mends_both",
    "expert-worse-than-random": "test_truth.py: test_a_better_expert_mends_both",
    "blind-expert": "../../agents/test_normalised_experts.py: test_an_export_shows_its_expert_what_its_training_showed",
    "few-episodes": "../../loop/test_pipeline_from_data.py: test_the_doctor_finds_that_two_episodes_are_few",
    "dropped-actions": "../../demonstrations/test_last_actions.py: "
    "test_a_log_of_taxi_without_next_observations_teaches_the_drop_off",
    "unvisited-states": "test_unseen.py: test_more_of_the_expert_mends_unvisited_states",
    "strays": "test_unseen.py: test_avoiding_unknown_states_mends_strays",
    "small-gamma": "test_values.py: test_the_larger_gamma_mends_margins_that_vanish",
    "gamma-near-one": "test_values.py: test_the_smaller_gamma_mends_margins_that_drown",
    "never-ends": "test_values.py: test_an_end_mends_what_never_ends",
    "faint-margins": "test_values.py: test_shaping_mends_faint_margins",
    "flat-weights": "test_weights.py: test_a_price_mends_flat_weights",
}


@pytest.mark.parametrize(
    ("name", "says", "ill", "mended"), [(*one[:3], one[3:]) for one in CASES], ids=[one[0] for one in CASES]
)
def test_the_mend_of_a_finding_serves(name, says, ill, mended):
    check_mends(name, says, ill, mended)


def test_every_finding_of_the_doctor_has_its_mend_executed():
    found = set()
    for file in Path(diagnoses.__file__).parent.glob("*.py"):
        calls = [one for one in ast.walk(ast.parse(file.read_text())) if isinstance(one, ast.Call) and one.args]
        names = [one.args[0] for one in calls if getattr(one.func, "id", "") in ("Finding", "_found")]
        found |= {one.value for one in names if isinstance(one, ast.Constant)}
    assert found == {one[0] for one in CASES} | ELSEWHERE.keys()
    for place in ELSEWHERE.values():
        file, _, test = place.partition(": ")
        assert f"def {test}(" in (Path(__file__).parent / file).read_text()
