"""Programs that are stopped at an event, not at a moment: they send themselves the signal, in the n-th call of a function."""

import json
import os
import subprocess
import sys
from pathlib import Path

HANG = 1800
"""Seconds after which a program is taken to hang."""
ROOT = Path(__file__).parents[1]
STOPPING = """
import importlib, json, os, runpy, signal, sys
where, nth, sent, changes, script, *arguments = sys.argv[1:]

def owner(path):
    module, _, inner = path.partition(":")
    found, (*parts, name) = importlib.import_module(module), inner.split(".")
    for part in parts:
        found = getattr(found, part)
    return found, name

for path, value in json.loads(changes).items():
    setattr(*owner(path), value)
where, calls = owner(where), []
plain = getattr(*where)

def stopping(*given, **named):
    calls.append(1)
    if len(calls) == int(nth):
        os.kill(os.getpid(), int(sent))
    return plain(*given, **named)

setattr(*where, stopping)
signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background is born deaf to it
sys.argv = [script, *arguments]
runpy.run_path(script, run_name="__main__")
"""


def run_until(script, *arguments, where, nth=1, sent, cwd=None, **changes):
    """A script's finished process, which was sent a signal in the n-th call of `where`, such as
    "irl_gym.demonstrations.shards:Shards.append".

    `changes` are values of the child's modules: {"irl_gym.demonstrations.export:SHARD_BYTES": 1}.
    """
    command = [sys.executable, "-c", STOPPING, where, str(nth), str(int(sent)), json.dumps(changes), str(script), *arguments]
    path = os.pathsep.join([str(ROOT / "tests"), os.environ.get("PYTHONPATH", "")])
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=HANG, env=os.environ | {"PYTHONPATH": path})
