"""What only the proofs of FeatureLP and TrajectoryLP know."""

from dataclasses import replace

import numpy as np
import pytest
from certified import both
from models import paper_grid
from patients import finding, names, sampled

from irl_gym.judging.diagnoses.doctor import doctor
from irl_gym.learners.linear_programs.feature import FeatureLP
from irl_gym.learners.linear_programs.proofs.feature_proof import SampledFeatureProof

GRID = paper_grid()
FEW = np.random.default_rng(0).normal(size=(25, 2))


def test_features_that_cannot_express_a_reward_are_told():
    said = finding("inexpressible", FeatureLP(FEW).fit(GRID.mdp, GRID.expert), GRID.mdp, GRID.expert)
    assert "2 features" in said.sentence


def test_one_feature_a_state_mends_features_that_cannot_express():
    enough = FeatureLP(np.eye(25), margin_cap="auto").fit(GRID.mdp, GRID.expert)
    assert names(enough, GRID.mdp, GRID.expert, true=GRID.R) == ()


@pytest.mark.parametrize(("error", "found"), [(10.0, ("noisy-rows",)), (1e-6, ())])
def test_margins_within_their_noise_are_told(error, found):
    result = FeatureLP(np.eye(25), margin_cap="auto").fit(GRID.mdp, GRID.expert)
    rollouts = SampledFeatureProof(
        **vars(result.proof), expert_optimal=True, worst_violation=0.0, margin=both(result, GRID.mdp, GRID.expert).margin,
        violated=np.zeros(0, dtype=np.int64), indifferent=False, standard_error=error,
    )  # fmt: skip
    assert names(replace(result, proof=rollouts), None, None) == found


def test_trajectories_in_which_nothing_is_wrong_are_healthy():
    assert names(sampled(), None, None) == ()


@pytest.mark.parametrize("regret", [-1.0, 1.0])
def test_one_episode_is_told_to_tell_no_noise(regret):
    errors = {"gap_errors": np.full(2, np.nan), "regret_error": np.nan, "regret": regret}
    made = doctor(sampled(**errors, stats={"expert_episodes": 1}), None, None)
    assert made.names == ("too-few-trajectories",) and "One episode tells no noise" in made.findings[0].sentence


def test_an_exact_inner_planner_is_given_no_flags():
    patients = (sampled(regret=-1.0, stats={"exact_planner": exact}) for exact in (False, True))
    told = [finding("planner-fell-short", one, None, None) for one in patients]
    assert [one.flags for one in told] == [("--total-timesteps",), ()]


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("planner-fell-short", {"regret": -1.0}),
        ("expert-beaten", {"regret": 1.0}),
        ("expert-beaten", {"gaps": np.array([3.0, -1.0])}),
        ("too-few-trajectories", {"gap_errors": np.array([5.0, 5.0])}),
        ("cut-short", {"truncation": 4.0}),
        ("cut-short", {"stats": {"episodes_dropped": 3}}),
        ("zero-weights", {"zero": True}),
    ],
)
def test_each_fault_of_trajectories_has_its_sentence(name, changes):
    assert names(sampled(**changes), None, None) == (name,)
