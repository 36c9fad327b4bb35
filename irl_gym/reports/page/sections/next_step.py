"""What next: the doctor's first mend, as a command that runs; or lines of Python that use what was learned."""

import shlex
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from irl_gym.judging.diagnoses.findings import told_finding
from irl_gym.judging.diagnoses.plain_words import usable_flags
from irl_gym.judging.shares import training_fell_short
from irl_gym.reports.page.python_code import reward_lines
from irl_gym.runs.identity import mended, ours
from irl_gym.tables.tabulation import Tabulation

AGAIN = "This command does it, in a folder of its own:"
MORE = 4
"""How many times as many are proposed, where a mend asks for more and leaves it to the reader how many."""
PAID = {
    "reward_shaped.npz": ", as what each action loses under it, from which an agent learns more easily",
    "reward.npz": "",
}
"""What holds a reward, the best to learn from first, and how it pays."""
POLICY = "learned_policy.npz"


def next_step(
    diagnosis: Mapping[str, Any] | None, version: Mapping[str, Any], config: Mapping[str, Any], metrics: Mapping[str, Any],
    place_name: Callable[[int, int | None], str], rewarded: bool, given: bool, path: Path, table: Tabulation | None,
) -> dict[str, Any]:  # fmt: skip
    """An answer, its sentence, and lines to copy, or None.

    Args:
        diagnosis: the content of diagnosis.json; None for an earlier version's run.
        version: that of run.json.
        config: that of config.json.
        metrics: that of metrics.json.
        place_name: what a state is called, or a state and an action.
        rewarded: was a reward learned?
        given: was a dataset given? Then some flags cannot be.
        path: the folder, which is asked which files it has.
        table: the run's; None where the environment was stepped.
    """
    command = [*map(str, version.get("command") or ())] if ours(version.get("command") or ()) else []
    if diagnosis is not None and diagnosis["findings"]:
        return _mend(diagnosis["findings"], command, config, place_name, given=given)
    share = metrics["reward"].get("worst_tie_regret_share")
    if (told := training_fell_short(metrics["policies"], metrics.get("table"), share)) is not None:
        exactly = mended(command, ["--retrain value-iteration"]) if command else None
        instead = ". This command plans exactly under the reward instead:" if exactly else "."
        return _told("Train the agent better", f"{told}: it is the training that fell short{instead}", exactly)
    if not rewarded:
        return _use_policy(path, table)
    healthy = diagnosis is not None and diagnosis["answer"] == "healthy"
    return _use_reward(config, path, table, "Nothing was found that is to be mended. " if healthy else "")


def _mend(
    findings: list[Mapping[str, Any]], command: list[str], config: Mapping[str, Any],
    place_name: Callable[[int, int | None], str], *, given: bool,
) -> dict[str, Any]:  # fmt: skip
    """The first finding whose mend is a command; the first of all where none is."""
    found, again = next(_with_commands(findings, command, config, given=given), (findings[0], None))
    which = "first finding" if found is findings[0] else "first finding that a command mends"
    sentence = f"The doctor's {which}: {told_finding(found, place_name)} Mend: {found['mend']} {AGAIN if again else ''}"
    return _told("Mend it", sentence, again)


def _with_commands(
    findings: list[Mapping[str, Any]], command: list[str], config: Mapping[str, Any], *, given: bool
) -> Iterator[tuple[Mapping[str, Any], list[str]]]:
    """The findings that a command mends, each with it."""
    for one in findings if command else ():
        flags = [_with_value(flag, config) for flag in usable_flags(one["flags"], given=given)]
        if (again := mended(command, flags)) is not None:
            yield one, again


def _with_value(flag: str, config: Mapping[str, Any]) -> str:
    """A flag with a value to begin with, where its mend leaves it to the reader and asks for more, or for none."""
    learner, table = (config.get(key) or {} for key in ("learner", "table"))
    now = {"--episodes": config.get("episodes"), "--rounds": learner.get("max_rounds"), "--steps": table.get("steps")}
    if flag == "--epsilon":
        return "--epsilon 0"
    return f"{flag} {MORE * now[flag]}" if now.get(flag) else flag


def _use_reward(config: Mapping[str, Any], path: Path, table: Tabulation | None, healthy: str) -> dict[str, Any]:
    """Train an agent of one's own."""
    file = next((name for name in PAID if (path / name).is_file()), None)
    if file is None:
        return _told("Use the reward", f"{healthy}An agent of your own is paid it by irl_gym's LearnedReward.", None)
    states = None if table is None else table.states
    lines = reward_lines(config, file, states)
    told = f"{healthy}Train an agent of your own on {file} in this run's folder"
    told += "." if lines is None else f": there these lines pay it the reward in place of the environment's own{PAID[file]}."
    return {"answer": "Use the reward", "sentence": told, "lines": lines}


def _use_policy(path: Path, table: Tabulation | None) -> dict[str, Any]:
    """Act by it."""
    if table is None or not (path / POLICY).is_file():
        return _told("Use the policy", "It lies in this run's folder.", None)
    told = f"It lies in {POLICY} in this run's folder: there these lines give each state's action, or probabilities of actions."
    lines = f"from irl_gym.mdp.policies import load_actions\n\npolicy = load_actions({POLICY!r})"
    return {"answer": "Use the policy", "sentence": told, "lines": lines}


def _told(answer: str, sentence: str, command: list[str] | None) -> dict[str, Any]:
    """The same as the template takes it."""
    return {"answer": answer, "sentence": sentence.strip(), "lines": None if command is None else shlex.join(command)}
