"""report.html: everything a run found, as one page that opens from disk.

The order is a reader's: the verdict, the table of policies, rewards, values and policies side by side, the lambda slider, the
feasible widths, the learning curve, episodes; then what proves it, what the doctor says, and how to run it again.
"""

import os
from typing import Any

from irl_gym.page import compared, episodes, slider, training
from irl_gym.page.asked import asked, reproduce
from irl_gym.page.document import write_page
from irl_gym.page.proof import certificate, doctor, table_facts
from irl_gym.page.scene import Scene
from irl_gym.page.sections import Section, specs
from irl_gym.page.verdict import policies_table, verdict
from irl_gym.runs import Run
from irl_gym.written import number, seconds

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
        policies_table(run.metrics),
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
    context = {
        "title": page_title(run),
        "facts": facts(run),
        "verdict": verdict(run.metrics, recomputed=run.recomputed),
        "sections": sections,
    }
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
