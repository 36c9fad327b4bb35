"""What metrics refuse, and how they say so."""

import numpy as np
import pytest

from irl_gym.errors import InvalidMDP, InvalidParameter
from irl_gym.judging.metrics import (
    agreement,
    best_tie,
    expected_value_difference,
    occupancy_distance,
    policy_value,
    random_value,
    regret,
    tie_aware_agreement,
    worst_tie,
)
from irl_gym.mdp.tabular_mdp import TabularMDP

FLAT = np.zeros(3)
ZEROS = np.zeros(3, dtype=np.int64)
TWO_WAYS = TabularMDP(np.eye(6, 3, 1), 0.9, [1.0, 0.0, 0.0])  # from state 0 to 1 or to 2


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("call", [
    lambda mdp: policy_value(mdp, FLAT, ZEROS),
    lambda mdp: policy_value(mdp, FLAT, ZEROS, horizon=3),
    lambda mdp: random_value(mdp, FLAT),
    lambda mdp: regret(mdp, FLAT, ZEROS),
    lambda mdp: expected_value_difference(mdp, FLAT, FLAT),
    lambda mdp: expected_value_difference(mdp, FLAT, FLAT, ZEROS),
    lambda mdp: worst_tie(mdp, FLAT, FLAT),
    lambda mdp: best_tie(mdp, FLAT, FLAT),
    lambda mdp: agreement(mdp, ZEROS, np.ones((3, 2), bool)),
    lambda mdp: tie_aware_agreement(mdp, FLAT, ZEROS),
    lambda mdp: occupancy_distance(mdp, ZEROS, ZEROS),
])  # fmt: skip
def test_metrics_refuse_an_environment_where_a_table_is_expected(call):
    with pytest.raises(InvalidMDP, match="mdp is a str: expected a TabularMDP, such as `tabulate"):
        call("FrozenLake-v1")


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("tolerance", [-1e-6, np.nan])
def test_a_tolerance_of_ties_is_a_share(tolerance):
    with pytest.raises(InvalidParameter, match=r"tolerance is .*: expected a share"):
        tie_aware_agreement(TWO_WAYS, FLAT, ZEROS, tolerance=tolerance)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("horizon", [-1, 2.5, "all"])
def test_a_horizon_is_a_number_of_steps(horizon):
    with pytest.raises(InvalidParameter, match=r"horizon is .*: expected a whole number of steps"):
        policy_value(TWO_WAYS, FLAT, ZEROS, horizon)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("good", [np.ones((2, 2), bool), np.ones((3, 2)), ZEROS])
def test_agreement_refuses_something_else_than_a_set_of_actions(good):
    with pytest.raises(InvalidParameter, match=r"good has shape .*: expected \(3, 2\) booleans, such as `optimal_actions"):
        agreement(TWO_WAYS, ZEROS, good)
