"""What checks the annotations while the tests run: beartype, with an int wherever a float is written (PEP 484).

A test's first 5,000 checks are made, and no more: the loops of a long one would otherwise spend most of its time in them.
"""

import functools

import jaxtyping
from beartype import BeartypeConf, beartype

LIMIT = 5_000
checked = 0
"""Checks of this test; `conftest` sets it to 0 before each."""


def begin():
    """Check annotations again: a test begins."""
    global checked
    checked = 0
    jaxtyping.config.update("jaxtyping_disable", False)


def check(annotated):
    """Check what `annotated` is called with, until this test has had enough."""
    checks = beartype(annotated, conf=BeartypeConf(is_pep484_tower=True))

    @functools.wraps(checks)
    def counted(*args, **kwargs):
        global checked
        checked += 1
        if checked == LIMIT:
            jaxtyping.config.update("jaxtyping_disable", True)
        return checks(*args, **kwargs)

    return counted
