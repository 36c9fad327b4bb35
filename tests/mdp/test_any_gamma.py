"""What a reward says of an expert at any discount and size: it never contradicts itself, nor takes rounding for more."""

import models
import numpy as np
import pytest

from irl_gym.errors import InvalidReward
from irl_gym.mdp.optimality import certify
from irl_gym.mdp.tabular_mdp import TabularMDP

GAMMAS = (1e-12, 0.5, 0.9, 0.99, 1 - 1e-6, 1 - 1e-9, 1 - 1e-12)
SCALES = (1e-300, 1.0, 1e300, 1e308)


def rewards(model, scale):
    """The one the expert maximises, its opposite, one that prefers nothing, and one on steps that is about nothing."""
    steps = np.random.default_rng(0).normal(size=(7, 3))
    return [scale * (one / np.abs(one).max()) for one in (model.R, -model.R, np.ones(7), steps)]


@pytest.mark.parametrize("errs", [False, True])
@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("gamma", GAMMAS)
def test_certify_never_contradicts_itself_at_any_gamma_and_size(gamma, scale, errs):
    """Warnings are errors here; what is refused is no number, by the largest that a value, or a difference of two, can be."""
    for seed, kind in ((0, "dense"), (1, "sparse"), (3, "walls")):
        model = models.random_model(seed, kind=kind)
        mdp = TabularMDP(model.mdp.P, gamma, model.mdp.d0)
        for R in rewards(model, scale):
            try:
                found = certify(mdp, model.expert, R, errs=errs)
            except InvalidReward:
                assert scale * 4 / (1 - gamma) > 1e308
                continue
            tied, violated, undecided = (set(one.tolist()) for one in (found.tied, found.violated, found.undecided))
            assert not (tied & violated or tied & undecided or violated & undecided)
            assert found.expert_optimal is not False or ((violated or undecided) and not found.degenerate)
            assert not found.degenerate or not (violated or undecided)
            assert not (found.expert_optimal and np.isnan(found.loss_share)) or found.degenerate
            numbers = found.loss_low, found.at_stake, found.worst_violation, *found.violations
            assert np.isfinite(numbers).all() and not np.isinf(found.margin).any()


@pytest.mark.parametrize("exponent", [-1000, -300, 300, 1000])
def test_certify_says_the_same_of_a_reward_in_other_units(exponent):
    model = models.random_model(0)
    plain, scaled = (certify(model.mdp, model.expert, -one) for one in (model.R, np.ldexp(model.R, exponent)))
    for name in ("loss_low", "loss_bound", "at_stake", "worst_violation", "margin", "violations"):
        np.testing.assert_array_equal(np.ldexp(getattr(plain, name), exponent), getattr(scaled, name))
    assert (plain.expert_optimal, plain.loss_share) == (scaled.expert_optimal, scaled.loss_share)


@pytest.mark.parametrize("gamma", [1 - 1e-9, 1 - 1e-12])
def test_margins_that_drown_in_rounding_are_undecided_and_no_ties(gamma):
    model = models.random_model(0)
    found = certify(TabularMDP(model.mdp.P, gamma, model.mdp.d0), model.expert, -model.R)
    assert found.expert_optimal is False and found.undecided.size and not found.tied.size
    assert "no action is certainly better than the expert's, and one may be" in str(found)


@pytest.mark.parametrize("gamma", [0.999, 1 - 1e-4, 1 - 1e-6, 1 - 1e-9, 1 - 1e-12])
def test_a_constant_reward_where_no_episode_ends_is_never_called_not_optimal(gamma):
    """Each policy earns the same; that rows of float64 sum to 1 but for rounding must not say otherwise, over many steps."""
    for seed in range(3):
        model = models.random_model(seed)
        found = certify(TabularMDP(model.mdp.P, gamma, model.mdp.d0), model.expert, np.ones(7))
        assert found.expert_optimal is not False and not found.violated.size


@pytest.mark.parametrize("gamma", [0.9, 0.99, 0.999, 1 - 1e-4, 1 - 1e-6])
@pytest.mark.parametrize("action", [0, 1])
def test_rows_that_sum_to_1_but_for_rounding_violate_nothing(gamma, action):
    """One action leads to where 0.1 + 0.2 + 0.7 is a little less than 1, the other to where 1/4 + 1/4 + 1/2 is 1."""
    P = np.zeros((7, 2, 7))
    P[0, 0, 1] = P[0, 1, 4] = 1
    P[1:4, :, 1:4], P[4:, :, 4:] = [0.1, 0.2, 0.7], [0.25, 0.25, 0.5]
    found = certify(TabularMDP.from_dense(P, gamma, np.eye(7)[0]), np.full(7, action), np.ones(7))
    assert found.expert_optimal is not False and not found.violated.size


@pytest.mark.parametrize("gamma", GAMMAS)
def test_a_tie_of_whole_numbers_is_one_at_any_gamma(gamma):
    """Both actions lead to states of equal reward, with no rounding in it."""
    P = np.zeros((4, 2, 4))
    P[0, [0, 1], [1, 2]] = P[1, :, 3] = P[2, :, 3] = P[3, :, 0] = 1
    found = certify(TabularMDP.from_dense(P, gamma, np.eye(4)[0]), np.zeros(4, dtype=int), np.array([0.0, 1, 1, 0]))
    assert found.tied.tolist() == [0] and found.expert_optimal and found.degenerate and not found.undecided.size
