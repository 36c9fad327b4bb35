"""What checks the annotations while the tests run: beartype, with an int wherever a float is written (PEP 484).

In each test the first 20 calls of every function are checked, and no more: a long loop would otherwise spend most of its time
in the checks of the same few functions.
"""

import functools
import inspect

import jaxtyping
from beartype import BeartypeConf, beartype

EACH = 20
test = 0
"""The number of the test that runs; `conftest` goes on to the next."""
_jaxtyped = jaxtyping.jaxtyped


def begin():
    """Check annotations again: a test begins."""
    global test
    test += 1
    jaxtyping.config.update("jaxtyping_disable", False)


def check(annotated):
    """Check what `annotated` is called with."""
    return beartype(annotated, conf=BeartypeConf(is_pep484_tower=True))


def jaxtyped(*, typechecker):
    """What jaxtyping's import hook decorates each function and class with; functions only for so many calls of a test."""
    decorate = _jaxtyped(typechecker=typechecker)

    def decorated(plain):
        if not inspect.isfunction(plain):
            return decorate(plain)
        checked, seen, left = None, 0, EACH

        @functools.wraps(plain)
        def first_calls(*args, **kwargs):
            __tracebackhide__ = True
            nonlocal checked, seen, left
            if seen != test:
                seen, left = test, EACH
            if not left:
                return plain(*args, **kwargs)
            left -= 1
            checked = checked or decorate(plain)  # most of what is imported is never called
            return checked(*args, **kwargs)

        return first_calls

    return decorated


def install():
    """Let the functions of irl_gym be decorated so, whatever imports them."""
    jaxtyping.jaxtyped = jaxtyped
    jaxtyping.install_import_hook("irl_gym", "typechecker.check")
