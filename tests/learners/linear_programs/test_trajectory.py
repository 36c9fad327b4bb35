"""TrajectoryLP is the program of section 5 of Ng & Russell (2000), and what its rounds say of themselves is so."""

from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from chain_world import GAMMA, Chain
from scipy.optimize import linprog

from irl_gym.environments.generative import least_horizon
from irl_gym.errors import InvalidDemonstrations, SolverTimeout
from irl_gym.features.feature_maps import Functions, OneHot, Table
from irl_gym.features.feature_sums import discounted_sums
from irl_gym.learners.linear_programs.estimates import usable
from irl_gym.learners.linear_programs.trajectory import TrajectoryLP
from irl_gym.mdp.episodes import Episode
from irl_gym.programs import deadline
from irl_gym.programs.killable import check_limit
from irl_gym.programs.solvers import Status


def learner(**kwargs):
    return TrajectoryLP(**{"features": OneHot(8), "trajectories": 60, "max_rounds": 4, **kwargs})


@pytest.fixture(scope="module")
def run():
    """A world, an expert's episodes, and all rounds."""
    world = Chain()
    expert = world.expert()
    return world, expert, list(learner().iterate(world, expert))


# --- oracle: the paper ---


def section_5_lp(gaps, penalty=2.0, l1=0.0):
    """maximise sum_k p(gaps_k . alpha) - l1 ||alpha||_1, |alpha_i| <= 1; unknowns alpha+, alpha-, z. The optimum."""
    n, K = gaps.shape
    upper = [np.hstack([-slope * gaps, slope * gaps, np.eye(n)]) for slope in (1.0, penalty)]
    cost = np.concatenate([np.full(2 * K, l1), -np.ones(n)])
    bounds = [(0, 1)] * (2 * K) + [(None, None)] * n
    found = linprog(cost, A_ub=np.vstack(upper), b_ub=np.zeros(2 * n), bounds=bounds, method="highs")
    assert found.success, found.message
    return -found.fun


@pytest.mark.parametrize(("penalty", "l1"), [(2.0, 0.0), (1.0, 0.0), (20.0, 0.3)])
def test_trajectory_lp_solves_the_program_of_the_paper_in_every_round(penalty, l1):
    for seed in range(2):
        world = Chain(seed)
        expert = world.expert(20)
        theirs = discounted_sums(expert, OneHot(8), GAMMA, horizon=least_horizon(GAMMA)).mean(axis=0)
        for number, result in enumerate(learner(penalty=penalty, l1=l1).iterate(world, expert), start=1):
            gaps = theirs - np.array([sums.mean(axis=0) for sums in world.seen[:number]])
            assert result.proof.objective == pytest.approx(section_5_lp(gaps, penalty, l1), rel=1e-7, abs=1e-7)


def test_trajectory_lp_begins_with_random_actions_and_adds_what_it_planned(run):
    world, _, results = run
    assert len(world.seen) == 5 and [one.proof.gaps.size for one in results] == [1, 2, 3, 4]
    np.testing.assert_array_equal(world.asked, [one.reward.alpha for one in results])


# --- what a round proves ---


def test_trajectory_lp_duals_close_the_gap(run):
    assert all(-1e-9 <= one.proof.duality_gap < 1e-6 for one in run[2])


def test_trajectory_lp_keeps_the_weights_within_the_box(run):
    assert all(np.abs(one.reward.alpha).max() <= 1 for one in run[2])


def test_trajectory_lp_gaps_are_the_experts_advantage_under_the_reward(run):
    world, expert, results = run
    theirs = discounted_sums(expert, OneHot(8), GAMMA, horizon=least_horizon(GAMMA)).mean(axis=0)
    for number, one in enumerate(results, start=1):
        expected = [(theirs - sums.mean(axis=0)) @ one.reward.alpha for sums in world.seen[:number]]
        np.testing.assert_allclose(one.proof.gaps, expected, atol=1e-12)
        assert one.proof.regret == pytest.approx((world.seen[number].mean(axis=0) - theirs) @ one.reward.alpha)


def test_trajectory_lp_distance_bounds_every_difference_of_values(run):
    world, expert, results = run
    theirs = discounted_sums(expert, OneHot(8), GAMMA, horizon=least_horizon(GAMMA)).mean(axis=0)
    rewards = np.random.default_rng(0).uniform(-1, 1, size=(200, 8))
    for number, one in enumerate(results, start=1):
        differences = np.abs(rewards @ (theirs - world.seen[number].mean(axis=0)))
        assert differences.max() <= one.proof.distance == np.abs(theirs - world.seen[number].mean(axis=0)).sum()


def test_trajectory_lp_standard_errors_are_calibrated():
    """Over seeds, gap and regret stray from their true values by one standard error, in the root mean square."""
    strays = []
    world = Chain(3)
    phi = np.stack([world.model.R, np.full(8, 0.1)], axis=1)
    for seed in range(60):
        one = next(learner(features=phi, trajectories=40, horizon=100, seed=1000 * seed).iterate(world, world.expert(40, seed)))
        alpha, found = one.reward.alpha, one.proof
        theirs, first, new = (world.exact(p, phi) @ alpha for p in (world.policy(world.model.R), None, one.policy))
        gap, regret = found.gaps[0] - (theirs - first), found.regret - (new - theirs)
        strays.append([gap / found.gap_errors[0], regret / found.regret_error])
    size = np.sqrt(np.mean(np.square(strays), axis=0))
    assert (0.75 < size).all() and (size < 1.3).all(), size


def test_trajectory_lp_states_the_bound_of_footnote_2():
    world = Chain()
    phi = np.random.default_rng(0).normal(size=(8, 2))
    expert = world.expert(10)
    (one,) = learner(features=phi, horizon=7, max_rounds=1).iterate(world, expert)
    largest = max(np.abs(phi[episode.observations]).sum(axis=1).max() for episode in expert)
    assert one.proof.truncation == pytest.approx(GAMMA**8 * largest / (1 - GAMMA))


# --- the horizon ---


@pytest.mark.parametrize(("asked", "expected"), [(None, least_horizon(GAMMA)), (7, 7), (90, 90)])
def test_trajectory_lp_cuts_trajectories_after_the_horizon(asked, expected):
    world = Chain()
    (one,) = learner(horizon=asked, max_rounds=1).iterate(world, world.expert(5))
    assert one.proof.horizon == expected


def test_trajectory_lp_shares_its_time_among_all_rounds(monkeypatch):
    world, results = Chain(), []
    monkeypatch.setattr(deadline.time, "monotonic", map(float, count()).__next__)  # a second passes whenever it is asked
    with pytest.raises(SolverTimeout, match="which all steps of a fit have together"):
        for result in TrajectoryLP(OneHot(8), trajectories=50, horizon=50, time_limit=1000.0).iterate(world, world.expert(20)):
            results.append(result)
    assert 0 < len(results) < 30


def test_trajectory_lp_holds_its_limit_in_the_first_episodes_too(monkeypatch):
    world, begun = Chain(), []

    def sums(*args, **how):
        begun.append(args)
        monkeypatch.setattr(deadline.time, "monotonic", lambda: 1e12)  # the time is up
        check_limit()

    monkeypatch.setattr(world, "sums", sums)
    with pytest.raises(SolverTimeout, match=r"no answer in 5\.0 s"):
        next(TrajectoryLP(OneHot(8), trajectories=5, horizon=5, time_limit=5.0).iterate(world, world.expert(5)))
    assert len(begun) == 1


def test_trajectory_lp_cuts_all_where_a_time_limit_cut_the_expert():
    world = Chain()
    expert = [*world.expert(5), *world.expert(30, horizon=2), *world.expert(5, horizon=3)]
    assert any(episode.truncated for episode in expert)
    (one,) = learner(max_rounds=1).iterate(world, expert)
    assert one.proof.horizon == 2


def test_trajectory_lp_drops_an_episode_that_broke_off():
    world = Chain()
    whole, (broken,) = world.expert(5), world.expert(1, horizon=2)
    (one,) = learner(max_rounds=1).iterate(world, [*whole, replace(broken, terminated=False, truncated=True)])
    assert (one.proof.horizon, one.stats["episodes_dropped"]) == (least_horizon(GAMMA), 1)


def test_usable_says_what_is_missing_when_every_episode_broke_off():
    broken = [replace(one, terminated=False, truncated=True) for one in Chain().expert(3, horizon=2)]
    with pytest.raises(InvalidDemonstrations, match="shorter horizon, such as 2"):
        usable(broken, 50, 20)


# --- which round, and when to stop ---


FAR = {"trajectories": 1_500, "patience": 4}
"""So little noise that the first round can be told from the expert."""


@pytest.fixture(scope="module")
def fitted():
    """What `fit` gives, and all rounds of the same learner."""
    expert = Chain(1).expert(1_500)
    return learner(**FAR).fit(Chain(1), expert), list(learner(**FAR).iterate(Chain(1), expert))


def test_fit_returns_the_round_with_the_least_distance(fitted):
    found, results = fitted
    distances = [one.proof.distance for one in results]
    distances = distances[: len(found.stats["rounds"])]
    assert found.proof.distance == min(distances) and found.stats["best_round"] == int(np.argmin(distances)) + 1


def test_fit_says_how_best_was_judged_and_keeps_every_round(fitted):
    found, results = fitted
    assert found.stats["best_by"] == "distance" and found.stats["round"] == found.stats["best_round"]
    kept = [(one["round"], one["distance"], one["regret"]) for one in found.stats["rounds"]]
    assert kept == [(i + 1, one.proof.distance, one.proof.regret) for i, one in enumerate(results[: len(kept)])]
    assert len(kept) > 1


class Never(Chain):
    """A world whose planner never comes nearer to the expert: it always acts at random."""

    def plan(self, reward, *, seed=0):
        self.asked.append(reward.alpha)


@pytest.mark.parametrize("patience", [1, 3])
def test_fit_stops_when_patience_is_over(patience):
    world = Never()
    found = learner(patience=patience, max_rounds=40, seed=3).fit(world, world.expert())
    distances = [one["distance"] for one in found.stats["rounds"]]
    assert len(distances) < 40 and len(distances) - int(np.argmin(distances)) == patience + 1


def test_fit_stops_when_the_policy_cannot_be_told_from_the_expert():
    world = Chain()
    found = learner(max_rounds=50, patience=50, trajectories=100).fit(world, world.expert(20))
    assert len(found.stats["rounds"]) < 50
    assert found.proof.distance <= found.proof.distance_error


def test_fit_stops_after_max_rounds():
    world = Never()
    assert len(learner(max_rounds=2).fit(world, world.expert()).stats["rounds"]) == 2


def test_the_same_seed_gives_the_same_result(run):
    found, again = (learner().fit(Chain(), run[1]) for _ in range(2))
    assert found.proof.to_json() == again.proof.to_json()
    np.testing.assert_array_equal(found.reward.alpha, again.reward.alpha)


def test_another_seed_draws_other_trajectories(run):
    found, other = (learner(seed=seed).fit(Chain(), run[1]) for seed in (0, 50))
    assert found.proof.distance != other.proof.distance


# --- odd but legal ---


def test_trajectory_lp_learns_from_one_episode():
    world = Chain()
    assert np.isfinite(learner().fit(world, world.expert(1)).proof.distance)


def test_trajectory_lp_learns_from_episodes_of_one_step():
    world = Chain()
    short = [Episode(np.array([0, 7]), np.array([0]), np.zeros(1), True, False)]
    assert learner(max_rounds=1).fit(world, short).proof.horizon == least_horizon(GAMMA)


def test_trajectory_lp_learns_one_weight():
    world = Chain()
    found = learner(features=world.model.R[:, None], max_rounds=1).fit(world, world.expert())
    assert found.reward.alpha.tolist() == [1.0]


def test_trajectory_lp_takes_maps_tables_and_functions_alike(run):
    phi = np.random.default_rng(0).normal(size=(8, 3))
    maps = (phi, Table(phi), Functions(lambda rows: phi[rows], 3))
    found = [learner(features=one).fit(Chain(), run[1]).proof.objective for one in maps]
    assert found == pytest.approx([found[0]] * 3, abs=1e-12)


def test_trajectory_lp_says_zero_weights_when_l1_is_too_high(run):
    found = learner(l1=1e3).fit(Chain(), run[1])
    assert found.status is Status.ZERO_WEIGHTS and found.proof.zero and found.proof.degenerate
