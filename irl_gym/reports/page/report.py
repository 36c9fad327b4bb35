"""report.html: everything a run found, as one page that opens from disk.

The order is a reader's: three answers with what to do next, the table of policies, rewards, values and policies side by side,
the learning curve, episodes; then how far the reward is from the true one, the lambda slider and the feasible widths; then what
proves it, what the doctor says, and how to run it again.
"""

import os
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from irl_gym.reports.page.contents import RunContents
from irl_gym.reports.page.document import write_page
from irl_gym.reports.page.sections import compared, episodes, slider, training
from irl_gym.reports.page.sections.absent import absent
from irl_gym.reports.page.sections.asked import asked, reproduce
from irl_gym.reports.page.sections.judged import distances, policies_table
from irl_gym.reports.page.sections.next_step import next_step
from irl_gym.reports.page.sections.proof import doctor, proved, table_facts
from irl_gym.reports.page.sections.section import Section, specs
from irl_gym.reports.page.sections.verdict import verdict
from irl_gym.runs.run import Run
from irl_gym.runs.supply import missing, supplied
from irl_gym.written import seconds

SCRIPTS = ("theme.js", "figures.js", "enlarge.js", "slider.js", "episodes.js")
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
    contents = RunContents(run)
    sections = list(sections_of(contents, run))
    context = {
        "title": page_title(run.env_id, run.config),
        "facts": supplied(facts, run),
        "verdict": supplied(verdict, contents, run),
        "next": supplied(next_step, contents, run),
        "sections": sections,
    }
    data: dict[str, Any] = {"figures": specs(sections), "slider": None, "episodes": {}}
    for section in sections:
        data |= section.script
    write_page(path, "report.html", context, data, SCRIPTS)


def sections_of(*sources: Any) -> Iterator[Section]:
    """The sections of a page, or in place of one why it is absent.

    Args:
        sources: who supplies what they need, such as a run's contents and the run.
    """
    for show in SECTIONS:
        need = missing(show, *sources)
        section = supplied(show, *sources) if need is None else supplied(absent, *sources, need=need)
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


def facts(config: Mapping[str, Any], version: Mapping[str, Any], caution: str | None) -> list[tuple[str, str]]:
    """What stands below the title."""
    told = [
        ("learner", str((config.get("learner") or {}).get("type", "not known"))),
        ("gamma", str(config.get("gamma"))),  # in full: 1 - 1e-12 is not 1
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
    return told


SECTIONS: tuple[Callable[..., Section | None], ...] = (
    policies_table,
    compared.rewards,
    compared.values,
    compared.policies,
    training.learning,
    episodes.episodes,
    distances,
    slider.lambda_slider,
    training.widths,
    proved,
    doctor,
    table_facts,
    stages_table,
    asked,
    reproduce,
)
"""In order: each is shown where what it needs is there (`RunContents`, then the run's own fields)."""
