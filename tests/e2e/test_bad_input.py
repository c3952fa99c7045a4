"""Everything that people get wrong, once over gRPC and once on the command line."""

import json
import math
import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import grpc
import numpy as np
import PIL.Image
import pytest
from google.rpc import error_details_pb2, status_pb2

from sketchmatch.examples import LIVING_ROOM_MAP
from sketchmatch_client import Client, InvalidRequestError, sources
from sketchmatch_proto.v1 import source_pb2
from sketchmatch_proto.v1.match_pb2 import ConfidenceWeights
from sketchmatch_proto.v1.match_service_pb2 import MatchRequest
from sketchmatch_proto.v1.match_service_pb2_grpc import MatchServiceStub
from sketchmatch_proto.v1.pipeline_pb2 import AlgorithmSelection
from tests import processes
from tests.processes import sketchmatch

SQUARE = [[0, 0], [2, 0], [2, 2], [0, 2]]
WEDGE = [[5, 0], [9, 0], [9, 3]]
BAR = [[0, 6], [6, 6], [6, 7], [0, 7]]
BOW_TIE = [[0, 0], [2, 2], [2, 0], [0, 2]]


# Files -------------------------------------------------------------------------------------------


def strokes(*drawn):
    """Return what writes a file of strokes, each closed."""

    def write(folder: Path, name: str) -> Path:
        path = folder / f"{name}.json"
        path.write_text(json.dumps({"strokes": [{"points": points} for points in drawn]}))
        return path

    return write


def polygons(*drawn):
    """Return what writes a file of polygons, each an outer ring."""

    def write(folder: Path, name: str) -> Path:
        path = folder / f"{name}.geojson"
        shapes = [{"type": "Polygon", "coordinates": [ring]} for ring in drawn]
        path.write_text(json.dumps({"type": "GeometryCollection", "geometries": shapes}))
        return path

    return write


def robot_map(picture: bytes | str | None = "living room", text: str | None = None, **keys):
    """Return what writes the example's map with other keys (None: left out) or another picture."""

    def write(folder: Path, name: str) -> Path:
        path, image = folder / f"{name}.yaml", folder / f"{name}.pgm"
        if picture == "living room":
            shutil.copy(LIVING_ROOM_MAP.with_suffix(".pgm"), image)
        elif picture is not None:
            image.write_bytes(picture)
        lines = dict(line.split(": ", 1) for line in LIVING_ROOM_MAP.read_text().splitlines())
        lines |= {"image": image.name, **keys}
        kept = "".join(f"{key}: {value}\n" for key, value in lines.items() if value is not None)
        path.write_text(kept if text is None else text)
        return path

    return write


def image(data: bytes):
    """Return what writes a picture."""

    def write(folder: Path, name: str) -> Path:
        path = folder / f"{name}.png"
        path.write_bytes(data)
        return path

    return write


def encoded(pixels: np.ndarray, kind: str = "PNG") -> bytes:
    from io import BytesIO

    file = BytesIO()
    PIL.Image.fromarray(pixels.astype(np.uint8)).save(file, kind)
    return file.getvalue()


PAPER = np.full((60, 80), 255)
GREY = np.full((60, 80), 205)
ONE_SHAPE = np.pad(np.zeros((20, 30)), 15, constant_values=255)
LIVING_ROOM_PICTURE = LIVING_ROOM_MAP.with_suffix(".pgm").read_bytes()


# Cases -------------------------------------------------------------------------------------------

SKETCH = strokes([*SQUARE, SQUARE[0]], [*WEDGE, WEDGE[0]], [*BAR, BAR[0]])
MAP = polygons(SQUARE, WEDGE, BAR)


@dataclass(frozen=True)
class Case:
    """One thing that is wrong.

    Attributes
    ----------
    path
        The field's in the request. ``place`` is what the command line says instead, where it
        names a file.
    problem, remedy
        What the sentence goes on with, and what it advises.
    """

    name: str
    reason: str
    path: str
    problem: str
    remedy: str
    place: str = ""
    sketch: Callable[[Path, str], Path] = SKETCH
    map: Callable[[Path, str], Path] = MAP
    chosen: dict[str, str] = field(default_factory=dict)
    params: dict[str, dict] = field(default_factory=dict)
    weights: tuple[float, ...] | None = None
    time_budget: float | None = None


CLOSED = [*SQUARE, SQUARE[0]]


def bad_strokes(name, reason, path, problem, remedy, *drawn, place=None):
    return Case(
        name,
        reason,
        f"sketch.stroke_set.{path}",
        problem,
        remedy,
        f"{{sketch}}: {path if place is None else place}",
        sketch=strokes(*drawn),
    )


def bad_polygons(name, reason, path, problem, remedy, *drawn, place=None):
    return Case(
        name,
        reason,
        f"map.polygon_set.{path}",
        problem,
        remedy,
        f"{{map}}: {path if place is None else place}",
        map=polygons(*drawn),
    )


def bad_yaml(name, key, problem, remedy, **keys):
    return Case(
        name,
        "INVALID_GRID",
        f"map.map_server_map.yaml.{key}".rstrip("."),
        problem,
        remedy,
        f"{{map}}: {key}" if key else "{map}",
        map=robot_map(**keys),
    )


def bad_map_picture(name, reason, problem, remedy, picture, place="{map}"):
    path = "map.map_server_map.image"
    return Case(name, reason, path, problem, remedy, place, map=robot_map(picture))


def bad_image(name, reason, problem, remedy, data):
    return Case(name, reason, "sketch.image.data", problem, remedy, "{sketch}", sketch=image(data))


def bad_choice(name, reason, path, problem, remedy, **choice):
    return Case(name, reason, f"pipeline.{path}", problem, remedy, **choice)


CASES = [
    # A scene with fewer than two objects.
    bad_strokes(
        "no stroke", "TOO_FEW_OBJECTS", "strokes", "hold no closed outline", "draw around each"
    ),
    bad_strokes(
        "one stroke",
        "TOO_FEW_OBJECTS",
        "strokes",
        "hold one closed outline",
        "draw around each object",
        CLOSED,
    ),
    bad_strokes(
        "one stroke and a line",
        "TOO_FEW_OBJECTS",
        "strokes",
        "hold one closed outline (1 stroke was left out",
        "draw around each object",
        CLOSED,
        [[0, 0], [1, 0], [0, 0]],
    ),
    bad_polygons("no polygon", "TOO_FEW_OBJECTS", "polygons", "holds no", "give at least two"),
    bad_polygons(
        "one polygon", "TOO_FEW_OBJECTS", "polygons", "holds one", "give at least two", SQUARE
    ),
    # Strokes of one point, or none, draw nothing.
    bad_strokes(
        "one stroke and a tap",
        "TOO_FEW_OBJECTS",
        "strokes",
        "hold one closed outline (1 stroke was left out",
        "draw around each object",
        CLOSED,
        [[7, 7]],
    ),
    bad_strokes(
        "one stroke and one of no point",
        "TOO_FEW_OBJECTS",
        "strokes",
        "hold one closed outline, and",
        "draw around each object",
        CLOSED,
        [],
    ),
    bad_strokes(
        "stroke with NaN",
        "INVALID_STROKE",
        "strokes[1].points[2]",
        "is ",
        "number",
        CLOSED,
        [[0, 0], [1, 0], [1, math.nan]],
        place="strokes[1].points[2][1]",
    ),
    # Polygons that cross themselves, have no area, are not finite.
    bad_polygons(
        "self-crossing polygon",
        "INVALID_POLYGON",
        "polygons[1]",
        "crosses itself at (1, 1)",
        "draw its outline without crossing",
        SQUARE,
        BOW_TIE,
    ),
    bad_polygons(
        "polygon without area",
        "INVALID_POLYGON",
        "polygons[1]",
        "has no area",
        "give three corners not on one line",
        SQUARE,
        [[0, 0], [1, 1], [2, 2]],
    ),
    bad_polygons(
        "polygon of two corners",
        "INVALID_POLYGON",
        "polygons[1].rings[0]",
        "has 2 distinct points",
        "needs at least three",
        SQUARE,
        [[0, 0], [1, 1]],
    ),
    bad_polygons(
        "polygon with NaN",
        "INVALID_POLYGON",
        "polygons[1].rings[0].points[2]",
        "is ",
        "number",
        SQUARE,
        [[0, 0], [1, 1], [math.nan, 2]],
        place="geometries[1].coordinates[0][2][0]",
    ),
    bad_polygons(
        "polygon with infinity",
        "INVALID_POLYGON",
        "polygons[1].rings[0].points[0]",
        "is ",
        "number",
        SQUARE,
        [[0, -math.inf], [1, 1], [0, 2]],
        place="geometries[1].coordinates[0][0][1]",
    ),
    bad_polygons(
        "polygon beyond all bounds",
        "INVALID_POLYGON",
        "polygons[1].rings[0]",
        "reaches beyond",
        "use a larger unit",
        SQUARE,
        [[0, 0], [1e200, 1], [1e200, 1e200]],
    ),
    # A map's yaml with missing or wrong keys, its picture missing or cut short.
    bad_yaml("no resolution", "resolution", "is missing", "resolution: 0.05", resolution=None),
    bad_yaml("resolution 0", "resolution", "is 0;", "positive number", resolution="0.0"),
    bad_yaml("resolution < 0", "resolution", "is -0.05;", "positive", resolution="-0.05"),
    bad_yaml("resolution NaN", "resolution", "is nan", "give a finite number", resolution=".nan"),
    bad_yaml("resolution tiny", "resolution", "is 1e-300", "as in 0.05", resolution="1e-300"),
    bad_yaml("resolution huge", "resolution", "is 1e+300", "as in 0.05", resolution="1e+300"),
    bad_yaml("no origin", "origin", "is missing", "origin: [", origin=None),
    bad_yaml("short origin", "origin", "is not a list of three", "give [x, y, yaw]", origin="[0]"),
    bad_yaml("no image", "image", "is missing", "image: office.pgm", image=None),
    bad_yaml("odd negate", "negate", "is 'maybe'", "give 0, or 1", negate="maybe"),
    bad_yaml(
        "word as threshold",
        "occupied_thresh",
        "is 'lots'",
        "give a finite number",
        occupied_thresh="lots",
    ),
    bad_yaml(
        "thresholds exchanged", "free_thresh", "is 0.9, not below", "0.196", free_thresh="0.9"
    ),
    bad_yaml("odd mode", "mode", "is 'fancy'", "give trinary, scale or raw", mode="fancy"),
    bad_yaml("not yaml", "", "is not YAML", "give the file that map_server saved", text="a: [1"),
    bad_yaml("empty yaml", "", "is not a list of keys", "give the file that", text=""),
    bad_map_picture(
        "picture missing",
        "INVALID_IMAGE",
        "",
        "; ",
        None,
        place="{map}: image {folder}/map.pgm does not exist; check the path",
    ),
    bad_map_picture(
        "picture cut short",
        "INVALID_IMAGE",
        "is damaged or cut short",
        "save the picture again",
        LIVING_ROOM_PICTURE[:500],
        place="{map}: image",
    ),
    bad_map_picture(
        "picture of another kind",
        "INVALID_IMAGE",
        "is not a picture",
        "give a PNG, JPEG, WebP, GIF, BMP, TIFF or PGM",
        b"%PDF-1.4",
        place="{map}: image",
    ),
    # A picture with nothing in it.
    bad_map_picture(
        "map of free space alone",
        "TOO_FEW_OBJECTS",
        "has no object of at least 0.2 m",
        "lower min_size",
        encoded(PAPER, "PPM"),
    ),
    bad_map_picture(
        "map of unknown space alone",
        "TOO_FEW_OBJECTS",
        "has no free cell",
        "check the thresholds",
        encoded(GREY, "PPM"),
    ),
    bad_image(
        "blank image",
        "INVALID_IMAGE",
        "is blank",
        "give a picture with dark shapes on light paper",
        encoded(PAPER),
    ),
    bad_image(
        "image of one shape",
        "TOO_FEW_OBJECTS",
        "has only one shape",
        "draw objects apart from each other",
        encoded(ONE_SHAPE),
    ),
    bad_image(
        "image cut short",
        "INVALID_IMAGE",
        "is damaged or cut short",
        "save the picture again",
        encoded(ONE_SHAPE)[:60],
    ),
    bad_image("empty image", "INVALID_IMAGE", "is not a picture", "give a PNG", b""),
    # An unknown algorithm or parameter, a value out of range.
    bad_choice(
        "unknown searcher",
        "UNKNOWN_ALGORITHM",
        "searcher.name",
        "is 'quantum', which is not a searcher",
        "choose one of: ",
        chosen={"searcher": "quantum"},
    ),
    bad_choice(
        "algorithm of another kind",
        "UNKNOWN_ALGORITHM",
        "histogram.name",
        "is 'easm', which is not a histogram",
        "choose one of: ",
        chosen={"histogram": "easm"},
    ),
    bad_choice(
        "segmenter for another source",
        "WRONG_ALGORITHM",
        "map_segmenter.name",
        "is 'strokes', which cannot read a source of type polygon_set",
        "choose one of: polygons",
        chosen={"map_segmenter": "strokes"},
    ),
    bad_choice(
        "unknown parameter",
        "INVALID_PARAMETER",
        "searcher.parameters.populaton",
        "is not a parameter of easm",
        "it has: consistency, population",
        chosen={"searcher": "easm"},
        params={"searcher": {"populaton": 3}},
    ),
    bad_choice(
        "parameter out of range",
        "INVALID_PARAMETER",
        "searcher.parameters.population",
        "is 1;",
        "greater than or equal to 2",
        chosen={"searcher": "easm"},
        params={"searcher": {"population": 1}},
    ),
    bad_choice(
        "word as number",
        "INVALID_PARAMETER",
        "searcher.parameters.population",
        "is 'many'",
        "it should be a valid integer",
        chosen={"searcher": "easm"},
        params={"searcher": {"population": "many"}},
    ),
    bad_choice(
        "list as number",
        "INVALID_PARAMETER",
        "searcher.parameters.population",
        "is [1",
        "it should be a valid integer",
        chosen={"searcher": "easm"},
        params={"searcher": {"population": [1, {"a": True}, None]}},
    ),
    bad_choice(
        "odd number of directions",
        "INVALID_PARAMETER",
        "histogram.parameters.directions",
        "is 7;",
        "it should be a multiple of 2",
        params={"histogram": {"directions": 7}},
    ),
    bad_choice(
        "word that is no option",
        "INVALID_PARAMETER",
        "searcher.parameters.consistency",
        "is 'some'",
        "'object' or 'pairwise'",
        chosen={"searcher": "easm"},
        params={"searcher": {"consistency": "some"}},
    ),
    bad_choice(
        "parameter NaN",
        "INVALID_PARAMETER",
        "sketch_segmenter.parameters.max_gap",
        "is nan",
        "it should be a finite number",
        params={"sketch_segmenter": {"max_gap": math.nan}},
    ),
    Case(
        "weight < 0",
        "INVALID_FIELD",
        "weights.dilation",
        "is -1",
        "give a number from 0",
        weights=(1, 1, -1),
    ),
    Case(
        "weight NaN",
        "INVALID_FIELD",
        "weights.similarity",
        "is nan",
        "give a number from 0",
        weights=(math.nan, 1, 1),
    ),
    Case(
        "weight of shape < 0",
        "INVALID_FIELD",
        "weights.shape",
        "is -1",
        "give a number from 0",
        weights=(1, 1, 1, -1, 0),
    ),
    Case(
        "weight of shape for pairs",
        "INVALID_FIELD",
        "weights.shape",
        "needs a searcher that finds one object map, which 'nn'",
        "choose another",
        weights=(1, 1, 1, 1, 0),
        chosen={"searcher": "nn"},
    ),
    Case(
        "exponent of distance > 4",
        "INVALID_FIELD",
        "weights.distance",
        "is 5",
        "give a number from 0 to 4",
        weights=(1, 1, 1, 0, 0, 5),
    ),
    Case(
        "no weight",
        "INVALID_FIELD",
        "weights",
        "are all zero",
        "give at least one above zero",
        weights=(0, 0, 0),
    ),
    Case(
        "no time",
        "INVALID_FIELD",
        "time_budget",
        "is 0 s",
        "give a positive time",
        time_budget=0,
    ),
]


FINE = Case("fine", "", "", "", "")


# As a request ------------------------------------------------------------------------------------


def message(path: Path) -> source_pb2.Source:
    """Return a file as a careless client would send it, unchecked."""
    if path.suffix == ".json":
        drawn = [stroke["points"] for stroke in json.loads(path.read_text())["strokes"]]
        return sources.strokes(drawn)
    if path.suffix == ".geojson":
        shapes = json.loads(path.read_text())["geometries"]
        return sources.polygons([shape["coordinates"] for shape in shapes])
    if path.suffix == ".yaml":
        picture = path.with_suffix(".pgm")
        data = picture.read_bytes() if picture.exists() else b""
        robots = source_pb2.MapServerMap(yaml=path.read_text(), image=data)
        return source_pb2.Source(map_server_map=robots)
    return sources.image(path)


def asked(case: Case, folder: Path) -> MatchRequest:
    made = MatchRequest(
        sketch=message(case.sketch(folder, "sketch")), map=message(case.map(folder, "map"))
    )
    for stage in {*case.chosen, *case.params}:
        selection: AlgorithmSelection = getattr(made.pipeline, stage)
        selection.name = case.chosen.get(stage, "")
        selection.parameters.update(case.params.get(stage, {}))
    if case.weights:
        names = ("similarity", "rotation", "dilation", "shape", "size", "distance")
        made.weights.CopyFrom(ConfidenceWeights(**dict(zip(names, case.weights, strict=False))))
    if case.time_budget is not None:
        made.time_budget.FromNanoseconds(round(1e9 * case.time_budget))
    return made


def arguments(case: Case, folder: Path) -> list[str]:
    options = {"sketch_segmenter": "sketch-segmenter", "map_segmenter": "map-segmenter"}
    made = [str(case.sketch(folder, "sketch")), str(case.map(folder, "map"))]
    made += [f"--{options.get(stage, stage)}={name}" for stage, name in case.chosen.items()]
    for stage, params in case.params.items():
        made += [f"--set={stage}.{name}={json.dumps(value)}" for name, value in params.items()]
    if case.weights:
        made += ["--weights", ",".join(map(str, case.weights))]
    if case.time_budget is not None:
        made += ["--time-budget", str(case.time_budget)]
    return made


# Over gRPC and on the command line ---------------------------------------------------------------


@pytest.fixture(scope="module")
def stub(address):
    with grpc.insecure_channel(address) as channel:
        yield MatchServiceStub(channel)


def details(error: grpc.RpcError) -> tuple[error_details_pb2.ErrorInfo, list]:
    """Return what an error says to programs: the info and the violations of fields."""
    info, bad_request = error_details_pb2.ErrorInfo(), error_details_pb2.BadRequest()
    status = status_pb2.Status.FromString(
        dict(error.trailing_metadata())["grpc-status-details-bin"]
    )
    assert status.message == error.details()
    for detail in status.details:
        assert detail.Unpack(info) or detail.Unpack(bad_request)
    return info, list(bad_request.field_violations)


every_case = pytest.mark.parametrize("case", CASES, ids=lambda case: case.name.replace(" ", "-"))


@pytest.mark.slow
@every_case
def test_over_grpc_it_is_an_invalid_argument_with_the_fields_path_and_the_remedy(
    stub, case, tmp_path
):
    with pytest.raises(grpc.RpcError) as raised:
        list(stub.Match(asked(case, tmp_path), timeout=60))
    sentence = raised.value.details()
    info, (violation,) = details(raised.value)
    assert raised.value.code() is grpc.StatusCode.INVALID_ARGUMENT
    assert (info.reason, info.domain) == (case.reason, "sketchmatch")
    assert violation.field == case.path
    assert sentence == f"{case.path} {violation.description}"
    assert_helps(sentence, case.path, case)
    good = list(stub.Match(asked(FINE, tmp_path), timeout=60))
    assert len(good[-1].result.object_matches) == 3, "the server goes on serving"


@every_case
@pytest.mark.parametrize("where", ["in process", "server"])
def test_on_the_command_line_it_is_exit_code_2_and_one_line_with_the_remedy(
    command_line, address, case, where, tmp_path
):
    server = ["--server", address] if where == "server" else []
    done = command_line("match", *arguments(case, tmp_path), *server)
    assert_refused(done, case, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["one stroke", "self-crossing polygon", "resolution 0", "picture missing", "no weight"]
)
def test_a_process_of_its_own_says_the_same(name, tmp_path):
    case = next(case for case in CASES if case.name == name)
    assert_refused(sketchmatch("match", *arguments(case, tmp_path)), case, tmp_path)


def assert_refused(done, case, folder):
    assert done.stdout == ""
    assert done.returncode == 2, done.stderr
    (line,) = done.stderr.splitlines()
    (sketch,), (map_,) = folder.glob("sketch.*"), folder.glob("map.[!p]*")
    place = (case.place or case.path).format(sketch=sketch, map=map_, folder=folder)
    assert_helps(line, f"sketchmatch: {place}", case)


def assert_helps(sentence, begin, case):
    assert sentence.startswith(f"{begin} {case.problem}".rstrip(" ")), sentence
    assert case.remedy in sentence, sentence
    assert "\n" not in sentence
    assert not sentence.endswith("."), "it is read after others"


# What files cannot show --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "path", "problem"),
    [
        ({"resolution_meters": 0.0}, "map.occupancy_grid.resolution_meters", "is 0; give the pos"),
        ({"rows": 3}, "map.occupancy_grid.cells", "has 4 bytes for 3 × 2 cells; give one"),
        ({"rows": 0, "cells": b""}, "map.occupancy_grid.cells", "is empty; give rows"),
        (
            {"cells": bytes([0, 0, 0, 101])},
            "map.occupancy_grid.cells",
            "has a value outside −1…100",
        ),
        ({"cells": bytes(4)}, "map.occupancy_grid.cells", "has no object of at least 0.2 m"),
    ],
)
def test_a_wrong_occupancy_grid_is_refused_with_the_path(stub, changes, path, problem, tmp_path):
    wrong = asked(FINE, tmp_path)
    grid = {"rows": 2, "columns": 2, "resolution_meters": 0.05, "cells": bytes(4)} | changes
    wrong.map.occupancy_grid.CopyFrom(source_pb2.OccupancyGrid(**grid))
    with pytest.raises(grpc.RpcError, match=re.escape(f"{path} {problem}")) as raised:
        list(stub.Match(wrong, timeout=60))
    assert details(raised.value)[1][0].field == path


@pytest.mark.parametrize("field", ["sketch", "map"])
@pytest.mark.parametrize("empty", [None, source_pb2.Source()], ids=["absent", "empty"])
def test_a_missing_source_is_refused_with_what_there_is_to_give(stub, field, empty, tmp_path):
    wrong = asked(FINE, tmp_path)
    wrong.ClearField(field)
    if empty is not None:
        getattr(wrong, field).CopyFrom(empty)
    with pytest.raises(grpc.RpcError, match=f"{field} is not set; give stroke_set, poly") as raised:
        list(stub.Match(wrong, timeout=60))
    info, (violation,) = details(raised.value)
    assert (info.reason, violation.field) == ("MISSING_FIELD", field)


def test_half_timed_strokes_are_refused_with_the_path(stub, tmp_path):
    wrong = asked(FINE, tmp_path)
    wrong.sketch.stroke_set.strokes[1].points[2].time_seconds = 0.5
    with pytest.raises(grpc.RpcError, match="set it on every point or on none") as raised:
        list(stub.Match(wrong, timeout=60))
    path = "sketch.stroke_set.strokes[1].points[0].time_seconds"
    assert details(raised.value)[1][0].field == path


def test_a_name_of_any_length_gets_an_answer_that_fits_into_a_trailer(stub, tmp_path):
    wrong = asked(FINE, tmp_path)
    wrong.pipeline.searcher.name = "ζ" * 100_000
    with pytest.raises(grpc.RpcError, match="which is not a searcher; choose one of") as raised:
        list(stub.Match(wrong, timeout=60))
    info, (violation,) = details(raised.value)
    assert raised.value.code() is grpc.StatusCode.INVALID_ARGUMENT
    assert (info.reason, violation.field) == ("UNKNOWN_ALGORITHM", "pipeline.searcher.name")


@pytest.mark.parametrize("kind", ["name", "value"])
def test_a_parameter_of_any_length_gets_an_answer_that_fits_into_a_trailer(stub, kind, tmp_path):
    wrong = asked(FINE, tmp_path)
    long = "x" * 100_000
    wrong.pipeline.searcher.parameters[long if kind == "name" else "population"] = long
    with pytest.raises(grpc.RpcError, match=r"pipeline\.searcher\.parameters") as raised:
        list(stub.Match(wrong, timeout=60))
    assert raised.value.code() is grpc.StatusCode.INVALID_ARGUMENT
    assert details(raised.value)[0].reason == "INVALID_PARAMETER"


def test_segment_names_the_path_in_its_own_request(address):
    with Client(address) as client, pytest.raises(InvalidRequestError) as raised:
        client.segment(sources.strokes([CLOSED, [(7, 7), (float("nan"), 8)]]))
    assert raised.value.field == "source.stroke_set.strokes[1].points[1]"
    with Client(address) as client, pytest.raises(InvalidRequestError) as raised:
        client.segment(sources.strokes([CLOSED, CLOSED]), params={"max_gap": 2})
    assert raised.value.field == "segmenter.parameters.max_gap"


# Too large ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def small_server():
    with processes.server("--max-request-mib", "1") as running:
        yield running.address


@pytest.fixture(params=[2, 5], ids=["above the limit", "above what the transport lets through"])
def large(request, tmp_path):
    """Return the path of a picture of so many MiB that nothing compresses."""
    rng = np.random.default_rng(0)
    side = int(math.sqrt(request.param * 2**20))
    path = tmp_path / "large.png"
    path.write_bytes(encoded(rng.integers(0, 256, (side, side))))
    return path


@pytest.mark.slow
def test_a_request_that_is_too_large_is_refused_over_grpc(small_server, large):
    with Client(small_server) as client:
        with pytest.raises(InvalidRequestError, match=r"send fewer|make it smaller") as raised:
            client.match(sources.image(large), sources.polygons([SQUARE, WEDGE]))
        assert raised.value.reason == "MESSAGE_TOO_LARGE"
        assert client.match(
            sources.polygons([SQUARE, WEDGE]), sources.polygons([SQUARE, WEDGE])
        ).object_map


@pytest.mark.slow
@pytest.mark.parametrize("command", ["match", "segment"])
def test_a_file_that_is_too_large_is_refused_on_the_command_line(
    command_line, small_server, large, tmp_path, command
):
    files = [large, MAP(tmp_path, "map")] if command == "match" else [large]
    done = command_line(command, *files, "--server", small_server)
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    assert "larger than" in line or "more than the limit of 1048576" in line
    assert "make it smaller" in line or "send fewer points or a smaller picture" in line
