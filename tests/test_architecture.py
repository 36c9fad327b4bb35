"""docs/architecture.md says what is the case: the picture is that of the imports, and every file that it names is there."""

import importlib.metadata
import re
import runpy
from pathlib import Path

import irl_gym

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs/architecture.md").read_text()
SCRIPT = runpy.run_path(str(ROOT / "scripts/draw_architecture.py"))


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
    assert {str(one): n for one, n in counts.items() if n > 15} == {} and counts[ROOT / "irl_gym"] <= 8


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
