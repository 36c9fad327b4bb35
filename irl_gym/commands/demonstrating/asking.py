"""A person as oracle: DAgger asks at the keyboard what is to be done where the learner goes itself.

Gated, the learner acts after a first round that is the person's, and the person watches: enter lets it act; any action takes
over, is done, and is what it learns (HG-DAgger). Else every step is asked about, and what is done is the learner's own. Answers
are kept as they are given: where the keyboard is closed in the middle the same command goes on, from the same question.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import gymnasium as gym
import numpy as np

from irl_gym.agents.neural_clone import NeuralClone
from irl_gym.commands.demonstrating.keyboard import HELP, QUIT, Controls, described
from irl_gym.commands.demonstrating.playing import Turn
from irl_gym.demonstrations.minari_files import dataset_name
from irl_gym.environments.generative import GenerativeModel
from irl_gym.errors import NotDiscrete
from irl_gym.files.own_files import held, write_arrays
from irl_gym.learners.base import Outcome
from irl_gym.learners.cloning.clone import Clone
from irl_gym.learners.interactive.dagger import DAgger
from irl_gym.learners.interactive.labelled import write_labelled
from irl_gym.learners.problem import Oracle, Problem, Spaces
from irl_gym.loop.table_world import step_limit
from irl_gym.runs.experiment import digest_of
from irl_gym.spaces.states import StateIndex

Gating = Literal["own", "gated"]
LET = ("enter", ".")
"""Keys that let the learner act."""
UNUSED = 0.5
"""A discount, which a generative model carries: where episodes are played and nothing is judged, nothing is discounted."""


class Left(Exception):
    """The person left, or the keyboard was closed."""


@dataclass(eq=False)
class Person:
    """Who is asked, and who takes over."""

    stage: gym.Env
    """What is stepped meanwhile, and drawn."""
    controls: Controls
    """Which key is which action."""
    keys: Iterator[str]
    """As they are pressed."""
    show: Callable[[Turn], None]
    """Draws, and prints what is said."""
    _taken: int | None = field(default=None, init=False)

    @property
    def help(self) -> str:
        """The keys."""
        return f"{self.controls} Where the learner would act: it may ({' '.join(LET)})."

    def __call__(self, observation: Any, info: Mapping[str, Any]) -> int:
        """What the person does, or did when it took over just now.

        Raises:
            Left: no more keys come.
        """
        taken, self._taken = self._taken, None
        if taken is not None:
            return taken
        chosen = self._asked(observation, "What is to be done?", lets=False)
        assert chosen is not None
        return chosen

    def gate(self, observation: Any, info: Mapping[str, Any], action: int) -> bool:
        """Does the person take over? With what, it says when it is asked; errors as there."""
        self._taken = self._asked(observation, f"The learner is about to do: {self.controls.names[action]}.", lets=True)
        return self._taken is not None

    def _asked(self, observation: Any, question: str, *, lets: bool) -> int | None:
        words = described(self.stage, observation)
        place = f"{words[0].upper()}{words[1:]}. " if words else ""
        self.show(Turn(None if self.stage.render_mode is None else self.stage.render(), f"{place}{question}"))
        for key in self.keys:
            action = self.controls.action(key)
            if key.lower() == QUIT:
                break
            if lets and key in LET:
                return None
            if action is not None:
                return action
            self.show(Turn(None, self.help if key == HELP else f"{key!r} is no key here: {HELP} shows them."))
        raise Left


@dataclass(frozen=True)
class Questions:
    """What is asked of a person."""

    env_id: str
    """Of the environment."""
    env_kwargs: Mapping[str, Any]
    """What it is made with."""
    rounds: int
    """At most."""
    episodes: int
    """A round."""
    labels: Gating
    """Of all steps, or of those in which the person takes over."""
    seed: int
    """Of episodes."""

    @property
    def folder(self) -> Path:
        """Where it is kept, if nobody says: no other command has the same."""
        return Path("runs") / f"{dataset_name(self.env_id, 'asked').rpartition('/')[2][:-3]}-{digest_of(vars(self))}"

    def learner(self, spaces: Spaces, limit: int) -> DAgger:
        """Clones numbered states by counting, and others by a network."""
        numbered = spaces.states is not None
        ask = "unseen" if numbered and self.labels == "own" else "always"
        clone: Any = Clone() if numbered else NeuralClone(held_out=0.0)
        return DAgger(self.rounds, clone, episodes=self.episodes, max_episode_steps=limit, labels=self.labels, ask=ask)

    def learned(self, plain: gym.Env, person: Person, out: Path) -> Outcome:
        """What is learned, and kept in a folder: policy.npz or policy.zip, and the episodes as a Minari dataset in labels/.

        Raises:
            Left: the person left; what was answered is in the folder.
            RunConflict: another process works in the folder, or it holds answers to other questions.
        """
        try:
            states = StateIndex(plain.observation_space)
        except NotDiscrete:
            states = None
        spaces = Spaces(plain.observation_space, plain.action_space, states)
        known = Problem(spaces, oracle=Oracle(person, gate=person.gate), dynamics=GenerativeModel(plain, UNUSED))
        with held(out, f"another process works in {out}: wait for it, or choose another --out."):
            learner = self.learner(spaces, step_limit(plain))
            found = learner.learn(known, np.random.default_rng(self.seed), out / "answers", person.stage)
            if isinstance(found.policy, np.ndarray):
                write_arrays(out / "policy.npz", {"probabilities": found.policy})
            else:
                found.policy.save(out / "policy.zip")
            root = out / "labels"
            if not root.exists():
                root.mkdir()
                write_labelled(found.labelled, dataset_name(self.env_id, "labels"), plain, root=root,
                               observation_space=plain.observation_space, action_space=plain.action_space)  # fmt: skip
        return found


def answers_in(out: Path) -> int:
    """How many answers a folder holds."""
    kept = out / "answers" / "answers.txt"
    return kept.read_text("ascii").count("\nask ") + kept.read_text("ascii").startswith("ask ") if kept.exists() else 0
