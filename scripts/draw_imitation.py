"""Draw the two figures of docs/imitation.md, as SVG: docs/figures/feedback.svg and docs/figures/irl.svg.

feedback    what a learner is told of what it does, along three axes, and which learners are where: a learner's column of
            Table 1, which it declares by `needs`, decides
irl         the way from an expert to an agent that is paid by a learned reward, and what each part of it has of the world
Both are 420 wide, so that they can be read on a telephone, and follow the reader's choice of light or dark.

For example:
    python scripts/draw_imitation.py
"""

import textwrap
from collections.abc import Sequence
from html import escape
from pathlib import Path

from irl_gym.commands.learners import rows

FIGURES = Path(__file__).parents[1] / "docs/figures"
WIDTH = 420
STYLE = """
text { font: 12px system-ui, sans-serif; fill: #1f2328 } .name { font-weight: 600 } .about { fill: #59636e }
.row { font-weight: 600; text-anchor: middle }
.paper { fill: #fff } .cell { fill: #f6f8fa; stroke: #d1d9e0 } .here { fill: #ddf4ff; stroke: #54aeff }
path { stroke: #59636e; fill: none; stroke-width: 1.5 } .tip { fill: #59636e; stroke: none }
@media (prefers-color-scheme: dark) { text { fill: #f0f6fc } .about { fill: #9198a1 } .paper { fill: #0d1117 }
  .cell { fill: #151b23; stroke: #3d444d } .here { fill: #0c2d6b; stroke: #1f6feb } path { stroke: #9198a1 }
  .tip { fill: #9198a1 } }
"""
LINE, LETTER = 15, 7.2
"""Height of a line, and the width of a letter of wide fonts, of which as many stand in a line as fit."""

GUTTER, COLUMN, ROW, GAP = 22, 195, 80, 6
"""Of the figure of feedback: room for the names of rows, and the size of a cell."""
HEADS = (("instructive", "what was right"), ("evaluative", "how good it was"))
PANELS = (
    ("one-shot", "what is done does not change what comes next", "passive"),
    ("sequential", "what is done decides what comes next", "interactive"),
)
"""Each half of the figure, and the learners of its left column."""
KNOWN = {
    ("passive", "sampled", 1): ("bandits", "none in this library"),
    ("passive", "exhaustive", 0): ("a policy shown whole", "Clone.fit of an occupancy"),
    ("passive", "exhaustive", 1): ("choice by known values", "greedy(Q)"),
    ("interactive", "sampled", 1): ("reinforcement learning", "PPO, DQN, A2C: a run's agents"),
    ("interactive", "exhaustive", 0): ("an oracle, asked wherever the learner can come to", "DAgger(episodes=None)"),
    ("interactive", "exhaustive", 1): ("planning", "value iteration, policy iteration"),
}
"""What stands in the cells that no learner is in: a name, and what there is of it here."""

SPINE, WORLD = 222, 104
"""Of the figure of inverse reinforcement learning: the width of its boxes, and that of the world beside them."""
BOXES = (
    ("1  expert", "acts well under the true reward, or is simply a person", "steps, true reward"),
    ("2  demonstrations", "episodes: what it saw and did", ""),
    ("3  inverse learner", "which rewards make that the best that can be done?", "dynamics"),
    ("4  reward and certificate", "is the expert optimal under it, by which margin?", ""),
    ("5  agent", "plans or trains, and is paid the learned reward alone", "steps"),
    ("6  judgement", "what does the agent earn of the true reward?", "true reward"),
)
"""From top to bottom: a name, what it is, and what it has of the world."""


def feedback() -> str:
    """The axes of feedback, and the learners in the cells between them."""
    of = {column: [row[0] for row in rows() if row[1] == column] for column in ("passive", "active", "interactive")}
    parts, y = [], 16
    for column, (name, about) in enumerate(HEADS):
        x = GUTTER + column * (COLUMN + GAP)
        parts += [_text(x, y, name, "name"), _text(x, y + LINE, about, "about")]
    y += 2 * LINE + 6
    for title, about, kind in PANELS:
        parts += [_text(2, y + 6, title, "name"), _text(10 + 8 * len(title), y + 6, about, "about")]
        y += 16
        for row in ("sampled", "exhaustive"):
            parts.append(f'<text class="row" transform="translate(14 {y + ROW / 2:g}) rotate(-90)">{row}</text>')
            for column in (0, 1):
                learners = row == "sampled" and column == 0
                name, told = (f"{kind} imitation", ", ".join(of[kind])) if learners else KNOWN[kind, row, column]
                parts += _box(GUTTER + column * (COLUMN + GAP), y, COLUMN, ROW, name, told, "here" if learners else "cell")
            y += ROW + GAP
        y += 14
    y -= 14
    told = f"{', '.join(of['active'])}: an expert's actions in, a reward out"
    parts += _box(GUTTER, y, 2 * COLUMN + GAP, ROW - 4, "active imitation leads from left to right", told, "here")
    parts += _arrow(GUTTER + 8, y + ROW - 14, GUTTER + 2 * COLUMN + GAP - 8, y + ROW - 14)
    return _picture(y + ROW, "What a learner is told of what it does", parts)


def irl() -> str:
    """The paradigm of inverse reinforcement learning."""
    height, apart = 60, 22
    world, bottom = WIDTH - WORLD - 2, len(BOXES) * (height + apart) - apart
    parts = _box(world, 2, WORLD, bottom, "world", "stepped, or its table of transitions", "cell")
    for i, (name, about, has) in enumerate(BOXES):
        y = 2 + i * (height + apart)
        parts += _box(2, y, SPINE, height, name, about, "here" if name.startswith(("3", "4")) else "cell")
        if has:
            parts += _arrow(world, y + height / 2, SPINE + 4, y + height / 2)
            for j, line in enumerate(reversed(has.split(", "))):
                parts.append(_text(SPINE + 10, y + height / 2 - 6 - 13 * j, line, "about"))
        if i + 1 < len(BOXES):
            parts += _arrow(SPINE / 2, y + height, SPINE / 2, y + height + apart - 2)
    return _picture(bottom + 4, "From an expert to an agent that is paid by a learned reward", parts)


def _picture(height: float, title: str, parts: Sequence[str]) -> str:
    size = f'viewBox="0 0 {WIDTH} {height:g}" width="{WIDTH}" height="{height:g}"'
    first = f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img">'
    paper = '<rect class="paper" width="100%" height="100%"/>'
    return "\n".join([first, f"<title>{escape(title)}</title>", f"<style>{STYLE}</style>", paper, *parts, "</svg>", ""])


def _text(x: float, y: float, text: str, kind: str) -> str:
    return f'<text class="{kind}" x="{x:g}" y="{y:g}">{escape(text)}</text>'


def _box(x: float, y: float, width: float, height: float, name: str, about: str, kind: str) -> list[str]:
    """A box with its name, and what it is below, in as many lines as they take."""
    most = int((width - 12) / LETTER)
    lines = [(line, "name") for line in textwrap.wrap(name, most - 1)]
    lines += [(line, "about") for line in textwrap.wrap(about, most, break_on_hyphens=False)]
    rect = f'<rect class="{kind}" x="{x:g}" y="{y:g}" width="{width:g}" height="{height:g}" rx="5"/>'
    return [rect, *(_text(x + 8, y + 18 + LINE * i, line, style) for i, (line, style) in enumerate(lines))]


def _arrow(x: float, y: float, to_x: float, to_y: float) -> list[str]:
    """From one point to another, to the right, to the left or down."""
    if x == to_x:
        tip = f"M{to_x - 4:g} {to_y - 6:g}l4 6l4 -6z"
    else:
        back = 6 if to_x < x else -6
        tip = f"M{to_x + back:g} {to_y - 4:g}l{-back} 4l{back} 4z"
    return [f'<path d="M{x:g} {y:g}L{to_x:g} {to_y:g}"/>', f'<path class="tip" d="{tip}"/>']


def main() -> None:
    """Write both."""
    for name, draw in (("feedback", feedback), ("irl", irl)):
        (FIGURES / f"{name}.svg").write_text(draw())


if __name__ == "__main__":
    main()
