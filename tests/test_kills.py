"""Runs and exports are killed at random, again and again, and end in the bytes in which they would have ended.

A kill comes before a file operation in the folder, whose number is drawn: what is done between two of them leaves no trace.
Each is of a process of its own, forked from one that has imported the library: importing it takes longer than an export.
A hundred kills: `pytest -m slow tests/test_kills.py`.
"""

import contextlib
import json
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

SCRIPTS = Path(__file__).parents[1] / "scripts"
FORKING = """
import importlib, json, os, runpy, signal, sys, traceback
changes, script = json.loads(sys.argv[1]), sys.argv[2]
for name in ("loop.pipeline", "reports.terminal_report", "commands.demonstrating.demonstrators"):  # once, not in each child
    importlib.import_module(f"irl_gym.{name}")
for path, value in changes.items():
    module, _, name = path.partition(":")
    setattr(importlib.import_module(module), name, value)

def forked(number, folder, arguments):
    count, told, code = 0, os.open(folder + ".txt", os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 1
    os.dup2(told, 1), os.dup2(told, 2)

    def hook(event, given):
        nonlocal count
        if event not in ("open", "os.rename", "os.remove", "os.mkdir", "os.rmdir"):
            return
        if not any(isinstance(one, str | os.PathLike) and os.path.abspath(one).startswith(folder) for one in given[:2]):
            return
        count += 1
        if count == number:
            os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(hook)
    sys.argv = [script, *arguments]
    try:
        runpy.run_path(script, run_name="__main__")
        code = 0
    except SystemExit as end:
        code = end.code or 0
    except BaseException:
        traceback.print_exc()
    print("operations", count, flush=True)
    os._exit(code)

for line in sys.stdin:
    child = os.fork() or forked(*json.loads(line))
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""
RUN = ("recover_and_retrain.py", "--out", ("--env-kwargs", "is_slippery=false", "--episodes", "5", "--total-timesteps", "6144"))
EXPORT = ("export_dataset.py", "--root", ("--env-id", "FrozenLake-v1", "--dataset-id", "lake/best-v0", "--episodes", "40"))
OFTEN = {"irl_gym.demonstrations.export:SHARD_BYTES": 3_000}
TIMED = re.compile(r"(.*/)?(agent\.zip|tensorboard/.*|\.stages/.*)")
"""Files that hold the time."""


@contextlib.contextmanager
def starting(what):
    """Starts a script in a folder, killed before the file operation of a number, never for 0; returns what it said, if not."""
    script, flag, arguments = what
    command = [sys.executable, "-c", FORKING, json.dumps(OFTEN), str(SCRIPTS / script)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as parent:

        def start(folder, number=0):
            print(json.dumps([number, str(folder), [flag, str(folder), *arguments]]), file=parent.stdin, flush=True)
            code, said = int(parent.stdout.readline()), Path(f"{folder}.txt").read_text()
            assert code in (0, -signal.SIGKILL), said
            return None if code else said

        yield start


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
    with starting(what) as start:
        operations, expected = int(start(tmp_path / "00").split()[-1]), content(tmp_path / "00")
    with starting(what) as start:  # whose sets have another order
        while done < kills:
            folder = tmp_path / f"{(round_ := round_ + 1):02}"
            folder.mkdir()
            for again in range(4):  # killed three times at most, then it is left to end
                said = start(folder, int(rng.integers(1, operations)) if again < 3 and done < kills else 0)
                if said or (what == EXPORT and (folder / "lake").exists() and not list(folder.glob(".*"))):
                    break
                done += 1
            found = content(folder)
            assert [name for name in {*expected, *found} if expected.get(name) != found.get(name)] == [], (round_, done)
    print(f"\n{what[0]}: {done} kills in {round_} folders, each before one of {operations} operations")
