"""What the loop with features refuses before it makes anything: worlds without a table, features of other observations."""

import pytest

from irl_gym.errors import HiddenState, InvalidFeatures, NotDiscrete, NotTabular
from irl_gym.features.feature_maps import OneHot
from irl_gym.learners.linear_programs.feature import FeatureLP
from irl_gym.loop.pipeline import recover_and_retrain
from irl_gym.runs.experiment import Experiment
from irl_gym.tables.enumeration.table import Enumeration

CAPPED = FeatureLP(OneHot(16), margin_cap="auto")


@pytest.mark.parametrize(
    ("asked", "error", "match"),
    [
        (Experiment("CartPole-v1", 0.99, learner=CAPPED), NotDiscrete, "--bins 5 --retrain.*Or learn .*TrajectoryLP"),
        (Experiment("Blackjack-v1", 0.99, reveal={}, learner=CAPPED), NotTabular, r"reveal.Reveal\(env\).*--table sample"),
        pytest.param(  # a minute and a half, until what is hidden in Blackjack's deck of hands shows
            Experiment("Blackjack-v1", 0.99, reveal={}, table=Enumeration(), learner=CAPPED),
            HiddenState,
            "--reveal .*--table sample",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_feature_lp_without_a_table_is_refused_with_its_mend(tmp_path, asked, error, match):
    with pytest.raises(error, match=match):
        recover_and_retrain(asked, tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_features_of_other_observations_are_refused(tmp_path):
    with pytest.raises(InvalidFeatures, match="observation 16 has no features"):
        recover_and_retrain(Experiment("Taxi-v4", 0.99, episodes=2, learner=CAPPED), tmp_path)
