"""The tables of all that was judged: every policy under the true reward, and how far the learned reward is from it."""

from collections.abc import Mapping
from typing import Any

from irl_gym.judging import measures
from irl_gym.judging.measures import explained, shown
from irl_gym.judging.scores import called
from irl_gym.judging.shares import judgements
from irl_gym.reports.page.sections.section import Section
from irl_gym.written import sentence_of

DISTANCES_LEAD = (
    "Many rewards make the same actions best, so the learned reward need not look like the true one. Two questions are asked "
    "of it. What may an agent lose that finds the best actions under it, but happens to choose the worst among those that tie? "
    "And do the two rewards rank all other policies alike, bad ones too? That is what the distances measure; an agent that "
    "acts as the expert does needs the first alone."
)


def policies_table(metrics: Mapping[str, Any]) -> Section:
    """Every policy that was judged, with how it came about."""
    rows = metrics["policies"]
    columns = shown(measures.POLICIES, list(rows.values()))
    table = {
        "headings": ["policy", *(one.heading for one in columns)],
        "rows": [(f"{called(name)}, {how(row)}", *(one.text(row) for one in columns)) for name, row in rows.items()],
        "lines": [],
        "note": " ".join(map(sentence_of, explained(columns, metrics)))
        + f" How score and mean return are coloured: {judgements(rows, metrics.get('table'))}",
    }
    lead = "What each policy is worth in the environment as it is."
    return Section("summary", "Under the true reward", lead, (), "summary", table)


def distances(metrics: Mapping[str, Any]) -> Section | None:
    """How far the learned reward is from the true one; None where nothing of it was measured."""
    reward = metrics["reward"]
    measured = shown(measures.REWARDS, [reward])
    if not measured:
        return None
    told = {
        "rows": [],
        "lines": [(one.heading, one.text(reward)) for one in measured],
        "note": " ".join(map(sentence_of, explained(measured, metrics))),
    }
    return Section("distances", "How far from the true reward", DISTANCES_LEAD, (), "summary", told)


def how(row: Mapping[str, Any]) -> str:
    """How a policy came about, by its row of metrics.json."""
    return str(row.get("how", "not recorded in this version"))


def answer(optimal: bool | None) -> str:
    """Yes, no or undecided."""
    return "undecided" if optimal is None else "yes" if optimal else "no"
