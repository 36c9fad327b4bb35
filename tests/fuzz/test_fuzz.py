"""Whatever is in a file, only errors of ours and documented ones come out, and what is accepted is sound.

2,000 inputs in CI, spread over all readers. The slow test reads 100,000, and says how many were refused, in which time and
memory: `pytest -m slow tests/fuzz -s`.
"""

import math
import shutil
import time
import warnings
from pathlib import Path

import pytest
from fuzz.mutations import CHANGES, changed
from fuzz.readers import READERS
from fuzz.runs import ASKED
from hypothesis import HealthCheck, given, settings

from irl_gym.agents import experts
from irl_gym.errors import InvalidParameter, IrlGymError
from irl_gym.loop.pipeline import recover_and_retrain

SMALL, MANY = 1_700, 95_000
"""Inputs of files; the rest of 2,000 and 100,000 are arguments."""
TOTAL = sum(one.weight for one in READERS.values())
MOST_MEMORY = 1e9
"""Bytes."""


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """The folder of a run."""
    out = tmp_path_factory.mktemp("fuzz") / "run"
    recover_and_retrain(ASKED, out)
    return out


@pytest.fixture
def no_agent(monkeypatch):
    """The zip of an agent is looked at, and not loaded: loading it runs what is in it."""

    def refused(path, *_):
        raise InvalidParameter(f"{path} is not loaded in a test.")

    monkeypatch.setattr(experts, "load_agent", refused)


def fuzz(name, request, folder, inputs):
    """Read changed files of a reader; how many there were, and how many of them were refused."""
    reader, seen = READERS[name], {"inputs": 0, "refused": 0}
    if reader.of_run:
        finished = request.getfixturevalue("finished")
        shutil.copytree(finished, folder / "files")
        shutil.copy(finished / "config.json", folder)
    folder = folder / "files"
    folder.mkdir(exist_ok=True)
    reader.write(folder)
    files = {path: path.read_bytes() for path in sorted(folder.glob(reader.files)) if path.is_file()}
    files = {path: data for path, data in files.items() if path.suffix not in (".html", ".png", ".webp") and data}

    @settings(max_examples=inputs, suppress_health_check=list(HealthCheck))
    @given(CHANGES)
    def read(change):
        path = change.pick(files)
        seen["inputs"] += 1
        try:
            changed(path, change)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of Gymnasium and Minari, about what they read
                reader.read(folder)
        except (IrlGymError, FileNotFoundError, *reader.documented):
            seen["refused"] += 1
        finally:
            for path, data in files.items():
                if not path.exists() or path.read_bytes() != data:
                    path.write_bytes(data)

    read()
    return seen


def share(name, inputs):
    """The inputs of a reader, of those of all."""
    return math.ceil(inputs * READERS[name].weight / TOTAL)


@pytest.mark.parametrize("name", READERS)
def test_a_changed_file_is_refused_by_an_error_of_ours_or_read_as_something_sound(name, request, tmp_path, no_agent, unchecked):
    fuzz(name, request, tmp_path, share(name, SMALL))


@pytest.mark.slow
@pytest.mark.parametrize("name", READERS)
def test_each_of_100_000_inputs_is_refused_by_an_error_of_ours_or_read_as_something_sound(
    name, request, tmp_path, no_agent, unchecked
):
    forget_peak()
    begun = time.perf_counter()
    seen = fuzz(name, request, tmp_path, share(name, MANY))
    told = ", ".join(f"{count:,} {what}" for what, count in seen.items())
    print(f"\n{name}: {told}, {time.perf_counter() - begun:.0f} s, {peak() / 1e6:.0f} MB at most")
    assert seen["inputs"] >= share(name, MANY) and peak() < MOST_MEMORY


def forget_peak():
    Path("/proc/self/clear_refs").write_text("5")


def peak():
    """Bytes of memory held at most since it was forgotten."""
    told = Path("/proc/self/status").read_text()
    return 1024 * int(told.partition("VmHWM:")[2].split()[0])
