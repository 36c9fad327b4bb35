"""compare.html: several runs side by side, of one environment or of several.

Runs are called A, B, C, ... in the order they are given. Of the configurations only what differs is listed; learning curves are
in one figure, as scores where the environments differ.
"""

import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

from irl_gym.errors import InvalidParameter
from irl_gym.features.linear_reward import LinearReward
from irl_gym.judging import measures
from irl_gym.judging.copied import copied
from irl_gym.judging.diagnoses.findings import told_answer
from irl_gym.judging.measures import Measure, explained, shown
from irl_gym.judging.scores import REFERENCES, agent_of, called, others, scored
from irl_gym.judging.shares import judged
from irl_gym.mdp.rewards import TabularReward
from irl_gym.reports.comparison.compared_runs import ComparedRuns, lettered
from irl_gym.reports.comparison.pooled import over_seeds
from irl_gym.reports.comparison.ranked import learning, sentence
from irl_gym.reports.comparison.runs_as_rows import NONE, runs_as_rows
from irl_gym.reports.comparison.shared_worlds import run_title
from irl_gym.reports.page.document import write_page
from irl_gym.reports.page.panels import Panel
from irl_gym.reports.page.scene import Scene
from irl_gym.reports.page.sections import compared
from irl_gym.reports.page.sections.asked import written
from irl_gym.reports.page.sections.judged import answer, how
from irl_gym.reports.page.sections.proof import finding
from irl_gym.reports.page.sections.section import Section, specs
from irl_gym.runs.certificates import facts_in
from irl_gym.runs.run import Run
from irl_gym.runs.supply import supplied
from irl_gym.written import counted, seconds, sentence_of

SCRIPTS = ("theme.js", "figures.js", "enlarge.js")
MOST_RUNS = 26


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
    context, data = _page(lettered(runs))
    write_page(path, "compare.html", context, data, SCRIPTS)


def _page(compared_runs: ComparedRuns) -> tuple[dict[str, Any], dict[str, Any]]:
    """What the template shows, and the scripts."""
    kept = [section for show in SECTIONS if (section := supplied(show, compared_runs)) is not None]
    runs, places = compared_runs.runs, compared_runs.places
    facts = [(letter, f"{run_title(run.config, places[letter])} ({run.path.resolve().name})") for letter, run in runs.items()]
    facts += [(letter, run.caution) for letter, run in runs.items() if run.caution is not None]
    told = {run.whose: [letter for letter, one in runs.items() if one.whose == run.whose] for run in runs.values()}
    facts += [(", ".join(letters), whose) for whose, letters in told.items()]
    said = supplied(sentence, compared_runs)
    context = {"title": f"{len(runs)} runs side by side", "facts": facts, "sentence": said, "sections": kept}
    return context, {"figures": specs(kept), "slider": None, "episodes": {}}


def results(
    metrics: Mapping[str, Mapping[str, Any]], stages: Mapping[str, Mapping[str, Mapping[str, Any]]],
    recomputed: Mapping[str, bool], places: Mapping[str, str], configs: Mapping[str, Mapping[str, Any]],
) -> Section:  # fmt: skip
    """One row a run."""
    told = shown(measures.POLICIES, [row for one in metrics.values() for row in one["policies"].values()])
    rows = {
        letter: {
            "environment": places[letter],
            **dict(_numbers(one, told, recomputed=recomputed[letter])),
            **_copied(one, configs[letter]),
            "time of all stages": _time(stages[letter]),
        }
        for letter, one in metrics.items()
    }
    lead = [
        "Every number is under the true reward of its own environment.",
        *_explained([*metrics.values()]),
    ]
    return _table("results", "Results", " ".join(map(sentence_of, lead)), rows)


def _explained(told: Sequence[Mapping[str, Any]]) -> list[str]:
    """What the measures are, where that is the same in all runs; each run's own page says all of it."""
    each = []
    for metrics in told:
        found = [*shown(measures.POLICIES, [*metrics["policies"].values()]), *shown(measures.REWARDS, [metrics["reward"]])]
        each.append(explained(found, metrics))
    return [one for one in each[0] if all(one in other for other in each)]


def _table(name: str, title: str, lead: str, told: Mapping[str, Mapping[str, str]]) -> Section:
    """A section of a table, of what there is to say of each run by its letter."""
    shown = runs_as_rows(title, {f"run {letter}": one for letter, one in told.items()})
    return Section(name, title, lead, (), "compare", shown)


def _time(stages: Mapping[str, Mapping[str, Any]]) -> str:
    """How long all stages took."""
    return seconds(sum(record.get("seconds") or 0.0 for name, record in stages.items() if name != "report"))


def _numbers(metrics: Mapping[str, Any], told: Sequence[Measure], *, recomputed: bool) -> Iterator[tuple[str, str]]:
    """What the table of results says of a run's policies and reward.

    Args:
        metrics: the run's.
        told: measures of policies that some run has.
        recomputed: was what it says of the expert under the reward computed from the run's files?
    """
    policies, reward = metrics["policies"], metrics["reward"]
    agents, rated = others(policies), scored(policies)
    for one, name in product((one for one in told if one.relative), rated):
        yield f"{one.heading}, {called(name)}", one.text(policies[name])
    for name in agents:
        yield f"{called(name)}, judged by the worse share", judged(policies, metrics.get("table"), name).brief
    for one, name in product((one for one in told if not one.relative), (*rated, *REFERENCES)):
        yield f"{one.heading}, {called(name)}", one.text(policies[name])
    for name in (*rated, *REFERENCES):
        yield f"how it came about, {called(name)}", how(policies[name])
    yield from ((one.heading, one.text(reward)) for one in shown(measures.REWARDS, [reward]))
    whose = "" if recomputed else ", as recorded"
    if "expert_optimal" in reward:
        yield "expert optimal under the reward", f"{answer(reward.get('expert_optimal'))}{whose}"
    if metrics["training"]["environment_steps"] and policies[agent_of(policies)]["score"] is not None:
        steps = metrics["training"].get("steps_to_0.99")
        yield "environment steps to a score of 0.99", "not reached" if steps is None else f"{steps:,}"


def _copied(metrics: Mapping[str, Any], config: Mapping[str, Any]) -> dict[str, str]:
    """Does copying the demonstrations do as well? Nothing where there is no clone."""
    found = copied(metrics, config.get("eval_episodes", 0))
    told = {"as well": "yes", "worse": "no"}
    return {} if found is None else {"does copying the demonstrations do as well?": told.get(found, found)}


def rewards(
    learned: Mapping[str, TabularReward | LinearReward | None], scenes: Mapping[str, Scene | None], places: Mapping[str, str]
) -> Section | None:
    """The learned rewards; one that several runs learned is drawn once."""
    drawn: list[tuple[str, str, Panel]] = []
    for letter, reward in learned.items():
        if reward is None:
            continue
        if (scene := scenes[letter]) is not None and scene.learned is not None:
            panel = compared.reward_panel("reward", places[letter], scene.learned, scene)
            drawn.append((letter, f"{panel.title} {scene.learned.values.tobytes()!r}", panel))
        else:  # features that only look alike are drawn by themselves
            drawn += [(letter, letter, replace(one, name="reward", title="weights")) for one in compared.weights(reward).panels]
    made = _once(drawn)
    lead = "What each run recovered. Each has its own scale; compare patterns, not colours."
    lead += " Runs that recovered the same have one figure." if len(made) < len(drawn) else ""
    return Section("rewards", "Learned rewards", lead, made) if made else None


def _once(drawn: Sequence[tuple[str, str, Panel]]) -> list[Panel]:
    """Figures without those that say the same again, each with the letters of its runs in its name and title.

    Args:
        drawn: letter of the run, what figures share that say the same, and the figure.
    """
    found: dict[str, tuple[list[str], Panel]] = {}
    for letter, same, panel in drawn:
        found.setdefault(same, ([], panel))[0].append(letter)
    return [
        replace(one, name=f"{one.name}-{runs[0]}", title=f"Run{'s' * (len(runs) > 1)} {', '.join(runs)}: {one.title}")
        for runs, one in found.values()
    ]


def policies(scenes: Mapping[str, Scene | None], places: Mapping[str, str]) -> Section | None:
    """What is judged in each run, with what deviates shaded; a figure that several runs share is drawn once."""
    drawn: list[tuple[str, str, Panel]] = []
    for letter, scene in scenes.items():
        for panel in () if scene is None else compared.policy_panels(scene):
            if panel.name != "policy-expert":
                one = replace(panel, title=f"{panel.title[0].lower()}{panel.title[1:]}")
                drawn.append((letter, f"{places[letter]} {one.name} {one.caption} {json.dumps(one.spec())}", one))
    made = _once(drawn)
    lead = "What was judged in each run; shaded is where it deviates from its expert."
    lead += " A figure that several runs share is drawn once." if len(made) < len(drawn) else ""
    return Section("policies", "Policies", lead, made) if made else None


def differences(configs: Mapping[str, Mapping[str, Any]]) -> Section:
    """What differs between the configurations."""
    flat = [dict(_leaves(config)) for config in configs.values()]
    keys = _entries(flat)
    differ = [key for key in keys if not _alike(key, flat)]
    if not differ:
        return Section("differences", "What differs", "The runs have the same configuration.")
    told = counted(len(differ), "entry differs", "entries differ")
    lead = f"Of the configuration {told}; the other {len(keys) - len(differ)} are the same in all runs."
    rows = {letter: {key: _entry(one, key) for key in differ} for letter, one in zip(configs, flat, strict=True)}
    return _table("differences", "What differs", lead, rows)


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


def proofs(certificates: Mapping[str, Mapping[str, Any]], recomputed: Mapping[str, bool]) -> Section:
    """What each run's reward says of its expert, and what its learner proves."""
    rows = {}
    for letter, certificate in certificates.items():
        of_reward, of_program = facts_in(certificate)
        rows[letter] = {one.label: one.sentence for one in of_reward}
        rows[letter] |= {f"{one.label}, as its learner recorded": one.sentence for one in of_program}
    recorded = ", ".join(letter for letter, whether in recomputed.items() if not whether)
    lead = "What each run's reward says of its expert, and by the run's own record what its learner proves of its program."
    lead += f" Of {recorded} all of it is the record." if recorded else ""
    return _table("certificate", "Certificates", lead, rows)


def doctors(
    diagnoses: Mapping[str, Mapping[str, Any] | None], configs: Mapping[str, Mapping[str, Any]],
    place_names: Mapping[str, Callable[[int, int | None], str]],
) -> Section:  # fmt: skip
    """What the doctor says of each run."""
    findings = []
    answers: dict[str, list[str]] = {}
    for letter, diagnosis in diagnoses.items():
        said = told_answer(diagnosis) if diagnosis else "Not looked at, by the earlier version of irl_gym that made it."
        answers.setdefault(said, []).append(letter)
        for one in diagnosis["findings"] if diagnosis else ():
            told = finding(one, place_names[letter], given=configs[letter].get("dataset") is not None)
            findings.append({**told, "name": f"run {letter}: {told['name']}"})
    lead = "What is to be said against each reward, and what to do about it. " if findings else ""
    lead += "As recorded when each run was made. " if any(diagnoses.values()) else ""
    lead += " ".join(f"Run{'s' * (len(letters) > 1)} {', '.join(letters)}: {said}" for said, letters in answers.items())
    return Section("doctor", "Doctor", lead, (), "doctor", {"findings": findings})


SECTIONS: tuple[Callable[..., Section | None], ...] = (
    results, over_seeds, learning, rewards, policies, differences, proofs, doctors,
)  # fmt: skip
"""In order: each is shown where there is something to show."""
