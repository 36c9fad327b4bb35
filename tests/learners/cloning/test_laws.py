"""What cloning loses, against laws that are known in closed form: worlds in which undiscounted rewards of T steps are added up.

absorbing mistake   99 of 100 equally likely situations ask for action 0, one for action 1; after a wrong one nothing is earned.
                    A clone that does not tell the situations apart errs with eps = 0.01 a step however much it is shown, and
                    loses T - (1 - eps) (1 - (1 - eps)^T) / eps.
recoverable         the same, but a wrong action leads to a place from which the next one leads back.
reset cliff         a wrong one of A actions leads to a place that is never left; 19 good states are equally likely at each
                    step, and a clone of N episodes acts at random in those that it was not shown.
"""

from math import comb

import numpy as np
import pytest
from mistakes import earned, world

from irl_gym.demonstrations.demonstrated import counted_pairs
from irl_gym.learners.cloning.clone import Clone


def situations(after_mistake):
    """The world of 100 situations, the right actions, and the class of policies: one action for all of them."""
    right = (np.arange(100) == 0).astype(int)
    return *world(right, after_mistake, 2), right, Clone(majority=True, cells=[0] * 100 + [1])


@pytest.mark.parametrize(("T", "lost"), [(10, 0.5338), (40, 7.2282), (160, 80.8274)])
def test_one_mistake_that_cannot_be_undone_costs_a_clone_in_the_square_of_the_steps(T, lost):
    table, R, right, learner = situations("stay")
    shown = np.zeros((101, 2))
    shown[np.arange(100), right] = 1 / 100  # infinitely many demonstrations
    found = learner.fit(shown, table)
    assert found.proof.mistakes == pytest.approx(0.01)
    loss = T - earned(table, R, found.policy, T)
    assert loss == pytest.approx(T - 0.99 * (1 - 0.99**T) / 0.01) and loss == pytest.approx(lost, abs=5e-5)


@pytest.mark.parametrize(("T", "lost"), [(10, 0.0991), (40, 0.3961), (160, 1.5843)])
def test_the_same_mistakes_cost_in_the_steps_where_the_expert_shows_the_way_back(T, lost):
    table, R, right, learner = situations("back")
    e, shown = 0.01, np.full((101, 2), 1e-3)
    shown[np.arange(100), right] = 1 / 100
    loss = T - earned(table, R, learner.fit(shown, table).policy, T)
    assert loss == pytest.approx(e / (1 + e) * (T + e / (1 + e) * (1 - (-e) ** T))) and loss == pytest.approx(lost, abs=5e-5)


GOOD, A, H = 19, 5, 20
CLIFF, PAID = world(np.zeros(GOOD, dtype=int), "stay", A)
GAPS = {1: 17.1419, 2: 10.5591, 4: 1.6646, 8: 0.0228}


def gap(states):
    """What a clone of steps in these states loses."""
    found = Clone().fit(counted_pairs(states, np.zeros_like(states), GOOD + 1, A), CLIFF)
    return H - earned(CLIFF, PAID, found.policy, H)


def law_of_states_seen(draws):
    """(20,) the probability that so many of the 19 good states are among the draws, by inclusion and exclusion."""
    return [
        comb(GOOD, k) * sum((-1) ** (k - j) * comb(k, j) * j**draws for j in range(k + 1)) / GOOD**draws
        for k in range(GOOD + 1)
    ]


@pytest.fixture(scope="module")
def gaps():
    """(20,) what a clone loses that was shown so many of the good states; NaN of none."""
    return np.array([np.nan, *(gap(np.arange(k)) for k in range(1, GOOD + 1))])


@pytest.mark.parametrize("N", GAPS)
def test_a_clone_at_the_reset_cliff_loses_what_the_exact_law_says(N, gaps):
    law = law_of_states_seen(N * H)
    assert sum(law) == pytest.approx(1) and law[0] == 0
    assert np.dot(law[1:], gaps[1:]) == pytest.approx(GAPS[N], abs=1e-4)


@pytest.mark.parametrize("N", GAPS)
def test_clones_of_episodes_at_the_reset_cliff_lose_that_on_average(N):
    rng = np.random.default_rng(N)
    found = np.array([gap(rng.integers(GOOD, size=N * H)) for _ in range(400)])
    assert abs(found.mean() - GAPS[N]) <= 3 * found.std(ddof=1) / 20 + 1e-4
