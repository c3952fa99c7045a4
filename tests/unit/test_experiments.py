"""The experiments: scenes, simulated sketches, the truth about them, and what is counted."""

import base64
import dataclasses
import io
import math
import re
import signal
import subprocess
import sys
from statistics import mean
from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from PIL import Image

from sketchmatch import Scene
from sketchmatch.model import Stroke, StrokeSet
from sketchmatch.pipeline.describe import describe
from sketchmatch.pipeline.relate import relate
from sketchmatch.pipeline.slices import finish
from sketchmatch_builtin.histograms.constant import ConstantForce
from sketchmatch_builtin.similarities.cross_correlation import CrossCorrelation
from tests.experiments import __main__ as program
from tests.experiments import cases as case_module
from tests.experiments import document, protocol, study, thesis
from tests.experiments.arms import ARMS
from tests.experiments.calibrate import calibrated
from tests.experiments.cases import NOTHING, CaseName, Record, Removal, answer, cases, evaluate
from tests.experiments.claims import CONFIRMED, IN_PART, REFUTED, claims
from tests.experiments.intervals import wilson
from tests.experiments.methods import METHODS, Method
from tests.experiments.people import EXTRA, Person, Shapes, draw, with_extras
from tests.experiments.records import Results, chosen, interval_by_sketch, share
from tests.experiments.reliability import by_chance, reliability
from tests.experiments.report import report
from tests.experiments.runs import Work, run
from tests.experiments.scenes import PLACES, charted, place_named, truth_by_overlap
from tests.experiments.study import Style, sketch
from tests.processes import assert_all_end, children_of

pytestmark = pytest.mark.slow

NEAT = Person(0.3)


def squares(*corners):
    return Scene.from_polygons([np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) + c for c in corners])


def untimed(records):
    return [dataclasses.replace(record, seconds=0.0) for record in records]


def test_scenes_stand_free_of_walls_and_of_each_other():
    assert {name: len(place.furniture) for name, place in PLACES.items()} == {"A": 8, "B": 7}
    for place in PLACES.values():
        room = shapely.Polygon(place.room)
        pieces = [item.polygon for item in place.furniture.objects]
        for k, piece in enumerate(pieces):
            assert room.contains(piece.buffer(0.5))
            assert all(piece.distance(other) > 0.5 for other in pieces[:k])


@pytest.mark.parametrize("name", PLACES)
def test_the_grid_has_every_object_where_it_is(name):
    place = PLACES[name]
    grid = charted(place, 0)
    assert sorted(grid.furniture) == [*range(len(place.furniture))]
    for item, piece in zip(grid.scene.objects, grid.furniture, strict=True):
        truth = place.furniture.objects[piece]
        assert math.dist(item.centroid, truth.centroid) < 0.25
    outlines = [np.array(item.rings[0]) for item in charted(place, 1).scene.objects]
    assert len(outlines[0]) != len(grid.scene.objects[0].rings[0]) or not np.array_equal(
        outlines[0], grid.scene.objects[0].rings[0]
    )


def test_truth_by_overlap():
    furniture = squares([0, 0], [3, 0], [6, 0])
    seen = squares([5.9, 0.1], [0.1, 0.0], [3.7, 0.0])
    assert truth_by_overlap(seen, furniture).tolist() == [2, 0, -1]


def test_without_strength_the_room_is_drawn_to_scale():
    room = PLACES["A"].furniture
    strokes = draw(room, Person(0.0), np.random.default_rng(3))
    centres = {s.label: shapely.Polygon(s.points).centroid for s in strokes.strokes}
    true = {item.label: item.polygon.centroid for item in room.objects}
    for a in room.labels:
        for b in room.labels:
            assert centres[a].distance(centres[b]) == pytest.approx(
                true[a].distance(true[b]), abs=0.2
            )
    assert list(centres) != list(true)


def test_strength_is_how_far_sketches_leave_the_truth():
    confidences = []
    for strength in (0.3, 1.0, 2.0):
        style = Style(Person(strength))
        found = [case for k in range(8) for case in cases("B", k, style)]
        confidences.append(mean(evaluate(case, "auto").true_zeta for case in found))
    assert confidences[0] > 0.95 > confidences[1] > 0.88 > confidences[2]


NO_DIALS = ("strength", "small", "upright", "shapes")
DIALS = [f.name for f in dataclasses.fields(Person) if f.name not in NO_DIALS]


@pytest.mark.parametrize("dial", DIALS)
def test_every_dial_does_something(dial):
    room = PLACES["A"].furniture
    still = dict.fromkeys(DIALS, 0.0)
    drawn = [
        draw(room, person, np.random.default_rng(1)).strokes[0].points
        for person in (Person(1.0, **still), Person(1.0, **{**still, dial: 0.3}))
    ]
    assert drawn[0].shape != drawn[1].shape or np.abs(drawn[0] - drawn[1]).max() > 0.005


def test_what_stands_apart_is_drawn_apart():
    for seed in range(5):
        strokes = draw(PLACES["A"].furniture, Person(2.0), np.random.default_rng(seed)).strokes
        pieces = [shapely.Polygon(stroke.points).buffer(-0.05) for stroke in strokes]
        assert not any(a.intersects(b) for k, a in enumerate(pieces) for b in pieces[:k])


@pytest.mark.parametrize("shapes", Shapes)
def test_shapes(shapes):
    room = PLACES["A"].furniture
    person = Person(0.0, shapes=shapes)
    strokes = draw(room, person, np.random.default_rng(0)).strokes
    areas = {stroke.label: shapely.Polygon(stroke.points).area for stroke in strokes}
    hulls = {s.label: shapely.convex_hull(shapely.LineString(s.points)).area for s in strokes}
    for item in room.objects:
        assert areas[item.label] == pytest.approx(item.area, rel=0.2)
    is_solid = areas["desk"] > 0.93 * hulls["desk"]
    assert is_solid == (shapes is not Shapes.OUTLINES)


def test_things_drawn_small_keep_their_places():
    room = PLACES["A"].furniture
    for small in (1.0, 0.4):
        person = Person(0.0, small=small, upright=True)
        drawn = {s.label: s.points for s in draw(room, person, np.random.default_rng(2)).strokes}
        offset = drawn["desk"].mean(axis=0) - room.objects[room.labels.index("desk")].centroid
        for item in room.objects:
            outline = shapely.convex_hull(shapely.LineString(drawn[item.label]))
            hull = shapely.convex_hull(item.polygon)
            assert outline.area == pytest.approx(small**2 * hull.area, rel=0.25)
            centre = np.array(shapely.Polygon(drawn[item.label]).centroid.coords[0])
            assert centre - item.centroid == pytest.approx(offset, abs=0.25)


def test_the_turned_sketches_of_small_things_are_the_upright_ones():
    work = protocol.experiments(("fsnn-pso", "auto"), 20, ["small"])
    upright, turned = (work[title] for title in protocol.SMALL_TITLES)
    assert len(upright) == len(turned) == 2 * 5
    for one, other in zip(upright, turned, strict=True):
        assert one.style == Style(study.SMALL)
        assert dataclasses.replace(other, style=one.style) == one
        assert other.style.paper == pytest.approx(137.5 * (one.number + 1) % 360)
        assert one.methods == ("fsnn-pso", "fsnn-folded", "auto")


def test_people_who_draw_small_have_the_parts_of_zeta_that_the_thesis_prints():
    thesis_, *ways = (line for line in calibrated().parts if line.drawn != "thesis, with (a)")
    person = f"{study.SMALL.small:g} times as large, strength {study.SMALL.strength:g}"
    nearest = min(
        ways,
        key=lambda way: math.dist(
            (way.similarity, way.others), (thesis_.similarity, thesis_.others)
        ),
    )
    assert nearest.drawn == person
    found = [
        case.confidence(case.true_map)
        for place in PLACES
        for k in range(6)
        for case in cases(place, k, Style(study.SMALL))
    ]
    assert mean(one.similarity for one in found) == pytest.approx(0.797, abs=0.03)
    assert mean(one.rotation + one.dilation for one in found) == pytest.approx(1.91, abs=0.03)


def test_things_that_are_not_there_stand_clear():
    room = PLACES["B"].furniture
    more = with_extras(room, 2, np.random.default_rng(5))
    assert more.labels[7:] == (f"{EXTRA} 1", f"{EXTRA} 2")
    pieces = [item.polygon for item in more.objects]
    assert all(a.distance(b) > 0.3 for k, a in enumerate(pieces[7:], 7) for b in pieces[:k])


def test_sketches_are_numbered():
    one, again = (sketch(PLACES["A"], 4, Style()) for _ in range(2))
    for a, b in zip(one.scene.objects, again.scene.objects, strict=True):
        np.testing.assert_array_equal(a.rings[0], b.rings[0])
    others = (
        sketch(PLACES["A"], 5, Style()),
        sketch(PLACES["A"], 4, Style(seed=1)),
    )
    for other in others:
        assert other.scene.bounds != one.scene.bounds


@pytest.mark.parametrize(("missing", "extra"), [(0, 0), (1, 0), (2, 0), (0, 1), (1, 2)])
def test_missing_and_extra_objects(missing, extra):
    found = sketch(PLACES["A"], 0, Style(missing=missing, extra=extra))
    assert (found.lost, found.invented) == (0, 0)
    assert (found.furniture == -1).sum() == extra
    drawn = found.furniture[found.furniture >= 0]
    assert len(set(drawn.tolist())) == 8 - missing
    labels = [found.scene.labels[k] for k in np.flatnonzero(found.furniture >= 0)]
    assert labels == [PLACES["A"].furniture.labels[k] for k in drawn]


def test_what_segmentation_loses_or_invents_counts(monkeypatch):
    def careless(*arguments):
        strokes = list(draw(*arguments).strokes)
        half = strokes[0].points[: len(strokes[0].points) // 2]
        strokes[0] = Stroke(half, label=strokes[0].label)
        circle = np.linspace(0.0, 2.0 * np.pi, 40)
        ring = np.stack([np.cos(circle), np.sin(circle)], axis=1) + 30.0
        return StrokeSet((*strokes, Stroke(ring)))

    monkeypatch.setattr(study, "draw", careless)
    found = sketch(PLACES["A"], 0, Style(NEAT))
    assert (found.lost, found.invented) == (1, 1)
    (case,) = cases("A", 0, Style(NEAT))
    record = evaluate(case, "auto")
    assert record.faults == 2
    assert not record.perfect


def test_a_removed_object_leaves_the_others_as_they_were():
    removal = Removal((2, 5))
    (case,) = cases("A", 1, Style(), [removal])
    drawn = sketch(PLACES["A"], 1, Style())
    kept = [k for k, piece in enumerate(drawn.furniture) if piece not in removal.sketch]
    scene = Scene(tuple(drawn.scene.objects[k] for k in kept))
    first, second = (
        finish(describe(each, ConstantForce())) for each in (scene, PLACES["A"].furniture)
    )
    expected = finish(relate(first, second, CrossCorrelation()))
    np.testing.assert_allclose(case.table.similarity, expected.similarity, rtol=1e-12)
    assert case.truth.tolist() == drawn.furniture[kept].tolist()


def test_a_smaller_scene_lacks_objects_on_both_sides():
    (case,) = cases("A", 1, Style(NEAT), [Removal(both=(0, 3, 7))])
    assert (len(case.sketch), len(case.map)) == (5, 5)
    assert evaluate(case, "exact").perfect


def test_what_is_not_there_has_no_partner():
    (case,) = cases("B", 0, Style(NEAT, extra=1))
    assert (len(case.sketch), len(case.map)) == (8, 7)
    assert sorted(case.truth) == [-1, *range(7)]
    record = evaluate(case, "exact")
    assert record.perfect
    assert record.objects == 7
    assert record.map_zeta == pytest.approx(record.true_zeta)


@pytest.mark.parametrize("grid", [False, True])
def test_case_a_is_the_map_itself(grid):
    (case,) = cases("A", 1, Style(traced=True), grids=[grid])
    record = evaluate(case, "auto")
    assert record.perfect
    assert (record.zeta, record.true_zeta) == (pytest.approx(1.0), pytest.approx(1.0))


def test_turning_the_paper_turns_the_sketch():
    (upright,), (turned,) = (cases("A", 2, Style(paper=paper)) for paper in (0.0, 90.0))
    first, second = (np.array([o.centroid for o in c.sketch.objects]) for c in (upright, turned))
    assert np.ptp(second, axis=0) == pytest.approx(np.ptp(first, axis=0)[::-1], rel=0.05)
    assert evaluate(turned, "auto").true_zeta == pytest.approx(
        evaluate(upright, "auto").true_zeta, abs=0.005
    )


def test_scenes_by_chance_have_the_objects_asked_for():
    assert len(place_named("12").furniture) == 12
    assert place_named("12").furniture.bounds == place_named("12").furniture.bounds
    (case,) = cases("12", 0, Style(NEAT))
    assert evaluate(case, "direct").perfect


def test_a_sketch_on_the_grid_has_its_objects():
    on_map, on_grid = cases("B", 2, Style(NEAT), grids=(False, True))
    pieces = charted(PLACES["B"], 2).furniture
    assert pieces[on_grid.truth].tolist() == on_map.truth.tolist()
    assert evaluate(on_grid, "auto").perfect


def test_what_is_wrong_is_named(monkeypatch):
    (case,) = cases("A", 3, Style(NEAT), [Removal((4,))])

    def exchanged(case, method):
        result = answer(case, method)
        matches = list(result.matches)
        one, other = matches[0].map_object, matches[1].map_object
        matches[0] = dataclasses.replace(matches[0], map_object=other)
        matches[1] = dataclasses.replace(matches[1], map_object=one)
        return dataclasses.replace(result, matches=tuple(matches))

    monkeypatch.setattr(case_module, "answer", exchanged)
    record = evaluate(case, "auto")
    assert (record.objects, record.right, record.perfect) == (7, 5, False)
    assert record.wrong == tuple(case.furniture[:2].tolist())
    assert record.map_zeta < record.true_zeta
    assert not record.misled
    assert dataclasses.replace(record, map_zeta=record.true_zeta + 0.01).misled


def test_an_object_left_without_partner_is_wrong_and_has_no_zeta(monkeypatch):
    (case,) = cases("A", 3, Style(NEAT))

    def short(case, method):
        result = answer(case, method)
        return dataclasses.replace(result, matches=result.matches[1:])

    monkeypatch.setattr(case_module, "answer", short)
    record = evaluate(case, "auto")
    assert (record.right, record.wrong) == (7, (int(case.furniture[0]),))
    assert math.isnan(record.map_zeta)
    assert not record.perfect


def test_records_are_the_same_again_and_in_any_number_of_processes():
    works = [
        Work("B", number, Style(), (NOTHING, Removal((1,))), (False, True), ("auto",))
        for number in range(2)
    ]
    alone = run(works, "alone", processes=1)
    assert len(alone) == 2 * 2 * 2
    assert untimed(alone) == untimed(run(works, "together", processes=2))


def test_the_protocol_is_the_thesis_s():
    work = protocol.experiments(("easm",), 9)
    sweeps = [*work["one missing, map"], *work["one missing, grid"]]
    assert sum(len(each.removals) for each in sweeps) == thesis.TOTAL.tests
    several = work["several missing"]
    removed = {each.place: [len(r.sketch) for r in each.removals] for each in several}
    assert removed == {"A": [1, 2, 3, 4, 5], "B": [1, 2, 3, 4]}
    growing = protocol.times(1)["times, 3 to 8 objects"][0]
    assert [8 - len(removal.both) for removal in growing.removals] == [3, 4, 5, 6, 7, 8]
    letters = [each for k in "klm" for each in work[f"sketches like ({k}), map"]]
    assert len({(each.place, each.number) for each in letters}) == len(letters)


def test_slow_methods_get_fewer_sketches():
    work = protocol.experiments(("fsnn-pso", "easm", "auto"), 80)
    for title, fsnn, easm in (
        ("all objects, map", 20, 80),
        ("one missing, map", 9, 80),
        ("one missing, grid", 9, 40),
    ):
        for method, count in (("fsnn-pso", fsnn), ("easm", easm), ("auto", 80)):
            numbers = {each.number for each in work[title] if method in each.methods}
            assert sorted(numbers) == [*range(count)]
    few = protocol.experiments(("fsnn-pso", "auto"), 9)
    assert all("fsnn-pso" in each.methods for each in few["all objects, map"])


def test_wilson():
    assert wilson(0, 10) == (0.0, pytest.approx(0.2775, abs=1e-4))
    assert wilson(18, 18) == (pytest.approx(0.8241, abs=1e-4), 1.0)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """The whole of it on one sketch a scene, and the folder with its report."""
    kept = {}
    brief = {
        name: Method(name, name, {"profile": "thesis", "params": {"searcher": {limit: 2}}})
        for name, limit in (("easm", "patience"), ("fsnn-pso", "iterations"))
    }
    folder = tmp_path_factory.mktemp("experiments")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(case_module, "METHODS", {**METHODS, **brief})
        patch.setattr(protocol, "_LARGE", {10: 1})
        patch.setattr(protocol, "_PAPERS", (0, 30))
        patch.setattr(protocol, "STRENGTHS", (0.95,))
        for part, arms in ARMS.items():
            patch.setitem(ARMS, part, arms[:1])
        patch.setattr(
            program, "report", lambda found: kept.setdefault("r", found) and report(found)
        )
        program.main(["--sketches=1", "--processes=1", f"--out={folder}"])
    return SimpleNamespace(results=kept["r"], folder=folder)


def cells(text, title, *first):
    """Return the cells of a Markdown table's row that begins so."""
    table = text.split(f"**{title}")[1].split("\n\n")[1]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()]
    return next(row for row in rows if tuple(row[: len(first)]) == first)


def test_the_report_has_every_table_of_the_thesis(results):
    for name in ("report.md", "report.html"):
        text = (results.folder / name).read_text(encoding="utf-8")
        for number in range(1, 19):
            assert re.search(rf"[Tt]ables? (4\.\d+ and )?4\.{number}\b", text), number
        for letter in "ABCD":
            assert f"Appendix {letter}" in text


def test_the_report_has_the_numbers_of_the_records(results):
    text = (results.folder / "report.md").read_text(encoding="utf-8")
    (record,) = chosen(results.results["all objects, map"], place="A", method="easm")
    row = cells(text, "Tables 4.1 and 4.3", "b")
    assert row[1:7] == ["0.881", "0.528", "8", "0.899", "0.761", "8"]
    assert row[10:13] == [f"{record.zeta:.3f}", f"{record.omega:.3f}", f"{record.right}"]
    sweep = chosen(results.results["one missing, grid"], place="B", method="auto")
    row = cells(text, "Table 4.18 on all sketches", "B", "grid", "auto")
    assert row[3:5] == ["7", f"{sum(record.perfect for record in sweep)}"]
    assert row[7:9] == ["42", f"{sum(record.right for record in sweep)}"]
    row = cells(text, "Table 4.18 on all sketches", "A+B", "both", "thesis EASM")
    assert row[3:6] == ["270", "239", "88.5 [84.2, 91.8]"]
    row = cells(text, "Table 4.5", "8")
    assert row[1:4] == ["37", "4607", "124.5"]


def test_the_report_has_the_arms(results):
    text = (results.folder / "report.md").read_text(encoding="utf-8")
    judged = results.results.judged
    assert [*judged] == [f"{part}, {kind}" for part in ARMS for kind in ("plain", "memory")]
    (record,) = (each for each in judged["parts, memory"] if each.method == "default")
    row = cells(text, "Sketches of parts of a map", "", "memory", "default")
    assert row[3:5] == ["1", share(int(record.perfect), 1)]
    row = cells(text, "Sketches of other places", "8 of another 8", "plain", "auto")
    assert row[3] == "1"


def test_the_report_says_what_segmentation_cost_and_who_can_leave_objects_out(results):
    text = (results.folder / "report.md").read_text(encoding="utf-8")
    assert "In 0 of our 2 sketches segmentation lost" in text
    drawn = chosen(results.results["missing and extra"], place="B", method="default")
    row = cells(text, "One object missing and one that is not there", "B", "default")
    assert row[2:4] == ["1", share(sum(record.perfect for record in drawn), 1)]


def test_markdown_is_aligned_and_has_no_html(results):
    text = (results.folder / "report.md").read_text(encoding="utf-8")
    assert not re.search(r"</?[a-z]+[ >/]", text)
    tables_ = [part for part in text.split("\n\n") if part.startswith("|")]
    assert len(tables_) > 20
    for table in tables_:
        assert len({len(line) for line in table.splitlines()}) == 1
    for name in re.findall(r"\]\((.+?)\)", text):
        with Image.open(results.folder / name) as picture:
            assert picture.width > 300


def test_html_is_one_file(results):
    text = (results.folder / "report.html").read_text(encoding="utf-8")
    pictures = re.findall(r'src="(.+?)"', text)
    assert len(pictures) >= 8
    for picture in pictures:
        assert picture.startswith("data:image/png;base64,")
        Image.open(io.BytesIO(base64.b64decode(picture.partition(",")[2]))).verify()
    links = re.findall(r'href="(.+?)"', text)
    assert all(link.startswith("#") and f'id="{link[1:]}"' in text for link in links)
    assert "http" not in re.sub(r'src=".+?"', "", text)


def test_the_report_begins_with_the_numbers_of_the_readme(results):
    text = (results.folder / "report.md").read_text(encoding="utf-8")
    row = cells(text, "Against the thesis", "one object missing: wholly right, %")
    sweeps = [results.results[f"one missing, {map_}"] for map_ in ("map", "grid")]
    shares = []
    for method in ("auto", "default"):
        own = [record for sweep in sweeps for record in chosen(sweep, method=method)]
        shares.append(share(sum(each.perfect for each in own), len(own)))
    assert row[1:] == ["88.5 [84.2, 91.8]", *shares]
    assert (results.folder / "against-the-thesis.png").exists()


def test_html_is_escaped(tmp_path):
    table = document.Table("a < b", ("x & y",), (("<b>",),), note="1 > 0")
    document.save(tmp_path, [document.Heading("T", 1), document.Paragraph("<p>"), table])
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    for escaped in ("a &lt; b", "x &amp; y", "&lt;b&gt;", "1 &gt; 0", "&lt;p&gt;"):
        assert escaped in text


def test_an_arm_alone_makes_a_report(tmp_path, monkeypatch):
    monkeypatch.setitem(ARMS, "places", ARMS["places"][:1])
    program.main(["--sketches=1", "--processes=1", "--only=places", f"--out={tmp_path}"])
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert cells(text, "Sketches of other places", "", "plain", "default")[3] == "1"
    assert "Sketches of parts of a map" not in text


def test_a_part_alone_makes_a_report(tmp_path, capsys):
    program.main(
        ["--sketches=1", "--processes=1", "--only=2", "--methods=auto", f"--out={tmp_path}"]
    )
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert "Tables 4.1 and 4.3" in text
    assert "4.18" not in text.split("## Calibration")[0]
    assert str(tmp_path / "report.html") in capsys.readouterr().out


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGINT])
def test_it_stops_when_it_is_told_to_and_leaves_no_process_behind(how, tmp_path):
    command = [sys.executable, "-m", "tests.experiments", "--only=2", "--methods=auto"]
    with subprocess.Popen(
        [*command, f"--out={tmp_path}"],
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
        start_new_session=True,
    ) as running:
        told = iter(running.stderr.readline, "")
        assert any("sketches, " in line for line in told), "it has begun"
        children = children_of(running.pid)
        assert len(children) >= 2
        running.send_signal(how)
        rest = list(told)
    assert "stopped; there is no report\n" in rest
    assert running.returncode == 1
    assert_all_end(children)


@pytest.mark.parametrize(
    "arguments",
    [["--methods=x"], ["--sketches=0"], ["--only=6"], ["--processes=0"], [f"--out={__file__}/x"]],
)
def test_senseless_options_are_refused(arguments, capsys):
    with pytest.raises(SystemExit):
        program.main(arguments)
    assert "error" in capsys.readouterr().err


def records(outcomes, method="easm", place="A", **others):
    """Return a record of an object map of 8 for each number of right objects."""
    return [
        Record(
            CaseName(place, number, Style(), **others),
            method,
            objects=8,
            right=right,
            wrong=(0,) * (8 - right),
            faults=0,
            zeta=0.9 + number / 1000,
            omega=0.97 + number / 1000,
            map_zeta=0.9,
            true_zeta=0.91,
            seconds=0.01,
        )
        for number, right in enumerate(outcomes)
    ]


def claimed(word, titles, outcomes, **others):
    """Return the verdict on a claim if all methods and scenes have these outcomes."""
    made = [
        record
        for method in ("fsnn-pso", "fsnn-folded", "easm")
        for place in PLACES
        for record in records(outcomes, method, place, **others)
    ]
    found = claims(Results(dict.fromkeys(titles, made), ("fsnn-pso", "easm"), len(outcomes)))
    return next(claim for claim in found if word in claim.text).verdict


@pytest.mark.parametrize(
    ("wrong", "always", "one_missing"),
    [
        (0, CONFIRMED, CONFIRMED),
        (2, IN_PART, CONFIRMED),
        (24, REFUTED, IN_PART),
        (80, *[REFUTED] * 2),
    ],
)
def test_claims_follow_the_records(wrong, always, one_missing):
    outcomes = [6] * wrong + [8] * (200 - wrong)
    titles = ("all objects, map", "all objects, grid")
    assert claimed("always finds", titles, outcomes) == always
    titles = ("one missing, map", "one missing, grid")
    assert claimed("88.5", titles, outcomes, removed=Removal((1,))) == one_missing


def test_every_claim_is_put_to_the_test(results):
    def another(record):
        case = dataclasses.replace(record.case, number=record.case.number + 1)
        zeta, omega = record.zeta + 0.01, record.omega + 0.01
        return dataclasses.replace(record, case=case, zeta=zeta, omega=omega)

    found = {
        title: [*each, *map(another, each)] for title, each in results.results.experiments.items()
    }
    made = claims(dataclasses.replace(results.results, experiments=found, sketches=2))
    assert len(made) == 12
    assert {claim.verdict for claim in made} <= {CONFIRMED, IN_PART, REFUTED}


def test_cases_of_one_sketch_count_as_one():
    sketches = [dataclasses.replace(each) for each in records([8] * 20 + [6] * 20)]
    alone = interval_by_sketch(sketches)
    assert alone == pytest.approx(wilson(20, 40), abs=0.04)
    assert interval_by_sketch(sketches * 50) == pytest.approx(alone, abs=0.02)
    low, high = wilson(1000, 2000)
    assert high - low < 0.5 * (alone[1] - alone[0])


def test_reliability_finds_what_is_too_sure():
    rng = np.random.default_rng(0)
    given = rng.uniform(0.0, 1.0, 20000)
    honest = reliability(zip(given, rng.random(20000) < given, strict=True))
    assert honest.error < 0.02
    assert len(honest.bins) == 10
    sure = reliability(zip(given, rng.random(20000) < given**2, strict=True))
    assert sure.error == pytest.approx(1 / 6, abs=0.02)
    assert reliability([(1.0, True), (0.0, False)]).error == 0.0
    for bad in ([], [(1.2, True)], [(math.nan, True)]):
        with pytest.raises(ValueError, match="probability"):
            reliability(bad)


def test_by_chance_true_probabilities_err_the_more_the_fewer_there_are():
    assert by_chance([1.0, 0.0, 1.0]) == 0.0
    assert by_chance([0.5]) == 0.5
    few, many = (by_chance([0.9] * count) for count in (100, 10_000))
    # The mean of |share − .9|, which is about normal.
    assert few == pytest.approx(0.03 * math.sqrt(2.0 / math.pi), rel=0.15)
    assert many == pytest.approx(0.1 * few, rel=0.2)


def test_probabilities_are_drawn_once_records_carry_them():
    made = [dataclasses.replace(each, probability=0.9) for each in records([8, 8, 6], "auto")]
    traced = [dataclasses.replace(each, probability=0.1) for each in made]
    blocks = report(Results({"several missing": made, "case (a), map": traced}, (), 1))
    (picture,) = [block for block in blocks if isinstance(block, document.Picture)]
    assert "expected calibration error 0.233" in picture.caption


def test_every_method_is_a_request_that_works():
    (case,) = cases("B", 0, Style(NEAT), [Removal(both=(0, 1, 2))])
    for method in METHODS:
        assert evaluate(case, method).objects == 4


def test_shares():
    assert share(0, 0) == "–"
    assert share(18, 18) == "100.0 [82.4, 100.0]"


def test_the_thesis_adds_up_where_it_does():
    for table, rows in thesis.EQUAL.items():
        zeta, omega = thesis.AVERAGES[table]
        assert mean(row.zeta for row in rows.values()) == pytest.approx(zeta, abs=0.0011)
        assert mean(row.omega for row in rows.values()) == pytest.approx(omega, abs=0.0011)
    lines = thesis.SUMMARY.values()
    total = thesis.TOTAL
    for name in ("tests", "objects", "perfect", "right"):
        assert sum(getattr(line, name) for line in lines) == getattr(total, name)


def test_the_thesis_contradicts_itself_as_we_say():
    counted = {}
    for key, sketches in thesis.ONE_MISSING.items():
        rows = [row for each in sketches.values() for row in each]
        matched = len(next(iter(sketches.values()))) - 1
        counted[key] = (
            len(rows),
            sum(row.right == matched for row in rows),
            sum(row.right for row in rows),
            round(mean(row.zeta for row in rows), 3),
            round(mean(row.omega for row in rows), 3),
        )
    assert counted == {
        ("A", False): (72, 61, 492, 0.897, 0.799),
        ("B", False): (63, 56, 371, 0.906, 0.812),
        ("A", True): (72, 65, 497, 0.876, 0.732),
        ("B", True): (63, 56, 370, 0.909, 0.808),
    }
    place, grid, letter = thesis.ONE_MISSING_TABLES["4.11"]
    shown = thesis.ONE_MISSING[place, grid][letter]
    assert mean(row.zeta for row in shown) == pytest.approx(0.922, abs=0.0005)
    assert thesis.AVERAGES["4.11"][0] == 0.906


@pytest.mark.parametrize(
    ("by_zeta", "by_parts", "verdict"),
    [(9, 9, CONFIRMED), (2, 9, IN_PART), (9, 2, IN_PART), (2, 2, REFUTED)],
)
def test_the_claim_for_fsnn_says_in_which_world_it_holds(by_zeta, by_parts, verdict):
    def experiment(right):
        return [
            record
            for method in ("fsnn-pso", "fsnn-folded", "easm")
            for place in PLACES
            for record in records([8] * right + [6] * (10 - right), method, place)
        ]

    experiments = {"all objects, map": experiment(by_zeta)}
    experiments |= dict.fromkeys(protocol.SMALL_TITLES, experiment(by_parts))
    found = claims(Results(experiments, ("fsnn-pso", "easm"), 10))
    claim = next(each for each in found if each.text.startswith("FSNN gives good results"))
    assert claim.verdict == verdict
    words = {True: "which agrees", False: "which does not agree"}
    assert claim.finding.count(words[True]) == (by_zeta == 9) + (by_parts == 9)
    assert claim.finding.count(words[False]) == (by_zeta == 2) + (by_parts == 2)
