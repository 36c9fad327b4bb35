"""compare.html: several runs side by side, of one environment or of several.

Runs are called A, B, C, ... in the order they are given. Of the configurations only what differs is listed; learning curves are
in one figure, as scores where the environments differ.
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from irl_gym.errors import InvalidParameter
from irl_gym.page import compared, panels
from irl_gym.page.asked import written
from irl_gym.page.document import write_page
from irl_gym.page.panels import Panel
from irl_gym.page.report import page_title, policy_row
from irl_gym.page.scene import Scene
from irl_gym.page.sections import Section, specs
from irl_gym.page.training import curves
from irl_gym.page.written import number, percent, seconds
from irl_gym.runs import Run

SCRIPTS = ("theme.js", "figures.js")
MOST_RUNS = 26


def write_comparison(runs: Sequence[Run], path: str | os.PathLike) -> None:
    """Write several runs as one page beside, then rename. The same runs make the same bytes.

    Args:
        runs: at least two, 26 at most.
        path: of the file.

    Raises:
        InvalidParameter: fewer or more runs.
    """
    if not 2 <= len(runs) <= MOST_RUNS:
        raise InvalidParameter(f"runs has {len(runs)} of them: expected 2 to {MOST_RUNS} to put side by side.")
    letters = [chr(ord("A") + i) for i in range(len(runs))]
    named = dict(zip(letters, runs, strict=True))
    scenes = {letter: Scene.of(run) for letter, run in named.items()}
    sections = [
        _results(named),
        _learning(named),
        _rewards(named, scenes),
        _policies(scenes),
        _differences(named),
        _proofs(named),
        _doctors(named),
    ]
    kept = [section for section in sections if section is not None]
    facts = [(letter, f"{run_title(run)} ({run.path.name})") for letter, run in named.items()]
    context = {"title": f"{len(runs)} runs side by side", "facts": facts, "sentence": _sentence(named), "sections": kept}
    data = {"figures": specs(kept), "slider": None, "episodes": {}}
    write_page(path, "compare.html", context, data, SCRIPTS)


def run_title(run: Run) -> str:
    """Environment, learner and seed."""
    learner = (run.config.get("learner") or {}).get("type", "")
    return f"{page_title(run)}, {learner}, seed {run.config.get('seed')}"


def _sentence(named: Mapping[str, Run]) -> str:
    """Which agent is best, by score."""
    scores = {letter: run.metrics["policies"]["retrained"]["score"] for letter, run in named.items()}
    known = {letter: score for letter, score in scores.items() if score is not None}
    if not known:
        return "None of these runs has a score: no expert earns more than random actions."
    best, worst = max(known, key=lambda one: known[one]), min(known, key=lambda one: known[one])
    if number(known[best], 3) == number(known[worst], 3):
        return f"The retrained agents are equally good, with a score of {number(known[best], 3)}."
    return (
        f"The retrained agent of run {best} has the best score, {number(known[best], 3)}; that of run {worst} the worst, "
        f"{number(known[worst], 3)}. Random actions are 0, the expert is 1."
    )


def _results(named: Mapping[str, Run]) -> Section:
    """One row a number, one column a run."""
    columns = [dict(_numbers(run)) for run in named.values()]
    keys = list(dict.fromkeys(key for column in columns for key in column))
    rows = [[key, *(column.get(key, "") for column in columns)] for key in keys]
    return _table("results", "Results", "Every number is under the true reward of its own environment.", named, rows)


def _table(name: str, title: str, lead: str, named: Mapping[str, Run], rows: list[list[str]]) -> Section:
    shown = {"caption": title, "headings": ["", *(f"run {letter}" for letter in named)], "rows": rows}
    return Section(name, title, lead, (), "compare", shown)


def _numbers(run: Run) -> Iterator[tuple[str, str]]:
    """What the table of results says of a run."""
    policies, reward = run.metrics["policies"], run.metrics["reward"]
    told = {name: policy_row(name, row) for name, row in policies.items()}
    yield "environment", page_title(run)
    yield "score of the retrained agent", told["retrained"]["score"]
    for name in ("expert", "retrained", "random"):
        yield f"value, {told[name]['name']}", told[name]["value"]
    for name in ("expert", "retrained", "random"):
        yield f"mean return (95 %), {told[name]['name']}", told[name]["returns"]
    if any(row["agreement"] is not None for row in policies.values()):
        yield "agreement, retrained agent", told["retrained"]["agreement"]
    if reward.get("worst_tie_regret_share") is not None:
        yield "lost by the worst tie", percent(max(reward["worst_tie_regret_share"], 0.0))
    yield "expert optimal under the reward", "yes" if reward["expert_optimal"] else "no"
    steps = run.metrics["training"].get("steps_to_0.9")
    yield "environment steps to a score of 0.9", "not reached" if steps is None else f"{steps:,}"
    spent = [record.get("seconds") or 0.0 for name, record in run.stages.items() if name != "report"]
    yield "time of all stages", seconds(sum(spent))


def _learning(named: Mapping[str, Run]) -> Section:
    """All learning curves in one figure."""
    title, trained = "Learning curves", {letter: run for letter, run in named.items() if len(run.curve.steps)}
    if not trained:
        return Section("learning", title, "The agents were planned exactly, not trained.")
    same = (
        len({(page_title(run), written(run.config.get("env_kwargs") or {}), run.config["gamma"]) for run in named.values()})
        == 1
    )
    series, levels = {}, {}
    for letter, run in trained.items():
        policies = run.metrics["policies"]
        low, high = policies["random"]["value"], policies["expert"]["value"]
        if not same and not high > low:
            continue
        values = run.curve.value if same else (run.curve.value - low) / (high - low)
        series[f"run {letter}"] = (run.curve.steps, values, None)
        levels = {"expert": high, "random": low} if same else {"expert": 1.0, "random": 0.0}
    if not series:
        return Section("learning", title, "No run has a score to draw: no expert earns more than random actions.")
    what = "discounted value from the start" if same else "score"
    told = "the expert's and random actions' levels are dashed" if same else "random actions are 0, the expert is 1"
    ends = "; ".join(f"{name} ends at {number(values[-1])}" for name, (_, values, _) in series.items())
    panel = Panel("curves", what.capitalize(), f"{ends}; {told}.", curves(series, levels, what), height=400)
    return Section("learning", title, "What each agent earned under the true reward as it trained.", [panel])


def _rewards(named: Mapping[str, Run], scenes: Mapping[str, Scene | None]) -> Section:
    """The learned rewards, and once each environment's true one."""
    made: list[Panel] = []
    for letter, run in named.items():
        scene = scenes[letter]
        if scene is None:
            section = compared.rewards(run, None)
            made += [replace(one, name=f"reward-{letter}", title=f"Run {letter}: weights") for one in section.panels]
        else:
            made.append(compared.reward_panel(f"reward-{letter}", f"Run {letter}: {page_title(run)}", scene.learned, scene))
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
    keys = list(dict.fromkeys(key for one in flat for key in one))
    rows = [[key, *(written(one[key]) if key in one else "" for one in flat)] for key in keys if not _alike(key, flat)]
    if not rows:
        return Section("differences", "What differs", "The runs have the same configuration.")
    lead = f"Of the configuration {len(rows)} entries differ; the other {len(keys) - len(rows)} are the same in all runs."
    return _table("differences", "What differs", lead, named, rows)


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
        [told, *(number(one[key]) if one.get(key) is not None else "" for one in held)]
        for key, told in CERTIFIED.items()
        if any(one.get(key) is not None for one in held)
    ]
    margins = [np.array([one for one in cert.get("margin", []) if one is not None], dtype=float) for cert in held]
    if any(one.size for one in margins):
        rows.append(["margins", *(panels.spread(one) if one.size else "" for one in margins)])
    return _table("certificate", "Certificates", "What each learned reward proves.", named, rows)


def _doctors(named: Mapping[str, Run]) -> Section:
    """What the doctor says of each run."""
    findings = []
    for letter, run in named.items():
        for one in (run.diagnosis or {}).get("findings", ()):
            name = f"run {letter}: {str(one.get('name', '')).replace('-', ' ').replace('_', ' ')}"
            findings.append({"name": name, "sentence": one.get("sentence", ""), "mend": one.get("mend", ""), "states": ""})
    lead = (
        "What is to be said against each reward, and what to do about it."
        if findings
        else "The doctor has nothing to complain about."
    )
    return Section("doctor", "Doctor", lead, (), "doctor", {"findings": findings})
