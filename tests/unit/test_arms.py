"""The arms of the study: what is counted right, what is said of it, and the tables."""

from types import SimpleNamespace

import numpy as np
import pytest

from sketchmatch import Scene
from tests.experiments import arm_tables, judging
from tests.experiments.arms import ARMS, Arm, Judged
from tests.experiments.drawings import Drawing
from tests.experiments.judging import ArmWork, arm_works, drawing_of, judged
from tests.experiments.people import Shapes
from tests.experiments.records import Results
from tests.experiments.report import report

PART = Arm("7 of 20 and 1 extra", 20, missing=1, extra=1)
ELSEWHERE = Arm("8 of another 20", 20, wrong_place=True)
SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])


def row_of(squares):
    return Scene.from_polygons([SQUARE + np.array([2 * k, 0]) for k in range(squares)])


@pytest.fixture
def answered(monkeypatch):
    """Return what lets a match of three objects on five say something, with this truth."""

    def answer(truth, object_map, probabilities=(), *, unmatched=(), others=(), **said):
        asked = []

        def match(sketch, map_, *, searcher, alternatives, **options):
            asked.append((searcher, alternatives, options))
            return SimpleNamespace(
                sketch=sketch,
                map=map_,
                object_map=object_map,
                matches=[
                    SimpleNamespace(sketch_object=k, probability=probability)
                    for k, probability in zip(object_map, probabilities, strict=True)
                ],
                unmatched_sketch_objects=tuple(k for k in range(3) if k not in object_map),
                unmatched_sketch_probabilities=unmatched,
                alternatives=[SimpleNamespace(object_map=o) for o in others][:alternatives],
                **{"probability": 0.5, "place_probability": None, **said},
            )

        drawn = Drawing(row_of(3), row_of(5), np.array(truth))
        monkeypatch.setattr(judging, "match", match)
        monkeypatch.setattr(judging, "drawing_of", lambda *_: drawn)
        return asked

    return answer


def test_an_object_that_is_not_there_is_right_without_a_partner(answered):
    asked = answered([4, -1, 0], {0: 4, 2: 0}, (0.9, 0.8), unmatched=(0.7,))
    found = judged("plain", PART, 3, "default")
    assert (found.objects, found.right, found.perfect, found.among) == (3, 3, True, True)
    assert sorted(found.lines) == [(0.7, True), (0.8, True), (0.9, True)]
    assert asked == [(None, 0, {})]


def test_what_is_wrong_counts_and_many_more_maps_are_asked_for(answered):
    wrong = {"object_map": {0: 4, 1: 2, 2: 0}, "probabilities": (0.9, 0.3, None)}
    asked = answered([4, -1, 0], **wrong, others=[{0: 0}, {0: 4, 2: 0}])
    found = judged("plain", PART, 3, "auto")
    assert (found.objects, found.right, found.perfect, found.among) == (3, 2, False, True)
    assert sorted(found.lines) == [(0.3, False), (0.9, True)]
    assert asked == [("auto", each, {"profile": "thesis"}) for each in (0, 100)]
    answered([4, -1, 0], **wrong, others=[{0: 0}, {0: 4, 2: 1}])
    assert not judged("plain", PART, 3, "auto").among


def test_no_map_of_another_place_is_right_and_no_partner_is(answered):
    said = {"probability": 0.1, "place_probability": 0.2}
    asked = answered([-1, -1, -1], {0: 4}, (0.1,), unmatched=(0.9, 0.8), **said)
    found = judged("plain", ELSEWHERE, 3, "default")
    assert (found.right, found.perfect, found.among) == (2, False, False)
    assert (found.probability, found.place) == (0.1, 0.2)
    assert sorted(found.lines) == [(0.1, False), (0.8, True), (0.9, True)]
    assert len(asked) == 1
    answered([-1, -1, -1], {}, unmatched=(0.9,) * 3)
    assert not judged("plain", ELSEWHERE, 3, "default").perfect


def test_a_real_match_is_judged():
    found = judged("plain", Arm("8 of 8", 8), 0, "auto")
    assert found.perfect
    assert found.among
    assert len(found.lines) == found.objects == 8
    assert 0.0 < found.probability <= min(said for said, _ in found.lines)
    assert found.seconds > 0.0


def test_arms_are_drawn_as_they_say():
    assert ARMS.keys() == {"parts", "places"}
    for arm in (arm for arms in ARMS.values() for arm in arms):
        drawn = drawing_of(arm, "memory", 0)
        assert len(drawn.map) == arm.objects
        shown, where = arm.name.split(",")[0].split(" of ")
        assert str(arm.objects) in where.split()
        known = (drawn.truth >= 0).sum()
        assert known == (0 if arm.wrong_place else int(shown))
        assert len(drawn.scene) == int(shown) + arm.extra
        assert ("extra" in where) == bool(arm.extra)
        assert ("another" in where) == arm.wrong_place
    boxes = next(arm for arm in ARMS["parts"] if arm.shapes is Shapes.BOXES)
    scene = drawing_of(boxes, "plain", 0).scene
    assert {len(item.rings[0]) for item in scene.objects} == {4}


def test_the_method_that_searches_long_gets_fewer_sketches_of_large_maps():
    works = arm_works(("easm", "auto", "default"), 20, ["parts"])
    assert [*works] == ["parts, plain", "parts, memory"]
    for own in works.values():
        counts = {
            (arm, method): sum(w.arm == arm and method in w.methods for w in own)
            for arm in ARMS["parts"]
            for method in ("easm", "auto", "default")
        }
        assert {counts[arm, "default"] for arm in ARMS["parts"]} == {20}
        assert {counts[arm, "auto"] for arm in ARMS["parts"] if arm.objects == 8} == {20}
        assert {counts[arm, "auto"] for arm in ARMS["parts"] if arm.objects > 8} == {2}
        assert {counts[arm, "easm"] for arm in ARMS["parts"]} == {0}
    few = arm_works(("auto",), 1, ["places"])["places, memory"]
    assert [(w.number, w.methods) for w in few] == [(0, ("auto",))] * 4


def test_work_is_done_by_each_method(monkeypatch):
    monkeypatch.setattr(judging, "judged", lambda *what: what)
    work = ArmWork("memory", PART, 5, ("auto", "default"))
    assert work.done() == [("memory", PART, 5, method) for method in ("auto", "default")]


def made(arm=PART, right=8, probability=None, place=None, lines=(), **others):
    values = {"kind": "plain", "number": 0, "method": "default", "among": right == 8, **others}
    return Judged(
        arm=arm,
        objects=8,
        right=right,
        probability=probability,
        place=place,
        lines=lines,
        seconds=0.02,
        **values,
    )


def cells(table, *first):
    """Return the cells of the row that begins so, by column."""
    (row,) = (row for row in table.rows if row[: len(first)] == first)
    return dict(zip(table.header, row, strict=True))


def test_the_table_of_parts_counts():
    records = [
        made(probability=0.9, place=0.8, lines=((1.0, True), (0.5, True))),
        made(probability=0.9, place=0.4, among=True, right=6, lines=((0.5, False), (1.0, True))),
        made(probability=0.9, place=0.9, among=False, right=4),
        made(probability=0.9, place=0.9),
        made(ELSEWHERE, right=0, place=0.9),
        made(kind="memory", method="auto", right=4),
    ]
    table = arm_tables.parts(records)
    own = cells(table, PART.name, "plain", "default")
    assert own["sketches"] == "4"
    assert own["wholly right, %"] == "50.0 [15.0, 85.0]"
    assert own["objects, %"] == f"{100 * 26 / 32:.1f}"
    assert own["right map met, %"] == "75.0"
    assert own["place refused, %"].startswith("25.0 ")
    assert (own["error of map"], own["of lines"], own["of place"]) == ("0.400", "0.000", "0.250")
    assert (own["ms"], own["p95"]) == ("20", "20")
    other = cells(table, "", "memory", "auto")
    assert (other["wholly right, %"], other["right map met, %"]) == ("0.0 [0.0, 79.3]", "0.0")
    assert {other[name] for name in ("place refused, %", "error of map", "of place")} == {"–"}
    assert len(table.rows) == 2


def test_the_table_of_other_places_counts_what_is_believed():
    records = [
        made(ELSEWHERE, right=8, probability=0.6, place=0.97, lines=((0.6, False),)),
        made(ELSEWHERE, right=0, probability=0.2, place=0.6),
        made(ELSEWHERE, right=0, probability=0.0, place=0.0, lines=((1.0, True),)),
        made(ELSEWHERE, right=0, probability=0.0, place=0.03),
        made(probability=0.9, place=0.9),
    ]
    (row,) = arm_tables.places(records).rows
    own = cells(arm_tables.places(records), ELSEWHERE.name, "plain", "default")
    assert [*own.values()] == [*row]
    assert own["place above 0.5, %"].startswith("50.0 ")
    assert own["place above 0.95, %"].startswith("25.0 ")
    assert own["map above 0.5, %"].startswith("25.0 ")
    assert (own["error of map"], own["of lines"], own["of place"]) == ("0.200", "0.300", "0.400")


def test_all_arms_together_mix_right_and_wrong_places():
    records = [
        made(place=0.75),
        made(place=0.45, kind="memory"),
        made(ELSEWHERE, right=0, place=0.75),
        made(ELSEWHERE, right=0, place=0.96, kind="memory"),
    ]
    table = arm_tables.together(records)
    assert [row[0] for row in table.rows] == ["plain", "memory", "both"]
    own = cells(table, "both", "default")
    assert own["sketches"] == "4"
    assert own["right place refused, %"].startswith("50.0 ")
    assert own["wrong above 0.5, %"].startswith("100.0 ")
    assert own["wrong above 0.95, %"].startswith("50.0 ")
    # 0.75 twice, half of them true; 0.45, true; 0.96, false.
    assert own["of place"] == f"{(2 * 0.25 + 0.55 + 0.96) / 4:.3f}"
    assert cells(table, "plain", "default")["of place"] == "0.250"


def test_the_report_has_the_tables_of_what_was_done():
    def titles(records):
        blocks = report(Results({}, ("default",), 1, {"parts, plain": records}))
        return {getattr(block, "title", None) for block in blocks}

    parts, places = "Sketches of parts of a map", "Sketches of other places"
    assert {parts, places} & titles([made(place=0.5)]) == {parts}
    assert {parts, places} & titles([made(ELSEWHERE, place=0.5)]) == {places}
    assert not {parts, places, "All arms together"} & titles([])
