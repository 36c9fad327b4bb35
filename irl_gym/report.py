"""A run in a few tables a person reads, for the terminal."""

import math
import shlex
from collections.abc import Iterator, Mapping
from typing import Any

from rich.console import Console, RenderableType
from rich.table import Table
from rich.text import Text

from irl_gym.claims import ENVIRONMENT
from irl_gym.confirmation import loss_told
from irl_gym.diagnoses.findings import told_answer
from irl_gym.endings import LOST
from irl_gym.estimated import errors_told
from irl_gym.intervals import as_interval
from irl_gym.optimality import AT_STAKE
from irl_gym.pipeline import Report
from irl_gym.run_folder import read_json
from irl_gym.run_schema import Diagnosed, Environment
from irl_gym.scores import score_of
from irl_gym.shares import MUCH, judged
from irl_gym.told_rewards import told_of_reward

ABOUT_THE_GIVEN = ("blind-expert", "dropped-actions")
"""Findings that say that what was given is not what it seems: they are told at once."""
ANSWERS = {"healthy": "green", "findings": "yellow", "not examined": "yellow"}
"""Of what the doctor says."""
COLOURS = {"good": "green", "open": "yellow", "bad": "red", "plain": ""}
"""Of a score and a mean return, by how both are judged."""


def print_report(report: Report, console: Console) -> None:
    """Print what a run found; brackets and colons in names are no markup."""
    for part in [*render(report)]:
        console.print(part, markup=False, emoji=False)


def render(report: Report) -> Iterator[RenderableType]:
    """The parts of the report, in reading order."""
    yield _asked(report)
    yield _policies(report)
    yield from _lost(report)
    yield _reward(report)
    yield _stages(report)
    yield f"Kept in {report.out}: dataset, reward, certificate, agent, metrics, figures and films."
    lost = report.stages.get("demonstrations", {}).get("no_environment")
    if lost:
        yield Text(lost)
    yield from _doctor(report)
    yield f"Open {report.page} in a browser."


def _doctor(report: Report) -> Iterator[RenderableType]:
    """The doctor's answer, and what of it is about the expert that was given."""
    diagnosis = read_json(report.out / "diagnosis.json", Diagnosed)
    for one in diagnosis["findings"]:
        if one["name"] in ABOUT_THE_GIVEN:
            yield Text(f"Warning: {one['sentence']} {one['mend']}", "yellow")
    more = f" python scripts/doctor.py --run {shlex.quote(str(report.out))}" if diagnosis["findings"] else ""
    yield Text(f"The doctor: {told_answer(diagnosis)}{more}", ANSWERS[diagnosis["answer"]])


def _asked(report: Report) -> str:
    """Where and with which discount it was done, and what the environment was made to do."""
    config = report.config
    made = ", ".join(f"{name}={value}" for name, value in config["env_kwargs"].items())
    where = config["env_id"] or f"{_recorded_in(report)}the environment of {config['dataset']}"
    told = [f"{where} ({made})" if made else where, f"gamma {config['gamma']:g}", f"seed {config['seed']}"]
    if config["start_seeds"]:
        told.append(f"layouts from the seeds {', '.join(map(str, config['start_seeds']))}")
    if report.shown:
        hidden = ", ".join(f"{name} ({n} values)" for name, n in report.shown.items())
        told.append(f"shown beside the observation, since the environment hides it: {hidden}")
    return "; ".join(told) + "."


def _lost(report: Report) -> Iterator[RenderableType]:
    """What the dataset lacks, or what of it was not taken; nothing where that is nothing."""
    told = report.metrics["demonstrations"]
    lost = [f"{told[key]:,} {words}" for key, words in LOST.items() if told.get(key)]
    if lost:
        yield f"Of the {told['episodes']:,} episodes learned from: {'; '.join(lost)}."


def _recorded_in(report: Report) -> str:
    """The id of the environment that a dataset brought with it, where it has one."""
    kept = report.out / ENVIRONMENT
    found = read_json(kept, Environment)["id"] if kept.exists() else None
    return f"{found}, " if found else ""


def _policies(report: Report) -> Table:
    table = Table(title="Under the true reward", title_justify="left", title_style="bold")
    table.add_column("policy")
    headings = {"value": "value", "score": "score", "mean_return": "mean return (95 %)"}
    known = any(row["agreement"] is not None for row in report.metrics["policies"].values())
    found = judged(report.metrics["policies"], report.metrics["table"])
    confirmed = any("sampled_value" in row for row in report.metrics["policies"].values())
    more = (("value by episodes (95 %)",) if confirmed else ()) + (("agreement",) if known else ())
    for heading in (*headings.values(), *more):
        table.add_column(heading, justify="right")
    for name, row in report.metrics["policies"].items():
        score = "-" if row["score"] is None else score_of(row["score"])
        interval = str(as_interval(row["mean_return"], row["return_low"], row["return_high"]))
        agreement = ["-" if row["agreement"] is None else f"{row['agreement']:.1%}"] if known else []
        by_episodes = [_by_episodes(row)] if confirmed else []
        whose = f"{name}, {_shown(report)}" if name == "expert" and report.metrics["demonstrations"]["given"] else name
        style = COLOURS[found.mood] if name == "retrained" else ""
        table.add_row(whose, f"{row['value']:.4f}", Text(score, style), Text(interval, style), *by_episodes, *agreement)
    given, only = (report.metrics["demonstrations"][key] for key in ("given", "episodes_only"))
    errs = " with its errors" if only and not given else ""
    table.caption = f"value: {_how_valued(report)}. score: random = 0, expert{errs} = 1. mean return: undiscounted, sampled."
    if report.metrics["policies"]["expert"]["score"] is None:
        reason = report.metrics.get("score_reason") or "the expert earns no more than random actions"
        table.caption += f" There is no score: {reason}."
    if known:
        table.caption += f" agreement: share of states with {OPTIMAL if only else OWN}."
    if confirmed:
        told = loss_told(report.metrics["policies"]["retrained"])
        table.caption += f" value by episodes: the same, by episodes that were not counted.{told}"
    if report.metrics["table"] is not None:
        table.caption += f"\ntable: {_table(report.metrics['table'])}"
    table.caption += f"\njudged: {found.told}"
    table.caption = Text(table.caption + _of_training(report), "table.caption")
    table.caption_justify = "left"
    return table


def _by_episodes(row: Mapping[str, Any]) -> str:
    """The value that fresh episodes say a policy has."""
    if "sampled_value" not in row:
        return "-"
    return str(as_interval(row["sampled_value"], row["sampled_low"], row["sampled_high"]))


def _shown(report: Report) -> str:
    """How many episodes were given."""
    count = report.metrics["demonstrations"]["episodes"]
    return "1 episode" if count == 1 else f"{count:,} episodes"


def _of_training(report: Report) -> str:
    """Where every policy that is best under the reward is good, and the agent is not, what to do."""
    table, share = report.metrics["table"], report.metrics["reward"].get("worst_tie_regret_share")
    if judged(report.metrics["policies"], table).mood != "bad" or share is None or share > MUCH or not table["exact"]:
        return ""
    least = math.floor(1000 * (1 - share)) / 1000
    told = f"Every policy that is best under the reward has a score of at least {least:.3f}"
    return f"\n{told}: try more --total-timesteps, or --retrain value-iteration."


OPTIMAL, OWN = "an optimal action", "one of the expert's actions, or an optimal one where it is optimal"


def _table(table: Mapping[str, Any]) -> str:
    """How big the table is, where it is from, and how far off it can be."""
    errors = "; ".join(f"{name} {told}" for name, told in errors_told(table).items())
    told = [table["method"], *([f"{errors[0].upper()}{errors[1:]}."] if errors else [])]
    if not table["exact"]:
        kept = (("Hidden state", "hidden_state"), ("Checked against the environment:", "checked"))
        told += [f"{what} {table[key]}." for what, key in kept if table.get(key)]
    return f"{table['reachable']:,} reachable states, {table['actions']} actions. {' '.join(told)}"


def _how_valued(report: Report) -> str:
    """Where the values come from, in a few words."""
    table = report.metrics["table"]
    if table is None:
        return "discounted, from the start, mean of episodes"
    cut = f", cut after {table['horizon']} steps" if table["horizon"] is not None else ""
    from_data = report.metrics["demonstrations"]["given"]
    given = f"{cut}, the expert's that of its episodes, paid by the table" if from_data else cut
    where = "exact" if table["exact"] else "computed on a table that is an estimate"
    return f"{where}, discounted, from the start{given}"


def _reward(report: Report) -> Table:
    reward = report.metrics["reward"]
    table = Table(title="The recovered reward", title_justify="left", title_style="bold", show_header=False)
    table.add_column("what")
    table.add_column("is")
    for what, told in told_of_reward(reward, report.metrics):
        table.add_row(what, Text(told))
    tie = "worst-tie regret: what the worst policy greedy under the reward loses against the expert. "
    told = (tie if "worst_tie_regret" in reward else "", f"{AT_STAKE} " if reward.get("loss_share") is not None else "")
    table.caption = "".join(told) + _CAPTIONS.get(reward["learner"], "")
    table.caption_justify = "left"
    return table


_CAPTIONS = {
    "FiniteLP": "lambda: price of ||R||_1; above lambda_0 R is 0. margin: how much better the expert's action is than another.",
    "FeatureLP": "sample: the states that the program compares actions in. rank: directions of alpha they say anything about.",
    "TrajectoryLP": (
        "distance: ||V expert - V policy||_1 in the features, of the policy planned in the best round; no reward with "
        "|alpha_i| <= 1 tells the two apart by more on these trajectories."
    ),
}


def _stages(report: Report) -> Table:
    scored = report.metrics["policies"]["expert"]["score"] is not None
    crossing = report.metrics["training"].get("steps_to_0.99")
    table = Table(title="Stages", title_justify="left", title_style="bold")
    table.add_column("stage")
    table.add_column("seconds", justify="right")
    table.add_column("environment steps", justify="right")
    for name, record in report.stages.items():
        taken = record.get("environment_steps", 0)
        steps = f"{taken:,}" if taken else ""
        if name == "agent" and taken and scored:
            steps += " (did not stay at score 0.99)" if crossing is None else f" (score 0.99 or more after {crossing:,})"
        table.add_row(name, f"{record['seconds']:.1f}{' (kept)' if record.get('kept') else ''}", steps)
    return table
