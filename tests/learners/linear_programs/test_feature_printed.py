"""FeatureLP(trivial_rows="as printed") is section 4's program as printed, rows of equal successors included."""

import models
import numpy as np
import pytest
import reference

from irl_gym.errors import InvalidParameter
from irl_gym.learners.linear_programs.feature import FeatureLP


def repeated(seed):
    """A random table in which another action repeats the expert's successors in half of the states, and features."""
    model = models.random_model(seed, S=8, kind="dense")
    P = model.P.copy()
    for s in range(0, 8, 2):
        P[s, (model.expert[s] + 1) % P.shape[1]] = P[s, model.expert[s]]
    mdp = type(model.mdp).from_dense(P, 0.9, np.ones(8) / 8)
    return P, mdp, model.expert, np.random.default_rng([seed, 1]).normal(size=(8, 4))


@pytest.mark.parametrize("l1", [0.0, 0.3])
def test_program_as_printed_equals_the_dense_lp_and_the_default_departs(l1):
    differ = 0
    for seed in range(8):
        P, mdp, expert, Phi = repeated(seed)
        printed, _ = reference.section_4_lp(P, 0.9, expert, Phi, range(8), l1=l1, printed=True)
        departs, _ = reference.section_4_lp(P, 0.9, expert, Phi, range(8), l1=l1)
        found = FeatureLP(Phi, l1=l1, trivial_rows="as printed").fit(mdp, expert)
        assert found.proof.objective == pytest.approx(printed, rel=1e-7, abs=1e-7)
        assert found.proof.duality_gap <= 1e-6
        assert FeatureLP(Phi, l1=l1).fit(mdp, expert).proof.objective == pytest.approx(departs, rel=1e-7, abs=1e-7)
        differ += departs > printed + 1e-6
    assert differ


def test_another_word_for_trivial_rows_is_refused():
    learner = FeatureLP(np.eye(3))
    object.__setattr__(learner, "trivial_rows", "kept")  # the suite's type checker would refuse it first
    with pytest.raises(InvalidParameter, match="'left out' or 'as printed'"):
        learner.__post_init__()
