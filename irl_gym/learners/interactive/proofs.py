"""What is certain of a learner that asks: what it asked, which round is kept and why, and how far it is from the answers."""

from dataclasses import dataclass
from typing import Any

from irl_gym.facts import Fact, counted, plain


@dataclass(frozen=True)
class DaggerProof:
    """What is certain of DAgger's policy."""

    queries: int
    """How often the oracle was asked."""
    rounds: int
    """That were played."""
    most_rounds: int
    """That were allowed."""
    labelled: int | None
    """States in which the oracle answered; None where they are not numbered."""
    contradicted: int
    """Of these, where it did not always answer the same."""
    steps: int | None
    """Of all episodes; None where visits are exact."""
    kept: int
    """The round after which the policy was learned that is kept."""
    chosen_by: str
    """What that round is the best by: value, odds, or nothing (last)."""
    value: float | None
    """Of the policy, exactly; None where the table or the reward is not known."""
    odds: float | None
    """Discounted steps at odds with the oracle, at most; None without a table."""
    acting: float | None
    """Discounted steps of the policy; None without a table."""
    mistakes: float
    """The share of the last round's visits that was labelled otherwise than the policy before it would act."""

    def facts(self) -> tuple[Fact, ...]:
        """What was asked, what is kept, and how it differs from what was answered."""
        states = "" if self.labelled is None else f"in {counted(self.labelled)}, "
        where = f"{states}over {counted(self.rounds, 'round')}"
        seen = "" if self.steps is None else f" of {self.steps:,} steps"
        found = [Fact("oracle", f"asked {counted(self.queries, 'time')}, {where}{seen}")]
        if self.contradicted:
            found.append(Fact("contradictions", f"it did not always answer the same in {counted(self.contradicted)}", "open"))
        why = {"value": f"of the highest value in the table, {self.value or 0:.6g}",
               "odds": "of the fewest steps at odds with the oracle",
               "last": "the last: without a table nothing compares them"}  # fmt: skip
        found.append(Fact("policy kept", f"that after round {self.kept}, {why[self.chosen_by]}"))
        return (*found, self._told_of_odds())

    def _told_of_odds(self) -> Fact:
        label = "at odds with the oracle"
        if self.odds is None or self.acting is None:
            return Fact(label, f"{self.mistakes:.4%} of the last round's steps, before they were learned from", "open")
        if self.odds == 0:
            told = "nowhere that it comes to in the table: whoever acts as the oracle answered is worth the same"
            return Fact(label, f"{told}, under any reward", "good")
        share = self.odds / self.acting
        told = f"{self.odds:.4g} of {self.acting:.4g} discounted steps at most ({share:.2%})"
        if self.contradicted:
            return Fact(label, told, "open")
        most = "against whoever acts as it answered, this loses at most that many times what one other action costs"
        return Fact(label, f"{told}; {most}", "open")

    def to_json(self) -> dict[str, Any]:
        """As json holds it."""
        return plain(self)
