"""Sections of the page: figures under a heading, or the sentence that says why there are none."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from irl_gym.reports.page.panels import Panel


@dataclass(frozen=True, eq=False)
class Section:
    """A part of the page."""

    name: str
    """Of its anchor."""
    title: str
    lead: str
    """What is to be seen, or why there is nothing."""
    panels: Sequence[Panel] = ()
    kind: str = "figures"
    """Which part of the template shows it."""
    shown: Mapping[str, Any] = field(default_factory=dict)
    """More for the template."""
    script: Mapping[str, Any] = field(default_factory=dict)
    """What the page's scripts move, by the name that they know it by."""


def specs(sections: Sequence[Section]) -> dict[str, Any]:
    """The figures of all sections by name, as the page's script takes them."""
    return {panel.name: panel.spec() for section in sections for panel in section.panels}
