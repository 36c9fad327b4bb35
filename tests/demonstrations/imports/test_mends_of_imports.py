"""The mends that errors about imported demonstrations name are executed, and serve."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch
from gymnasium import spaces
from mended import named
from stable_baselines3.common.buffers import RolloutBuffer

from irl_gym.demonstrations import imports
from irl_gym.demonstrations.imports import from_arrays, from_d4rl, from_frame, from_imitation, from_rollouts
from irl_gym.errors import IrlGymError

SPACE = {"space": spaces.Discrete(16)}
LAKE = SPACE | {"n_actions": 4}
COLUMN = np.ones((3, 1), dtype=int)
LOG = pd.DataFrame({"episode": [0, 0, 1], "step": [0, 1, 0], "observation": [0, 4, 0], "action": [1, 1, 2]})
NEXT = LOG.assign(then=[4, 8, 1])
CONTINUOUS = spaces.Box(-1, 1, (1,))


def frame(**columns):
    return LOG.assign(**columns)


def read(source, **how):
    return from_frame(source, **(LAKE | how))


def text(lines, name="log.csv"):
    """What reads a file of these lines, and what `pandas.read_csv` makes of it."""

    def reads(path):
        (path / name).write_text("\n".join(lines))
        return path / name

    return reads


def buffer(steps=2):
    made = RolloutBuffer(4, spaces.Discrete(16), spaces.Discrete(4))
    for step in range(2):
        start = np.array([step % (steps or 2) == 0])
        made.add(np.array([step]), np.array([1]), np.zeros(1), start, torch.zeros(1), torch.zeros(1))
    return made


HEADED = ["episode,step,observation,action", "0,0,0,1", "0,1,4,1"]
NO_HEADER, COMMENTED = HEADED[1:], ["# by hand", *HEADED]
SEMICOLONS, SPACED = ([one.replace(",", sign) for one in HEADED] for sign in "; ")
VECTORS = ["episode,step,observation,action", "0,0,0,4,1", "0,1,4,8,1"]
VECTOR = {"space": spaces.MultiDiscrete([16, 16]), "n_actions": 4}
QUOTED = [VECTORS[0], '0,0,"0,4",1', '0,1,"4,8",1']

CASES = [
    # arrays
    ("Leave the other out.",
     lambda _: from_arrays([0, 4, 0], [1, 1, 2], lengths=[2, 1], ends=[0, 1, 1], **LAKE),
     lambda _: from_arrays([0, 4, 0], [1, 1, 2], lengths=[2, 1], **LAKE)),
    ("Give actions[:, 0] for steps,",
     lambda _: from_arrays(np.zeros((3, 1, 1)), COLUMN, space=spaces.Box(0, 9, (1,), int), n_actions=4),
     lambda _: from_arrays([np.zeros((3, 1), int)], [COLUMN[:, 0]], space=spaces.Box(0, 9, (1,), int), n_actions=4)),
    ("or lengths=[1] * 3 for episodes.",
     lambda _: from_arrays(np.zeros((3, 1), int), COLUMN, **LAKE),
     lambda _: len(from_arrays(np.zeros((3, 1), int), COLUMN, lengths=[1] * 3, **LAKE)) == 3),
    ("Write [actions] and [observations] if it is one episode.",
     lambda _: from_arrays([0, 4, 8], [1, 1], **LAKE), lambda _: from_arrays([[0, 4, 8]], [[1, 1]], **LAKE)),
    ("Sort them.",
     lambda _: from_arrays([0, 0, 4], [1, 1, 2], episode=[0, 1, 0], **LAKE),
     lambda _: from_arrays([0, 4, 0], [1, 2, 1], episode=[0, 0, 1], **LAKE)),
    ("Give the steps of each episode.",
     lambda _: from_arrays([0, 4, 0], None, lengths=[3], **LAKE), lambda _: from_arrays([0, 4, 0], None, lengths=[2], **LAKE)),
    # cutting
    ("Leave it out.", lambda _: from_arrays([[0, 4], [0]], [[1], []], **LAKE), lambda _: from_arrays([[0, 4]], [[1]], **LAKE)),
    ("Leave empty episodes out.",
     lambda _: from_arrays([0, 4], [1], lengths=[1, 0], **LAKE), lambda _: from_arrays([0, 4], [1], lengths=[1], **LAKE)),
    # buffers
    ("Let the algorithm collect some steps first.",
     lambda _: from_rollouts(RolloutBuffer(4, spaces.Discrete(16), spaces.Discrete(4))), lambda _: from_rollouts(buffer())),
    ("Pass last='keep'.", lambda _: from_rollouts(buffer(1), last="drop"), lambda _: from_rollouts(buffer(1), last="keep")),
    # files
    ("Or pass a DataFrame.",
     lambda path: read(text(HEADED, "log.txt")(path)), lambda path: read(pd.read_csv(text(HEADED, "log.txt")(path)))),
    ("Take the '#' away, and pass pandas.read_csv(..., sep=' ')",
     lambda path: read(text(["# " + SPACED[0], *SPACED[1:]])(path)),
     lambda path: read(pd.read_csv(text(SPACED)(path), sep=" "))),
    ("Delete the comments,", lambda path: read(text(COMMENTED)(path)), lambda path: read(text(HEADED)(path))),
    ("or pass pandas.read_csv(..., comment='#')",
     lambda path: read(text(COMMENTED)(path)), lambda path: read(pd.read_csv(text(COMMENTED)(path), comment="#"))),
    ("pandas.read_csv(..., sep=';')",
     lambda path: read(text(SEMICOLONS)(path)), lambda path: read(pd.read_csv(text(SEMICOLONS)(path), sep=";"))),
    ("Let the file end in .tsv",
     lambda path: read(text([one.replace(",", "\t") for one in HEADED])(path)),
     lambda path: read(text([one.replace(",", "\t") for one in HEADED], "log.tsv")(path))),
    ("Write one, or pass pandas.read_csv(..., names=[...])",
     lambda path: read(text(NO_HEADER)(path)),
     lambda path: read(pd.read_csv(text(NO_HEADER)(path), names=HEADED[0].split(",")))),
    ("Put quotes around values that hold commas.",
     lambda path: read(text(VECTORS)(path), **VECTOR), lambda path: read(text(QUOTED)(path), **VECTOR)),
    ("Did you mean action='Action'?",
     lambda _: read(LOG.rename(columns={"action": "Action"})),
     lambda _: read(LOG.rename(columns={"action": "Action"}), action="Action")),
    ("Name the right one with action=",
     lambda _: read(LOG.rename(columns={"action": "u"})), lambda _: read(LOG.rename(columns={"action": "u"}), action="u")),
    ("If only the states are known, pass action=None.",
     lambda _: read(LOG[:2].drop(columns="action")), lambda _: read(LOG[:2].drop(columns="action"), action=None)),
    # frames
    ("Pass step=None if the rows are in order",
     lambda _: read(frame(step=[0, 7, 0])), lambda _: read(frame(step=[0, 7, 0]), step=None)),
    ("Give each of two episodes an id of its own,",
     lambda _: read(frame(episode=0, step=[0, 1, 0])), lambda _: read(frame(episode=[0, 0, 1], step=[0, 1, 0]))),
    ("Fill it in, or leave the row out.",
     lambda _: read(frame(episode=[0, 0, None])), lambda _: read(frame(episode=[0, 0, None]).dropna())),
    # reading
    ("or space=... with n_actions=...", lambda _: from_arrays([[0, 4]], [[1]]), lambda _: from_arrays([[0, 4]], [[1]], **LAKE)),
    ("or action_space=..., so that every row can be checked.",
     lambda _: from_arrays([[0, 4]], [[1]]), lambda _: from_arrays([[0, 4]], [[1]], **SPACE, action_space=spaces.Discrete(4))),
    ("Give each action the number of a bin, and n_actions with space in place of env and action_space.",
     lambda _: from_arrays([[0, 4]], [[0.3]], **SPACE, action_space=CONTINUOUS),
     lambda _: from_arrays([[0, 4]], [np.digitize([0.3], [-0.5, 0, 0.5])], **LAKE)),
    ("Leave one out.",
     lambda _: from_arrays([[0, 4]], [[1]], **LAKE, action_space=spaces.Discrete(5)),
     lambda _: from_arrays([[0, 4]], [[1]], **LAKE)),
    # rows
    ("If the last row of an episode holds only the last observation, pass last='row'.",
     lambda _: read(frame(episode=0, step=[0, 1, 2], action=[1, 1, None])),
     lambda _: read(frame(episode=0, step=[0, 1, 2], action=[1, 1, None]), last="row")),
    ("give each continuous action the number of a bin.",
     lambda _: read(frame(action=[0.5, 1.5, 2])), lambda _: read(frame(action=np.digitize([0.5, 1.5, 2], [1, 2])))),
    ("Pass action_space=Discrete(4, start=1).",
     lambda _: read(frame(action=[1, 4, 2])),
     lambda _: from_frame(frame(action=[1, 4, 2]), **SPACE, action_space=spaces.Discrete(4, start=1))),
    ("Leave the rewards out if they are not known",
     lambda _: read(frame(reward=[0, np.nan, 0])), lambda _: read(frame(reward=[0, np.nan, 0]), reward=None)),
    ("Give the rows after it the id of another episode.",
     lambda _: read(frame(terminated=[True, False, False])),
     lambda _: read(frame(terminated=[True, False, False], episode=[0, 2, 1]))),
    ("Leave the episode out.", lambda _: read(LOG, last="row"), lambda _: read(LOG[LOG.episode == 0], last="row")),
    ("Give the next observations,",
     lambda _: read(LOG, last="drop"), lambda _: read(NEXT, last="drop", next_observation="then")),
    ("or pass last='keep'.", lambda _: read(LOG, last="drop"), lambda _: read(LOG, last="keep")),
    ("give those after it the id of another episode.",
     lambda _: read(NEXT.assign(then=[9, 8, 1]), next_observation="then"),
     lambda _: read(NEXT.assign(then=[9, 8, 1], episode=[0, 2, 1]), next_observation="then")),
    # trajectories
    ("Drop the rewards.",
     lambda _: from_imitation([{"obs": [0, 4], "acts": [1], "rews": [1]}, {"obs": [0, 4], "acts": [1]}], **LAKE),
     lambda _: from_imitation([{"obs": [0, 4], "acts": [1]}] * 2, **LAKE)),
    ("Rename 'terminal'.",
     lambda _: from_d4rl({"observations": [0, 4], "actions": [1, 1], "terminal": [0, 1]}, **LAKE),
     lambda _: from_d4rl({"observations": [0, 4], "actions": [1, 1], "terminals": [0, 1]}, **LAKE)),
    # values
    ("Put a number in place of each word,",
     lambda _: read(frame(action=["1", "left", "2"])), lambda _: read(frame(action=["1", "0", "2"]))),
    ("or read another column.",
     lambda _: read(frame(action="left", number=[1, 0, 2])), lambda _: read(frame(action="left", number=1), action="number")),
]  # fmt: skip


def message(breaks, path):
    with pytest.raises(IrlGymError) as caught:
        breaks(path)
    return str(caught.value)


@pytest.mark.parametrize(("says", "breaks", "mended"), CASES, ids=[one[0] for one in CASES])
def test_a_mend_that_an_import_names_serves(tmp_path, says, breaks, mended):
    assert says in message(breaks, tmp_path) and mended(tmp_path)


def test_every_mend_that_an_import_names_is_executed(tmp_path):
    told = "\n".join(message(breaks, tmp_path) for _, breaks, _ in CASES)
    files = [f"imports/{one.name}" for one in Path(imports.__file__).parent.glob("*.py")]
    assert not [mend for mend in named(*files) if not re.search(mend, told) and "pip" not in mend]
