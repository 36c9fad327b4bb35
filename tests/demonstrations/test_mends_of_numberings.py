"""The mends that errors about numberings of observations, and agents of other ones, name are executed, and serve."""

import re
from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest
from enumeration_envs import Board
from gymnasium import spaces
from mended import named, told

from irl_gym.agents.expert_files import check_agent
from irl_gym.spaces.listed_states import ListedStates
from irl_gym.tables.counted.counting import Interaction
from irl_gym.tables.tabulate import tabulate

SIXTEEN = spaces.Discrete(16)
pytestmark = pytest.mark.usefixtures("unchecked")


def agent(n):
    return SimpleNamespace(observation_space=spaces.Discrete(n), model=SimpleNamespace(action_space=spaces.Discrete(4)))


def counted(steps):
    return tabulate(Board(4), gamma=0.9, by=Interaction(steps)).states.encode(np.array([2, 2])) > 0


CASES = [
    ("Sort them, each once.",
     lambda: ListedStates(spaces.Discrete(16), np.array([[4], [0], [4]])),
     lambda: ListedStates(spaces.Discrete(16), np.unique([[4], [0], [4]], axis=0))),
    ("If the table was counted, count it again with more samples; one that was enumerated has all that its environment shows.",
     lambda: counted(3), lambda: counted(2000)),
    ("Name the environment that it was trained in,",
     lambda: check_agent(agent(48), SIXTEEN, spaces.Discrete(4)),
     lambda: check_agent(agent(48), gym.make("CliffWalking-v1").observation_space, spaces.Discrete(4)) is None),
    ("or train it in this one.",
     lambda: check_agent(agent(48), SIXTEEN, spaces.Discrete(4)),
     lambda: check_agent(agent(16), SIXTEEN, spaces.Discrete(4)) is None),
]  # fmt: skip
FILES = [f"{one}.py" for one in ("listed_states", "cells", "expert_files")]
ELSEWHERE = "An expert read from a dataset cannot act; give the dataset."


@pytest.mark.parametrize(("says", "breaks", "mended"), CASES, ids=[one[0] for one in CASES])
def test_a_mend_that_an_error_about_a_numbering_names_serves(says, breaks, mended):
    assert says in told(breaks) and mended()


def test_every_mend_that_an_error_about_a_numbering_names_is_executed():
    said = " ".join([*(one[0] for one in CASES), ELSEWHERE])  # so that each part of a mend is a case
    assert not [one for one in named(*FILES) if not re.search(one, said) and "pip" not in one]
