"""Mends as errors name them: what stands between backquotes, evaluated; and which of them a file names."""

import ast
import re
from pathlib import Path

import gymnasium
import numpy
import numpy as np
import pytest
from gymnasium import spaces

from irl_gym import errors
from irl_gym.environments.reveal import Reveal
from irl_gym.errors import HiddenState, UnknownObservation
from irl_gym.tables.discretize import discretize
from irl_gym.tables.tabulate import tabulate

GAMMA = 0.9


def mends(message):
    """The code that a message names, in its order."""
    return re.findall(r"`([^`]*)`", message)


def named(*files, wide=False):
    """Patterns of the mends that errors of these files of the library name: what follows what was expected, if no question.

    Widely, also the last sentences of errors that do not say what was expected.
    """
    for file in files:
        for node in ast.walk(ast.parse(_file(file).read_text())):
            if isinstance(node, ast.Call) and hasattr(errors, getattr(node.func, "id", "")) and node.args:
                text = _text(node.args[0])
                texts = [text.partition(": expected")[2].partition(". ")[2]]
                if wide and ": expected" not in text:
                    texts = re.findall(r"\. ([A-Z`].*)", text)
            elif isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "").lower() == "mend":
                one = node.value
                texts = map(_text, [one.body, one.orelse] if isinstance(one, ast.IfExp) else [one])
            else:
                continue
            yield from (
                ".*".join(map(re.escape, one.split("\0")))
                for one in texts
                if re.search("[a-z]", one) and not one.strip().endswith("?")
            )


def _file(name):
    """A file of the library, by the end of its path."""
    (found,) = Path(errors.__file__).parent.rglob(str(name))
    return found


def _text(node):
    """A text of the code, with a sign in place of what is filled in."""
    parts = node.values if isinstance(node, ast.JoinedStr) else [node]
    return "".join(one.value if isinstance(getattr(one, "value", 0), str) else "\0" for one in parts)


VERBS = (
    "add|ask|call|choose|clip|convert|copy|correct|count|delete|discretise|divide|draw|drop|fill|fix|flatten|give|hold|import|"
    "install|keep|learn|leave|let|list|load|look|lower|make|mend|move|name|normalise|number|open|pass|put|raise|read|record|"
    "register|remove|rename|rescale|retrain|run|save|scale|shift|show|sort|stack|take|train|try|turn|upgrade|use|wait|wrap|write"
)
ASKS = re.compile(rf"(?:^ ?(?=[A-Z])|(?<=[.:;?,] ))(?:[Oo]r |and |then )?((?:Cut|Have|More|Play|(?i:{VERBS})) [^.,;:\0]{{2,}})")
"""What asks a reader to do something: from a verb with which a sentence, or a part of it, begins to the next sign or value."""


def asked(file):
    """What the texts of a file ask a reader to do, wherever they stand in it, and the lines."""
    tree = ast.parse(file.read_text())
    silent = {node.value for node in ast.walk(tree) if isinstance(node, ast.Expr)}  # the docstrings
    silent |= {part for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
    for node in ast.walk(tree):
        if node not in silent and isinstance(node, ast.JoinedStr | ast.Constant):
            yield from ((node.lineno, one.strip()) for one in ASKS.findall(_text(node)))


def told(breaks, *given):
    """What the error says that something breaks with."""
    with pytest.raises((errors.IrlGymError, FileNotFoundError)) as caught:
        breaks(*given)
    return str(caught.value)


def unsaid(cases, *files):
    """The mends of these files that no case says."""
    said = " ".join(says for says, *_ in cases)
    return [one for one in named(*files, wide=True) if not re.search(one, said)]


def done(code, env):
    """What a mend makes."""
    import irl_gym.environments.reveal
    import irl_gym.environments.seeded_starts
    import irl_gym.tables.counted.counting

    return eval(
        code, {"env": env, "gamma": GAMMA, "discretize": discretize, "irl_gym": irl_gym, "gymnasium": gymnasium, "numpy": numpy}
    )


def error_of(env, error, **options):
    with pytest.raises(error) as caught:
        tabulate(env, gamma=GAMMA, **options)
    return str(caught.value)


def revealed(env):
    """The environment with all that its errors say to reveal, and their mends where a value was not counted."""
    shown = {}
    for _ in range(20):
        try:
            tabulate(Reveal(env, shown) if shown else env, gamma=GAMMA, check_steps=500)
            return Reveal(env, shown)
        except HiddenState as error:
            code = next(one for one in mends(str(error)) if one.startswith("irl_gym.environments.reveal.Reveal"))
            shown |= done(code, env).shown
        except UnknownObservation as error:
            more = re.search(r"shown=(\{.*?\})", str(error))
            if more is None:  # a listed value: "List it too"
                name, value = re.match(r"(\S+) is (.*?): expected one of", str(error)).groups()
                shown[name] = [*shown[name], eval(value)]
            else:
                shown |= eval(more[1])
    raise AssertionError("the mends lead nowhere")


WORDS = ["first", "second", "third", "fourth", "fifth", "sixth", "last"]
SHOWN = {
    "whole numbers as floats": (spaces.Box(0, 6, (2,), np.float32), lambda cell: np.array([cell, 0], np.float32)),
    "floats without bounds": (spaces.Box(-np.inf, np.inf, (), np.float64), np.float64),
    "words": (spaces.Text(6), WORDS.__getitem__),
    "a dict with a word": (
        spaces.Dict({"cell": spaces.Discrete(7), "word": spaces.Text(6)}), lambda cell: {"cell": cell, "word": WORDS[cell]}
    ),
    "a tuple with a float": (
        spaces.Tuple([spaces.Box(0, 6, (1,)), spaces.MultiBinary(1)]),
        lambda cell: (np.array([cell], np.float32), np.zeros(1, np.int8)),
    ),
}  # fmt: skip
