"""Native code that looks at no clock, in a process of its own that is killed when the time is up.

Factors fill up where successors are drawn at random, and one factorisation of such a table can take minutes. Within a limit
(`within`) a call that could take longer than a share of it, were nothing sparse, is made in a child: the same function on the
same arrays, so the same bytes. There is one child for a limit; it starts with the first such call (a third of a second), keeps
what later calls need (factors), and ends with the limit's block, with Ctrl-C, and by itself: when its parent dies (on Linux at
once, elsewhere when it next reads or the time is up). It is started afresh, not forked, and imports the function's module
alone: nothing of the caller's script, and nothing that came from a file.
"""

import builtins
import contextlib
import json
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from typing import Any

from irl_gym.errors import SolverFailed
from irl_gym.programs.deadline import NEVER, Deadline
from irl_gym.programs.native import LONGEST
from irl_gym.programs.piped import receive, send

PACE, SHARE = 1e9, 0.1
"""Operations in a second, and the share of a limit that a call in this process may take at that pace."""
BEGIN = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); from irl_gym.programs import native; "
    "native.serve(float(sys.argv[2]))"
)


class Limited:
    """A limit that is in force, and its child once there is one. `with within(deadline):` makes it."""

    def __init__(self, deadline: Deadline):
        self.deadline, self._late, self._made, self._dropped = deadline, False, 0, list[int]()
        self._process: subprocess.Popen[bytes] | None = None
        self._timer: threading.Timer | None = None

    def long(self, operations: float) -> bool:
        """Could so many operations outlast the share? Where no process can be started, nothing is long."""
        possible = bool(sys.executable) and not getattr(sys, "frozen", False)
        return possible and operations / PACE > SHARE * (self.deadline.seconds or 0.0)

    def ask(self, function: Callable[..., Any] | str, *args: Any, of: int | None = None, keep: bool = False) -> Any:
        """The child's answer: of a function, or of a method of what it keeps; or the number under which it keeps the answer."""
        self.deadline.check()
        dropped, self._dropped = self._dropped, []
        self._made += keep
        name = function if isinstance(function, str) else f"{function.__module__}.{function.__name__}"
        try:
            child = self._process or self._begun()
            assert child.stdin is not None and child.stdout is not None
            send(child.stdin, (dropped, name, args, of, self._made if keep else None))
            error, answer = receive(child.stdout)
        except (EOFError, OSError) as reason:
            if self._late or not self.deadline.left:
                raise self.deadline.late() from reason
            code = None if self._process is None else self._process.wait()
            raise SolverFailed(
                f"the process that solves within {self.deadline.seconds:g} s ended with {code}: expected an answer. Is there "
                "enough memory? Without time_limit the first solver works in this process, and is not ended."
            ) from reason
        if error is not None:
            raise getattr(builtins, error)(answer)
        return self._made if keep else answer

    def forget(self, number: int) -> None:
        """The child need not keep this: it is told with the next question."""
        self._dropped.append(number)

    def close(self) -> None:
        """End the child."""
        if self._timer is not None:
            self._timer.cancel()
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            for pipe in (self._process.stdin, self._process.stdout):
                with contextlib.suppress(OSError):  # what was not written yet
                    pipe.close()  # type: ignore[union-attr]

    def _begun(self) -> subprocess.Popen[bytes]:
        pipe = subprocess.PIPE
        command = [sys.executable, "-I", "-c", BEGIN, json.dumps(list(map(str, sys.path))), repr(self.deadline.until)]
        self._process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL)
        self._timer = threading.Timer(min(self.deadline.left, LONGEST), self._stop)
        self._timer.daemon = True
        self._timer.start()
        return self._process

    def _stop(self) -> None:
        self._late = True
        if self._process is not None:
            self._process.kill()


class Kept:
    """What a child made and keeps; its methods are called there."""

    def __init__(self, limited: Limited, function: Callable[..., Any], *args: Any):
        self._limited, self._number = limited, limited.ask(function, *args, keep=True)

    def __getattr__(self, method: str) -> Callable[..., Any]:
        return lambda *args: self._limited.ask(method, *args, of=self._number)

    def __del__(self) -> None:
        if "_number" in self.__dict__:
            self._limited.forget(self._number)


_CURRENT: ContextVar[Limited | None] = ContextVar("irl_gym_limit", default=None)


@contextlib.contextmanager
def within(deadline: Deadline) -> Iterator[None]:
    """A block in which `called`, `made` and `check_limit` hold a limit.

    In a block of a limit that ends earlier, or of the same, that one stays in force, with its child.
    """
    current = _CURRENT.get()
    if deadline is NEVER or (current is not None and current.deadline.until <= deadline.until):
        yield
        return
    limited = Limited(deadline)
    token = _CURRENT.set(limited)
    try:
        yield
    finally:
        _CURRENT.reset(token)
        limited.close()


def check_limit() -> None:
    """Go on only while the limit in force has time left, if there is one.

    Raises:
        SolverTimeout: the time is up.
    """
    _limited()


def called(operations: float, function: Callable[..., Any], *args: Any) -> Any:
    """function(*args), in a child where so many operations could outlast the limit in force.

    Args:
        operations: at most so many, were nothing sparse.
        function: of a module of ours that imports little.
        args: what `piped` sends.

    Raises:
        SolverTimeout: the time is up.
        SolverFailed: the child died, of memory for instance.
    """
    limited = _limited()
    return limited.ask(function, *args) if limited is not None and limited.long(operations) else function(*args)


def made(operations: float, function: Callable[..., Any], *args: Any) -> Any:
    """The same of what cannot leave the child, where it is then kept: an object whose methods may be called."""
    limited = _limited()
    return Kept(limited, function, *args) if limited is not None and limited.long(operations) else function(*args)


def _limited() -> Limited | None:
    limited = _CURRENT.get()
    if limited is not None:
        limited.deadline.check()
    return limited
