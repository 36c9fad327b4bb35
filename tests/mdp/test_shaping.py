"""Transforms keep the set of optimal policies, terminal states included."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from models import models, random_model

from irl_gym.errors import InvalidParameter, InvalidReward
from irl_gym.mdp.planning.dynamic_programming import policy_iteration, tied
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.shaping import (
    ExpectedAdvantage,
    PositiveScaling,
    PotentialShaping,
    ShapedReward,
    Unchanged,
    typical_loss,
)

SEEDS = st.integers(0, 2**32 - 1)


def optimal_sets(model, reward):
    """(S, A) optimal actions of the states that act."""
    Q = policy_iteration(model.mdp, reward.expected(model.mdp)).Q
    return tied(Q, 1e-8 * max(1.0, np.abs(Q).max()))[~model.mdp.terminal]


def rewards_of(model, seed):
    """A reward on states and one on steps; rounded, so that some actions tie."""
    rng = np.random.default_rng(seed)
    shape = (model.mdp.n_states, model.mdp.n_actions)
    return TabularReward(model.R), TabularReward(rng.integers(-2, 3, size=shape).astype(float))


def potential_of(model, seed):
    return np.where(model.mdp.terminal, 0.0, np.random.default_rng(seed).normal(size=model.mdp.n_states))


@given(model=models(), seed=SEEDS, which=st.sampled_from(["none", "scaling", "potential", "advantage", "clipped"]))
def test_transforms_keep_the_set_of_optimal_policies(model, seed, which):
    transform = {
        "none": Unchanged(),
        "scaling": PositiveScaling(0.3),
        "potential": PotentialShaping(potential_of(model, seed)),
        "advantage": ExpectedAdvantage(),
        "clipped": ExpectedAdvantage(clip=0.05),
    }[which]
    for reward in rewards_of(model, seed):
        assert np.array_equal(optimal_sets(model, reward), optimal_sets(model, transform.apply(reward, model.mdp)))


@given(model=models())
def test_expected_advantage_is_zero_exactly_on_optimal_actions(model):
    reward = TabularReward(model.R)
    advantage = ExpectedAdvantage().apply(reward, model.mdp).values[~model.mdp.terminal]
    assert np.array_equal(advantage > -1e-8, optimal_sets(model, reward))


@given(model=models())
def test_expected_advantage_lies_between_minus_one_and_zero_when_clipped(model):
    values = ExpectedAdvantage(clip=0.1).apply(TabularReward(model.R), model.mdp).values
    assert values.min() >= -1 and values.max() <= 0


@given(model=models(kinds=("terminal", "walls")), seed=SEEDS)
def test_potential_shaping_moves_values_by_the_potential(model, seed):
    reward, phi = TabularReward(model.R), potential_of(model, seed)
    plain = policy_iteration(model.mdp, reward.expected(model.mdp)).V
    shaped = policy_iteration(model.mdp, PotentialShaping(phi).apply(reward, model.mdp).values).V
    assert np.allclose(shaped, plain - phi, atol=1e-8)


@given(model=models(kinds=("terminal",)))
def test_potential_shaping_refuses_a_potential_at_a_terminal_state(model):
    with pytest.raises(InvalidParameter, match="terminal state"):
        PotentialShaping(np.ones(model.mdp.n_states)).apply(TabularReward(model.R), model.mdp)


@pytest.mark.parametrize("factor", [0.0, -1.0, np.inf, np.nan])
def test_positive_scaling_refuses(factor):
    with pytest.raises(InvalidParameter, match=str(factor)):
        PositiveScaling(factor)


@pytest.mark.parametrize("clip", [0.0, -1.0, np.nan])
def test_expected_advantage_refuses_a_clip(clip):
    with pytest.raises(InvalidParameter, match=str(clip)):
        ExpectedAdvantage(clip)


@pytest.mark.parametrize("factor", [1e-11, 1e9])
def test_expected_advantage_does_not_depend_on_the_scale_of_the_reward(factor):
    model = random_model(2)
    plain, scaled = (ExpectedAdvantage(clip=0.1 * f).apply(TabularReward(f * model.R), model.mdp) for f in (1.0, factor))
    np.testing.assert_allclose(plain.values, scaled.values, atol=1e-6)


@given(model=models())
def test_typical_loss_is_the_median_of_what_the_second_best_action_loses(model):
    reward = TabularReward(model.R)
    loss = typical_loss(reward, model.mdp)
    Q = policy_iteration(model.mdp, reward.expected(model.mdp)).Q[model.mdp.reachable & ~model.mdp.terminal]
    losses = Q.max(axis=1, keepdims=True) - Q
    second = np.where(losses > 1e-9, losses, np.inf).min(axis=1)
    assert loss == (pytest.approx(np.median(second[np.isfinite(second)])) if np.isfinite(second).any() else None)


@pytest.mark.parametrize("factor", [1e-9, 1.0, 1e9])
def test_typical_loss_is_in_units_of_the_reward(factor):
    model = random_model(2)
    plain, scaled = (typical_loss(TabularReward(f * model.R), model.mdp) for f in (1.0, factor))
    assert scaled == pytest.approx(factor * plain, rel=1e-5)


@pytest.mark.parametrize("value", [0.0, 1.0])
def test_typical_loss_is_none_when_no_action_loses_anything(value):
    model = random_model(0)
    assert typical_loss(TabularReward(np.full(7, value)), model.mdp) is None


def test_typical_loss_clips_half_of_the_losses_at_most():
    model = random_model(5, S=10)
    reward = TabularReward(model.R)
    clipped = ExpectedAdvantage(typical_loss(reward, model.mdp)).apply(reward, model.mdp).values
    second = np.sort(clipped, axis=1)[:, -2]
    assert (second > -1).mean() == pytest.approx(0.5, abs=0.1)


@given(model=models(), seed=SEEDS)
def test_a_shaped_reward_keeps_the_set_of_optimal_policies(model, seed):
    for reward in rewards_of(model, seed):
        assert np.array_equal(optimal_sets(model, reward), optimal_sets(model, ShapedReward.of(reward, model.mdp).paid))


def test_a_shaped_reward_is_kept_in_a_file(tmp_path):
    model = random_model(0)
    made = ShapedReward.of(TabularReward.learned(model.R, {"learner": "FiniteLP"}), model.mdp)
    made.save(tmp_path / "shaped.npz")
    read = ShapedReward.load(tmp_path / "shaped.npz")
    assert np.array_equal(read.values, made.values) and np.array_equal(read.learned.values, model.R)
    assert (read.clip, read.paid.tolerance, read.learned.note) == (made.clip, made.paid.tolerance, {"learner": "FiniteLP"})


def test_a_file_of_a_plain_reward_is_no_shaped_one(tmp_path):
    TabularReward(np.zeros(3)).save(tmp_path / "reward.npz")
    with pytest.raises(InvalidReward, match="holds a TabularReward: expected a ShapedReward"):
        ShapedReward.load(tmp_path / "reward.npz")


@pytest.mark.parametrize(("paid", "learned"), [((3,), (3,)), ((3, 2), (4,)), ((3, 2), (3, 3))])
def test_a_shaped_reward_of_other_states_or_actions_is_refused(paid, learned):
    with pytest.raises(InvalidReward, match="expected"):
        ShapedReward(TabularReward(np.zeros(paid)), TabularReward(np.zeros(learned)))
