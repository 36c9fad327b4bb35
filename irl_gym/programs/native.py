"""Factorisations and linear programs as native code is given them: arrays in, arrays out, and no import that takes long.

A program is cvxpy's, compiled:   minimise c x   subject to   b - A x = 0 in the first rows, >= 0 in the others, and for HiGHS
                                  lower <= x <= upper
"""

import contextlib
import faulthandler
import importlib
import math
import os
import signal
import sys
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import scipy.sparse as sp

from irl_gym.programs.piped import receive, send

LONGEST = 4e6
"""Seconds that every system's timers can wait."""

ERRORS = (ArithmeticError, MemoryError, RuntimeError, ValueError)
"""That a child answers with; any other ends it."""
NativeProgram = tuple[np.ndarray, Any, np.ndarray, int, np.ndarray | None, np.ndarray | None]
"""c (n,), A (m, n) by columns, b (m,), the number of rows that are equations, lower and upper (n,), None for none."""


def factors(matrix: Any) -> Any:
    """Of a matrix (S, S), by columns, whose diagonal dominates each row.

    So no pivots are sought; that order halves the factors of SuperLU's default.
    """
    from scipy.sparse.linalg import splu

    return splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})


def singular_values(matrix: np.ndarray) -> np.ndarray:
    """(K,) of a matrix."""
    return np.linalg.svd(matrix, compute_uv=False)


def clarabel(program: NativeProgram, options: dict[str, Any], until: float) -> Any:
    """What Clarabel says of a program, as cvxpy reads it."""
    import clarabel as module

    solver: Any = module
    c, A, b, equations, _, _ = program
    settings = solver.DefaultSettings()
    settings.verbose = False
    for name, value in options.items():
        setattr(settings, name, value)
    if until < math.inf:
        settings.time_limit = max(until - time.monotonic(), 0.0)
    cones = [solver.ZeroConeT(equations)] if equations else []
    cones += [solver.NonnegativeConeT(b.size - equations)] if b.size > equations else []
    found = solver.DefaultSolver(sp.csc_array((c.size, c.size)), c, A, b, cones, settings).solve()
    return SimpleNamespace(
        status=str(found.status), solve_time=found.solve_time, iterations=found.iterations, obj_val=found.obj_val,
        x=np.array(found.x), z=np.array(found.z), s=np.array(found.s),
    )  # fmt: skip


def highs(program: NativeProgram, options: dict[str, Any], until: float) -> Any:
    """What HiGHS says of a program, as cvxpy reads it."""
    import highspy

    from irl_gym.programs.silent_highs import SilentHighs

    c, A, b, equations, lower, upper = program
    lp: Any = highspy.HighsLp()
    lp.num_row_, lp.num_col_ = A.shape
    lp.col_cost_, lp.row_upper_ = c, b
    lp.row_lower_ = np.where(np.arange(b.size) < equations, b, -highspy.kHighsInf)
    lp.col_lower_ = np.full(c.size, -highspy.kHighsInf) if lower is None else lower
    lp.col_upper_ = np.full(c.size, highspy.kHighsInf) if upper is None else upper
    lp.a_matrix_.format_ = highspy.MatrixFormat.kColwise
    lp.a_matrix_.start_, lp.a_matrix_.index_, lp.a_matrix_.value_ = A.indptr, A.indices, A.data
    solver: Any = SilentHighs()
    for name, value in options.items():
        solver.setOptionValue(name, value)
    solver.passModel(lp)
    if until < math.inf:
        solver.setOptionValue("time_limit", max(until - time.monotonic(), 0.0))
    solver.run()
    status, info, solution = solver.getModelStatus().name, solver.getInfo(), solver.getSolution()
    return {
        "model_status": status,
        "run_time": solver.getRunTime(),
        "info": SimpleNamespace(**{name: getattr(info, name) for name in dir(info) if name.endswith(("_count", "_value"))}),
        "solution": SimpleNamespace(col_value=np.array(solution.col_value), row_dual=np.array(solution.row_dual)),
        "dual_ray": (None, None, np.array(solver.getDualRay()[2])) if status == "kInfeasible" else None,
    }


def serve(until: float) -> None:
    """A child's life: questions from its standard input, answers to its standard output, which is no other code's here."""
    signal.signal(signal.SIGINT, signal.SIG_DFL if os.name == "nt" else signal.SIG_IGN)  # the parent's is what counts
    asked, answers = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
        if sys.platform == "linux":
            import ctypes

            ctypes.CDLL(None).prctl(1, int(signal.SIGKILL))  # PR_SET_PDEATHSIG
        kept = dict[int, Any]()
        left = min(max(until - time.monotonic(), 0.0) + 1, LONGEST)
        faulthandler.dump_traceback_later(left, file=nowhere, exit=True)  # by a thread in C: also within native code
        with contextlib.suppress(EOFError, OSError):  # the parent is gone
            while True:
                dropped, name, args, of, number = receive(asked)
                for one in dropped:
                    del kept[one]
                module, _, function = name.rpartition(".")
                answer = _answered(getattr(kept[of] if of is not None else importlib.import_module(module), function), args)
                if number is not None and answer[0] is None:
                    kept[number], answer = answer[1], (None, None)
                send(answers, answer)


def _answered(function: Callable[..., Any], args: tuple[Any, ...]) -> tuple[str | None, Any]:
    try:
        return None, function(*args)
    except ERRORS as error:
        return next(kind.__name__ for kind in ERRORS if isinstance(error, kind)), str(error)
