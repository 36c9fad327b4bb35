"""Runs and exports are killed at random, again and again, and end in the bytes in which they would have ended.

A kill comes before a file operation in the folder, whose number is drawn: what is done between two of them leaves no trace.
A hundred kills: `pytest -m slow tests/test_kills.py`.
"""

import json
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from stopped import HANG

SCRIPTS = Path(__file__).parents[1] / "scripts"
KILLED = """
import importlib, json, os, runpy, signal, sys
number, folder, changes, script, *arguments = sys.argv[1:]
for path, value in json.loads(changes).items():
    module, _, name = path.partition(":")
    setattr(importlib.import_module(module), name, value)
count = 0

def hook(event, given):
    global count
    if event not in ("open", "os.rename", "os.remove", "os.mkdir", "os.rmdir"):
        return
    if not any(isinstance(one, str | os.PathLike) and os.path.abspath(one).startswith(folder) for one in given[:2]):
        return
    count += 1
    if count == int(number):
        os.kill(os.getpid(), signal.SIGKILL)

sys.addaudithook(hook)
sys.argv = [script, *arguments]
try:
    runpy.run_path(script, run_name="__main__")
finally:
    print("operations", count, file=sys.stderr)
"""
RUN = ("recover_and_retrain.py", "--out", ("--env-kwargs", "is_slippery=false", "--episodes", "5", "--total-timesteps", "2048"))
EXPORT = ("export_dataset.py", "--root", ("--env-id", "FrozenLake-v1", "--dataset-id", "lake/best-v0", "--episodes", "40"))
OFTEN = {"irl_gym.export:SHARD_BYTES": 3_000}
TIMED = re.compile(r"(.*/)?(agent\.zip|tensorboard/.*|\.stages/.*)")
"""Files that hold the time."""


def start(what, folder, number=0):
    """A script in a folder, killed before the file operation of a number; never for 0."""
    script, flag, arguments = what
    command = [str(number), str(folder), json.dumps(OFTEN), str(SCRIPTS / script), flag, str(folder), *arguments]
    made = subprocess.run([sys.executable, "-c", KILLED, *command], capture_output=True, text=True, timeout=HANG)
    assert made.returncode in (0, -signal.SIGKILL), made.stderr
    return made


def content(folder):
    """Every file's bytes but for the time: those of a page without its table of stages, of run.json without the folder."""
    files = {one.relative_to(folder).as_posix(): one.read_bytes() for one in folder.rglob("*") if one.is_file()}
    files["report.html"] = re.sub(rb"<td>[\d.]+\xc2\xa0s</td>", b"", files.get("report.html", b""))
    files["run.json"] = files.get("run.json", b"").replace(str(folder).encode(), b"")
    return {name: held for name, held in files.items() if not TIMED.fullmatch(name)}


@pytest.mark.parametrize("what", [RUN, EXPORT], ids=["run", "export"])
@pytest.mark.slow
@pytest.mark.parametrize("kills", [1, 50])
def test_what_is_killed_at_random_ends_in_the_same_bytes(tmp_path, what, kills):
    rng, done, round_ = np.random.default_rng(kills), 0, 0
    (tmp_path / "00").mkdir()
    whole = start(what, tmp_path / "00")
    operations, expected = int(whole.stderr.split()[-1]), content(tmp_path / "00")
    while done < kills:
        folder = tmp_path / f"{(round_ := round_ + 1):02}"
        folder.mkdir()
        for again in range(4):  # killed three times at most, then it is left to end
            made = start(what, folder, int(rng.integers(1, operations)) if again < 3 and done < kills else 0)
            if made.returncode == 0 or (what == EXPORT and (folder / "lake").exists() and not list(folder.glob(".*"))):
                break
            done += 1
        found = content(folder)
        assert [name for name in {*expected, *found} if expected.get(name) != found.get(name)] == [], (round_, done)
