"""Needs: functions are given parts by name, and every stage and section names only parts that there can be, of their types."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Optional

import pytest

from irl_gym.errors import InvalidParameter
from irl_gym.loop.loop import MAKERS, Loop
from irl_gym.loop.table_world import TableWorld
from irl_gym.loop.worlds import SteppedWorld
from irl_gym.reports.page.contents import RunContents
from irl_gym.reports.page.report import SECTIONS, facts
from irl_gym.reports.page.sections.absent import LACKS
from irl_gym.runs.experiment import Experiment
from irl_gym.runs.run import Run
from irl_gym.runs.supply import missing, needs, parts, supplied


@dataclass
class Shelf:
    """A source of two parts, one of which is not there, and of one that must not be looked at."""

    bread: str = "rye"
    butter: str | None = None

    @cached_property
    def cellar(self) -> str:
        raise AssertionError("nobody asked for it")


def plain(bread: str) -> str:
    return bread


def spread(bread: str, butter: str) -> str:
    return bread + butter


def anyway(bread: str, butter: str | None) -> str:
    return f"{bread}, {butter}"


def roasted(bread: str, oven: str) -> str:
    return bread + oven


def test_a_function_is_given_the_parts_that_it_names_and_no_other_is_worked_out():
    assert supplied(plain, Shelf()) == "rye"


def test_the_first_source_that_has_a_part_gives_it_and_what_is_given_comes_before_all():
    assert supplied(plain, Shelf("oat"), Shelf()) == "oat" and supplied(plain, Shelf(), bread="corn") == "corn"


@pytest.mark.parametrize(("function", "lacks"), [(plain, None), (spread, "butter"), (anyway, None)])
def test_a_part_that_is_none_is_missing_where_the_function_cannot_do_without(function, lacks):
    assert missing(function, Shelf()) == lacks


def test_a_part_that_no_source_knows_of_is_an_error_that_names_those_there_are():
    for ask in (missing, supplied):
        with pytest.raises(InvalidParameter, match=r"roasted needs 'oven'.*There can be bread, butter, cellar\."):
            ask(roasted, Shelf())


def suits(asked, there):
    """Does a parameter take what a part may be, or what it is where it is there?"""
    return Any in (asked, there) or Optional[asked] == Optional[there]  # noqa: UP045


def wrong(function, *kinds, given=()):
    known = {name: typed for kind in reversed(kinds) for name, typed in parts(kind).items()}
    asked = {name: typed for name, typed in needs(function).items() if name not in given}
    return [name for name, typed in asked.items() if name not in known or not suits(typed, known[name])]


@pytest.mark.parametrize("make", [make for made in MAKERS.values() for make in made])
def test_a_stage_needs_only_parts_of_the_loop_and_takes_them_as_they_are(make):
    assert wrong(make, Loop, TableWorld, Experiment, given=("folder",)) == []


@pytest.mark.parametrize("show", [*SECTIONS, facts])
def test_a_section_needs_only_parts_of_a_run_and_takes_them_as_they_are(show):
    assert wrong(show, RunContents, Run) == []


def test_what_is_said_of_an_absent_section_is_of_something_that_a_section_needs():
    assert set(LACKS) <= {name for show in SECTIONS for name in needs(show)}


def test_what_only_a_table_has_is_known_of_where_there_is_none():
    assert {"table", "mdp", "states", "true", "layout", "horizon"} <= set(parts(TableWorld)) & set(parts(SteppedWorld))
