"""The verdict, the certificate in words, and the doctor's sentences."""

import json
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from irl_gym.confirmation import loss_told
from irl_gym.diagnoses.findings import told_answer
from irl_gym.diagnoses.spoken import usable_flags, with_names
from irl_gym.estimated import errors_told
from irl_gym.intervals import TOO_FEW, Interval
from irl_gym.optimality import AT_STAKE, told_record
from irl_gym.page.sections import Section
from irl_gym.page.written import counted, number, percent, sum_of
from irl_gym.runs import Run
from irl_gym.sampling_error import estimated_table
from irl_gym.scores import score_of
from irl_gym.shares import MUCH, judged, returns_of
from irl_gym.status import Status

UNKNOWN = "one episode tells no noise"
"""In place of a standard error that there is none of."""
ROUNDING = 1e-7
"""A gap to the program's optimum below this share of the objective is none."""


def verdict(run: Run) -> dict[str, Any]:
    """The sentence at the top, four figures, each with whether it is good, and how the agent was judged."""
    agent, reward = run.metrics["policies"]["retrained"], run.metrics["reward"]
    score, share = agent.get("score"), reward.get("worst_tie_regret_share")
    optimal, found = reward.get("expert_optimal"), judged(run.metrics["policies"], run.metrics.get("table"))
    lost = "" if share is None else f"{sum_of(max(reward['worst_tie_regret'], 0.0))} of value, as a share "
    figures = [
        {
            "label": "the agent's score",
            "value": score_of(score),
            "note": "random actions are 0, the expert is 1" if score is not None else _no_score(run),
            "mood": found.mood,
        },
        {
            "label": "the agent's mean return",
            "value": number(agent.get("mean_return")),
            "note": _returns(run),
            "mood": found.mood,
        },
        {
            "label": "lost by the worst tie",
            "value": "not known" if share is None else percent(max(share, 0.0)),
            "note": f"{lost}of what the expert has over random, by the worst policy that is best under the learned reward",
            "mood": "plain" if share is None else "good" if share <= MUCH else "bad",
        },
        {
            "label": "expert optimal under it",
            "value": answer(optimal),
            "note": "degenerate: the reward says nothing" if reward.get("degenerate") else _proved(reward, run.recomputed),
            "mood": _mood(optimal, reward),
        },
    ]
    return {
        "sentence": _sentence(run, score, share, optimal),
        "figures": figures,
        "judged": f"How score and mean return are coloured: {found.told}",
    }


def _returns(run: Run) -> str:
    """The interval of the agent's mean return, and what random actions and the expert return."""
    agent, random, expert = (returns_of(run.metrics["policies"][name]) for name in ("retrained", "random", "expert"))
    if agent is None:
        return "not recorded in this version"
    sure = f"95 %: {number(agent.low)} to {number(agent.high)}" if agent.known else f"{TOO_FEW} how surely"
    return f"{sure}; random actions have {_mean(random)}, the expert {_mean(expert)}"


def _mean(found: Interval | None) -> str:
    return number(None if found is None else found.estimate)


def _mood(optimal: bool | None, reward: Mapping[str, Any]) -> str:
    """Of whether the expert is optimal: not good where the reward says nothing or a counted table leaves margins open."""
    if optimal is False or reward.get("degenerate"):
        return "bad"
    return "good" if optimal and not reward.get("unsettled_states") else "plain"


def answer(optimal: bool | None) -> str:
    """Yes, no or undecided."""
    return "undecided" if optimal is None else "yes" if optimal else "no"


def _no_score(run: Run) -> str:
    """Why there is no score."""
    return str(run.metrics.get("score_reason") or "the expert earns no more than random actions")


def _proved(reward: Mapping[str, Any], recomputed: bool) -> str:
    gap, whose = reward.get("duality_gap"), whence(recomputed)
    if gap is None:
        return whose
    if gap <= ROUNDING * max(1.0, abs(reward.get("objective") or 0.0)):
        return f"{whose}; to rounding no reward does better in the program, as recorded"
    return f"{whose}; the program's optimum is at most {number(gap, 2)} away, as recorded"


def whence(recomputed: bool) -> str:
    """Whose word it is that the expert is optimal, or not."""
    return "computed again for this page" if recomputed else "the run's own record"


def _sentence(run: Run, score: float | None, share: float | None, optimal: bool | None) -> str:
    agent = run.metrics["policies"]["retrained"]
    random, expert = (_mean(returns_of(run.metrics["policies"][name])) for name in ("random", "expert"))
    who, returned = "The agent that saw only the recovered reward has", f"a mean return of {_mean(returns_of(agent))}"
    earned = (
        f"{who} a score of {score_of(score)} and {returned}: random actions have 0 and {random}, the expert has 1 and {expert}"
        if score is not None
        else f"{who} value {number(agent['value'])} and {returned}: random actions have {random}, the expert {expert}; "
        f"there is no score, as {_no_score(run)}"
    )
    tie = (
        ""
        if share is None
        else f"; the unluckiest policy that is best under that reward would lose {percent(max(share, 0.0))} of what the expert "
        "has over random actions"
        if share > 1e-9
        else "; every policy that is best under that reward is as good as the expert"
    )
    certified = "whether the expert is optimal under it is undecided"
    if optimal is not None:
        certified = "the expert is optimal under it" if optimal else "the expert is not optimal under it"
    on_table = run.metrics["reward"].get("on_table")
    certified += "" if run.recomputed else ", by the run's own record" + (f", and on the table: {on_table}" if on_table else "")
    return f"{earned}{tie}; {certified}.{_counted(run)}"


def _counted(run: Run) -> str:
    """What the verdict rests on, where the table is counted; nothing where it is exact."""
    reward, agent = run.metrics["reward"], run.metrics["policies"]["retrained"]
    table = run.metrics.get("table") or {}
    if table.get("exact", True):
        return ""
    n = reward.get("unsettled_states")
    left = f", and in {counted(n, 'state')} a margin is smaller than its error" if n else ""
    return f" All this is judged on {estimated_table(table, reward)}{left}.{loss_told(agent)}"


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
    yield "Status of the program", Status(reward["status"]).sentence
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
    if "worst_tie_regret" in reward:
        yield "Worst tie", f"loses {sum_of(max(reward['worst_tie_regret'], 0.0))} of value against the expert"


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
    """The doctor's answer, and findings with their mends."""
    if run.diagnosis is None:
        return Section("doctor", "Doctor", "The doctor did not look at this run: an earlier version of irl_gym made it.")
    findings = [finding(run, one) for one in run.diagnosis["findings"]]
    lead = "What a careful reader would ask of this reward, and what to do about it. " if findings else ""
    lead += f"{told_answer(run.diagnosis)} {run.diagnosis['examined']}"
    return Section("doctor", "Doctor", lead.strip(), (), "doctor", {"findings": findings})


def finding(run: Run, found: Mapping[str, Any]) -> dict[str, str]:
    """A finding as diagnosis.json holds it, in words: states and actions by their names, and its mend with flags."""
    sentence, mend = found["sentence"], found["mend"]
    flags = usable_flags(found["flags"], given=run.config.get("dataset") is not None)
    return {
        "name": found["name"].replace("-", " "),
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
