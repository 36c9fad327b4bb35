"""The pages of docs/ for users do what they say: their blocks are run, and what these print is compared with the page.

A page is run as a reader would: its Python blocks in order, in one process, in an empty folder. A ```text block below a block
is what that block prints; `...` stands for the rest of a line, or for any lines where it stands alone; the last line is the
error where the block ends in one. Shell blocks with a ```text block below are run after the Python ones; of the others only the
options are checked.
"""

import functools
import json
import os
import re
import runpy
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import pytest
from stopped import HANG

from irl_gym.commands import door
from irl_gym.learners.registry import BUILT_IN

ROOT = Path(__file__).parents[1]
PAGES = (
    "../README", "python", "learners", "runs", "wrap-any-environment", "bring-your-own-demonstrations", "reward-distances",
    "ambiguity", "doctor", "security", "imitation",
)  # fmt: skip
SCRIPTS = ("reward_distances.py", "measure_ambiguity.py")
LEARNERS = ("finite-lp", "feature-lp", "trajectory-lp", "module:Class")
HELP = f"""
import contextlib, runpy, sys
from irl_gym.commands import door
from irl_gym.learners.registry import BUILT_IN
for script in {SCRIPTS}:
    print("===", script, flush=True)
    sys.argv = [script, "--help"]
    with contextlib.suppress(SystemExit):
        runpy.run_path(script, run_name="__main__")
for name in door.SUBCOMMANDS:
    print("===", name, flush=True)
    more = {{"run": [["--learner", one] for one in {LEARNERS}], "reproduce": [["ng-russell-2000"]]}}
    for words in more.get(name, [[]]):
        with contextlib.suppress(SystemExit):
            door.main([name, *words, "--help"])
"""
COMMAND = r"(?:python scripts/|irl-gym )([\w.]+)([^\n|]*)"
CHILD = """
import contextlib, io, json, sys, traceback
page, printed = {"__name__": "page"}, []
for line, code, expected in json.load(sys.stdin):
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        try:
            exec(compile("\\n" * line + code, sys.argv[1], "exec"), page)
        except Exception as error:
            if f"{type(error).__name__}:" not in expected:
                traceback.print_exc()
            print(f"{type(error).__name__}: {error}")
    printed.append(out.getvalue())
sys.__stdout__.write(json.dumps(printed))
"""


class Block(NamedTuple):
    """A block of code, and what it prints; None where the page does not say."""

    language: str
    line: int
    code: str
    printed: str | None


def blocks(text):
    """The blocks of a page that can be run."""
    found = []
    for match in re.finditer(r"^```(\w*)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE):
        language, code = match.groups()
        if language == "text":
            assert found and found[-1].printed is None, f"nothing prints {code!r}"
            found[-1] = found[-1]._replace(printed=code)
        elif language in ("python", "sh"):
            found.append(Block(language, text[: match.start()].count("\n") + 1, code, None))
    return found


def agrees(printed, expected):
    """Is it what is expected, with `...` for what is left out?"""
    pattern = "".join(
        r"(?:[^\n]*\n)*?" if line == "..." else re.escape(line).replace(r"\.\.\.", r"[^\n]*") + r"\n"
        for line in expected.splitlines()
    )
    lines = "".join(f"{line.rstrip()}\n" for line in printed.replace("\xa0", " ").splitlines())
    return re.fullmatch(pattern, lines) is not None


def run(command, folder, given=None, shell=False):
    """What a process in an otherwise empty world prints, and its errors."""
    surroundings = os.environ | {"MINARI_DATASETS_PATH": str(folder / "datasets"), "COLUMNS": "120"}
    done = subprocess.run(
        command, cwd=folder, env=surroundings, input=given, capture_output=True, text=True, shell=shell, timeout=HANG
    )
    return done.stdout, done.stderr


def page(name):
    return (ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8")


@functools.cache
def options():
    """Script or subcommand -> the options that it knows."""
    done = subprocess.run([sys.executable, "-c", HELP], cwd=ROOT / "scripts", capture_output=True, text=True)
    helps = [text.partition("\n") for text in done.stdout.split("=== ")[1:]]
    assert len(helps) > len(SCRIPTS), done.stderr
    return {name: set(re.findall(r"--[a-z][-a-z0-9]*", text)) for name, _, text in helps}


@pytest.mark.parametrize("name", PAGES)
def test_blocks_print_what_the_page_says(name, tmp_path):
    found = blocks(page(name))
    python = [block for block in found if block.language == "python"]
    given = json.dumps([(block.line, block.code, block.printed or "") for block in python])
    out, errors = run([sys.executable, "-W", "error", "-c", CHILD, f"{name}.md"], tmp_path, given)
    assert out, errors
    ran = list(zip(python, json.loads(out), strict=True))
    for block in found:
        if block.language == "sh" and block.printed is not None:
            command = block.code.replace("python scripts/", f"{sys.executable} {ROOT}/scripts/")
            command = command.replace("irl-gym ", f"{sys.executable} -m irl_gym ")
            printed, more = run(command, tmp_path, shell=True)
            errors += more
            ran.append((block, printed))
    wrong = [
        f"line {block.line} printed\n{printed}\nexpected\n{block.printed}"
        for block, printed in ran
        if not agrees(printed, block.printed or "")
    ]
    assert not wrong, "\n".join([*wrong, errors])


@pytest.mark.parametrize("name", PAGES)
def test_commands_have_only_options_that_exist(name):
    commands = re.findall(COMMAND, page(name).replace("`", "\n"))
    assert commands or "irl-gym" not in page(name)
    unknown = [
        (script, one)
        for script, rest in commands
        for one in re.findall(r"--[a-z][-a-z0-9]*", rest)
        if one not in options()[script]
    ]
    assert not unknown


@pytest.mark.parametrize("name", PAGES)
def test_options_in_the_text_exist(name):
    assert set(re.findall(r"`[^`\n]*?(--[a-z][-a-z0-9]*)", page(name))) <= set().union(*options().values())


@pytest.mark.parametrize("name", PAGES)
def test_links_lead_somewhere(name):
    text = page(name)
    headings = {
        re.sub(r"[^-a-z0-9 _]", "", title.lower()).replace(" ", "-") for title in re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    }
    for target in re.findall(r"\]\(([^)]+)\)", text):
        file, _, anchor = target.partition("#")
        assert (ROOT / "docs" / name).parent.joinpath(file).exists() if file else anchor in headings, target


@pytest.mark.parametrize("name", ["../README", "imitation"])
def test_the_table_of_learners_is_that_of_the_command(name, capsys):
    door.main(["learners", "--markdown"])
    assert capsys.readouterr().out.strip() in page(name)


@pytest.mark.parametrize("name", ["feedback", "irl"])
def test_the_figures_of_the_map_are_those_of_its_script(name):
    drawn = runpy.run_path(str(ROOT / "scripts/draw_imitation.py"))[name]()
    assert drawn == (ROOT / f"docs/figures/{name}.svg").read_text(encoding="utf-8"), "python scripts/draw_imitation.py"
    ElementTree.fromstring(drawn)


def test_every_learner_is_in_the_map_of_feedback():
    drawn = (ROOT / "docs/figures/feedback.svg").read_text(encoding="utf-8")
    assert {name for name in BUILT_IN if name not in drawn} == set()


def test_the_readme_is_short():
    assert len(page("../README").splitlines()) <= 80


def test_output_agrees_with_what_was_left_out():
    assert agrees("a 1\nb\nc\nd 2  \n", "a ...\n...\nd 2\n")


def test_output_that_differs_does_not_agree():
    assert not agrees("a 1\nb\n", "a 2\nb\n") and not agrees("a\nb\n", "a\n") and not agrees("a\n", "a\nb\n")
