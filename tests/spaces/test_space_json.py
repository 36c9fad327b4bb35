"""Files that declare more than they hold, and texts that tell no space, are refused."""

import json

import gymnasium as gym
import numpy as np
import pytest

from irl_gym.demonstrations.imports import from_frame
from irl_gym.errors import DamagedFile, InvalidDemonstrations
from irl_gym.files import archives
from irl_gym.spaces.space_json import told_space

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")  # Minari's, about metadata


def test_parquet_that_declares_more_than_it_can_hold_is_refused(tmp_path, monkeypatch):
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet as pq

    pq.write_table(pa.table({"observation": np.zeros(100_000, int), "action": np.zeros(100_000, int)}), tmp_path / "a.parquet")
    monkeypatch.setattr(archives, "FREE", 1 << 10)
    with pytest.raises(InvalidDemonstrations, match="declares 1,600,000: expected at most"):
        from_frame(tmp_path / "a.parquet", episode=None, step=None, space=gym.spaces.Discrete(2), n_actions=2)


@pytest.mark.parametrize(
    "told",
    [
        {"type": "Discrete", "n": 10**400, "start": 0}, {"type": "Discrete", "n": 0, "start": 0}, {"type": "os.system"},
        {"type": "Box", "low": 0.0, "high": 1.0, "shape": [10**5, 10**5], "dtype": "float64"},
        {"type": "Box", "low": [0], "high": [1], "shape": [1], "dtype": "U100000000"},
        {"type": "MultiBinary", "n": 10**12}, {"type": "Tuple", "subspaces": []}, {"type": "Dict", "subspaces": [1]},
        {"type": ["Box"]}, [], "Box", None,
    ],
)  # fmt: skip
def test_text_that_tells_no_space_is_refused(told):
    with pytest.raises(DamagedFile, match="tells no space"):
        told_space("observations", json.dumps(told))


def test_a_space_that_is_nested_too_deeply_is_refused():
    nested = '{"type": "Tuple", "subspaces": [' * 5_000 + "]}" * 5_000
    with pytest.raises(DamagedFile, match="tells no space"):
        told_space("observations", nested)
