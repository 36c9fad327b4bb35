"""Facts: printed one below the other, and read from files as untrusted text."""

import pytest

from irl_gym.errors import DamagedFile
from irl_gym.facts import LONGEST_SENTENCE, MOST_FACTS, Fact, aligned, facts_of

KEPT = {"label": "tied", "sentence": "in 1 state", "mood": "open"}


def test_facts_come_back_as_they_were_kept():
    facts = (Fact("tied", "in 1 state", "open"), Fact("margins", "none"))
    assert facts_of([one.to_json() for one in facts]) == facts


def test_sentences_stand_one_below_the_other():
    assert aligned([Fact("a", "one"), Fact("longer", "two")]) == "a        one\nlonger   two"


def test_what_a_terminal_would_obey_is_spelled_out():
    found = facts_of([{**KEPT, "label": "\x1b[2Jtied", "sentence": "yes\nno\u202e"}])
    assert found == (Fact("\\x1b[2Jtied", "yes\\nno\\u202e", "open"),)


@pytest.mark.parametrize(
    ("told", "why"),
    [
        (None, "facts are None: expected a list"),
        ([KEPT] * (MOST_FACTS + 1), f"expected a list of at most {MOST_FACTS}"),
        ([KEPT, "yes"], r"facts\[1\] is 'yes': expected a label, a sentence and a mood"),
        ([{**KEPT, "more": 1}], r"facts\[0\] is .*: expected a label, a sentence and a mood"),
        ([{**KEPT, "sentence": 1}], r"facts\[0\] has the sentence 1: expected text"),
        ([{**KEPT, "sentence": "x" * (LONGEST_SENTENCE + 1)}], f"expected text of at most {LONGEST_SENTENCE} characters"),
        ([{**KEPT, "mood": "great"}], r"has the mood 'great': expected one of good, open, bad, plain"),
        ([{**KEPT, "mood": ["good"]}], r"has the mood \['good'\]: expected one of"),
    ],
)
def test_what_is_no_fact_is_refused(told, why):
    with pytest.raises(DamagedFile, match=why):
        facts_of(told)
