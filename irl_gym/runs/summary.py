"""What a run found, in one record: what `recover_and_retrain` returns. And what a notebook shows of a run, in plain HTML."""

import html
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from irl_gym.facts import one_line
from irl_gym.judging import measures
from irl_gym.judging.measures import shown
from irl_gym.judging.scores import called
from irl_gym.judging.shares import WELL, as_well, judged
from irl_gym.records import Record, short

PAGE = "report.html"
MOST, LONG = 12, 600
"""Policies, and characters of one text, that a notebook shows."""


@dataclass(frozen=True, eq=False)
class Report(Record):
    """What a run found, as it stands in the run's folder."""

    out: Path
    """The folder."""
    metrics: Mapping[str, Any]
    """The content of metrics.json: policies, score_reason (None where there is a score), expert_value (its 95 % interval),
    reward, training, demonstrations, and table, None where there is none."""
    certificate: Mapping[str, Any]
    """The content of certificate.json."""
    stages: Mapping[str, Mapping[str, Any]]
    """The record of each stage: wall seconds in the run that finished it, environment steps, what the solver did."""
    config: Mapping[str, Any]
    """The content of config.json: the experiment."""
    shown: Mapping[str, int]
    """Hidden integers that the observation was made to show, with their numbers of values."""
    whose: str | None = None
    """Of a run that was finished before, what was computed again of it, and that all else is its record (`Run.whose`)."""

    @property
    def page(self) -> Path:
        """The page that shows it all."""
        return self.out / PAGE

    def _repr_html_(self) -> str:
        return in_html(self.out, self.config.get("env_id"), self.config, self.metrics, self.whose)


def in_html(folder: Path, env_id: str | None, config: Mapping[str, Any], metrics: Mapping[str, Any], whose: str | None) -> str:
    """What a notebook shows of a run: where it was, does the agent do as well as the expert, every policy, and where it lies.

    Plain tags around escaped text, which nothing typesets: a stranger's run may say anything.

    Args:
        folder: the run's.
        env_id: the environment's id, where it has one.
        config: the content of config.json.
        metrics: that of metrics.json.
        whose: whose word it is; None of a run that was just made.
    """
    rows = metrics["policies"]
    found = judged(rows, metrics.get("table"))
    columns = shown(measures.POLICIES, list(rows.values()))
    where = env_id or f"The environment of {config.get('dataset')}"
    made = f" {short(config['env_kwargs'])}" if config["env_kwargs"] else ""
    asked = f"{where}{made}, {metrics['reward']['learner']}, gamma {config['gamma']}, seed {config['seed']}."
    told = [_row("th", ("policy", *(one.heading for one in columns)))]
    told += [_row("td", (called(name), *(one.text(row) for one in columns))) for name, row in list(rows.items())[:MOST]]
    left = [f"{len(rows) - MOST} more policies are in metrics.json."] if len(rows) > MOST else []
    page = folder / PAGE
    kept = f"The whole report: {page}" if page.exists() else f"Kept in {folder}"
    lines = [_safe(one_line(asked)), f"{_safe(as_well(rows))} <b>{_safe(WELL[found.mood])}</b>"]
    more = map(_safe, [*left, f"Judged: {found.told}", *([] if whose is None else [whose]), one_line(kept)])
    top, bottom = ("".join(f"<p>{one}</p>" for one in part) for part in (lines, more))
    return f'<div class="tex2jax_ignore mathjax_ignore">{top}<table>{"".join(told)}</table>{bottom}</div>'


def _row(tag: str, cells: Iterable[str]) -> str:
    return f"<tr>{''.join(f'<{tag}>{_safe(one)}</{tag}>' for one in cells)}</tr>"


def _safe(text: str) -> str:
    return html.escape(text if len(text) <= LONG else f"{text[:LONG]}...")
