"""The certificate in words, and the doctor's sentences."""

import json
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from irl_gym.diagnoses.spoken import usable_flags, with_names
from irl_gym.estimated import errors_told
from irl_gym.optimality import AT_STAKE, told_record
from irl_gym.page.sections import Section
from irl_gym.runs import Run
from irl_gym.sampling_error import estimated_table
from irl_gym.written import counted, number, sentence_of

UNKNOWN = "one episode tells no noise"
"""In place of a standard error that there is none of."""
ROUNDING = 1e-7
"""A gap to the program's optimum below this share of the objective is none."""


def certificate(run: Run) -> Section:
    """What the learned reward proves, line by line, and the raw numbers behind it."""
    raw = json.dumps(dict(run.certificate), indent=1, sort_keys=True, default=str)
    lead = "The run's record, which it computed from the table, the expert and the reward alone, not taken from the solver."
    if run.recomputed:
        lead = (
            "Whether the expert is optimal was computed again for this page, from the table, the expert and the reward in the "
            "run's folder; the rest is the run's record, which it computed from them, not taken from the solver."
        )
    if run.metrics["reward"].get("loss_share") is not None:
        lead = f"{lead} {AT_STAKE}"
    if run.table is None:
        lead = (
            "The run's record, which it computed from the sampled trajectories and the reward alone, not taken from the solver."
        )
    shown = {"lines": list(_lines(run)), "raw": raw}
    return Section("certificate", "Certificate", lead, (), "certificate", shown)


def _lines(run: Run) -> Iterator[tuple[str, str]]:
    """Terms and what they are, for whichever learner's certificate it is."""
    reward, held = run.metrics["reward"], run.certificate
    yield "Status of the program", str(reward.get("status", "not recorded in this version"))
    optimal = told_record(reward) or ("yes" if reward["expert_optimal"] else _why_not(reward))
    yield "Expert optimal under the reward", optimal
    if "on_table" in reward:
        yield "Judged on the table", reward["on_table"]
    if not (run.metrics.get("table") or {}).get("exact", True):
        yield "Judged on", estimated_table(run.metrics["table"], reward)
    if held.get("degenerate"):
        yield "Degenerate", "yes: the reward is zero, or ties the expert with every action, or every policy found"
    margin = np.array([np.nan if one is None else one for one in held.get("margin", [])], dtype=float)
    finite = margin[np.isfinite(margin)]
    if finite.size:
        yield "Margins", f"{number(finite.min())} to {number(finite.max())} in {counted(finite.size, 'state')}"
    cap = held.get("margin_cap")
    if "margin_cap" in held:
        yield "Margin cap", "none: Ng & Russell's own program" if cap is None else number(cap)
    gap = held.get("duality_gap")
    objective = abs(held.get("objective") or 0.0)
    nothing = gap is not None and gap <= ROUNDING * max(1.0, objective)
    best = (
        "" if gap is None else ", to rounding the best possible" if nothing else f", at most {gap:.1e} below the best possible"
    )
    yield "Objective", f"{number(held.get('objective'))}{best}"
    if "lambda_0" in held:
        top = held["lambda_0"]
        zero = "lambda_0 was not computed" if top is None else f"from {number(top)} on the reward is 0"
        yield "lambda and lambda_0", f"{number(held.get('l1'))}; {zero}"
    if held.get("least_l1_norm") is not None:
        yield "||R||_1", f"{number(held.get('l1_norm'))}; the least with these margins is {number(held['least_l1_norm'])}"
    for key, told in _COUNTS.items():
        n = reward.get(f"{key}_states")
        if n:
            yield told[0], f"{counted(n, 'state')}: {told[1]}"
    if "distance" in held:
        yield "Distance to the expert", (
            f"{number(held['distance'])} in the features; {_noise(held.get('distance_error'))}"
        )  # fmt: skip
        yield "Planner", "fell short of the expert" if held.get("fell_short") else "as good as the expert under the reward"
    if "n_features" in held:
        yield "Features", f"{held['n_features']:,}; the rows have rank {held['rank']:,}"


_COUNTS = {
    "inseparable": ("Cannot be settled", "another action has the same successors, so no reward on states tells them apart"),
    "marginless": ("Without a margin", "the expert is only tied with another action"),
    "unsettled": ("Left open by the counts", "a margin of the expert is within its sampling error, and may be noise"),
    "unbreakable": (
        "Always tied",
        "some action ties with the expert's under every reward of this kind that makes the expert optimal",
    ),
    "unknown": ("Expert not seen", "nothing is asked of its actions there"),
    "violated": ("Violated", "another action is better there under the learned reward"),
    "unconstrained": ("Without a comparison", "all actions do the same there"),
}


def _why_not(reward: Mapping[str, Any]) -> str:
    worst = reward.get("worst_violation")
    if worst:
        n = reward.get("violated_states")
        where = f" in {counted(n, 'state')}" if n else ""
        return f"no: another action is better by up to {number(worst, 3)}{where}"
    if "regret" in reward:
        error = reward["regret_error"]
        noise = f"; {UNKNOWN}" if error is None else f" +- {number(error, 2)}"
        return f"no: the policy planned for it gains {number(reward['regret'], 3)}{noise}"
    return "no"


def _noise(error: float | None) -> str:
    return UNKNOWN if error is None else f"noise alone makes about {number(error, 2)}"


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


def table_facts(run: Run) -> Section:
    """How big the table is, and how far it is to be trusted."""
    told = run.metrics.get("table")
    if told is None:
        lead = (
            "There is no table: the environment was stepped, and everything is estimated from episodes. So this page has no "
            "values, policies, lambda slider and feasible widths state by state."
        )
        return Section("table", "The table", lead)
    lines = [
        ("States", f"{told['states']:,}, of which episodes visit {told['reachable']:,}"),
        ("Actions", f"{told['actions']:,}: {', '.join(run.actions[:12])}"),
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
    return Section("table", "The table", "What the environment was turned into.", (), "facts", {"lines": lines})
