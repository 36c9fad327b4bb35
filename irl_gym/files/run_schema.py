"""What the json files of a run's folder hold, and the check that one does: whoever reads a file gets data of its shape.

A shape says what is read, of what kind; a file may hold more. Numbers are finite, and none is a boolean. Which file has which:

    config.json Config              films/*.json Film                  .stages/*.json RECORDS_OF
    run.json Version                grid.json Grid                     metrics.json metrics_schema.Metrics
    environment.json Environment    expert.json, agent.json Trained    certificate.json metrics_schema.Certificate
    diagnosis.json Diagnosed
"""

import functools
from collections.abc import Mapping
from typing import Annotated, Any, Literal, NotRequired

from pydantic import AfterValidator, ConfigDict, Field, TypeAdapter, ValidationError
from typing_extensions import TypedDict

from irl_gym.errors import DamagedFile
from irl_gym.programs.status import Status


def checked(content: Any, shape: Any) -> Any:
    """Content of json, as it is.

    Args:
        content: of a file.
        shape: one of those below, or of `metrics_schema`.

    Raises:
        DamagedFile: it is none of that shape; the first entry that is not is named, with its value and what was expected.
    """
    try:
        _adapter(shape).validate_python(content, strict=True)
    except ValidationError as error:
        fault = error.errors(include_url=False, include_context=False)[0]
        where, kind = ".".join(map(str, fault["loc"])), fault["type"]
        found = "missing" if kind == "missing" else f"{fault['input']!r:.60}"
        expected = EXPECTED.get(kind) or fault["msg"].removeprefix("Input should be ").removeprefix("Value error, ")
        raise DamagedFile(f"{f'its {where:.200}' if where else 'it'} is {found}: expected {expected}") from error
    return content


EXPECTED = {
    "missing": "it", "dict_type": "an object", "list_type": "a list", "string_type": "a text", "bool_type": "true or false",
    "float_type": "a number", "int_type": "a whole number",
}  # fmt: skip
"""What is said to be expected, by pydantic's kinds of errors; of others it has its own words."""


@functools.cache
def _adapter(shape: Any) -> TypeAdapter:
    return TypeAdapter(shape)


def _a_status(name: str) -> str:
    """Refuse what is the name of no status."""
    known = [one.value for one in Status]
    if name not in known:
        raise ValueError(f"one of {', '.join(known)}")
    return name


LARGEST = 1e150
"""Squares of larger numbers overflow."""
Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0, le=1)]
Count = Annotated[int, Field(ge=0, le=2**53)]
Text = Annotated[str, Field(max_length=100_000)]
Digest = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
Flag = Annotated[str, Field(pattern="^--[a-z]", max_length=200)]
StatusName = Annotated[str, AfterValidator(_a_status)]
Pair = Annotated[list[Count], Field(min_length=2, max_length=2)]


# --- what was asked, who wrote it, where it took place ---


class LearnerEntry(TypedDict):
    """A learner by its class's name; the other fields are its own."""

    type: Text
    r_max: NotRequired[Number]


class Config(TypedDict):
    """config.json, of `Experiment.to_json`."""

    gamma: Share
    seed: int
    env_kwargs: dict[str, Any]
    learner: LearnerEntry
    env_id: NotRequired[Text | None]
    dataset: NotRequired[Text | None]
    epsilon: NotRequired[Share]
    eval_episodes: NotRequired[Count]
    shaping: NotRequired[bool]


class Version(TypedDict):
    """run.json, of `identity.write_version`."""

    irl_gym: Text
    command: list[Text] | None


class EnvironmentFile(TypedDict):
    """environment.json, of `identity.write_environment`."""

    id: Text | None
    observations: Text
    actions: list[Text]


class Trained(TypedDict):
    """The agent in the zip beside, of `SteppedWorld.keep`."""

    algorithm: Text
    epsilon: Share


# --- the records of stages ---


class Start(TypedDict):
    """start.json, of `identity.record_start` and `record_dataset`."""

    files: list[Text]
    sha256: NotRequired[dict[Text, Digest]]
    dataset: NotRequired[Digest]


class Timed(Start):
    """The record of a stage, of `RunFolder.run`."""

    seconds: Annotated[Number, Field(ge=0)]


class Stage(Timed):
    """Of any stage."""

    environment_steps: NotRequired[Count]
    resumed_at: NotRequired[list[Count]]


class Lost(TypedDict, total=False):
    """What a dataset lacks, or what of it was not taken (`endings.LOST`)."""

    dropped: Count
    unseen: Count
    followed: Count
    steps_cut: Count
    episodes_cut: Count


class ShownRecord(Stage, Lost):
    """Of the demonstrations."""

    dataset_id: Text
    episodes: Count
    states_only: NotRequired[bool]
    no_environment: NotRequired[Text]


class ProgramEntry(TypedDict):
    """What is noted of one program, of `solvers.Answer`."""

    status: StatusName
    solver: Text
    seconds: Number
    attempts: Count


class Stats(TypedDict, total=False):
    """What is noted of all of them."""

    programs: dict[str, ProgramEntry]
    rounds: list[Any]
    best_round: Count
    best_by: Text
    exact_planner: bool
    expert_episodes: Count
    episodes_dropped: Count


class Learned(Stage):
    """Of the reward."""

    learner: Text
    status: StatusName
    stats: Stats
    policy: NotRequired[bool]


class Planned(Stage):
    """Of the expert."""

    planner: Text
    trained_return: NotRequired[Number | None]
    vecnormalize: NotRequired[bool]


class Retrained(Timed):
    """Of the agent; of none where the learner gave no reward."""

    planner: NotRequired[Text]
    environment_steps: NotRequired[Count]
    resumed_at: NotRequired[list[Count]]


class Open(Stage):
    """Of what the reward leaves open."""

    no_widths: NotRequired[Text]
    no_path: NotRequired[Text]
    no_ambiguity: NotRequired[Text]


RECORDS_OF: Mapping[str, Any] = {
    "start": Start, "expert": Planned, "demonstrations": ShownRecord, "reward": Learned, "agent": Retrained, "ambiguity": Open,
}  # fmt: skip
"""The shape of a record by its stage's name; of any other stage it is that of `Stage`."""


# --- what is left for who looks ---


def _answered(told: Any) -> Any:
    """Refuse an answer that is not that of the findings."""
    if (told["answer"] == "findings") is not bool(told["findings"]):
        raise ValueError("findings where that is the answer, and else none")
    return told


def _placed(told: Any) -> Any:
    """Refuse a finding whose actions are not those of its states."""
    if len(told["actions"]) not in (0, len(told["states"])):
        raise ValueError("an action for each of its states, or none")
    return told


class _Found(TypedDict):
    name: Text
    sentence: Text
    mend: Text
    states: list[Count]
    actions: list[Count]
    flags: list[Flag]


FindingEntry = Annotated[_Found, AfterValidator(_placed)]
"""A finding of the doctor."""


class _Diagnosed(TypedDict):
    answer: Literal["healthy", "findings", "not examined"]
    why: Text | None
    examined: Text
    findings: list[FindingEntry]


Diagnosed = Annotated[_Diagnosed, AfterValidator(_answered)]
"""diagnosis.json, of `Diagnosis.to_json`."""


class Grid(TypedDict):
    """grid.json, of `GridLayout.to_json`."""

    shape: Annotated[list[Annotated[int, Field(ge=1, le=2**24)]], Field(min_length=2, max_length=2)]
    directions: list[Annotated[list[Literal[-1, 0, 1]], Field(min_length=2, max_length=2)]]
    blocked: list[list[bool]]
    terminal: list[list[bool]]
    letters: list[list[Annotated[str, Field(max_length=1)]]]


class MomentEntry(TypedDict):
    """A time of a film; nothing else is told of it."""

    __pydantic_config__ = ConfigDict(extra="forbid")  # type: ignore[misc]
    text: Text
    state: Count | None
    action: Count | None
    action_name: Text | None
    true_reward: Number | None
    learned_reward: Number | None
    true_total: Number
    learned_total: Number
    frame: Count | None


class FilmFile(TypedDict):
    """films/*.json, of `Film.save`."""

    format: Literal["irl_gym.Film/1"]
    name: Text
    seed: int | None
    ends: Text
    kind: Literal["webp", "png"]
    frames: Count
    without_frames: Text | None
    steps: list[MomentEntry]
