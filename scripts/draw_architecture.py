"""Draw which room of irl_gym uses which, from the imports: docs/figures/architecture.svg. Run it in the root of a clone.

A row is a room and what it is, ground last; a dot says that it imports from the room of that column, with how many imports.
All dots are above the diagonal, since arrows point down only: a contract of pyproject.toml says so, and it is read here.

For example:
    python scripts/draw_architecture.py
"""

import ast
import textwrap
import tomllib
from collections import Counter
from html import escape
from pathlib import Path

import grimp

ROOT = Path(__file__).parents[1]
PICTURE = Path("docs/figures/architecture.svg")
CONTRACT = "rooms: arrows point down only"
ROW, NAME, TOP, TEXT = 30, 150, 120, 560
"""Height of a row, and where the first column begins, the first row does, and the room for what a room is."""
STYLE = """
text { font: 13px system-ui, sans-serif; fill: #1f2328 } .name { font-weight: 600 } .about { fill: #59636e }
.count { font-size: 11px; text-anchor: middle; fill: #fff } .dot { fill: #0969da } .self { fill: #d1d9e0 }
line { stroke: #d1d9e0 } rect { fill: #fff }
@media (prefers-color-scheme: dark) { text { fill: #f0f6fc } .about { fill: #9198a1 } .self { fill: #3d444d }
  line { stroke: #3d444d } rect { fill: #0d1117 } .dot { fill: #1f6feb } }
"""


def rooms(root: Path) -> list[str]:
    """The rooms in their order, commands first, as the contract has it."""
    contracts = tomllib.loads((root / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    layers = next(one["layers"] for one in contracts if one["name"] == CONTRACT)
    return [room.strip() for layer in layers for room in layer.replace("|", ":").split(":")]


def about(root: Path, room: str) -> str:
    """What a room is: the first line of its docstring."""
    path = root / "irl_gym" / room
    text = (path / "__init__.py" if path.is_dir() else path.with_suffix(".py")).read_text()
    return (ast.get_docstring(ast.parse(text)) or "").split("\n")[0].rstrip(".")


def imports(order: list[str]) -> Counter[tuple[str, str]]:
    """How many modules of one room are imported by modules of another, types included."""
    graph = grimp.build_graph("irl_gym", cache_dir=None, exclude_type_checking_imports=False)
    found: Counter[tuple[str, str]] = Counter()
    for module in graph.modules:
        for used in graph.find_modules_directly_imported_by(module):
            pair = tuple(one.split(".")[1] if "." in one else "" for one in (module, used))
            if pair[0] in order and pair[1] in order:
                found[pair[0], pair[1]] += 1
    return found


def draw(root: Path) -> str:
    """The picture."""
    order = rooms(root)
    used, n = imports(order), len(order)
    width, height = NAME + n * ROW + 16 + TEXT, TOP + n * ROW + 10
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" role="img">',
        "<title>Which room of irl_gym imports from which</title>",
        f"<style>{STYLE}</style>",
        '<rect width="100%" height="100%"/>',
    ]
    for i, room in enumerate(order):
        y, x = TOP + i * ROW, NAME + i * ROW
        middle = y + ROW / 2 + 4
        parts += [
            f'<line x1="0" y1="{y}" x2="{width}" y2="{y}"/>',
            f'<text class="name" x="8" y="{middle}">{room}</text>',
            *_lines(about(root, room), NAME + n * ROW + 16, y + ROW / 2),
            f'<text transform="translate({x + ROW / 2 + 4} {TOP - 8}) rotate(-60)">{room}</text>',
            f'<circle class="self" cx="{x + ROW / 2}" cy="{y + ROW / 2}" r="4"/>',
        ]
        for j, other in enumerate(order):
            count = used[room, other]
            if count and other != room:
                at = NAME + j * ROW + ROW / 2
                parts += [
                    f'<circle class="dot" cx="{at}" cy="{y + ROW / 2}" r="{min(6 + count**0.5, 14):.1f}"/>',
                    f'<text class="count" x="{at}" y="{middle}">{count}</text>',
                ]
    return "\n".join([*parts, "</svg>", ""])


def _lines(text: str, x: float, middle: float) -> list[str]:
    """A sentence in one line or two."""
    lines = textwrap.wrap(text, 78)
    first = middle + 4 - 7 * (len(lines) - 1)
    return [f'<text class="about" x="{x}" y="{first + 14 * i}">{escape(line)}</text>' for i, line in enumerate(lines)]


def main() -> None:
    """Write the picture."""
    (ROOT / PICTURE).write_text(draw(ROOT))


if __name__ == "__main__":
    main()
