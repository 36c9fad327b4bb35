"""What became of a program: a name that records keep, and what a person is told of it."""

import enum


class Status(enum.Enum):
    """What became of a program. Its value is a name, which records keep: `Status("zero").sentence`."""

    sentence: str
    """What that is, for a person, with the mend."""
    usable: bool
    """Does the reward say something: is there any to be paid?"""

    OPTIMAL = "optimal", True, "Optimal within the solver's tolerances."
    LEARNED = "learned", True, "Learned; no program was solved."
    INACCURATE = (
        "inaccurate",
        True,
        "Solved, but short of the solver's tolerances. Read the proof's duality gap; if it is too large, choose the "
        "other solver.",
    )
    ZERO = (
        "zero",
        False,
        "R = 0 is optimal: the l1 penalty is above lambda_0, where no reward is worth its price. Lower l1 below lambda_0, or "
        "make it auto.",
    )
    ZERO_WEIGHTS = (
        "zero-weights",
        False,
        "R = 0 is optimal, alpha = 0: no reward in the span of the features is worth more. Lower l1, or give features that "
        "tell the expert's successors from other actions'.",
    )
    INEXPRESSIBLE = (
        "inexpressible",
        True,
        "No reward in the span of the features makes the expert optimal, but those that tie it with everything; this one "
        "violates least. Give more or other features.",
    )

    def __new__(cls, name: str, usable: bool, sentence: str) -> "Status":
        """A member, by its name."""
        member = object.__new__(cls)
        member._value_, member.usable, member.sentence = name, usable, sentence
        return member
