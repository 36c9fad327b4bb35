"""The mends that errors about problems and learners' names name are executed, and serve."""

import models
import numpy as np
import pytest
from gymnasium import spaces

from irl_gym.errors import InvalidFeatures, InvalidParameter, UnknownLearner
from irl_gym.features.feature_maps import OneHot
from irl_gym.learners.linear_programs.feature import FeatureLP
from irl_gym.learners.problem import Problem, Spaces
from irl_gym.learners.registry import learner_class

GRID = models.paper_grid()


def test_features_that_are_missing_are_given_to_the_learner_or_the_problem(unchecked):
    with pytest.raises(InvalidFeatures, match="Give it features, or `learn` a problem that has some"):
        FeatureLP().fit(GRID.mdp, GRID.expert)
    phi = OneHot(GRID.mdp.n_states)
    problem = Problem.of(GRID.mdp, expert=GRID.expert, features=phi)
    one, other = FeatureLP(phi).fit(GRID.mdp, GRID.expert), FeatureLP().learn(problem)
    np.testing.assert_array_equal(one.reward.alpha, other.reward.alpha)


def test_parts_with_several_discounts_are_made_with_the_same():
    with pytest.raises(InvalidParameter, match="Make its parts with the same"):
        Problem.of(GRID.mdp, gamma=0.5)
    assert Problem.of(GRID.mdp, gamma=GRID.mdp.gamma).discount == GRID.mdp.gamma


@pytest.mark.parametrize("mend", ["Work in its folder", "or install it"])
def test_a_module_that_is_not_found_is_found_in_its_folder_or_where_it_is_installed(monkeypatch, tmp_path, mend):
    name = f"elsewhere_{len(mend)}"
    (tmp_path / f"{name}.py").write_text("from own_learners import Dice")
    with pytest.raises(UnknownLearner, match=mend):
        learner_class(f"{name}:Dice")
    monkeypatch.syspath_prepend(tmp_path)
    assert learner_class(f"{name}:Dice").__name__ == "Dice"


def test_spaces_alone_are_a_problem():
    assert Problem(Spaces(spaces.Discrete(3), spaces.Discrete(2))).discount is None
