"""Whatever a text of the library, its environments or its scripts asks a reader to do is in an inventory: `test_mends*.py`.

There it stands word by word, in a case that executes it, or with the name of the test that does.
"""

import ast
from pathlib import Path

from mended import asked

ROOT = Path(__file__).parents[1]
NO_MENDS = {
    "Run it again", "Put your own in place of each", "Move the slider to walk through the pieces", "Play them",
    "look at it before you run it",  # how a page is used
    "give or take", "lower left and upper right", "import irl_gym", "Run | None",  # no sentences
    "Give the expert as the (S", "Leave out the actions that it takes by mistake",  # of rewards on steps, which explain all
}  # fmt: skip
"""What looks like a mend."""


def test_every_mend_that_a_text_names_is_in_an_inventory():
    inventories = [ast.walk(ast.parse(one.read_text())) for one in (ROOT / "tests").rglob("test_mends*.py")]
    said = "\n".join(str(node.value) for nodes in inventories for node in nodes if isinstance(node, ast.Constant))
    files = [one for part in ("irl_gym", "envs", "scripts") for one in (ROOT / part).rglob("*.py")]
    missing = {what: f"{one.relative_to(ROOT)}, line {line}" for one in files for line, what in asked(one)
               if what not in said and "pip" not in what}  # fmt: skip
    assert {what: where for what, where in missing.items() if what not in NO_MENDS} == {}
    assert missing.keys() == NO_MENDS


def test_a_mend_of_a_new_text_is_found_wherever_it_stands(tmp_path):
    (tmp_path / "new.py").write_text(
        '"""Use a broom."""\n'
        "def sweep(room, told=()):\n"
        '    """Leave it."""\n'
        '    told += ("Take two brooms, or wait for rain",)\n'
        '    raise OSError(f"{room} is dusty: ask for a broom, as {told} say. It is late.")\n'
    )
    found = [(4, "Take two brooms"), (4, "wait for rain"), (5, "ask for a broom")]
    assert [*asked(tmp_path / "new.py")] == found
