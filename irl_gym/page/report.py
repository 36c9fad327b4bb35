"""report.html: everything a run found, as one page that opens from disk.

The order is a reader's: the verdict, the table of policies, rewards, values and policies side by side, the lambda slider, the
feasible widths, the learning curve, episodes; then what proves it, what the doctor says, and how to run it again.
"""

import os
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from irl_gym.needs import missing, supplied
from irl_gym.page import compared, episodes, slider, training
from irl_gym.page.absent import absent
from irl_gym.page.asked import asked, reproduce
from irl_gym.page.contents import Contents
from irl_gym.page.document import write_page
from irl_gym.page.proof import certificate, doctor, table_facts, verdict
from irl_gym.page.sections import Section, specs
from irl_gym.page.written import interval, number, percent, seconds
from irl_gym.runs import Run
from irl_gym.scores import score_of

SCRIPTS = ("theme.js", "figures.js", "slider.js", "episodes.js")
STAGES_LEAD = (
    "What was done once there was a table, and how long it took. The table is made first and this page is written last: "
    "neither is timed here."
)


def write_report(run: Run, path: str | os.PathLike) -> None:
    """Write a run's page beside, then rename. The same run makes the same bytes.

    Args:
        run: what a run left.
        path: of the file.
    """
    sections = list(sections_of(run))
    told = supplied(facts, run)
    context = {"title": page_title(run.env_id, run.config), "facts": told, "verdict": verdict(run), "sections": sections}
    data: dict[str, Any] = {"figures": specs(sections), "slider": None, "episodes": {}}
    for section in sections:
        data |= section.script
    write_page(path, "report.html", context, data, SCRIPTS)


def sections_of(run: Run) -> Iterator[Section]:
    """The sections of a run's page, or in place of one why it is absent."""
    contents = Contents(run)
    for show in SECTIONS:
        need = missing(show, contents, run)
        section = supplied(show, contents, run) if need is None else absent(need, run.stages)
        if section is not None:
            yield section


def stages_table(stages: Mapping[str, Mapping[str, Any]]) -> Section:
    """How long each stage took. Of these the page of the same run differs from machine to machine, and of nothing else."""
    rows = []
    for name, record in stages.items():
        if name == "report":  # it is being written
            continue
        steps = record.get("environment_steps", 0)
        rows.append((name, seconds(record.get("seconds")), f"{steps:,}" if steps else ""))
    return Section("stages", "Stages", STAGES_LEAD, (), "stages", {"rows": rows})


def page_title(env_id: str | None, config: Mapping[str, Any]) -> str:
    """The environment."""
    return str(env_id or config.get("env_id") or config.get("dataset"))


def facts(config: Mapping[str, Any], version: Mapping[str, Any], caution: str | None, whose: str) -> list[tuple[str, str]]:
    """What stands below the title."""
    told = [
        ("learner", str((config.get("learner") or {}).get("type", "not known"))),
        ("gamma", number(config.get("gamma"))),
        ("seed", str(config.get("seed"))),
    ]
    if config.get("env_kwargs"):
        told.insert(0, ("environment", ", ".join(f"{key}={value}" for key, value in config["env_kwargs"].items())))
    if config.get("dataset"):
        told.append(("dataset", str(config["dataset"])))
    if version.get("irl_gym"):
        told.append(("irl_gym", str(version["irl_gym"])))
    if caution is not None:
        told.append(("files", caution))
    told.append(("on this page", whose))
    return told


def policies_table(run: Run) -> Section:
    """Expert, random and retrained policy under the true reward."""
    rows = [policy_row(name, row) for name, row in run.metrics["policies"].items()]
    known = any(row["agreement"] is not None for row in run.metrics["policies"].values())
    where = (
        "the mean of episodes" if run.table is None else "exact" if _exact(run) else "computed on a table that is an estimate"
    )
    note = (
        f"Value: discounted, from the start, {where}. Score: random actions are 0, the expert is 1. Mean return: undiscounted, "
        "sampled, with a 95 % interval."
    )
    confirmed = any(row["by_episodes"] for row in rows)
    if confirmed:
        note += " Value by episodes: the same, by episodes that were not counted, with a 95 % interval."
    told = run.metrics.get("expert_value") or {}
    if told.get("episodes"):
        note += f" The expert's value is the mean of its {told['episodes']:,} episodes."
    if known:
        note += " Agreement: share of states with one of the expert's actions, or an optimal one where it is optimal."
    shown = {"rows": rows, "known": known, "confirmed": confirmed, "note": note}
    return Section(
        "summary", "Under the true reward", "What each policy is worth in the environment as it is.", (), "summary", shown
    )


def _exact(run: Run) -> bool:
    return bool((run.metrics.get("table") or {}).get("exact", True))


def policy_row(name: str, row: Mapping[str, Any]) -> dict[str, str]:
    """A policy's numbers as text."""
    return {
        "name": {"retrained": "retrained agent"}.get(name, name),
        "value": number(row["value"]),
        "score": score_of(row["score"]),
        "returns": interval(row),
        "by_episodes": interval(row, "sampled_value", "sampled_low", "sampled_high") if "sampled_value" in row else "",
        "agreement": "none" if row["agreement"] is None else percent(row["agreement"]),
    }


def _doctor(run: Run, diagnosis: Mapping[str, Any]) -> Section:
    """To be joined: `proof.doctor` shall be a function of the diagnosis, and what it says where there is none go."""
    return doctor(run)


SECTIONS: tuple[Callable[..., Section], ...] = (
    policies_table,  # to be joined: a function of the policies, not of the run
    compared.rewards,
    compared.weights,
    compared.values,
    compared.policies,
    slider.lambda_slider,
    training.widths,
    training.learning,
    episodes.episodes,
    certificate,  # to be joined: a function of the certificate, not of the run
    _doctor,
    table_facts,
    stages_table,
    asked,
    reproduce,
)
"""In order: each is shown where what it needs is there (`Contents`, then the run's own fields)."""
