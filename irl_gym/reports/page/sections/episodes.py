"""Episodes of the expert and of the retrained agent, as the page plays them.

A moment is shown by its picture where the film has some, by a token on the map where states are cells, else by its row in the
table of steps. Pictures that would make the page too large are thinned evenly.
"""

import base64
from collections.abc import Mapping
from typing import Any

from irl_gym.judging.scores import agent_of, called
from irl_gym.reports.page.maps import Map, geometry
from irl_gym.reports.page.sections.absent import EPISODES
from irl_gym.reports.page.sections.section import Section
from irl_gym.runs.films import MOST_BYTES, Film, Moment
from irl_gym.written import counted, sentence_of, state_called, sum_of

ENDS = {
    "terminated": "The episode ends by itself.",
    "truncated": "A time limit ends the episode.",
    "cut": "The film stops before the episode does.",
}


def episodes(films: Mapping[str, Film], place: Map | None, policies: Mapping[str, Any]) -> Section:
    """Films to be played, over the map where they have no pictures."""
    players = []
    for name, film in films.items():
        pictures, of = _pictures(film)
        on_map = not pictures and place is not None and all(one.state is not None for one in film.steps)
        players.append(
            {
                "name": name,
                "pictures": pictures,
                "map": _map(place) if on_map and place is not None else None,
                "moments": [_moment(one, film, of, place if on_map else None) for one in film.steps],
            }
        )
    lead = (
        "One episode of each, from the same kind of start. Play them, or step with the buttons; the slider below each goes to "
        "any moment."
    )
    shown = called(agent_of(policies))
    titles = {"expert": "Expert", "agent": f"{shown[0].upper()}{shown[1:]}"}
    told = [_told(name, titles.get(name, name), film) for name, film in films.items()]
    return Section(*EPISODES, lead, (), "episodes", {"players": told}, {"episodes": {"players": players}})


def _told(name: str, title: str, film: Film) -> dict[str, Any]:
    """The words around a player."""
    last, steps = film.steps[-1], len(film.steps) - 1
    seed = "" if film.seed is None else f" Reset with seed {film.seed}."
    learned = f", return under the learned reward {sum_of(last.learned_total)}" if _paid(film) else ""
    said = f"{counted(steps, 'step')}, true return {sum_of(last.true_total)}{learned}. {ENDS.get(film.ends, '')}{seed}"
    return {
        "name": name,
        "title": title,
        "said": said,
        "last": steps,
        "why": sentence_of(film.without_frames),
    }


def _paid(film: Film) -> bool:
    """Is there a learned reward, and does it pay any step that is known?"""
    return any(one.learned_reward is not None for one in film.steps)


def _pictures(film: Film) -> tuple[list[str], int]:
    """Pictures as data URLs, every first, second, third, ... of them; and that number."""
    size = sum(map(len, film.frames))
    every = max(1, -(-size // MOST_BYTES))
    kept = film.frames[::every]
    return [f"data:image/{film.kind};base64,{base64.b64encode(one).decode()}" for one in kept], every


def _moment(moment: Moment, film: Film, every: int, place: Map | None) -> dict[str, Any]:
    """One row of the table of steps, and what is drawn."""
    told: dict[str, Any] = {
        "text": state_called(moment.text),
        "action": moment.action_name or "",
        "pay": "" if moment.true_reward is None else sum_of(moment.true_reward),
        "learned": "" if moment.learned_reward is None else sum_of(moment.learned_reward, 3),
        "total": sum_of(moment.true_total),
        "learnedTotal": sum_of(moment.learned_total, 3) if _paid(film) else "",
    }
    if film.frames and moment.frame is not None:
        told["picture"] = moment.frame // every
    if place is not None and moment.state is not None and moment.state < place.layout.n_cells:
        told["cell"] = moment.state
    return told


def _map(place: Map) -> Mapping[str, Any]:
    """The map that a token moves over."""
    layout = place.layout
    return {
        **geometry(place),
        "blocked": layout.blocked.astype(int).ravel().tolist(),
        "letters": layout.letters.ravel().tolist(),
    }
