"""A run in a few tables a person reads, for the terminal."""

import shlex
from collections.abc import Iterator, Mapping
from pathlib import Path
from textwrap import wrap
from typing import Any

from rich.console import Console, RenderableType
from rich.table import Table
from rich.text import Text

from irl_gym.demonstrations.endings import LOST
from irl_gym.facts import Fact, counted, harmless
from irl_gym.files.run_folder import read_json
from irl_gym.files.run_schema import Diagnosed, EnvironmentFile
from irl_gym.judging import measures
from irl_gym.judging.copied import copied_told
from irl_gym.judging.diagnoses.findings import told_answer
from irl_gym.judging.estimated import errors_told
from irl_gym.judging.measures import explained, no_score, shown
from irl_gym.judging.scores import EXPERT, RETRAINED, others
from irl_gym.judging.shares import judged, judgements, training_fell_short
from irl_gym.runs.certificates import facts_in
from irl_gym.runs.identity import ENVIRONMENT
from irl_gym.runs.scorecard import resumed_told
from irl_gym.runs.summary import Report

ABOUT_THE_GIVEN = ("blind-expert", "dropped-actions")
"""Findings that say that what was given is not what it seems: they are told at once."""
ANSWERS = {"healthy": "green", "findings": "yellow", "not examined": "yellow"}
"""Of what the doctor says."""
COLOURS = {"good": "green", "open": "yellow", "bad": "red", "plain": ""}
"""Of the numbers of a policy, by how its score and mean return are judged."""


def print_report(report: Report, console: Console) -> None:
    """Print what a run found; brackets and colons in names are no markup."""
    for part in [*render(report)]:
        console.print(part, markup=False, emoji=False)


def render(report: Report) -> Iterator[RenderableType]:
    """The parts of the report, in reading order: a terminal shows the last ones, which are the verdict and what next."""
    out, metrics = report.out, report.metrics
    yield _asked(report.config, report.shown, out)
    yield _stages(report.stages, metrics)
    yield _reward(report.certificate, metrics)
    yield _policies(metrics)
    yield from _lost(metrics["demonstrations"])
    made = (
        "reward, certificate, agent, metrics, figures" if RETRAINED in metrics["policies"] else "certificate, policy, metrics"
    )
    own = "" if report.config.get("dataset") is not None else "dataset, "
    yield f"Kept in {out}: {own}{made} and films."
    if report.whose is not None:
        yield Text(harmless(report.whose))
    lost = report.stages.get("demonstrations", {}).get("no_environment")
    if lost:
        yield Text(harmless(lost))
    yield _verdict(metrics["policies"], metrics)
    if copied := copied_told(metrics, report.config.get("eval_episodes", 0)):
        yield Text(harmless(copied))
    yield from _doctor(out, kept=bool(report.stages.get("ambiguity", {}).get("kept")))
    yield f"Open {report.page} in a browser."


def _doctor(out: Path, *, kept: bool) -> Iterator[RenderableType]:
    """The doctor's answer, and what of it is about the expert that was given; of a run that is kept it is the record."""
    diagnosis = read_json(out / "diagnosis.json", Diagnosed)
    for one in diagnosis["findings"]:
        if one["name"] in ABOUT_THE_GIVEN:
            yield Text(harmless(f"Warning: {one['sentence']} {one['mend']}"), "yellow")
    more = (
        f" This command tells them, with mends: irl-gym doctor --run {shlex.quote(str(out))}" if diagnosis["findings"] else ""
    )
    who = "The doctor, as recorded when the run was made:" if kept else "The doctor:"
    yield Text(harmless(f"{who} {told_answer(diagnosis)}{more}"), ANSWERS[diagnosis["answer"]])


def _asked(config: Mapping[str, Any], hidden: Mapping[str, int], out: Path) -> str:
    """Where and with which discount it was done, and what the environment was made to do."""
    made = ", ".join(f"{name}={value}" for name, value in config["env_kwargs"].items())
    where = config["env_id"] or f"{_recorded_in(out)}the environment of {config['dataset']}"
    told = [f"{where} ({made})" if made else where, f"gamma {config['gamma']}", f"seed {config['seed']}"]
    if config["start_seeds"]:
        told.append(f"layouts from the seeds {', '.join(map(str, config['start_seeds']))}")
    if hidden:
        names = ", ".join(f"{name} ({counted(n, 'value')})" for name, n in hidden.items())
        told.append(f"shown beside the observation, since the environment hides it: {names}")
    return "; ".join(told) + "."


def _lost(told: Mapping[str, Any]) -> Iterator[RenderableType]:
    """What the dataset lacks, or what of it was not taken; nothing where that is nothing."""
    lost = [f"{counted(told[key], noun)} {what}" for key, (noun, what) in LOST.items() if told.get(key)]
    if lost:
        yield f"Of the {counted(told['episodes'], 'episode')} learned from: {'; '.join(lost)}."


def _recorded_in(out: Path) -> str:
    """The id of the environment that a dataset brought with it, where it has one."""
    kept = out / ENVIRONMENT
    found = read_json(kept, EnvironmentFile)["id"] if kept.exists() else None
    return f"{harmless(found)}, " if found else ""


def _policies(metrics: Mapping[str, Any]) -> Table:
    rows, on_table = metrics["policies"], metrics["table"]
    columns = shown(measures.POLICIES, list(rows.values()))
    table = Table(title="Under the true reward", title_justify="left", title_style="bold")
    table.add_column("policy")
    for one in columns:
        words = wrap(one.heading, 1, break_long_words=False)
        table.add_column(one.heading, justify="right", min_width=max(map(len, words)))  # no word is cut
    for name, row in rows.items():
        style = COLOURS[judged(rows, on_table, name).mood] if name in others(rows) else ""
        table.add_row(Text(name), *(Text(one.text(row), style) for one in columns))
    told = [f"{name}: {row.get('how', 'not recorded in this version')}." for name, row in rows.items()]
    told += explained(columns, metrics)
    if rows[EXPERT]["score"] is None:
        told.append(f"There is no score: {no_score(metrics)}.")
    lines = [" ".join(told), *([f"table: {_table(on_table)}"] if on_table is not None else [])]
    table.caption = Text("\n".join(lines), "table.caption")
    table.caption_justify = "left"
    return table


def _verdict(rows: Mapping[str, Any], metrics: Mapping[str, Any]) -> Text:
    """Does the agent do as well as the expert?"""
    on_table = metrics["table"]
    return Text(f"judged: {judgements(rows, on_table)}{_of_training(metrics)}", COLOURS[judged(rows, on_table).mood])


def _of_training(metrics: Mapping[str, Any]) -> str:
    """Where every policy that is best under the reward is good, and the agent is not, what to do."""
    share = metrics["reward"].get("worst_tie_regret_share")
    told = training_fell_short(metrics["policies"], metrics["table"], share)
    return "" if told is None else f"\n{told}: try more --total-timesteps, or --retrain value-iteration."


def _table(table: Mapping[str, Any]) -> str:
    """How big the table is, where it is from, and how far off it can be."""
    errors = "; ".join(f"{name} {told}" for name, told in errors_told(table).items())
    told = [table["method"], *([f"{errors[0].upper()}{errors[1:]}."] if errors else [])]
    if not table["exact"]:
        kept = (("Hidden state", "hidden_state"), ("Checked against the environment:", "checked"))
        told += [f"{what} {table[key]}." for what, key in kept if table.get(key)]
    return f"{counted(table['reachable'], 'reachable state')}, {counted(table['actions'], 'action')}. {' '.join(told)}"


def _reward(certificate: Mapping[str, Any], metrics: Mapping[str, Any]) -> Table:
    """What the reward says of the expert, what is measured of it, and what its learner proves."""
    title = "The recovered reward" if RETRAINED in metrics["policies"] else "What was learned"
    table = Table(title=title, title_justify="left", title_style="bold", show_header=False)
    table.add_column("what")
    table.add_column("is")
    of_reward, of_program = facts_in(certificate)
    lines = shown(measures.REWARDS, [metrics["reward"]])
    measured = [Fact(one.heading, one.text(metrics["reward"])) for one in lines]
    for one in (*of_reward, *measured):
        table.add_row(Text(one.label), Text(one.sentence, COLOURS[one.mood]))
    table.add_section()
    table.add_row("of its learner", "what it says itself, as the run recorded it")
    for one in of_program:
        table.add_row(Text(one.label), Text(one.sentence, COLOURS[one.mood]))
    table.caption = " ".join(explained(lines, metrics))
    table.caption_justify = "left"
    return table


def _stages(stages: Mapping[str, Mapping[str, Any]], metrics: Mapping[str, Any]) -> Table:
    scored = metrics["policies"][EXPERT]["score"] is not None
    crossing = metrics["training"].get("steps_to_0.99")
    table = Table(title="Stages", title_justify="left", title_style="bold")
    table.add_column("stage")
    table.add_column("seconds", justify="right")
    table.add_column("environment steps", justify="right")
    for name, record in stages.items():
        taken = record.get("environment_steps", 0)
        steps = f"{taken:,}" if taken else ""
        if name == "agent" and taken and scored:
            steps += " (did not stay at score 0.99)" if crossing is None else f" (score 0.99 or more after {crossing:,})"
        resumed = resumed_told(record)
        steps += f" ({resumed})" if resumed else ""
        table.add_row(name, f"{record['seconds']:.1f}{' (kept)' if record.get('kept') else ''}", steps)
    return table
