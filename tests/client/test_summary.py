"""What answers print."""

from copy import deepcopy

import pytest

from sketchmatch_client import Match, MatchCollector, Progress, summary
from sketchmatch_proto.v1 import match_pb2, scene_service_pb2
from sketchmatch_proto.v1.match_service_pb2 import MatchResponse
from tests.contract.golden import golden

STREAM = [golden(f"MatchResponse.{kind}") for kind in ("accepted", "scenes", "progress", "result")]


def finished(*events) -> Match:
    collector = MatchCollector(None)
    for event in events:
        collector.add(event)
    return collector.match()


@pytest.fixture
def grouped() -> Match:
    return finished(*map(deepcopy, STREAM))


@pytest.fixture
def match(grouped) -> Match:
    """Return the same match with objects one by one."""
    grouped.result.ClearField("object_groups")
    return grouped


def test_a_match_shows_itself_in_a_line(match):
    result = STREAM[-1].result
    assert repr(match) == (
        f"<Match: 2 of 3 sketched objects matched, "
        f"FMAP confidence {result.fmap_confidence.total:.3f}, "
        f"OMAP confidence {result.omap_confidence:.3f}, "
        f"probability {result.probability:.3f}, this place {result.place_probability:.3f}, "
        "2 maps about as likely, ask what 0 bed is, ITERATION_LIMIT>"
    )


def test_a_match_says_where_it_is_probably_another_place(match):
    match.result.place_probability = 0.499
    match.result.ClearField("ambiguity")
    line = repr(match)
    assert line.startswith(
        "<Match: probably not this place (this place: 0.499): 2 of 3 sketched objects matched, "
    )
    assert "this place 0" not in line
    match.result.place_probability = 0.5
    assert repr(match).startswith("<Match: 2 of 3 sketched objects matched, ")
    assert "probability 0.365, this place 0.500, ITERATION_LIMIT" in repr(match)


def test_a_match_prints_a_small_table(match):
    headline, heads, *rows = str(match).splitlines()
    assert str(match).isascii(), "any terminal can take it"
    assert headline == repr(match).removeprefix("<Match: ").removesuffix(">")
    assert heads.split("  ")[0] == "in the sketch"
    first, second = match.result.object_matches
    assert rows[0].split() == [
        *("1", first.sketch_label, "3", first.map_label),
        *(f"{first.confidence:.3f}", f"{first.probability:.3f}", f"{first.margin:.3f}"),
    ]
    assert rows[1].split()[:4] == ["2", second.sketch_label, "0", second.map_label]
    assert rows[2].split() == ["0", "bed", "no", "partner", "0.575"]
    match.result.ClearField("unmatched_sketch_probabilities")
    assert str(match).splitlines()[-1].split() == ["0", "bed", "no", "partner"]


def test_objects_that_are_one_together_are_said_to_be_and_not_without_partner(grouped):
    headline, _, *rows = str(grouped).splitlines()
    assert headline.startswith("3 of 3 sketched objects matched, ")
    assert "no partner" not in str(grouped)
    assert [row.split("  ")[0] for row in rows[2:]] == ["0 bed + 1 desk", "2 shelf"]
    assert rows[2].split()[-5:] == ["3", "rack", "as", "one", "0.735"]
    assert rows[3].endswith("0 table + 1 bar + 2 bunk      as one")
    grouped.result.object_groups[0].sketch_objects[:] = [1]
    assert str(grouped).startswith("2 of 3 sketched objects matched, ")
    assert str(grouped).splitlines()[4].split()[:4] == ["0", "bed", "no", "partner"]


def test_a_result_without_its_scenes_names_objects_by_number(match):
    headline, _, *rows = summary(match.result).splitlines()
    assert "ask what 0 is, " in headline
    assert rows[2].split() == ["0", "no", "partner", "0.575"]


def test_a_match_is_the_same_table_in_a_notebook(match):
    match.result.object_matches[0].sketch_label = "<b>"
    picture, _, table = match._repr_html_().partition("<pre>")
    assert table == f"{str(match).replace('<b>', '&lt;b&gt;')}</pre>"
    assert picture.startswith("<svg ")
    assert picture.endswith("</svg>")


def test_a_match_has_none_where_there_is_no_value():
    bare = finished(MatchResponse(result=match_pb2.MatchResult()))
    assert (bare.probability, bare.upper_bound) == (None, None)
    assert (bare.place_probability, bare.ambiguity) == (None, None)
    assert "probability" not in repr(bare)
    assert "place" not in repr(bare)


def test_a_match_has_the_numbers_of_its_result(match):
    result = match.result
    assert match.fmap_confidence == result.fmap_confidence.total > 0
    assert match.omap_confidence == result.omap_confidence > 0
    assert match.probability == result.probability > 0
    assert match.place_probability == result.place_probability > match.probability
    assert match.ambiguity == result.ambiguity
    assert match.ambiguity.maps == 2
    assert match.upper_bound == result.upper_bound > 0
    assert match.outcome == "ITERATION_LIMIT"


def test_an_outcome_of_later_is_a_number():
    later = finished(MatchResponse(result=match_pb2.MatchResult(outcome=99)))
    assert later.outcome == "99"
    assert repr(later).endswith(", 99>")


def test_a_long_match_prints_its_first_lines():
    result = match_pb2.MatchResult()
    for k in range(30):
        result.object_matches.add(sketch_object=k, map_object=k, sketch_label="a\nb\x1b" * 30)
    lines = str(finished(MatchResponse(result=result))).splitlines()
    assert len(lines) == 2 + 20 + 1
    assert lines[2].startswith("0 a b?a b?")
    assert "..." in lines[2]
    assert lines[-1] == "... and 10 more"


def test_a_certainty_is_not_rounded_up_to():
    result = match_pb2.MatchResult(probability=0.9996)
    assert "probability >0.999," in summary(result)
    result.probability = 1.0
    assert "probability 1.000," in summary(result)


def test_progress_has_none_until_there_is_a_value():
    begun = Progress(match_pb2.MatchProgress(phase=match_pb2.PHASE_SEGMENT))
    assert (begun.fraction, begun.confidence, begun.upper_bound) == (None, None, None)
    assert (begun.iteration, begun.evaluations, begun.object_map) == (0, 0, {})
    assert repr(begun) == "<Progress: SEGMENT, 0.00 s>"
    first = match_pb2.MatchProgress(phase=match_pb2.PHASE_SEARCH, confidence=0.5, evaluations=1)
    assert repr(Progress(first)) == "<Progress: SEARCH, 0.00 s, confidence 0.500, 1 evaluation>"


def test_progress_reads_as_its_message():
    message = STREAM[2].progress
    progress = Progress(message)
    assert progress == message
    assert progress == Progress(message)
    assert progress != Progress(match_pb2.MatchProgress())
    for field, value in message.ListFields():
        assert getattr(progress, field.name) == value
    assert progress.HasField("confidence")
    assert progress.object_map == {1: 3, 2: 0}
    assert repr(progress) == (
        "<Progress: SEARCH, 1.25 s, 62%, confidence 0.710, 1300 evaluations, at most 0.930>"
    )


def test_a_stream_can_be_printed_event_by_event():
    assert [summary(event).splitlines()[0] for event in STREAM] == [
        f"accepted as {STREAM[0].accepted.match_id}, seed {2**53 + 1}",
        "3 sketched objects, 4 mapped ones",
        "SEARCH, 1.25 s, 62%, confidence 0.710, 1300 evaluations, at most 0.930",
        summary(STREAM[-1].result).splitlines()[0],
    ]
    assert summary(MatchResponse()) == ""


def test_objects_that_were_found_are_a_table():
    found = golden("SegmentResponse")
    title, heads, *rest = summary(found).splitlines()
    assert title == f"{len(found.scene.objects)} objects, by {found.segmenter.name}"
    assert heads.split() == ["object", "area", "x", "y"]
    assert rest[len(found.scene.objects) :] == list(found.warnings)
    assert rest[0].split()[-3:] == [
        f"{value:.4g}"
        for item in found.scene.objects[:1]
        for value in (item.area, item.centroid.x, item.centroid.y)
    ]


def test_a_catalogue_is_a_table_of_all_its_algorithms():
    catalogue = golden("ListAlgorithmsResponse")
    _, _, *rows = summary(catalogue).splitlines()
    assert len(rows) == len(catalogue.algorithms)
    for row, algorithm in zip(rows, catalogue.algorithms, strict=True):
        assert algorithm.name in row
        assert (" *" in row) == algorithm.is_default


def test_other_messages_are_what_they_print():
    request = scene_service_pb2.SegmentRequest(profile="proof")
    assert summary(request) == str(request)
