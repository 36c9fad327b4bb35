"""Films as the page plays them: to their end, and no larger than a film may be."""

import base64
from dataclasses import replace

import pytest
from reports.page.made_runs import stepped_run

from irl_gym.loop import filming
from irl_gym.reports.page.sections import episodes as pages
from irl_gym.reports.page.sections.episodes import episodes
from irl_gym.runs.films import MOST_BYTES


@pytest.fixture
def film(tmp_path):
    return stepped_run(tmp_path).films["agent"]


def test_a_long_film_is_played_to_its_end(film):
    long = replace(film, steps=(*film.steps[:1], *film.steps[1:2] * 2_500))
    section = episodes({"agent": long}, None, {"retrained": {}})
    played = section.script["episodes"]["players"][0]
    assert section.shown["players"][0]["last"] == 2_500 and len(played["moments"]) == 2_501


def test_pictures_that_are_too_large_for_a_film_are_thinned(film):
    large = replace(film, frames=tuple(bytes([i]) * (MOST_BYTES // 4) for i in range(12)))
    played = episodes({"agent": large}, None, {"retrained": {}}).script["episodes"]
    pictures = [base64.b64decode(one.partition(",")[2]) for one in played["players"][0]["pictures"]]
    assert sum(map(len, pictures)) <= MOST_BYTES and [one[0] for one in pictures] == [0, 3, 6, 9]


def test_the_size_of_a_film_is_one_number():
    assert filming.MOST_BYTES is pages.MOST_BYTES is MOST_BYTES
