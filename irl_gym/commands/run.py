"""Recover a reward from an expert by linear-programming IRL, retrain an agent on it, and say how good the agent is.

For example:
    irl-gym run --env-id Taxi-v4
    irl-gym run --env-id CartPole-v1 --learner trajectory-lp
    irl-gym run --env-id my_env:MyEnv-v0 --seeds 0-4 --out runs/mine
    irl-gym run --env-id FrozenLake-v1 --csv log.csv --observation-columns cell --action-column move
    irl-gym run --dataset irl_gym/taxi-v4-expert-v0 --dataset-root DIR --learner feature-lp
"""

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.text import Text

from irl_gym.commands.arguments import Arguments, parse_reveal, parse_seeds
from irl_gym.commands.learning_arguments import Learning, for_help
from irl_gym.commands.terminal import STOPPED, Show, exit_code, print_error, read_arguments, stage_bars
from irl_gym.errors import InvalidParameter, IrlGymError, RunConflict
from irl_gym.runs.choices import PROGRAM

if TYPE_CHECKING:
    from irl_gym.runs.experiment import Experiment

OTHERS = "the environment or of a learner of your own"
"""Whose code runs in a run besides."""


def command(words: Sequence[str]) -> int:
    """The subcommand: what it exits with."""
    return exit_code(lambda: _called(read_arguments(_kind(words), words, "run", __doc__), words), others=OTHERS)


def main(arguments: Arguments, command: Sequence[str]) -> int:
    """Run the loop and print the report; the command is kept, so that the run can be had again."""
    return _told(arguments, command, Path(), quiet=False)


def several(arguments: Arguments, words: Sequence[str]) -> int:
    """Run one seed after the other, each in a folder of its own, and set those that ended side by side.

    What goes wrong with one is told, and the others are run all the same. The same command continues, as that of one run does.

    Args:
        arguments: with seeds.
        words: of the command line.
    """
    console = Console(soft_wrap=True)
    try:
        seeds = _seeds(arguments)
        with _loading() as show:
            from irl_gym.commands.compare import side_by_side
            from irl_gym.runs.identity import without

            out = arguments.out or Path("runs") / _name(replace(arguments, seed=seeds[0]))
            show("loading", 1.0)
        if (out / "config.json").exists():
            raise RunConflict(f"{out} holds a run: expected a folder for one run a seed. Choose another --out.")
    except (IrlGymError, OSError) as error:
        print_error(error)
        return 2
    codes: dict[Path, int] = {}
    for seed in seeds:
        folder = out / f"seed-{seed}"
        one = replace(arguments, seed=seed, seeds=None, out=folder)
        plain = [*PROGRAM, *without(words, "--seeds", "--out"), "--seed", str(seed), "--out", str(folder)]
        codes[folder] = exit_code(lambda one=one, plain=plain: _told(one, plain, out, quiet=True), others=OTHERS)
        if codes[folder] == STOPPED:
            return STOPPED
    ended = [folder for folder, code in codes.items() if code == 0]
    lost = [folder.name for folder, code in codes.items() if code]
    if lost:
        console.print(Text(f"{', '.join(lost)} did not end, as told above. The same command goes on with what is missing."))
    try:
        if len(ended) > 1:
            side_by_side(ended, out / "compare.html")
    except (IrlGymError, OSError) as error:
        print_error(error)
        return 2
    return max(codes.values())


def _called(arguments: Arguments, words: Sequence[str]) -> int:
    return main(arguments, [*PROGRAM, *words]) if arguments.seeds is None else several(arguments, words)


def _told(arguments: Arguments, command: Sequence[str], shared: Path, *, quiet: bool) -> int:
    """Run the loop, and print its report, or a line.

    Args:
        arguments: of one run.
        command: kept in the run's folder.
        shared: where a dataset that is made of a file is kept for several runs; the empty path for the run's own folder.
        quiet: print the verdict alone.
    """
    console = Console(soft_wrap=True) if quiet else Console()
    try:
        with _loading() as show:
            from irl_gym.judging.shares import judgements
            from irl_gym.loop.pipeline import recover_and_retrain
            from irl_gym.reports.terminal_report import print_report

            show("loading", 1.0)
            asked, out = _kept(arguments, shared)
            report = recover_and_retrain(asked, out, show, command)
        if quiet:
            judged = judgements(report.metrics["policies"], report.metrics["table"])
            console.print(Text(f"seed {asked.seed}, {out}: {judged}"))
        else:
            print_report(report, console)
    except KeyboardInterrupt:
        Console(stderr=True, soft_wrap=True).print(
            "Stopped. The same command continues after the last finished stage, and inside the training of an agent."
        )
        return STOPPED
    except (IrlGymError, OSError) as error:
        print_error(error)
        return 2
    return 0


@contextlib.contextmanager
def _loading() -> Iterator[Show]:
    """How far each stage is, of which the first is told before anything is imported that takes seconds."""
    with stage_bars(Console(stderr=True)) as show:  # so that they are seen where the report is piped
        show("loading", None)
        yield show


def _kept(arguments: Arguments, shared: Path) -> "tuple[Experiment, Path]":
    """The experiment and its folder; a file is made a dataset there, unless it was before."""
    from irl_gym.files.own_files import held
    from irl_gym.files.run_folder import RunFolder
    from irl_gym.runs.choices import parse_keywords
    from irl_gym.runs.identity import claim
    from irl_gym.runs.named_parts import environment_of

    log = arguments.file
    if log.csv is None:
        asked = arguments.experiment()
        return asked, arguments.out or Path("runs") / asked.name
    out = arguments.out or Path("runs") / arguments.learning_from(log.dataset_id, None).experiment().name
    root = (shared if shared.name else out) / "dataset"
    asked = arguments.learning_from(log.dataset_id, str(root)).experiment()
    if not (root / log.dataset_id).exists():
        given = arguments.environment
        env = environment_of(
            given.env_id, parse_keywords(given.env_kwargs), start_seeds=given.start_seeds, reveal=parse_reveal(given.reveal)
        )
        episodes = log.episodes(env)
        with held(out, f"another process works in {out}: wait for it, or choose another --out."):
            claim(out, asked.to_json())
            RunFolder(out, asked.to_json())  # whatever goes wrong from now on, the folder is this run's
            log.write(episodes, env, log.dataset_id, root)
    return asked, out


def _seeds(arguments: Arguments) -> list[int]:
    if arguments.seed:
        raise InvalidParameter(
            f"seed is {arguments.seed} and seeds {arguments.seeds!r}: expected one of them. Leave the other out."
        )
    return parse_seeds(str(arguments.seeds))


def _name(arguments: Arguments) -> str:
    """A folder's name for runs that differ in their seed alone: the environment, and a digest of all that they share."""
    from irl_gym.runs.experiment import digest_of
    from irl_gym.runs.pooling import without_seeds

    log = arguments.file
    asked = (arguments if log.csv is None else arguments.learning_from(log.dataset_id, None)).experiment()
    return f"{asked.name.rpartition('-')[0]}-{digest_of(without_seeds(asked.to_json()))}-seeds"


def _kind(words: Sequence[str]) -> type[Arguments]:
    """The record of the arguments; for --help without the options of other learners than the one that is named."""
    if not {"-h", "--help"} & {*words}:
        return Arguments
    said = " ".join(words).replace("=", " ").split(" ")
    named = [after for word, after in pairwise(said) if word == "--learner"]
    learning = for_help(named[-1] if named else Learning.learner)
    told = {"__doc__": Arguments.__doc__, "__module__": Arguments.__module__, "__annotations__": {"learning": learning}}
    return dataclass(frozen=True)(type("Arguments", (Arguments,), {**told, "learning": field(default_factory=learning)}))
