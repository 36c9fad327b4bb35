"""compare.html: several runs side by side, of one environment or of several.

Runs are called A, B, C, ... in the order they are given. Of the configurations only what differs is listed; learning curves are
in one figure, as scores where the environments differ.
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from irl_gym.diagnoses.findings import told_answer
from irl_gym.errors import InvalidParameter
from irl_gym.page import compared, panels
from irl_gym.page.asked import written
from irl_gym.page.document import write_page
from irl_gym.page.panels import Panel
from irl_gym.page.pooled import over_seeds
from irl_gym.page.proof import ROUNDING, answer, finding
from irl_gym.page.ranked import learning, sentence
from irl_gym.page.report import policy_row
from irl_gym.page.scene import Scene
from irl_gym.page.sections import Section, specs
from irl_gym.page.worlds import one_world, run_places, run_title
from irl_gym.page.written import counted, number, percent, seconds
from irl_gym.pooling import pools
from irl_gym.runs import Run
from irl_gym.shares import judged

SCRIPTS = ("theme.js", "figures.js")
MOST_RUNS = 26
NONE = "not there"
"""In place of an empty cell: the run has no such number."""


def write_comparison(runs: Sequence[Run], path: str | os.PathLike) -> None:
    """Write several runs as one page beside, then rename. The same runs make the same bytes.

    Args:
        runs: at least two, 26 at most.
        path: of the file.

    Raises:
        InvalidParameter: fewer or more runs, or a folder of the file's own name.
    """
    if not 2 <= len(runs) <= MOST_RUNS:
        raise InvalidParameter(f"runs has {len(runs)} of them: expected 2 to {MOST_RUNS} to put side by side.")
    named = lettered(runs)
    context, data = _page(named)
    write_page(path, "compare.html", context, data, SCRIPTS)


def lettered(runs: Sequence[Run]) -> dict[str, Run]:
    """Runs by their letters."""
    return {chr(ord("A") + i): run for i, run in enumerate(runs)}


def _page(named: Mapping[str, Run]) -> tuple[dict[str, Any], dict[str, Any]]:
    """What the template shows, and the scripts."""
    scenes = {letter: Scene.of(run) for letter, run in named.items()}
    places, found = run_places(named), pools(named)
    sections = [
        _results(named),
        over_seeds(found, places, same=one_world(named)),
        learning(named),
        _rewards(named, scenes),
        _policies(scenes),
        _differences(named),
        _proofs(named),
        _doctors(named),
    ]
    kept = [section for section in sections if section is not None]
    facts = [(letter, f"{run_title(run, places[letter])} ({run.path.resolve().name})") for letter, run in named.items()]
    facts += [(letter, run.caution) for letter, run in named.items() if run.caution is not None]
    told = {run.whose: [letter for letter, one in named.items() if one.whose == run.whose] for run in named.values()}
    facts += [(", ".join(letters), whose) for whose, letters in told.items()]
    context = {"title": f"{len(named)} runs side by side", "facts": facts, "sentence": sentence(named, found), "sections": kept}
    return context, {"figures": specs(kept), "slider": None, "episodes": {}}


def _results(named: Mapping[str, Run]) -> Section:
    """One row a number, one column a run."""
    places = run_places(named)
    columns = [dict(_numbers(run, places[letter])) for letter, run in named.items()]
    keys = list(dict.fromkeys(key for column in columns for key in column))
    rows = [[key, *(column.get(key, NONE) for column in columns)] for key in keys]
    return _table("results", "Results", "Every number is under the true reward of its own environment.", named, rows)


def _table(name: str, title: str, lead: str, named: Mapping[str, Run], rows: list[list[str]]) -> Section:
    shown = {"caption": title, "headings": ["", *(f"run {letter}" for letter in named)], "rows": rows}
    return Section(name, title, lead, (), "compare", shown)


def _numbers(run: Run, place: str) -> Iterator[tuple[str, str]]:
    """What the table of results says of a run."""
    policies, reward = run.metrics["policies"], run.metrics["reward"]
    told = {name: policy_row(name, row) for name, row in policies.items()}
    yield "environment", place
    yield "score of the retrained agent", told["retrained"]["score"]
    for name in ("retrained", "expert", "random"):
        yield f"mean return (95 %), {told[name]['name']}", told[name]["returns"]
    yield "judged by the worse of score and mean return", judged(policies, run.metrics.get("table")).brief
    for name in ("retrained", "expert", "random"):
        yield f"value, {told[name]['name']}", told[name]["value"]
    if any(row["agreement"] is not None for row in policies.values()):
        yield "agreement, retrained agent", told["retrained"]["agreement"]
    if reward.get("worst_tie_regret_share") is not None:
        yield "lost by the worst tie", percent(max(reward["worst_tie_regret_share"], 0.0))
    for name, key in compared.DISTANCES.items():
        if reward.get(key) is not None:
            yield f"{name} distance of the learned from the true reward", f"{reward[key]:.2f}"
    whose = "" if run.recomputed else ", as recorded"
    yield "expert optimal under the reward", f"{answer(reward['expert_optimal'])}{whose}"
    if "on_table" in reward:
        yield "expert optimal under it, judged on the table", reward["on_table"]
    if told["retrained"]["score"] is not None:
        steps = run.metrics["training"].get("steps_to_0.99")
        yield "environment steps to a score of 0.99", "not reached" if steps is None else f"{steps:,}"
    spent = [record.get("seconds") or 0.0 for name, record in run.stages.items() if name != "report"]
    yield "time of all stages", seconds(sum(spent))


def _rewards(named: Mapping[str, Run], scenes: Mapping[str, Scene | None]) -> Section:
    """The learned rewards, and once each environment's true one."""
    made: list[Panel] = []
    places = run_places(named)
    for letter, run in named.items():
        scene = scenes[letter]
        if scene is None:
            section = compared.rewards(run, None)
            made += [replace(one, name=f"reward-{letter}", title=f"Run {letter}: weights") for one in section.panels]
        else:
            made.append(compared.reward_panel(f"reward-{letter}", f"Run {letter}: {places[letter]}", scene.learned, scene))
    lead = "What each run recovered. Each has its own scale; compare patterns, not colours."
    return Section("rewards", "Learned rewards", lead, made)


def _policies(scenes: Mapping[str, Scene | None]) -> Section | None:
    """The retrained agents, with what deviates shaded."""
    made: list[Panel] = []
    for letter, scene in scenes.items():
        if scene is None:
            continue
        for panel in compared.policy_panels(scene):
            if panel.name != "policy-expert":
                made.append(replace(panel, name=f"policy-{letter}", title=f"Run {letter}"))
    if not made:
        return None
    return Section("policies", "Retrained agents", "What each agent does; shaded is where it deviates from its expert.", made)


def _differences(named: Mapping[str, Run]) -> Section:
    """What differs between the configurations."""
    flat = [dict(_leaves(run.config)) for run in named.values()]
    keys = _entries(flat)
    rows = [[key, *(_entry(one, key) for one in flat)] for key in keys if not _alike(key, flat)]
    if not rows:
        return Section("differences", "What differs", "The runs have the same configuration.")
    told = (
        f"{counted(len(rows), 'entry differs', 'entries differ')}; the other {len(keys) - len(rows)} are the same in all runs"
    )
    lead = f"Of the configuration {told}."
    return _table("differences", "What differs", lead, named, rows)


def _entries(flat: Sequence[Mapping[str, Any]]) -> list[str]:
    """The names of all entries; one that is empty in one run and has parts in another is told by its parts."""
    keys = list(dict.fromkeys(key for one in flat for key in one))
    empty = {key for one in flat for key, value in one.items() if value in (None, {})}
    return [key for key in keys if key not in empty or not any(other.startswith(f"{key}.") for other in keys)]


def _entry(leaves: Mapping[str, Any], key: str) -> str:
    """A value of a configuration, in words where it is none."""
    if key not in leaves:
        return NONE
    return "none" if leaves[key] in (None, {}, []) else written(leaves[key])


def _alike(key: str, flat: Sequence[Mapping[str, Any]]) -> bool:
    return all(key in one and one[key] == flat[0].get(key) for one in flat)


def _leaves(content: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """The values of nested objects with their dotted names."""
    if not isinstance(content, Mapping) or not content:
        yield prefix, content
        return
    for key, value in content.items():
        yield from _leaves(value, f"{prefix}.{key}" if prefix else str(key))


CERTIFIED = {
    "objective": "objective", "duality_gap": "at most below the best possible", "l1": "lambda", "lambda_0": "lambda_0",
    "margin_cap": "margin cap", "l1_norm": "||R||_1", "least_l1_norm": "least ||R||_1 with these margins",
    "distance": "distance to the expert", "rank": "rank of the rows",
}  # fmt: skip
"""Of a certificate's json, with what it is called."""


def _proofs(named: Mapping[str, Run]) -> Section:
    """The numbers of the certificates."""
    held = [run.certificate for run in named.values()]
    rows = [
        [told, *(_proof(one, key) for one in held)]
        for key, told in CERTIFIED.items()
        if any(one.get(key) is not None for one in held)
    ]
    margins = [np.array([one for one in cert.get("margin", []) if one is not None], dtype=float) for cert in held]
    if any(one.size for one in margins):
        rows.append(["margins", *(panels.spread(one) if one.size else NONE for one in margins)])
    return _table("certificate", "Certificates", "What each run recorded of its reward as it learned it.", named, rows)


def _proof(held: Mapping[str, Any], key: str) -> str:
    """A number of a certificate, in words where it has none: without a cap is the paper's own program."""
    if held.get(key) is None:
        return "none" if key == "margin_cap" and key in held else NONE
    rounding = key == "duality_gap" and held[key] <= ROUNDING * max(1.0, abs(held.get("objective") or 0.0))
    return "0, to rounding" if rounding else number(held[key])


def _doctors(named: Mapping[str, Run]) -> Section:
    """What the doctor says of each run."""
    findings = []
    answers: dict[str, list[str]] = {}
    for letter, run in named.items():
        said = told_answer(run.diagnosis) if run.diagnosis else "Not looked at, by the earlier version of irl_gym that made it."
        answers.setdefault(said, []).append(letter)
        for one in run.diagnosis["findings"] if run.diagnosis else ():
            told = finding(run, one)
            findings.append({**told, "name": f"run {letter}: {told['name']}"})
    lead = "What is to be said against each reward, and what to do about it. " if findings else ""
    lead += " ".join(f"Run{'s' * (len(letters) > 1)} {', '.join(letters)}: {said}" for said, letters in answers.items())
    return Section("doctor", "Doctor", lead, (), "doctor", {"findings": findings})
