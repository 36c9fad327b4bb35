"""The certificate in words, and the doctor's sentences."""

import json
from collections.abc import Callable, Mapping
from typing import Any

from irl_gym.judging.diagnoses.findings import told_answer, told_finding
from irl_gym.judging.diagnoses.plain_words import usable_flags
from irl_gym.judging.estimated import errors_told
from irl_gym.reports.page.sections.absent import DOCTOR, TABLE
from irl_gym.reports.page.sections.section import Section
from irl_gym.runs.certificates import facts_in
from irl_gym.tables.tabulation import Tabulation
from irl_gym.written import counted, number


def proved(certificate: Mapping[str, Any], recomputed: bool, table: Tabulation | None) -> Section:
    """What the learned reward says of the expert, what its learner proves, and the raw numbers behind both."""
    raw = json.dumps(dict(certificate), indent=1, sort_keys=True, default=str)
    of_reward, of_program = facts_in(certificate)
    parts = [
        {"title": f"Of the reward: {whence(recomputed)}", "lines": [(one.label, one.sentence) for one in of_reward]},
        {"title": f"Of the learner: {whence(False)}", "lines": [(one.label, one.sentence) for one in of_program]},
    ]
    lead = "What the reward says of the expert, from the table, the expert and the reward alone, and what its learner proves."
    if table is not None and not of_reward:
        lead = "What the learner says of the policy that it gives; none of it is computed again."
    elif table is None:
        lead = "What the learner proves. Without a table nothing is computed beside it."
    shown = {"parts": [one for one in parts if one["lines"]], "raw": raw}
    return Section(
        "certificate",
        "Certificate",
        f"{lead} No solver's word is taken but for the status of the program.",
        (),
        "certificate",
        shown,
    )


def whence(recomputed: bool) -> str:
    """Whose word it is what a reward says of the expert."""
    return "computed again for this page" if recomputed else "the run's own record"


def doctor(diagnosis: Mapping[str, Any], place_name: Callable[[int, int | None], str], given: bool) -> Section:
    """The doctor's answer, and findings with their mends."""
    findings = [finding(one, place_name, given=given) for one in diagnosis["findings"]]
    lead = "What a careful reader would ask of this reward, and what to do about it. " if findings else ""
    lead += f"As recorded when the run was made: {told_answer(diagnosis)} {diagnosis['examined']}"
    return Section(*DOCTOR, lead.strip(), (), "doctor", {"findings": findings})


def finding(found: Mapping[str, Any], place_name: Callable[[int, int | None], str], *, given: bool) -> dict[str, str]:
    """A finding as diagnosis.json holds it, in words: states and actions by their names, and its mend with flags.

    Args:
        found: the finding.
        place_name: what a state is called, or a state and an action.
        given: was a dataset given? Then some flags cannot be.
    """
    mend, flags = found["mend"], usable_flags(found["flags"], given=given)
    return {
        "name": found["name"].replace("-", " "),
        "sentence": told_finding(found, place_name),
        "mend": f"{mend} On the command line: {', '.join(flags)}." if flags else mend,
    }


def table_facts(told_of_table: Mapping[str, Any], actions: tuple[str, ...]) -> Section:
    """How big the table is, and how far it is to be trusted."""
    told = told_of_table
    lines = [
        ("States", f"{told['states']:,}, of which episodes can visit {told['reachable']:,}"),
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
