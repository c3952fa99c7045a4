"""Names are cleaned where they are set, whoever sets them."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch.io.geojson import decode_geojson
from sketchmatch.io.stroke_json import decode_strokes
from sketchmatch.model import LabelledPolygon, Scene, SceneObject, Stroke
from sketchmatch.model.labels import cleaned_label, compare_labels
from tests.pace import within

SQUARE = [[0, 0], [1, 0], [1, 1], [0, 1]]
CLEANED = {
    "desk": "desk",
    "  two  blanks ": "two blanks",
    "writing\n      desk": "writing desk",
    "shelf\tleft\r\nside": "shelf left side",
    "a\u2028b\u2029c\x85d\x0be": "a b c d e",
    "\x1b[31mred\x1b[0m": "red",
    "\x1b]0;a title\x07desk": "desk",
    "\x1b]8;;http://x\x1b\\link\x1b]8;;\x1b\\": "link",
    "\x9b31mred": "red",
    "\x1bc\x1b(Bdesk": "desk",
    "\x1b[31": "31",
    "de\0sk\x7f\x08": "desk",
    "\u202edesk\u202c\u2066x\u2069\u200f": "deskx",
    "\ufeffdesk\u200b\u00ad": "desk",
    "\ud800desk": "\ufffddesk",
    "\ud83d\ude00": "😀",
    "👩\u200d🔧 می\u200cخواهم": "👩\u200d🔧 می\u200cخواهم",
    "Tür 机 ~é": "Tür 机 ~é",
    "[bold]x[/bold]": "[bold]x[/bold]",
}


@pytest.mark.parametrize("given_", CLEANED, ids=ascii)
def test_a_label_is_one_line_that_a_terminal_obeys_in_nothing(given_):
    assert cleaned_label(given_) == CLEANED[given_]


def test_what_is_no_text_is_written_as_text():
    assert [cleaned_label(value) for value in (None, 0, 1.5, np.str_("a\nb"))] == [
        "",
        "0",
        "1.5",
        "a b",
    ]


@given(
    st.text(st.characters(codec=None), max_size=30)
    | st.text("\x1b[]0;m\x07\\ \ud800\udc00a", max_size=12)
)
def test_every_label_can_be_written_and_is_as_clean_as_can_be(text):
    label = cleaned_label(text)
    assert cleaned_label(label) == label
    assert label.encode("utf-8").decode("utf-8") == label
    assert label == " ".join(label.split())
    assert not any(c < " " or "\x7f" <= c < "\xa0" for c in label)


def test_whoever_sets_a_label_it_is_cleaned():
    raw, clean = "a\n\x1b[1mb\ud800", "a b\ufffd"
    assert SceneObject.from_rings([SQUARE], raw).label == clean
    assert Scene.from_polygons([SQUARE, SQUARE], [raw, "x"]).labels == (clean, "x")
    assert Stroke(np.zeros((2, 2)), label=raw).label == clean
    assert LabelledPolygon((np.array(SQUARE),), raw).label == clean
    strokes = {"strokes": [{"points": [[0, 0]], "label": raw}]}
    assert decode_strokes(json.dumps(strokes)).strokes[0].label == clean
    feature = {"type": "Polygon", "coordinates": [SQUARE]}
    feature = {"type": "Feature", "geometry": feature, "properties": {"name": raw}}
    assert decode_geojson(json.dumps(feature)).polygons[0].label == clean


@pytest.mark.parametrize("opening", ["\x9d", "\x90", "\x1b]", "\x9b", "\x1b[", "\x1b "])
def test_escape_sequences_that_never_end_are_looked_at_once(opening):
    with within(2.0):
        cleaned = cleaned_label(f"desk{opening * 100_000}")
    assert cleaned.isprintable()
    assert cleaned.startswith("desk")


def test_an_escape_sequence_ends_where_another_begins():
    assert cleaned_label("a\x9db\x9dc\x07d") == "abd"


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("chair", "Chair"),
        ("chairs", "chair"),
        ("CHAIRS", "chair 2"),
        ("chair2", "chair #12"),
        ("shelves", "shelf"),
        ("knives", "knife"),
        ("stoves", "stove"),
        ("batteries", "battery"),
        ("movies", "movie"),
        ("boxes", "box"),
        ("glasses", "glass"),
        ("buses", "bus"),
        ("houses", "house"),
        ("couches", "couch"),
        ("potatoes", "potato"),
        ("shoes", "shoe"),
        ("people", "person"),
        ("old  desks", "Old desk"),
        ("coffee-table", "coffee tables"),
        ("room 101", "ROOM 101"),
        ("caf\xe9", "Cafe\N{COMBINING ACUTE ACCENT}"),
        ("3", "3"),
    ],
)
def test_labels_mean_the_same_but_for_case_plural_and_count(one, other):
    assert compare_labels([one], [other]).tolist() == [[1]]
    assert compare_labels([other], [one]).tolist() == [[1]]


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("chair", "armchair"),
        ("desk", "old desk"),
        ("bases", "bass"),
        ("glas", "glass"),
        ("room 101", "room 102"),
        ("room 101", "room"),
        ("caf\xe9", "cafe"),
        ("3", "4"),
        ("कुर्सी", "करस"),
    ],
)
def test_other_labels_mean_other_things(one, other):
    assert compare_labels([one], [other]).tolist() == [[-1]]


def test_synonyms_mean_the_same_in_any_number_and_groups_that_share_one_are_one():
    synonyms = [("couch", "sofa"), ("desk", "bureau"), ("sofas", "Settee")]
    found = compare_labels(["Couches", "bureau 2"], ["settee", "desk", "sofa", "bed"], synonyms)
    assert found.tolist() == [[1, -1, 1, -1], [-1, 1, -1, -1]]


def test_an_object_without_a_label_is_compared_with_none():
    found = compare_labels(["desk", ""], ["", "desk", "bed"])
    assert found.tolist() == [[0, 1, -1], [0, 0, 0]]
    assert found.dtype == np.int64
    assert not found.flags.writeable


@pytest.mark.parametrize("side", [["", ""], []])
def test_nothing_is_compared_where_a_side_has_no_labels(side):
    assert compare_labels(side, ["desk"]) is None
    assert compare_labels(["desk"], side) is None


def test_labels_as_long_as_a_file_are_compared_in_time():
    label = "_" * 100_000 + "1" * 100_000 + " " * 100_000
    with within(5):
        compare_labels([label], [label[:-1]], [(label, "x")])
