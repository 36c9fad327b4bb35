"""docs/architecture.md says what is the case: the picture is that of the imports, and every file that it names is there."""

import ast
import functools
import importlib.metadata
import re
import runpy
from pathlib import Path

import pytest

import irl_gym

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs/architecture.md").read_text()
SCRIPT = runpy.run_path(str(ROOT / "scripts/draw_architecture.py"))
WHOLE = {"irl_gym.runs.run.Run", "irl_gym.loop.loop.Loop", "irl_gym.reports.terminal_report.Report"}
"""What nothing takes "to get at things"."""
SUBJECT = {"report.write_report", "compared_runs.lettered", "comparison_page.write_comparison", "pooling.pools"} | {
    f"terminal_report.{one}" for one in ("print_report", "render")
}
"""Functions whose subject is a whole run, several, or all that a loop found: docs/architecture.md says why."""
WORLDS = {"World", "TableWorld", "SteppedWorld", "Simulator", "GenerativeModel"}
AT_HOME = {
    "learners": ("learners",),
    "worlds": ("learners", "loop/worlds", "loop/table_world", "agents/simulator", "environments"),
}
"""Who may ask what kind of learner or world something is."""


@functools.cache
def modules():
    """Each module of the library with its syntax."""
    return {one.relative_to(ROOT / "irl_gym"): ast.parse(one.read_text()) for one in (ROOT / "irl_gym").rglob("*.py")}


def names(tree):
    """The names in a part of a module, those in quotes too."""
    said = [ast.parse(one.value, mode="eval") for one in ast.walk(tree) if isinstance(one, ast.Constant) and one.value == "Run"]
    return {one.id for part in (tree, *said) for one in ast.walk(part) if isinstance(one, ast.Name)}


def learners():
    """The classes that declare what they need."""
    room = [tree for where, tree in modules().items() if where.parts[0] == "learners"]
    classes = [one for tree in room for one in ast.walk(tree) if isinstance(one, ast.ClassDef)]
    return {one.name for one in classes if any(ast.unparse(line).startswith("needs:") for line in one.body)}


def test_the_picture_is_that_of_the_imports():
    assert (ROOT / SCRIPT["PICTURE"]).read_text() == SCRIPT["draw"](ROOT)


def test_no_module_is_part_of_a_circle():
    graph = SCRIPT["grimp"].build_graph("irl_gym", cache_dir=None, exclude_type_checking_imports=False)
    left = {one: set(graph.find_modules_directly_imported_by(one)) for one in graph.modules}
    while leaves := [one for one, uses in left.items() if not uses & left.keys() - {one}]:
        for one in leaves:
            del left[one]
    assert sorted(left) == []


def test_no_package_has_more_than_15_modules_and_the_root_no_more_than_8():
    counts = {one.parent: len([*one.parent.glob("*.py")]) for one in (ROOT / "irl_gym").rglob("__init__.py")}
    root = [one.name for one in (ROOT / "irl_gym").glob("*.py") if one.name != "__init__.py"]
    assert {str(one): n for one, n in counts.items() if n > 15} == {} and len(root) <= 8


def test_every_package_says_which_file_to_open_first():
    told = {one: one.read_text() for one in (ROOT / "irl_gym").rglob("__init__.py") if one.parent.name != "irl_gym"}
    assert [str(one.parent.name) for one, text in told.items() if "Open first: " not in text] == []


def test_every_file_that_the_page_names_is_there():
    named = re.findall(r"`([a-z_/]+/[a-z_]*(?:\.py)?)`", PAGE)
    missing = [one for one in named if not any((ROOT / folder / one).exists() for folder in ("", "irl_gym"))]
    assert len(named) > 25 and missing == []


def test_the_version_is_told_once():
    cited = re.search(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text(), re.M)
    assert cited is not None and irl_gym.__version__ == importlib.metadata.version("irl_gym") == cited[1]


def test_no_function_takes_a_whole_run_but_those_whose_subject_it_is():
    taken = set()
    for where, tree in modules().items():
        for one in ast.walk(tree):
            if isinstance(one, ast.FunctionDef):
                asked = [each.annotation for each in (*one.args.posonlyargs, *one.args.args, *one.args.kwonlyargs)]
                said = [names(each) for each in asked if each is not None]
                if any(each & {whole.rpartition(".")[2] for whole in WHOLE} and "Callable" not in each for each in said):
                    taken.add(f"{where.stem}.{one.name}")
    assert taken == SUBJECT and all(f"`{one.rpartition('.')[2]}`" in PAGE for one in SUBJECT)


@pytest.mark.parametrize(("room", "kinds"), [("learners", learners()), ("worlds", WORLDS)])
def test_nobody_asks_for_the_class_of_a_learner_or_a_world_but_its_own_room(room, kinds):
    asked = {
        where.as_posix()
        for where, tree in modules().items()
        for one in ast.walk(tree)
        if isinstance(one, ast.Call) and ast.unparse(one.func) in ("isinstance", "issubclass") and names(one.args[1]) & kinds
    }
    assert len(kinds) >= 3 and [one for one in asked if not one.startswith(AT_HOME[room])] == []


def test_the_name_of_a_class_means_one_thing():
    said: dict[str, set[str]] = {}
    for where, tree in modules().items():
        for one in tree.body:
            targets = one.targets if isinstance(one, ast.Assign) else [one] if isinstance(one, ast.ClassDef) else []
            for name in (getattr(target, "name", None) or getattr(target, "id", "") for target in targets):
                if re.fullmatch(r"[A-Z]\w*[a-z]\w*", name):
                    said.setdefault(name, set()).add(where.as_posix())
    twice = {name: found for name, found in said.items() if len(found) > 1}
    # Callbacks; phi in a table, and the flags that make one; what each subcommand is asked.
    assert {*twice} <= {"OnProgress", "Progress", "Table", "Arguments"}


def test_no_report_parses_a_text():
    reading = re.compile(r"^(import|from) re\b|(?<!np)\.(split|partition|rpartition|removeprefix|removesuffix)\(", re.M)
    found = {where.as_posix(): len(reading.findall((ROOT / "irl_gym" / where).read_text())) for where in modules()}
    told = {where: n for where, n in found.items() if n and where.startswith(("reports/", "judging/diagnoses/"))}
    assert told == {
        "reports/page/sections/asked.py": 1,
        "judging/diagnoses/plain_words.py": 1,
    }
