"""Who makes each stage of a run: plain functions, each called where what it needs is there."""

from collections.abc import Callable, Mapping
from typing import Any

from irl_gym.loop import figures, final_stages, stages
from irl_gym.runs.identity import STAGES

Make = Callable[..., Mapping[str, Any]]
"""Makes something of a stage of what it needs, in a folder, and returns what is recorded of it."""
MAKERS: dict[str, tuple[Make, ...]] = dict(
    zip(
        STAGES,
        (
            (stages.planned_expert, stages.recorded_expert),
            (stages.played_episodes, stages.recorded_episodes),
            (stages.learned_outcome,),
            (stages.retrained_agent,),
            (stages.cloned,),
            (stages.metrics,),
            (figures.of_table, figures.returns, figures.learning_curve),
            (final_stages.films, final_stages.grid, final_stages.figures_as_csv),
            (final_stages.diagnosis, final_stages.feasible_set),
            (final_stages.report,),
        ),
        strict=True,
    )
)
"""Who makes each stage, in order: all of them whose needs are there."""
