"""Export episodes of any expert in any environment with discrete actions as a Minari dataset.

A million steps take seconds, in memory that does not grow; an export that was stopped or killed goes on with the same command.

For example:
    irl-gym export --env-id FrozenLake-v1 --env-kwargs map_name=8x8 --steps 1000000 --dataset-id lake/best-v0
    irl-gym export --env-id CartPole-v1 --expert ppo --epsilon 0.1 --dataset-id cart/noisy-v0 --format arrow
    irl-gym export --env-id FrozenLake-v1 --csv log.csv --observation-columns cell --dataset-id me/log-v0
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Annotated, Any, Literal

from rich.console import Console
from rich.text import Text

from irl_gym.commands.arguments import parse_reveal
from irl_gym.commands.csv_columns import Log
from irl_gym.commands.terminal import UNSET, exit_code, print_error, read_arguments, stage_bars
from irl_gym.errors import InvalidParameter, IrlGymError
from irl_gym.facts import counted

OF_EXPERT = (
    "max_states", "expert", "expert_normalize", "epsilon", "episodes", "steps", "max_episode_steps", "total_timesteps", "gamma",
    "seed", "states_only",
)  # fmt: skip
"""Options that a file leaves nothing to say of."""


@dataclass(frozen=True)
class Arguments:
    """Export episodes of any expert in any environment with discrete actions as a Minari dataset."""

    env_id: str
    """A registered environment; module:id for one of another package."""
    dataset_id: str
    """namespace/name-v0; an id that is taken is never overwritten."""
    env_kwargs: Annotated[tuple[str, ...], UNSET] = ()
    """What the environment is made with: name=value ..., or one json object."""
    start_seeds: Annotated[tuple[int, ...], UNSET] = ()
    """Draw the layouts of resets from these seeds only; 0 fixes the layout of a MiniGrid environment."""
    reveal: tuple[str, ...] = ("known",)
    """Hidden integers that the observation shall show: name=number of values ...; known for those known to be hidden; none."""
    max_states: Annotated[int | None, UNSET] = None
    """States that an enumeration may find."""
    expert: str = "value-iteration"
    """value-iteration, on the table; ppo, dqn or a2c, trained here; random; or a file: SB3's zip, or an npz of actions."""
    expert_normalize: Annotated[str | None, UNSET] = None
    """Statistics of its observations, of a zip trained under SB3's VecNormalize: the file of its save, or an npz."""
    epsilon: float = 0.0
    """Probability of a uniformly random action in place of the expert's."""
    episodes: Annotated[int | None, UNSET] = None
    """How many; the default is 1,000, or as many as the steps take."""
    steps: Annotated[int | None, UNSET] = None
    """Stop after the episode in which this number of steps is reached."""
    max_episode_steps: Annotated[int | None, UNSET] = None
    """Truncate longer episodes; the default is the environment's own limit, or 500 where it has none."""
    total_timesteps: Annotated[int | None, UNSET] = None
    """Environment steps that an agent is trained for."""
    gamma: float = 0.99
    """Discount that the expert plans or learns with, between 0 and 1."""
    seed: int = 0
    """Of everything that is drawn: the same seed gives the same episodes."""
    states_only: bool = False
    """Leave the actions out, as if they had not been recorded."""
    format: Literal["hdf5", "arrow"] = "hdf5"
    """One file; or a folder an episode, which needs the extra `data`."""
    root: Annotated[Path | None, UNSET] = None
    """Minari's root folder; the default is the one in force."""
    file: Log = field(default_factory=Log)
    """Or episodes in a file, in place of an expert's."""

    def check_no_expert(self) -> None:
        """Check that nothing is asked of an expert, where the episodes are in a file.

        Raises:
            InvalidParameter: something is.
        """
        for one in fields(self):
            if one.name in OF_EXPERT and getattr(self, one.name) != one.default:
                raise InvalidParameter(
                    f"csv is {self.file.csv}, but {one.name} is {getattr(self, one.name)!r}: expected the episodes of the file "
                    "as they are. Leave the others out."
                )


def command(words: Sequence[str]) -> int:
    """The subcommand: what it exits with."""
    asked = read_arguments(Arguments, words, "export", __doc__)
    return exit_code(lambda: main(asked), others="the environment")


def main(arguments: Arguments) -> int:
    """Export, and say what there is."""
    console = Console(soft_wrap=True)
    try:
        dataset, lost = exported(arguments)
    except KeyboardInterrupt:
        Console(stderr=True).print("Stopped. The same command continues after the last episodes written.")
        return 130
    except IrlGymError as error:
        print_error(error)
        return 2
    size = dataset.storage.metadata["dataset_size"]
    held = f"{counted(dataset.total_episodes, 'episode')}, {counted(dataset.total_steps, 'step')}"
    console.print(f"{dataset.id}: {held}, {size:,.1f} MB, at", end=" ")
    console.print(Text(str(Path(dataset.storage.data_path).parent)))
    if lost:
        console.print(Text(f"{lost} Who learns from it names one with --env-id."))
    return 0


def exported(arguments: Arguments) -> tuple[Any, str | None]:
    """The dataset, of an expert's episodes or of a file's; and what it cannot say of where they were recorded.

    Raises:
        IrlGymError: no such environment, expert or file, or an id that is taken.
    """
    from irl_gym.commands.demonstrating.demonstrators import Recording, StatesAlone
    from irl_gym.demonstrations.datasets import described
    from irl_gym.demonstrations.export import Amount, export_dataset
    from irl_gym.demonstrations.minari_files import unkept
    from irl_gym.runs.choices import parse_keywords
    from irl_gym.runs.named_parts import environment_of

    amount = Amount(1_000 if arguments.episodes is None and arguments.steps is None else arguments.episodes, arguments.steps)
    recording = Recording(
        arguments.expert, arguments.gamma, arguments.epsilon, arguments.seed, arguments.max_episode_steps,
        arguments.total_timesteps, arguments.max_states, arguments.expert_normalize,
    )  # fmt: skip
    keywords, reveal = parse_keywords(arguments.env_kwargs), parse_reveal(arguments.reveal)
    env = environment_of(arguments.env_id, keywords, start_seeds=arguments.start_seeds, reveal=reveal)
    lost = unkept(env.spec)
    if arguments.file.csv is not None:
        arguments.check_no_expert()
        episodes = arguments.file.episodes(env)
        how = {"data_format": arguments.format}
        return arguments.file.write(episodes, env, arguments.dataset_id, arguments.root, **how), lost
    metadata = {**recording.metadata(arguments.env_id), "code_permalink": "irl-gym export"}
    if lost:
        metadata["description"] += f" {lost}"
    about = described(
        arguments.dataset_id, None if lost else env, env.observation_space, env.action_space, arguments.format, metadata
    )
    kind, plan = (StatesAlone, {"states_only": True}) if arguments.states_only else (lambda one: one, {})
    with stage_bars(Console(stderr=True)) as show:  # so that they are seen where the rest is piped
        dataset = export_dataset(
            lambda folder: kind(recording.demonstrator(env, folder, lambda share: show("expert", share))),
            about, amount, recording.plan(env) | plan, root=arguments.root, on_progress=show,
        )  # fmt: skip
    return dataset, lost
