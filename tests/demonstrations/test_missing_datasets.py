"""What is said of a Minari id under which there is no dataset, or none can be."""

import numpy as np
import pytest
from gymnasium import spaces

from irl_gym.demonstrations.datasets import load_minari, read_minari, write_minari
from irl_gym.errors import DatasetMissing, InvalidParameter
from irl_gym.mdp.episodes import Episode

ID = "irl_gym/lake-expert-v0"
pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")


def test_an_unknown_id_is_a_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError):
        next(iter(read_minari("nothing-v0", root=tmp_path)))


def test_a_missing_dataset_names_those_that_are_there_and_no_folder_whose_name_is_no_id(tmp_path):
    write_minari([Episode(np.array([0, 4]), np.array([1]), np.zeros(1), False, True)], ID, None, root=tmp_path, algorithm="x",
                 observation_space=spaces.Discrete(16), action_space=spaces.Discrete(4))  # fmt: skip
    for name in ("odd name", "me/no-version", "."):
        (tmp_path / name / "data").mkdir(parents=True)
    with pytest.raises(DatasetMissing, match=f"'nothing-v0' is not under .* Name one of these: {ID};"):
        load_minari("nothing-v0", root=tmp_path)


def test_a_missing_dataset_says_when_there_is_none(tmp_path):
    with pytest.raises(DatasetMissing, match=r"There is none: name the root folder .*, or set MINARI_DATASETS_PATH"):
        load_minari("nothing-v0", root=tmp_path)


@pytest.mark.parametrize("wrong", ["no-version", "bad name-v0", ""])
def test_a_malformed_id_is_not_looked_for(tmp_path, wrong):
    with pytest.raises(InvalidParameter, match="malformed"):
        load_minari(wrong, root=tmp_path)
