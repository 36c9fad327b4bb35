"""Play an environment with the keyboard; your episodes become a Minari dataset to learn from.

For example:
    irl-gym play --env-id Taxi-v4 --episodes 3 --dataset-id me/taxi-v0 --root data
    irl-gym play --env-id CartPole-v1 --mode window
    echo ddsssd | irl-gym play --env-kwargs is_slippery=false --episodes 1 --root data
    irl-gym play --as-oracle --env-kwargs is_slippery=false --episodes 1
"""

import io
import os
import shlex
import shutil
import signal
import sys
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from irl_gym.commands.terminal import UNSET, exit_code, print_error, read_arguments
from irl_gym.errors import IrlGymError

if TYPE_CHECKING:
    from irl_gym.commands.demonstrating.playing import Play, Turn

ENDINGS = {signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)}
"""Ctrl-C, a kill, a terminal that is closed: nothing that was finished is lost."""


@dataclass(frozen=True)
class Arguments:
    """What is played, where it is shown, and where it is kept."""

    env_id: str = "FrozenLake-v1"
    """A registered environment with Discrete actions; module:id for one of another package."""
    env_kwargs: Annotated[tuple[str, ...], UNSET] = ()
    """What the environment is made with: name=value ..., or one json object."""
    episodes: int = 5
    """Episodes to finish; q ends sooner."""
    dataset_id: Annotated[str | None, UNSET] = None
    """namespace/name-v0; the default is named after the environment, in its first free version."""
    root: Annotated[str | None, UNSET] = None
    """Minari's root folder; the default is Minari's own."""
    mode: Literal["terminal", "window"] = "terminal"
    """Show it in the terminal, or in a window."""
    keys: Annotated[str, UNSET] = ""
    """Keys of your own, such as "w=3,a=0,space=2": key=action, counted from 0. Press ? to see all."""
    seed: int = 0
    """Of the first attempt; each further one has the next."""
    keep_unfinished: bool = False
    """Keep the episode that you break off at the end, as a truncated one."""
    as_oracle: bool = False
    """Be asked by a learner, DAgger: you play the first round, then watch it, and take over where it errs."""
    rounds: int = 3
    """Of --as-oracle: rounds of as many episodes as --episodes says; after each it learns."""
    labels: Literal["own", "gated"] = "gated"
    """Of --as-oracle: it acts until you take over (gated); or you are asked at each step, and it acts as it would (own)."""
    out: Annotated[str | None, UNSET] = None
    """Of --as-oracle: folder of your answers, from which the same command goes on, and of what was learned."""


def command(words: Sequence[str]) -> int:
    """The subcommand: what it exits with."""
    asked = read_arguments(Arguments, words, "play", __doc__)
    return exit_code(lambda: main(asked), others="the environment")


def show(keys: str, turns: "list[Turn]", mode: str) -> None:
    """Draw turns and print what is said; on a terminal from its top, with the keys below."""
    from irl_gym.commands.demonstrating.playing import Turn
    from irl_gym.commands.demonstrating.screens import as_text, draw

    if mode == "window":
        draw(turns)
        turns = [Turn(None, turn.said) for turn in turns]
    colours, size = sys.stdout.isatty(), shutil.get_terminal_size()
    lines = [as_text(turn, size.columns, size.lines - 6, colours=colours) for turn in turns]
    if colours and sys.stdin.isatty() and any(turn.frame is not None for turn in turns):
        lines = ["\x1b[H\x1b[2J" + lines[0], *lines[1:], *(() if keys in lines[-1] else (keys,))]
    print(*lines, sep="\n\n", flush=True)


def play_on(play: "Play", mode: str) -> None:
    """Play until the game is over or no more keys come."""
    from irl_gym.commands.demonstrating.screens import terminal_keys, window_keys

    said = str(play.controls)
    show(said, [play.start()], mode)
    with closing(window_keys() if mode == "window" else terminal_keys()) as keys:
        for key in keys:
            show(said, play.press(key), mode)
            if play.over:
                return


def be_asked(asked: Arguments) -> int:
    """Answer a learner's questions, and say what it learned."""
    from irl_gym.commands.demonstrating.asking import Left, Person, Questions, answers_in
    from irl_gym.commands.demonstrating.keyboard import controls_of
    from irl_gym.commands.demonstrating.playing import stage
    from irl_gym.commands.demonstrating.screens import terminal_keys, window_keys
    from irl_gym.runs.choices import parse_keywords

    given = parse_keywords(asked.env_kwargs)
    plain, shown = stage(asked.env_id, given, asked.mode)
    task = Questions(asked.env_id, given, asked.rounds, asked.episodes, asked.labels, asked.seed)
    out = task.folder if asked.out is None else Path(asked.out)
    for ending in ENDINGS:
        signal.signal(ending, signal.default_int_handler)
    with closing(window_keys() if asked.mode == "window" else terminal_keys()) as keys:
        person = Person(shown, controls_of(plain, asked.keys), keys, lambda turn: show(person.help, [turn], asked.mode))
        print(person.help, end="\n\n")
        try:
            found = task.learned(plain, person, out)
        except (Left, KeyboardInterrupt) as end:
            print(f"Answers that are kept in {out}: {answers_in(out)}. The same command goes on.")
            return 1 if isinstance(end, Left) else 130
    print(*(f"{one.label}: {one.sentence}." for one in found.facts()), sep="\n")
    kept = next(one for one in (out / "policy.npz", out / "policy.zip") if one.exists())
    print(f"What was learned is in {kept}, and the episodes with your answers in {out / 'labels'}. Its own episodes:")
    words = ["irl-gym", "export", "--env-id", asked.env_id, *(("--env-kwargs", *asked.env_kwargs) if asked.env_kwargs else ())]
    print(f"    {shlex.join([*words, '--expert', str(kept), '--episodes', '100', '--dataset-id', 'irl_gym/learned-v0'])}")
    return 0


def main(asked: Arguments) -> int:
    """Play, write what was finished, and say how to learn from it."""
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")  # pygame greets on standard output
    from irl_gym.commands.demonstrating.keyboard import controls_of
    from irl_gym.commands.demonstrating.playing import Play, free_dataset, learn_command, stage, write_played
    from irl_gym.demonstrations.minari_files import unkept
    from irl_gym.runs.choices import parse_keywords

    code = 0
    if asked.mode == "terminal":
        os.environ.setdefault("SDL_VIDEODRIVER", "dummy")  # pictures for a terminal need no display
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a terminal that knows no arrows gets question marks
    try:
        if asked.as_oracle:
            return be_asked(asked)
        plain, shown = stage(asked.env_id, parse_keywords(asked.env_kwargs), asked.mode)
        play = Play(
            shown, controls_of(plain, asked.keys), asked.episodes, seed=asked.seed, keep_unfinished=asked.keep_unfinished
        )
        dataset_id = free_dataset(asked.dataset_id, plain, asked.root)
        for ending in ENDINGS:
            signal.signal(ending, signal.default_int_handler)
        try:
            play_on(play, asked.mode)
        except KeyboardInterrupt:
            code = 130
        finally:
            for ending in ENDINGS:  # a second Ctrl-C does not interrupt the writing
                signal.signal(ending, signal.SIG_IGN)
            parting = play.stop()
            if play.episodes:
                write_played(play, dataset_id, plain, asked.root)
    except IrlGymError as error:
        print_error(error)
        return 2
    print(*filter(None, (parting,)), sep="\n", end="\n" if parting else "")
    if not play.episodes:
        print("No episode was finished, so there is no dataset.")
        return code or 1
    returns = ", ".join(f"{episode.total_reward:g}" for episode in play.episodes)
    print(f"Dataset {dataset_id} is written. Episodes: {len(play.episodes)}. Returns: {returns}. Learn from it with")
    print(f"    {learn_command(dataset_id, asked.root, asked.env_id if unkept(plain.spec) else None)}")
    return code
