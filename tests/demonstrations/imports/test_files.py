"""Files of steps that a first-time user brings: what is wrong with the header, the fields or a word is said plainly."""

import pandas as pd
import pytest
from gymnasium import spaces

from irl_gym.demonstrations.imports.files import closest
from irl_gym.demonstrations.imports.frames import from_frame
from irl_gym.errors import InvalidDemonstrations

LAKE = {"space": spaces.Discrete(16), "n_actions": 4}
LOG = "episode,step,observation,action,done\n0,0,0,1,False\n0,1,4,1,False\n0,2,8,2,True\n"
HEADER, ROWS = LOG.split("\n", 1)


@pytest.fixture
def read(tmp_path):
    def read(text, name="log.csv", **columns):
        (tmp_path / name).write_text(text, encoding="utf-8")
        return from_frame(tmp_path / name, **{"terminated": "done", **columns}, **LAKE)

    return read


HEADERS = {
    "semicolons": (
        LOG.replace(",", ";"),
        r"line 1 of log.csv is 'episode;step;.*': expected commas between the columns, not semicolons. Pass .*sep=';'\)",
    ),
    "semicolons beside decimal commas": ("0;0;0;1;0,5\n", "expected commas between the columns, not semicolons"),
    "tabs": (LOG.replace(",", "\t"), r"not tabs. Let the file end in .tsv, or pass pandas.read_csv\(..., sep='\\t'\)"),
    "bars": (LOG.replace(",", "|"), "expected commas between the columns, not bars"),
    "spaces": (LOG.replace(",", " "), "expected commas between the columns, not spaces"),
    "values": (ROWS, r"line 1 of log.csv is '0,0,0,1,False': expected a header, .* before the values. Write one"),
    "values and a name": ("Ann,0,4,1\nAnn,1,8,1\n", "expected a header, such as .* before the values"),
    "vectors": ('"(1, 2)","[3 4]",run\n', "expected a header, such as .* before the values"),
    "a comment": (
        "# by a robot; 2026\n" + LOG,
        r"line 1 of log.csv is '# by a robot; 2026': expected a header, such as \['episode', .* Delete the comments",
    ),
    "blank lines and a comment": ("\n\n# by a robot\n" + LOG, "line 3 of log.csv is '# by a robot'"),
    "a header in a comment": ("# episode step observation action\n0 0 0 1\n", "Take the '#' away"),
    "nothing": ("", "log.csv is empty: there are no rows, expected a header"),
    "blank lines": ("\n \n\n", "log.csv is empty: there are no rows, expected a header"),
    "a byte order mark": ("\ufeff", "log.csv is empty"),
}


@pytest.mark.parametrize("case", HEADERS)
def test_a_file_without_a_header_is_refused_with_what_it_begins_with(case, read):
    text, message = HEADERS[case]
    with pytest.raises(InvalidDemonstrations, match=message):
        read(text)


def test_commas_in_a_tsv_are_refused(read):
    with pytest.raises(InvalidDemonstrations, match=r"line 1 of log.tsv .* not commas. Let the file end in .csv"):
        read(LOG, "log.tsv")


@pytest.mark.parametrize("text", ["\n \n" + LOG, "\ufeff" + LOG, LOG.replace("\n", "\r\n")])
def test_blank_lines_and_marks_before_the_header_do_no_harm(text, read):
    assert [one.actions.tolist() for one in read(text)] == [[1, 1, 2]]


def test_the_ending_may_be_in_capitals(read):
    assert len(read(LOG, "LOG.CSV")) == 1


def test_columns_may_be_named_by_numbers(read):
    text = "run,0,1,2\n0,0,0,1\n0,1,4,1\n"
    (episode,) = read(text, episode="run", step="0", observation="1", action="2", terminated=None)
    assert episode.observations.tolist() == [0, 4, 4]


def test_a_column_without_a_name_is_called_as_pandas_calls_it(read):
    (episode,) = read(LOG.replace("step", ""), step="Unnamed: 1")
    assert episode.actions.tolist() == [1, 1, 2]


def test_two_columns_of_one_name_in_a_file_are_refused(read):
    with pytest.raises(InvalidDemonstrations, match=r"log.csv has 2 columns 'action': expected one"):
        read(LOG.replace("done", "action"), terminated=None)


@pytest.mark.parametrize(
    "wanted, there, found",
    [
        ("action", ["step", "acton"], "acton"),
        ("action", ["step", "ACTION"], "ACTION"),
        ("action", ["step", " action"], " action"),
        ("observation", ["obs", "act"], "obs"),
        ("action", ["a", "move"], None),
        ("action", [], None),
    ],
)
def test_the_closest_name_is_found(wanted, there, found):
    assert closest(wanted, there) == found


def test_a_missing_column_is_told_with_those_that_exist_and_the_closest(read):
    with pytest.raises(InvalidDemonstrations, match=r"among the columns \['episode', 'step', 'obs', .* observation='obs'\?"):
        read(LOG.replace("observation", "obs"))


WORDS = {
    "action": ("0,1,4,left,False", r"has action 'left': expected numbers. Put a number in place of each word, or read another"),
    "step": ("0,one,4,1,False", "has step 'one': expected numbers. Put a number in place of each word"),
    "observation": ("0,1,kitchen,1,False", r"has observation 'kitchen': expected numbers, such as '\(13, 10, 0\)'. Put"),
    "truth": ("0,1,4,1,perhaps", "has terminated 'perhaps': expected true or false.$"),
}


@pytest.mark.parametrize("column", WORDS)
def test_a_word_among_numbers_is_named_with_its_line(column, read):
    row, message = WORDS[column]
    with pytest.raises(InvalidDemonstrations, match=r"^row 2 \(line 3 of log.csv\) " + message):
        read(LOG.replace("0,1,4,1,False", row))


def test_a_column_of_words_is_refused_at_its_first_row(read):
    with pytest.raises(InvalidDemonstrations, match=r"^row 1 \(line 2 of log.csv\) has reward 'False ': expected numbers"):
        read(LOG.replace("False", '"False "'), reward="done", terminated=None)


def test_a_text_that_is_missing_in_the_first_row_is_named(read):
    text = LOG.replace("0,0,0,1", "0,0,,1").replace("0,1,4", '0,1,"(4)"')
    with pytest.raises(InvalidDemonstrations, match=r"^row 1 \(line 2 of log.csv\) has no observation: .* Fill it in"):
        read(text)


def test_numbers_and_their_texts_in_one_column_of_a_frame_are_read():
    frame = pd.DataFrame({"episode": 0, "step": [0, 1], "observation": pd.Series(["0", 4], dtype=object), "action": 1})
    (episode,) = from_frame(frame, **LAKE)
    assert episode.observations.tolist() == [0, 4, 4]


@pytest.mark.parametrize(
    "text, line", [(LOG.replace("4,1,False", "4,1,False,9"), 3), (LOG.replace("False", "False,9").replace("True", "True,9"), 2)]
)
def test_a_line_with_more_fields_than_the_header_is_named(text, line, read):
    with pytest.raises(InvalidDemonstrations, match=rf"line {line} of log.csv has 6 fields, more fields .*: expected 5. Put"):
        read(text)


def test_a_row_after_a_very_long_field_is_named_without_its_line(read):
    with pytest.raises(InvalidDemonstrations, match=r"^row 2 of log.csv has action 9"):
        read(LOG.replace("False", "x" * 140_000).replace("4,1", "4,9"), terminated=None)


def test_lists_among_texts_are_refused():
    frame = pd.DataFrame({"episode": 0, "step": [0, 1], "observation": pd.Series(["0", [4]], dtype=object), "action": 1})
    with pytest.raises(InvalidDemonstrations, match=r"^row 2 \(index 1\) has observation \[4\] of shape \(1,\)"):
        from_frame(frame, **LAKE)
