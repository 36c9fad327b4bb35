"""A yard: what a fixed piece of plain Python costs on this machine, so that a bar of speed is a ratio within one run."""

import time


def yard() -> float:
    """Processor seconds of two million rounds of a loop, the least of five: about a twentieth of a second today.

    Processor seconds do not grow when another program takes its turn.
    """

    def once():
        began, total = time.process_time(), 0
        for k in range(2_000_000):
            total += k & 3
        return time.process_time() - began

    return min(once() for _ in range(5))
