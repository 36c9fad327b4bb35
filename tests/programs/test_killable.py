"""Native code in a child that is killed when the time is up."""

import json
import math
import os
import signal
import subprocess
import sys
import time
from functools import partial
from io import BytesIO
from pathlib import Path

import models
import numpy as np
import pytest
import scipy.sparse as sp

from irl_gym.errors import SolverFailed, SolverTimeout
from irl_gym.features.feature_maps import OneHot
from irl_gym.learners.linear_programs.feature import FeatureLP
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.programs import killable, native
from irl_gym.programs.deadline import Deadline
from irl_gym.programs.killable import called, made, within
from irl_gym.programs.piped import receive, send

LONG = 1e30
"""Operations that outlast any limit."""


def test_a_call_that_looks_at_no_clock_ends_with_the_time():
    begin = time.monotonic()
    with pytest.raises(SolverTimeout, match=r"no answer in 0\.5 s.*raise time_limit"), within(Deadline.after(0.5)):
        called(LONG, time.sleep, 600)
    assert time.monotonic() - begin < 60


@pytest.mark.parametrize(
    "learner",
    [FiniteLP, partial(FiniteLP, slack=5.0), partial(FiniteLP, solver="clarabel"), partial(FeatureLP, OneHot(30))],
)
def test_a_fit_in_a_child_has_the_same_bytes(learner, monkeypatch):
    model = models.random_model(1, S=30, A=3)
    plain = learner().fit(model.mdp, model.expert)
    monkeypatch.setattr(killable, "SHARE", 0.0)
    asked, ask = [], killable.Limited.ask
    monkeypatch.setattr(killable.Limited, "ask", lambda self, *args, **how: asked.append(args) or ask(self, *args, **how))
    limited = learner(time_limit=600.0).fit(model.mdp, model.expert)
    assert asked
    assert _told(limited) == _told(plain)


def _told(result):
    """A reward's bytes and the certificate's numbers, to the last bit."""
    values = result.reward.values if result.reward.alpha is None else result.reward.alpha
    return values.tobytes(), json.dumps(result.proof.to_json())


def test_what_a_child_keeps_is_called_there():
    matrix = sp.csc_matrix(np.array([[2.0, 1.0], [0.0, 4.0]]))
    with within(Deadline.after(60.0)):
        factors = made(LONG, native.factors, matrix)
        assert isinstance(factors, killable.Kept)
        np.testing.assert_allclose(factors.solve(np.array([2.0, 4.0]), "T"), [1.0, 0.75])


@pytest.mark.parametrize(
    "array",
    [
        np.zeros((0, 3)),
        np.arange(6, dtype=np.int32).reshape(2, 3),
        np.asfortranarray(np.eye(3)[:2]),
        np.eye(4)[::2, 1:],
        np.ones(()),
    ],
)
def test_an_array_arrives_as_it_was_sent(array):
    pipe = BytesIO()
    send(pipe, {"a": (array, sp.csc_array(np.eye(2)), None, math.inf, 0.1)})
    pipe.seek(0)
    (found, sparse, *rest) = receive(pipe)["a"]
    assert (found.dtype, found.shape, found.flags.f_contiguous) == (array.dtype, array.shape, array.flags.f_contiguous)
    assert found.tobytes() == array.tobytes() and (sparse.toarray() == np.eye(2)).all() and rest == [None, math.inf, 0.1]


def test_an_error_in_a_child_is_the_caller_s():
    with within(Deadline.after(60.0)):
        with pytest.raises(RuntimeError, match="singular"):
            made(LONG, native.factors, sp.csc_matrix((2, 2)))
        assert called(LONG, math.sqrt, 4.0) == 2.0


def test_a_child_that_died_is_told_from_one_that_was_late():
    with (
        within(Deadline.after(60.0)),
        pytest.raises(SolverFailed, match=r"within 60 s ended with 3.*Without time_limit the first solver works in this"),
    ):
        called(LONG, os._exit, 3)


def test_short_calls_and_calls_without_a_limit_start_no_child():
    with within(Deadline.after(60.0)):
        assert called(1.0, os.getpid) == os.getpid()
    assert called(LONG, os.getpid) == os.getpid()


SCRIPT = """
import os, signal, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # in the background of a shell it is ignored
from irl_gym.programs.deadline import Deadline
from irl_gym.programs.killable import called, within

with within(Deadline.after(600.0)):
    print(called(1e30, os.getpid), flush=True)
    called(1e30, time.sleep, 600)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a child ends at its limit at the latest")
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_a_child_ends_with_its_parent_in_a_script_without_a_guard(how):
    with subprocess.Popen([sys.executable, "-c", SCRIPT], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as parent:
        child = int(parent.stdout.readline())
        time.sleep(0.2)
        parent.send_signal(how)
        try:
            assert parent.wait(60) != 0
        finally:
            parent.kill()
    for _ in range(600):
        if _ended(child):
            return
        time.sleep(0.1)
    raise AssertionError(f"process {child} outlived its parent")


def _ended(child):
    """Is the process gone, or a zombie that nobody waits for?"""
    try:
        return Path(f"/proc/{child}/stat").read_text().split()[2] == "Z"
    except OSError:  # it may go while it is looked at
        return True
