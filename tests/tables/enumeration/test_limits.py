"""An enumeration stops where it was told to, and says how far it came."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from enumeration_envs import Board, same_table

from irl_gym.errors import EnumerationLimit, InvalidParameter
from irl_gym.tables.enumeration.limits import Limits
from irl_gym.tables.enumeration.table import Enumeration

pytestmark = pytest.mark.usefixtures("unchecked")

LIMITS = {"max_states": 50, "max_seconds": 1e-9, "max_bytes": 20_000}


@pytest.mark.parametrize("name", LIMITS)
def test_a_limit_says_how_far_the_search_came_and_how_to_raise_it(name):
    message = (
        r"stopped at \d+ states found, \d+ of them tried, after \d+ s, at 0\.00 GB: expected at most "
        rf"{name}=\S+\. Raise it, as in `tabulate\(env, gamma=\.\.\., by=Enumeration\({name}=\.\.\.\)\)`; with a `checkpoint`"
    )
    with pytest.raises(EnumerationLimit, match=message):
        Enumeration(**{name: LIMITS[name]}).table(Board(20), 0.9)


@pytest.mark.parametrize("name", LIMITS)
def test_a_search_goes_on_from_its_limit_to_the_same_table(tmp_path, name):
    path = tmp_path / "search.npz"
    with pytest.raises(EnumerationLimit):
        Enumeration(checkpoint=path, **{name: LIMITS[name]}).table(Board(20), 0.9)
    assert same_table(Enumeration(checkpoint=path).table(Board(20), 0.9), Enumeration().table(Board(20), 0.9))


class Ticking:
    """A clock on which 0.06 seconds pass each time it is looked at, however fast the machine is."""

    def __init__(self):
        self.looks = 0

    def monotonic(self):
        self.looks += 1
        return self.looks * 0.06


@pytest.fixture
def ticking(monkeypatch):
    monkeypatch.setattr("irl_gym.tables.enumeration.explorer.time", Ticking())


@pytest.mark.usefixtures("ticking")
def test_a_search_goes_on_a_little_each_time(tmp_path):
    tried = []
    for _ in range(3):
        with pytest.raises(EnumerationLimit) as caught:
            Enumeration(checkpoint=tmp_path / "search.npz", max_seconds=1.5).table(Board(60), 0.9)
        tried.append(int(str(caught.value).split(" of them tried")[0].split()[-1].replace(",", "")))
    assert tried[0] < tried[1] < tried[2]


def test_a_limit_that_is_just_met_is_no_error():
    assert Enumeration(max_states=35).table(Board(6), 0.9).mdp.n_states == 36  # 35 states and an end


def test_a_limit_of_seconds_is_no_error_when_all_is_done():
    class Once(Board):
        def step(self, action):
            return self._seen(), 0.0, False, False, {}

    assert Enumeration(max_seconds=1e-9).table(Once(1), 0.9).mdp.n_states == 1


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("max_states", 0, "whole number of at least 1"), ("max_states", 1.5, "whole number"), ("runs", 0, "at least 1"),
        ("start_runs", -1, "at least 1"), ("most_outcomes", 0, "at least 1"), ("revisits", -1, "at least 0"),
        ("seed", -1, "at least 0"), ("max_bytes", 0, "above 0"), ("max_seconds", 0, "above 0, or None"),
    ],
)  # fmt: skip
def test_a_limit_outside_its_range_is_refused(name, value, expected):
    with pytest.raises(InvalidParameter, match=f"{name} is {value}: expected .*{expected}"):
        Limits(**{name: value})


def test_a_negative_time_between_writings_is_refused():
    with pytest.raises(InvalidParameter, match="every is -1: expected seconds, at least 0"):
        Enumeration(every=-1)


SCRIPT = """
import json, resource, time
from enumeration_envs import Plain
from yardstick import yard
from irl_gym.tables.enumeration.table import Enumeration
began = time.process_time()
table = Enumeration().table(Plain(), 0.99)
yards = (time.process_time() - began) / yard()
print(json.dumps([table.mdp.n_states, yards, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6]))
"""


@pytest.mark.slow
def test_250_000_states_of_plain_python_take_less_than_2000_yards_and_4_gb():
    """In a process of its own: here every annotation is checked."""
    env = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
    done = subprocess.run([sys.executable, "-c", SCRIPT], env=env, capture_output=True, text=True, check=True)
    states, yards, gigabytes = json.loads(done.stdout)
    print(f"{yards:.0f} yards, {gigabytes:.2f} GB")
    assert states == 250_000 and yards < 2_000 and gigabytes < 4


class Dice(Board):
    """Rolls three dice at once."""

    def __init__(self, at):
        super().__init__(4)
        self.at = at

    def roll(self):
        self.x = int(self.np_random.integers(8, size=3).sum()) // 22

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        if self.at == "reset":
            self.roll()
        return self._seen(), {}

    def step(self, action):
        if self.at == "step":
            self.roll()
        return self._seen(), 0.0, False, False, {}


@pytest.mark.usefixtures("ticking")
@pytest.mark.parametrize("at", ["reset", "step"])
def test_the_clock_is_looked_at_and_told_within_a_call_of_many_outcomes(at):
    told = []
    with pytest.raises(EnumerationLimit, match=r"after 0 s.*max_seconds=0\.1"):
        Enumeration(max_seconds=0.1).table(Dice(at), 0.9, lambda *counts: told.append(counts))
    assert told


@pytest.mark.usefixtures("ticking")
@pytest.mark.parametrize("runs", [{"runs": 10_000}, {"start_runs": 10_000}])
def test_the_clock_is_looked_at_within_a_call_that_is_counted(runs):
    with pytest.raises(EnumerationLimit, match=r"after 0 s.*max_seconds=0\.1"):
        at = "step" if "runs" in runs else "reset"
        Enumeration(max_seconds=0.1, most_outcomes=10, **runs).table(Dice(at), 0.9)


@pytest.mark.usefixtures("ticking")
def test_a_search_that_stopped_within_a_call_goes_on_to_the_same_table(tmp_path):
    env, path = Dice("step"), tmp_path / "search.npz"
    with pytest.raises(EnumerationLimit, match="1 states found, 0 of them tried"):
        Enumeration(max_seconds=0.1, checkpoint=path).table(env, 0.9)
    assert same_table(Enumeration(checkpoint=path).table(env, 0.9), Enumeration().table(env, 0.9))
