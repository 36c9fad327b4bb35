"""gym-classics: the tables of its environments, enumerated or from the model that they offer."""

import warnings
from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest

from irl_gym.errors import NotTabular
from irl_gym.tables.enumeration.table import Enumeration
from irl_gym.tables.published_model import model_table
from irl_gym.tables.tabulate import tabulate

gym_classics = pytest.importorskip("gym_classics")
pytestmark = pytest.mark.usefixtures("unchecked")

ENUMERATED = (
    "5Walk-v0", "19Walk-v0", "ClassicGridworld-v0", "CliffWalk-v0", "DynaMaze-v0", "SparseGridworld-v0", "WindyGridworld-v0",
    "WindyGridworldKings-v0", "WindyGridworldKingsNoOp-v0", "WindyGridworldKingsStochastic-v0",
)  # fmt: skip
"""Episodes end there, so that the model cannot be taken."""
CARS = ("JacksCarRental-v0", "JacksCarRentalModified-v0")


@pytest.fixture(scope="session")
def classics():
    """Its environments are registered; twice would warn."""
    if "5Walk-v0" not in gym.registry:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            gym_classics.register("gymnasium")
    return gym.make


@pytest.mark.parametrize("env_id", [*ENUMERATED, "FourRooms-v0"])
def test_the_table_of_a_gym_classic_is_not_contradicted_by_its_steps(classics, env_id):
    table = tabulate(classics(env_id), gamma=0.9, check_steps=2000)
    assert table.evidence.exact and table.evidence.check.steps == 2000


@pytest.mark.parametrize("env_id", ENUMERATED)
def test_a_model_in_which_something_ends_is_not_taken(classics, env_id):
    assert model_table(classics(env_id), 0.9) is None


@pytest.mark.parametrize("env_id", ENUMERATED)
def test_enumeration_agrees_with_the_model_wherever_a_step_does_not_end(classics, env_id):
    env = classics(env_id)
    base, table = env.unwrapped, Enumeration().table(env, 0.9)
    rows = 0
    for s in np.flatnonzero(~table.mdp.terminal):
        number = table.states.decode(s)
        for a in range(table.mdp.n_actions):
            successors, rewards, ended, probabilities = base.model(number, a)
            if ended.any():
                continue
            found = table.mdp.P[[s * table.mdp.n_actions + a]].toarray()[0]
            known = np.zeros(table.mdp.n_states)
            known[[table.states.encode(int(one)) for one in successors]] = probabilities
            assert found == pytest.approx(known, abs=1e-12)
            assert table.reward.values[s, a] == pytest.approx(probabilities @ rewards, abs=1e-12)
            rows += 1
    assert rows > 0


def test_the_model_of_an_environment_that_never_ends_is_what_enumeration_finds(classics):
    env = classics("FourRooms-v0")
    model, found = model_table(env, 0.9), Enumeration().table(env, 0.9)
    assert model is not None and np.abs(model.mdp.P - found.mdp.P).max() < 1e-12
    assert np.abs(model.mdp.d0 - found.mdp.d0).max() < 1e-15 and np.allclose(model.reward.values, found.reward.values)


@pytest.mark.slow
@pytest.mark.parametrize("env_id", CARS)
def test_the_model_of_jacks_cars_is_not_contradicted_by_its_steps(classics, env_id):
    table = tabulate(classics(env_id), gamma=0.9, check_steps=2000)
    assert table.evidence.exact and "model(state, action)" in table.evidence.method and table.mdp.n_states == 21 * 21


def test_an_environment_of_somebody_else_has_no_such_model():
    assert model_table(gym.make("FrozenLake-v1"), 0.9) is None


def walk(change):
    """A 5Walk that never ends, and whose model is changed."""
    from gym_classics.envs.linear_walks import Walk5  # here: gym_classics has to be registered first

    class Endless(Walk5):
        def model(self, state, action):
            n = self.observation_space.n
            return change(SimpleNamespace(to=np.array([(state + action) % n]), p=np.array([1.0])))

    Endless.__module__ = "gym_classics.test"
    return Endless()


@pytest.mark.usefixtures("classics")
def test_rows_that_nearly_add_up_to_1_are_divided_by_their_sums():
    table = model_table(walk(lambda row: (row.to, row.p, np.zeros(1), row.p * (1 - 4e-6))), 0.9)
    assert table is not None and table.mdp.P.data.tolist() == [1.0] * table.mdp.P.nnz
    assert "add up to 1 within 4e-06" in table.evidence.method


@pytest.mark.usefixtures("classics")
def test_rows_that_do_not_add_up_to_1_are_refused():
    with pytest.raises(NotTabular, match=r"the probabilities of model\(0, 0\) sum to 0\.5: expected 1 within"):
        model_table(walk(lambda row: (row.to, row.p, np.zeros(1), row.p / 2)), 0.9)
