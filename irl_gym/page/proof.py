"""The certificate in words, and the doctor's sentences."""

import json
from collections.abc import Mapping
from typing import Any

from irl_gym.certificates import facts_in
from irl_gym.diagnoses.spoken import usable_flags, with_names
from irl_gym.estimated import errors_told
from irl_gym.page.absent import TABLE
from irl_gym.page.sections import Section
from irl_gym.runs import Run
from irl_gym.tabulation import Tabulation
from irl_gym.written import counted, number, sentence_of

ROUNDING = 1e-7
"""A gap to the program's optimum below this share of the objective is none."""


def proved(certificate: Mapping[str, Any], recomputed: bool, table: Tabulation | None) -> Section:
    """What the learned reward says of the expert, what its learner proves, and the raw numbers behind both."""
    raw = json.dumps(dict(certificate), indent=1, sort_keys=True, default=str)
    of_reward, of_program = facts_in(certificate)
    parts = [
        {"title": f"Of the reward: {whence(recomputed)}", "lines": [(one.label, one.sentence) for one in of_reward]},
        {"title": f"Of its program: {whence(False)}", "lines": [(one.label, one.sentence) for one in of_program]},
    ]
    lead = "What the reward says of the expert, from the table, the expert and the reward alone, and what its learner proves."
    if table is None:
        lead = "What the learner proves, from the sampled trajectories and the reward alone. Without a table there is no more."
    shown = {"parts": [one for one in parts if one["lines"]], "raw": raw}
    return Section("certificate", "Certificate", f"{lead} No solver's word is taken.", (), "certificate", shown)


def whence(recomputed: bool) -> str:
    """Whose word it is what a reward says of the expert."""
    return "computed again for this page" if recomputed else "the run's own record"


def doctor(run: Run) -> Section:
    """The doctor's findings with their mends."""
    title = "Doctor"
    if run.diagnosis is None:
        why = sentence_of(run.stages.get("ambiguity", {}).get("no_diagnosis"))
        return Section("doctor", title, f"The doctor did not look at this run. {why}".strip())
    findings = [finding(run, one) for one in run.diagnosis.get("findings", ())]
    lead = "What a careful reader would ask of this reward, and what to do about it."
    if not findings:
        lead = f"The doctor has nothing to complain about. {sentence_of(run.diagnosis.get('examined'))}".strip()
    return Section("doctor", title, lead, (), "doctor", {"findings": findings})


def finding(run: Run, found: Mapping[str, Any]) -> dict[str, str]:
    """A finding as diagnosis.json holds it, in words: states and actions by their names, and its mend with flags."""
    sentence, mend = str(found.get("sentence", "")), str(found.get("mend", ""))
    flags = usable_flags(found.get("flags") or (), given=run.config.get("dataset") is not None)
    return {
        "name": str(found.get("name", "")).replace("_", " ").replace("-", " "),
        "sentence": sentence if run.table is None else with_names(sentence, run.state_name, run.actions),
        "mend": f"{mend} On the command line: {', '.join(flags)}." if flags else mend,
    }


def table_facts(told_of_table: Mapping[str, Any], actions: tuple[str, ...]) -> Section:
    """How big the table is, and how far it is to be trusted."""
    told = told_of_table
    lines = [
        ("States", f"{told['states']:,}, of which episodes visit {told['reachable']:,}"),
        ("Actions", f"{told['actions']:,}: {', '.join(actions[:12])}"),
        ("Transitions", f"{told['transitions']:,}"),
    ]
    if "exact" in told:
        off = errors_told(told) or {"probabilities": "exact"}
        lines += [(name.capitalize(), words) for name, words in off.items()]
        lines.append(("Where from", str(told.get("method", ""))))
    if told.get("hidden_state"):
        lines.append(("Hidden state", str(told["hidden_state"])))
    if told.get("split"):
        lines.append(("Split", f"{counted(told['split'], 'state')} both ordinary and terminal"))
    check = told.get("check")
    if check and check.get("episodes"):
        lines.append(("Checked", str(told["checked"])))
    elif check:
        lines.append(
            ("Checked", f"{check['steps']:,} steps of the environment, no contradiction; p = {number(check['p_value'], 2)}")
        )
    return Section(*TABLE, "What the environment was turned into.", (), "facts", {"lines": lines})
