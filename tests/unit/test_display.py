"""How answers look to people, whatever is in them."""

import io

import pytest
from google.protobuf.duration_pb2 import Duration
from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cell_len
from rich.console import Console

from sketchmatch.cli import display, output
from sketchmatch.cli.tables import Column, Rows, plain
from sketchmatch_client import Match
from sketchmatch_proto.v1 import match_pb2, scene_pb2
from sketchmatch_proto.v1.scene_service_pb2 import SegmentResponse

RAW = "\x1b[31mdesk\x1b[0m\nby\tthe \x9bwall\u202e"


def drawn(what, width=80, encoding="utf-8") -> list[str]:
    stream = io.TextIOWrapper(io.BytesIO(), encoding=encoding, errors="sketchmatch.spelled")
    Console(file=stream, width=width, color_system=None).print(what)
    stream.seek(0)
    return [line.rstrip() for line in stream.read().splitlines()]


def scene(*labels):
    return scene_pb2.Scene(objects=[scene_pb2.SceneObject(label=label) for label in labels])


def line(sketch, mapped, **fields):
    return match_pb2.ObjectMatch(
        sketch_object=sketch, map_object=mapped, confidence=0.9, **{"margin": 0.1, **fields}
    )


def answer(**fields):
    return Match(
        match_pb2.MatchAccepted(),
        match_pb2.MatchScenes(sketch=scene("desk", "shelf", ""), map=scene("", "bed", "")),
        match_pb2.MatchResult(
            **{
                "object_matches": [line(0, 0), line(1, 1), line(2, 2)],
                "fmap_confidence": match_pb2.FmapConfidence(total=0.9),
                "outcome": match_pb2.OUTCOME_CONVERGED,
                "scale": 0.0105,
                **fields,
            }
        ),
    )


def shown(match, monkeypatch, width=100, metres=False) -> list[str]:
    said = []
    monkeypatch.setattr(output, "for_people", lambda: True)
    monkeypatch.setattr(output, "show", lambda what: said.extend(drawn(what, width)))
    display.show_match(match, metres, verbose=False)
    return said


# Tables -----------------------------------------------------------------------------------------

TEXTS = st.text(st.sampled_from("ab cé椅🛋…"), max_size=40)
COLUMNS = [
    Column("name", least=8),
    Column("figure", right=True),
    Column("rare", dispensable=2),
    Column("words", least=12, dispensable=1),
    Column("prose", least=20, wraps=True),
]


@given(
    st.lists(st.tuples(*[TEXTS] * len(COLUMNS)), min_size=1, max_size=4),
    st.integers(20, 200),
)
def test_no_line_is_wider_than_the_terminal_and_each_row_has_its_head(rows, width):
    cells = [[plain(text) for text in row] for row in rows]
    lines = drawn(Rows("", COLUMNS, cells), width)
    assert all(cell_len(line) <= width for line in lines)
    table = any(line.startswith("─") for line in lines)
    assert table or width <= 60 or max(map(len, sum(rows, ()))) > 8


def rows(*cells):
    return Rows("", COLUMNS[:4], [[plain(cell) for cell in cells]])


def test_what_has_no_room_goes_in_the_order_in_which_it_matters():
    cells = ("n" * 20, "1.0", "r" * 30, "w" * 30)
    whole = "  ".join(cells)
    assert drawn(rows(*cells), 100)[-1] == f"{'n' * 20}     1.0  {'r' * 30}  {'w' * 30}"
    assert len(whole) > 80
    assert drawn(rows(*cells), 80)[-1] == f"{'n' * 20}     1.0  {'w' * 30}", "rare goes first"
    cells = ("n" * 60, "1.0", "", "w" * 30)
    assert drawn(rows(*cells), 80)[-1] == f"{'n' * 39}…     1.0  {'w' * 30}", "then cells are cut"
    assert drawn(rows(*cells), 60)[1:] == [f"  figure: 1.0, words: {'w' * 30}"]


def test_a_list_leaves_out_what_is_empty():
    assert drawn(rows("desk", "", "", "left"), 60) == ["desk", "  words: left"]


def test_other_encodings_have_tables_of_their_own():
    lines = drawn(rows("Küche", "1°", "", ""), 80, "ascii")
    assert lines[0].split("|")[0].strip() == "name"
    assert lines[-1].startswith("K\\u00fcche")
    assert lines[-1].endswith("1 deg")


# Matches ----------------------------------------------------------------------------------------


@given(st.floats(0.0, 1.0))
def test_no_probability_is_rounded_to_certainty(probability):
    text = display.likely(probability)
    assert text not in ("100 %", "0 %", "100.0 %", "0.0 %")
    number = float(text.strip("<> %"))
    if text[0] not in "<>":
        assert abs(number - 100.0 * probability) <= (0.51 if 1.0 <= number < 99.0 else 0.051)


def test_a_result_without_probability_shows_none(monkeypatch):
    lines = shown(answer(), monkeypatch)
    assert not any("likely" in line or "Probability" in line for line in lines)
    assert not any("place" in line or "maps" in line for line in lines)
    assert any("confidence" in line for line in lines)


def test_probabilities_of_map_and_place_have_a_line_of_their_own(monkeypatch):
    lines = shown(answer(probability=0.4, place_probability=0.9996), monkeypatch)
    assert "Probability 40 %  This place > 99.9 %" in lines
    assert any(line.startswith("Rotation 0°  Scale 0.0105") for line in lines)


def test_where_it_is_probably_another_place_that_is_said_first(monkeypatch):
    apart = answer(place_probability=0.49, ambiguity=ambiguity(2, 1))
    assert shown(apart, monkeypatch)[:2] == [
        "Probably not this place (this place: 49 %)",
        "3 of 3 sketched objects matched",
    ]
    here = answer(place_probability=0.5)
    assert shown(here, monkeypatch)[0] == "3 of 3 sketched objects matched"


def ambiguity(maps, *deciding, alternatives=()):
    return match_pb2.Ambiguity(
        maps=maps, alternatives=alternatives, deciding_sketch_objects=deciding
    )


def test_of_maps_that_are_as_likely_it_is_said_what_to_tell(monkeypatch):
    def asked(k, *labels):
        match = answer(place_probability=0.9, ambiguity=ambiguity(4, k, 0))
        match.scenes.sketch.CopyFrom(scene(*labels))
        return shown(match, monkeypatch)[0]

    begin = "4 object maps fit about equally well; state which mapped object"
    assert asked(1, "desk", "shelf", "") == f"{begin} shelf is (--pin shelf=…)"
    assert asked(2, "desk", "shelf", "") == f"{begin} No. 3 is (--pin 3=…)"
    assert asked(1, "bed", "tea table", "") == f"{begin} tea table is (--pin 2=…)"
    assert asked(1, "bed", "chair", "chair") == f"{begin} chair (2) is (--pin 2=…)"
    assert asked(1, "bed", "7", "") == f"{begin} 7 is (--pin 2=…)"


def test_alternatives_that_share_the_probability_are_as_good_and_say_how_likely_they_are(
    monkeypatch,
):
    others = [
        alternative(0.95, line(0, 2), line(1, 1), line(2, 0), probability=0.02),
        alternative(0.7, line(0, 0), line(1, 2), line(2, 1), probability=0.37),
    ]
    shared = ambiguity(2, 1, 2, alternatives=[1])
    match = answer(alternatives=others, probability=0.4, ambiguity=shared)
    assert shown(match, monkeypatch)[-2:] == [
        "Next best, 2 %, ζ 0.950: on the map desk is No. 3, No. 3 is No. 1",
        "Just as good, 37 %, ζ 0.700: on the map shelf is No. 3, No. 3 is bed",
    ]


def test_sketched_objects_without_partner_are_listed_with_how_likely_that_is(monkeypatch):
    alone = answer(object_matches=[line(1, 1)], unmatched_sketch_objects=[0, 2])
    assert [row.split() for row in shown(alone, monkeypatch)[3:6]] == [
        ["2", "shelf", "2", "bed", "0.900", "0.100"],
        ["1", "desk", "no", "partner"],
        ["3", "no", "partner"],
    ]
    alone.result.unmatched_sketch_probabilities.extend([0.75, 0.9999])
    assert [row.split() for row in shown(alone, monkeypatch)[4:6]] == [
        ["1", "desk", "no", "partner", "75", "%"],
        ["3", "no", "partner", ">", "99.9", "%"],
    ]


def test_in_a_pipe_doubts_go_to_standard_error_and_the_columns_stay(monkeypatch, capsys):
    monkeypatch.setattr(output, "for_people", lambda: False)
    sure = answer(probability=0.9, place_probability=0.9)
    display.show_match(sure, metres=False, verbose=False)
    plain_ = capsys.readouterr()
    assert plain_.err == ""
    assert plain_.out.splitlines()[:2] == [
        "sketch_object\tmap_object\tconfidence\tsketch_label\tmap_label\tprobability",
        "0\t0\t0.9000\t\t\t",
    ]
    sure.result.object_matches[0].probability = 0.00412345
    display.show_match(sure, metres=False, verbose=False)
    assert capsys.readouterr().out.splitlines()[1] == "0\t0\t0.9000\t\t\t0.004123"
    sure.result.object_matches[0].ClearField("probability")
    sure.result.place_probability = 0.004
    sure.result.unmatched_sketch_objects.append(3)
    display.show_match(sure, metres=False, verbose=False)
    told = capsys.readouterr()
    assert told.err == "sketchmatch: Probably not this place (this place: 0.4 %)\n"
    assert told.out == plain_.out


@pytest.mark.parametrize(
    ("radians", "words"),
    [(0.0, "0°"), (0.5, "29° counter-clockwise"), (-0.5, "29° clockwise"), (3.14159, "180°")],
)
def test_a_rotation_says_which_way(radians, words):
    told = dict(display.facts(match_pb2.MatchResult(rotation_radians=radians), metres=False))
    assert told["Rotation"] == words


def test_a_scale_has_its_unit():
    result = match_pb2.MatchResult(scale=0.0105)
    assert dict(display.facts(result, metres=True))["Scale"] == "0.0105 m per sketch unit"
    assert dict(display.facts(result, metres=False))["Scale"] == "0.0105 map units per sketch unit"


def alternative(total, *lines, **fields):
    return match_pb2.AlternativeMap(
        object_matches=lines, fmap_confidence=match_pb2.FmapConfidence(total=total), **fields
    )


def test_other_maps_are_told_by_the_objects_that_differ(monkeypatch):
    others = [
        alternative(0.8991, line(0, 2), line(1, 1), line(2, 0)),
        alternative(0.7, line(0, 0), line(2, 1)),
    ]
    lines = shown(answer(alternatives=others), monkeypatch)
    assert lines[-2:] == [
        "Just as good, ζ 0.899: on the map desk is No. 3, No. 3 is No. 1",
        "Next best, ζ 0.700: on the map shelf has no partner, No. 3 is bed",
    ]


def test_what_is_several_on_one_side_is_told_as_one(monkeypatch):
    groups = [
        match_pb2.ObjectGroup(sketch_objects=[2], map_objects=[1, 2], probability=0.9),
        match_pb2.ObjectGroup(sketch_objects=[0, 1], map_objects=[0]),
    ]
    told = answer(object_groups=groups, unmatched_sketch_objects=[2])
    lines = shown(told, monkeypatch)
    assert lines[-2:] == [
        "As one, 90 %: No. 3 is bed and No. 3 on the map",
        "As one: desk and shelf are No. 1 on the map",
    ]
    assert not any("no partner" in each for each in lines)


def test_a_pair_that_could_be_another_keeps_its_margin_where_there_is_little_room(monkeypatch):
    relation = match_pb2.ObjectRelation(reference_object=1, phrase="to the right of and below it")
    told = {"relation": relation, "probability": 0.5}
    sure = answer(object_matches=[line(0, 0, **told)], probability=0.5)
    open_ = answer(object_matches=[line(0, 0, **told, margin=0.001)], probability=0.5)
    assert "margin" not in shown(sure, monkeypatch, 66)[1]
    assert "margin" in shown(open_, monkeypatch, 66)[1]


def test_progress_shows_no_figure_that_there_is_none_of():
    elapsed = Duration(seconds=3)
    screen = Console(width=100)

    def said(**fields):
        progress = match_pb2.MatchProgress(elapsed=elapsed, **fields)
        return drawn(display._progress(screen, progress), 100)[0]

    begun = said(phase=match_pb2.PHASE_SEARCH)
    assert begun.endswith("searching  3.0 s")
    once = said(confidence=0.5, upper_bound=1.0, iteration=1, evaluations=1)
    assert once.endswith("iteration 1  1 evaluation")
    trivial = said(confidence=0.5, upper_bound=1.0, iteration=2, evaluations=9)
    assert trivial.endswith("3.0 s  ζ 0.5000  iteration 2  9 evaluations")
    assert "ζ 0.5000  ≤ 0.7500" in said(confidence=0.5, upper_bound=0.75)


# Texts of others --------------------------------------------------------------------------------


def test_labels_of_a_careless_server_are_not_obeyed(monkeypatch, capsys):
    match = answer()
    match.scenes.sketch.objects[0].label = RAW
    match.result.object_matches[0].sketch_label = RAW
    match.result.alternatives.append(alternative(0.5, line(0, 1), line(1, 0)))
    match.scenes.sketch_warnings.append(f"{RAW} was left out")
    text = "\n".join(shown(match, monkeypatch))
    assert r"1 \x1b[31mdesk\x1b[0m by the \x9bwall\u202e" in text
    monkeypatch.setattr(output, "for_people", lambda: False)
    display.show_match(match, metres=False, verbose=False)
    piped = capsys.readouterr()
    assert len(piped.out.splitlines()) == 4
    for written in (text, piped.out, piped.err):
        assert not set("\x1b\x9b\u202e") & set(written)


def test_json_keeps_the_labels_and_hides_what_a_terminal_would_obey(capsys):
    found = SegmentResponse(scene=scene(RAW))
    output.write_message(found)
    written = capsys.readouterr().out
    assert not set("\x1b\x9b\u202e") & set(written)
    assert r"\u001b[31mdesk" in written
    assert r"\u009bwall\u202e" in written


def test_what_repeats_is_told_once_and_what_differs_is_told():
    notes = [f"strokes[{k}] ('desk {k}') is a mark." for k in range(100)]
    notes += ["the map has a yaw of nan.", *(f"{k} rooms were left out." for k in (1, 2))]
    assert display.summary_of(notes) == [
        "strokes[0] ('desk 0') is a mark (and 99 more like it)",
        "the map has a yaw of nan.",
        "1 rooms were left out (and 1 more like it)",
        "-v shows all 103 notes",
    ]
    different = [f"note {chr(97 + k)}" for k in range(20)]
    assert display.summary_of(different)[-1] == ("15 other notes; -v shows all 20 notes")
    assert display.summary_of(different[:5]) == different[:5]
