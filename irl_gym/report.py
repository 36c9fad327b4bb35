"""A run in a few tables a person reads, for the terminal."""

from collections.abc import Iterator

from rich.console import Console, RenderableType
from rich.table import Table

from irl_gym.pipeline import Report


def print_report(report: Report, console: Console) -> None:
    """Print what a run found."""
    for part in render(report):
        console.print(part)


def render(report: Report) -> Iterator[RenderableType]:
    """The parts of the report, in reading order."""
    yield _policies(report)
    yield _reward(report)
    yield _stages(report)
    yield f"Kept in {report.out}: dataset, reward, certificate, agent, metrics and figures."


def _policies(report: Report) -> Table:
    table = Table(title="Under the true reward", title_justify="left", title_style="bold")
    table.add_column("policy")
    for heading in ("value", "score", "mean return (95 %)", "agreement"):
        table.add_column(heading, justify="right")
    for name, row in report.metrics["policies"].items():
        score = "-" if row["score"] is None else f"{row['score']:.3f}"
        interval = "{:.3f} ({:.3f} to {:.3f})".format(*(row[key] for key in ("mean_return", "return_low", "return_high")))
        table.add_row(name, f"{row['value']:.4f}", score, interval, f"{row['agreement']:.1%}")
    table.caption = (
        "value: exact, discounted, from the start. score: random = 0, expert = 1. mean return: undiscounted, sampled. "
        "agreement: share of states with one of the expert's actions."
    )
    table.caption_justify = "left"
    return table


def _reward(report: Report) -> Table:
    reward = report.metrics["reward"]
    table = Table(title="The recovered reward", title_justify="left", title_style="bold", show_header=False)
    table.add_column("what")
    table.add_column("is")
    share = reward["worst_tie_regret_share"]
    of_range = "" if share is None else f", {share:.2%} of expert - random"
    table.add_row("expert optimal under it", "yes" if reward["expert_optimal"] else "NO: see certificate.json")
    table.add_row("worst-tie regret", f"{abs(reward['worst_tie_regret']):.4g}{of_range}")
    lambda_0 = "not computed" if reward["lambda_0"] is None else f"{reward['lambda_0']:.5g}"
    table.add_row("lambda, lambda_0", f"{reward['l1']:.5g}, {lambda_0}")
    cap = reward["margin_cap"]
    table.add_row("margin cap", "none (Ng & Russell's own program)" if cap is None else f"{cap:.4g}")
    gap = reward["duality_gap"]
    table.add_row("margins short of the most by", "unknown" if gap is None else f"at most {max(gap, 0.0):.1e}")
    if reward["least_l1_norm"] is not None:
        above = max(reward["l1_norm"] - reward["least_l1_norm"], 0.0)
        table.add_row("||R||_1", f"{reward['l1_norm']:.4g}, at most {above:.1e} above the least with these margins")
    if reward["marginless_states"]:
        mend = " Try --margin-cap auto." if cap is None else ""
        table.add_row("states where it leaves ties", f"{reward['marginless_states']}: the expert has no margin there.{mend}")
    if reward["inseparable_states"]:
        table.add_row(
            "states it cannot settle",
            f"{reward['inseparable_states']}: there an action has the expert's successors. Try --reward-on state-action.",
        )
    table.caption = (
        "worst-tie regret: what the worst policy greedy under the reward loses. lambda: price of ||R||_1; above lambda_0 R is "
        "0. margin: how much better the expert's action is than another."
    )
    table.caption_justify = "left"
    return table


def _stages(report: Report) -> Table:
    training = report.metrics["training"]
    table = Table(title="Stages", title_justify="left", title_style="bold")
    table.add_column("stage")
    table.add_column("seconds", justify="right")
    table.add_column("environment steps", justify="right")
    for name, record in report.stages.items():
        taken = record.get("environment_steps", 0)
        steps = f"{taken:,}" if taken else ""
        if name == "agent" and taken:
            crossing = training["steps_to_0.9"]
            steps += " (not at score 0.9 to stay)" if crossing is None else f" (score 0.9 or more after {crossing:,})"
        table.add_row(name, f"{record['seconds']:.1f}{' (kept)' if record.get('kept') else ''}", steps)
    return table
