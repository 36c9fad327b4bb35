"""report.html: everything a run found, as one page that opens from disk.

The order is a reader's: the verdict, the table of policies, rewards, values and policies side by side, the lambda slider, the
feasible widths, the learning curve, episodes; then what proves it, what the doctor says, and how to run it again.
"""

import os
from collections.abc import Mapping
from typing import Any

from irl_gym.page import compared, episodes, slider, training
from irl_gym.page.asked import asked, reproduce
from irl_gym.page.document import write_page
from irl_gym.page.proof import certificate, doctor, table_facts, verdict
from irl_gym.page.scene import Scene
from irl_gym.page.sections import Section, specs
from irl_gym.runs import Run
from irl_gym.scores import score_of
from irl_gym.written import interval, number, percent, seconds

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
    scene = Scene.of(run)
    of_states, path_data = ([], None) if scene is None else _of_states(scene)
    episode_section, episode_data = episodes.episodes(run, scene)
    sections = [
        policies_table(run),
        compared.rewards(run, scene),
        *of_states,
        training.learning(run),
        episode_section,
        certificate(run),
        doctor(run),
        table_facts(run),
        stages(run),
        asked(run),
        reproduce(run),
    ]
    context = {"title": page_title(run), "facts": facts(run), "verdict": verdict(run), "sections": sections}
    data = {"figures": specs(sections), "slider": path_data, "episodes": episode_data}
    write_page(path, "report.html", context, data, SCRIPTS)


def _of_states(scene: Scene) -> tuple[list[Section], dict[str, Any] | None]:
    """What is known state by state, and what the slider shows."""
    path, data = slider.lambda_slider(scene)
    return [compared.values(scene), compared.policies(scene), path, training.widths(scene)], data


def stages(run: Run) -> Section:
    """How long each stage took. Of these the page of the same run differs from machine to machine, and of nothing else."""
    rows = []
    for name, record in run.stages.items():
        if name == "report":  # it is being written
            continue
        steps = record.get("environment_steps", 0)
        rows.append((name, seconds(record.get("seconds")), f"{steps:,}" if steps else ""))
    return Section("stages", "Stages", STAGES_LEAD, (), "stages", {"rows": rows})


def page_title(run: Run) -> str:
    """The environment."""
    return str(run.env_id or run.config.get("env_id") or run.config.get("dataset"))


def facts(run: Run) -> list[tuple[str, str]]:
    """What stands below the title."""
    config = run.config
    told = [
        ("learner", str((config.get("learner") or {}).get("type", "not known"))),
        ("gamma", number(config.get("gamma"))),
        ("seed", str(config.get("seed"))),
    ]
    if config.get("env_kwargs"):
        told.insert(0, ("environment", ", ".join(f"{key}={value}" for key, value in config["env_kwargs"].items())))
    if config.get("dataset"):
        told.append(("dataset", str(config["dataset"])))
    if run.version.get("irl_gym"):
        told.append(("irl_gym", str(run.version["irl_gym"])))
    if run.caution is not None:
        told.append(("files", run.caution))
    told.append(("on this page", run.whose))
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
