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
from irl_gym.page.pooled import over_seeds, spoken
from irl_gym.page.proof import ROUNDING
from irl_gym.page.report import page_title, policy_row
from irl_gym.page.scene import Scene
from irl_gym.page.sections import Section, specs
from irl_gym.page.training import curves
from irl_gym.page.written import number, percent, score_of, seconds
from irl_gym.pooling import Pool, pools
from irl_gym.runs import Run

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
        InvalidParameter: fewer or more runs.
    """
    if not 2 <= len(runs) <= MOST_RUNS:
        raise InvalidParameter(f"runs has {len(runs)} of them: expected 2 to {MOST_RUNS} to put side by side.")
    letters = [chr(ord("A") + i) for i in range(len(runs))]
    named = dict(zip(letters, runs, strict=True))
    scenes = {letter: Scene.of(run) for letter, run in named.items()}
    places, found = run_places(named), pools(named)
    sections = [
        _results(named),
        over_seeds(found, places, same=one_world(named)),
        _learning(named),
        _rewards(named, scenes),
        _policies(scenes),
        _differences(named),
        _proofs(named),
        _doctors(named),
    ]
    kept = [section for section in sections if section is not None]
    facts = [(letter, f"{run_title(run, places[letter])} ({run.path.name})") for letter, run in named.items()]
    context = {"title": f"{len(runs)} runs side by side", "facts": facts, "sentence": _sentence(named, found), "sections": kept}
    data = {"figures": specs(kept), "slider": None, "episodes": {}}
    write_page(path, "compare.html", context, data, SCRIPTS)


def run_places(named: Mapping[str, Run]) -> dict[str, str]:
    """What the environment of each run is called: its id, with the arguments where runs of one id differ in them."""
    given = {letter: dict(run.config.get("env_kwargs") or {}) for letter, run in named.items()}
    told = {}
    for letter, run in named.items():
        same = [given[other] for other, one in named.items() if page_title(one) == page_title(run)]
        keys = [
            key
            for key in dict.fromkeys(key for one in same for key in one)
            if any(one.get(key) != same[0].get(key) for one in same)
        ]
        differing = ", ".join(f"{key}={written(given[letter][key])}" for key in keys if key in given[letter])
        told[letter] = page_title(run) + (f" ({differing or 'no arguments'})" if keys else "")
    return told


def run_title(run: Run, place: str) -> str:
    """Environment, learner and seed."""
    learner = (run.config.get("learner") or {}).get("type", "")
    return f"{place}, {learner}, seed {run.config.get('seed')}"


def one_world(named: Mapping[str, Run]) -> bool:
    """Are all runs of the same environment with the same discount, so that their values can be compared?"""
    worlds = {(page_title(run), written(run.config.get("env_kwargs") or {}), run.config["gamma"]) for run in named.values()}
    return len(worlds) == 1


def _sentence(named: Mapping[str, Run], found: Sequence[Pool]) -> str:
    """Which agent is best, by score; of runs that only differ in their seed, how good they are together."""
    scores = {letter: run.metrics["policies"]["retrained"]["score"] for letter, run in named.items()}
    known = {letter: score for letter, score in scores.items() if score is not None}
    if not known:
        return "None of these runs has a score; each run's own page says why."
    if len(found) == 1 and len(found[0].runs) == len(named) and found[0].score is not None:
        return (
            f"Over {len(named)} seeds the retrained agents have a score of {spoken(found[0].score)}, the interquartile mean "
            "with its 95 % interval. Random actions are 0, the expert is 1."
        )
    if not one_world(named):
        each = "; ".join(f"run {letter} {score_of(score)}" for letter, score in scores.items())
        return (
            f"Scores of the retrained agents: {each}. Random actions are 0, the expert is 1. The environments differ, so a "
            "score says how near each agent comes to its own expert, not which run is better."
        )
    best, worst = max(known, key=lambda one: known[one]), min(known, key=lambda one: known[one])
    if score_of(known[best]) == score_of(known[worst]):
        return f"The retrained agents are equally good, with a score of {score_of(known[best])}."
    return (
        f"The retrained agent of run {best} has the best score, {score_of(known[best])}; that of run {worst} the worst, "
        f"{score_of(known[worst])}. Random actions are 0, the expert is 1."
    )


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
    for name in ("expert", "retrained", "random"):
        yield f"value, {told[name]['name']}", told[name]["value"]
    for name in ("expert", "retrained", "random"):
        yield f"mean return (95 %), {told[name]['name']}", told[name]["returns"]
    if any(row["agreement"] is not None for row in policies.values()):
        yield "agreement, retrained agent", told["retrained"]["agreement"]
    if reward.get("worst_tie_regret_share") is not None:
        yield "lost by the worst tie", percent(max(reward["worst_tie_regret_share"], 0.0))
    yield "expert optimal under the reward", "yes" if reward["expert_optimal"] else "no"
    if told["retrained"]["score"] is not None:
        steps = run.metrics["training"].get("steps_to_0.99")
        yield "environment steps to a score of 0.99", "not reached" if steps is None else f"{steps:,}"
    spent = [record.get("seconds") or 0.0 for name, record in run.stages.items() if name != "report"]
    yield "time of all stages", seconds(sum(spent))


def _learning(named: Mapping[str, Run]) -> Section:
    """All learning curves in one figure."""
    title, trained = "Learning curves", {letter: run for letter, run in named.items() if len(run.curve.steps)}
    if not trained:
        return Section("learning", title, "The agents were planned exactly, not trained.")
    same = one_world(named)
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
        return Section("learning", title, "No run has a score to draw.")
    what = "discounted value from the start" if same else "score"
    told = "the expert's and random actions' levels are dashed" if same else "random actions are 0, the expert is 1"
    ends = "; ".join(f"{name} ends at {number(values[-1])}" for name, (_, values, _) in series.items())
    panel = Panel("curves", what.capitalize(), f"{ends}; {told}.", curves(series, levels, what), height=400)
    return Section("learning", title, "What each agent earned under the true reward as it trained.", [panel])


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
    keys = list(dict.fromkeys(key for one in flat for key in one))
    rows = [[key, *(_entry(one, key) for one in flat)] for key in keys if not _alike(key, flat)]
    if not rows:
        return Section("differences", "What differs", "The runs have the same configuration.")
    lead = f"Of the configuration {len(rows)} entries differ; the other {len(keys) - len(rows)} are the same in all runs."
    return _table("differences", "What differs", lead, named, rows)


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
    return _table("certificate", "Certificates", "What each learned reward proves.", named, rows)


def _proof(held: Mapping[str, Any], key: str) -> str:
    """A number of a certificate, in words where it has none: without a cap is the paper's own program."""
    if held.get(key) is None:
        return "none" if key == "margin_cap" and key in held else NONE
    rounding = key == "duality_gap" and held[key] <= ROUNDING * max(1.0, abs(held.get("objective") or 0.0))
    return "0, to rounding" if rounding else number(held[key])


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
