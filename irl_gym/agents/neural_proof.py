"""What was done by `irl_gym.agents.neural_clone`, and what is known of it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from irl_gym.facts import Fact, counted, plain

Epoch = Callable[[int, float, float], None]
"""Called after each epoch with its number from 1, the mean loss of its minibatches, and that of what is held out, or NaN."""


@dataclass(frozen=True)
class NeuralProof:
    """What was done, and how the steps that were held out are imitated: estimates, of states that the expert comes to."""

    steps: int
    """N that were trained on."""
    held_out: int
    """Steps of the episodes that were held out."""
    epochs: int
    """That were trained."""
    kept: int
    """The epoch whose weights were kept."""
    loss: float
    """Mean -log pi(a | s) of the steps that were trained on, nats."""
    held_out_loss: float
    """The same of those held out; NaN of none."""
    held_out_error: float
    """Share of the steps held out in which the policy's own action is another; of continuous actions the mean distance."""
    continuous: bool
    """Are the actions continuous?"""
    parameters: int
    """Of the network that acts."""

    @property
    def brief(self) -> str:
        """How the clone came about, in a few words."""
        return f"cloned from {self.steps + self.held_out:,} steps by a network, in {counted(self.epochs, 'epoch')}"

    def facts(self) -> tuple[Fact, ...]:
        """What it says, in sentences."""
        best = f"{counted(self.epochs, 'epoch')}, of which number {self.kept} was kept"
        told = Fact("learned from", f"{self.steps:,} steps in {best}; {self.parameters:,} parameters")
        loss = Fact("log loss", f"{self.loss:.4g} nats a step that was trained on")
        if not self.held_out:
            return told, loss, Fact("held out", "nothing, so that nothing is known of other steps", "open")
        how = f"its action is {self.held_out_error:.4g} away on average"
        how = how if self.continuous else f"its action is another in {self.held_out_error:.2%} of them"
        return told, loss, Fact("held out", f"{self.held_out:,} steps: {how}; {self.held_out_loss:.4g} nats a step")

    def to_json(self) -> dict[str, Any]:
        """As json holds it."""
        return plain(self)
