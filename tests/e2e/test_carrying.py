"""``sketchmatch transfer`` and ``sketchmatch carry``, as people use them."""

import json

import numpy as np
import PIL.Image
import pytest
import shapely
from google.protobuf.json_format import Parse

import sketchmatch
from sketchmatch import Feature
from sketchmatch.cli.app import ExitCode
from sketchmatch.examples import LIVING_ROOM_MAP, LIVING_ROOM_SKETCH
from sketchmatch.io.files import read_source
from sketchmatch.model import OccupancyGrid
from sketchmatch.transfers.files import read_features
from sketchmatch.transfers.obstacles import Obstacles
from sketchmatch_proto.v1.transfer_service_pb2 import TransferResponse

ROOM = (LIVING_ROOM_SKETCH, LIVING_ROOM_MAP)
BESIDE_THE_PLANT = [500.0, -120.0]


@pytest.fixture(params=["in process", "server"])
def where(request):
    """Yield the options with which a command computes here, or asks a server."""
    if request.param == "in process":
        return []
    return ["--server", request.getfixturevalue("address")]


def written(path, *features):
    """Write features as GeoJSON."""
    members = [
        {"type": "Feature", "properties": said, "geometry": {"type": kind, "coordinates": where}}
        for kind, where, said in features
    ]
    path.write_text(json.dumps({"type": "FeatureCollection", "features": members}), "utf-8")
    return path


@pytest.fixture
def drawn(tmp_path):
    """Return a file with a route, a zone and a point in the sketched living room."""
    ring = [[200, -300], [350, -300], [350, -200], [200, -200], [200, -300]]
    return written(
        tmp_path / "drawn.geojson",
        ("LineString", [[480, -150], [520, -480], [300, -600]], {"name": "patrol", "speed": 0.4}),
        ("Polygon", [ring], {"name": "no-go"}),
        ("Point", BESIDE_THE_PLANT, {"name": "dock", "yaw": 0.0}),
    )


@pytest.fixture
def zones(tmp_path):
    """Return a file with a zone and a point on the map of the living room."""
    ring = [[2.0, 1.0], [4.0, 1.0], [4.0, 2.5], [2.0, 2.5], [2.0, 1.0]]
    return written(
        tmp_path / "zones.geojson",
        ("Polygon", [ring], {"name": "carpet"}),
        ("Point", [3.0, 3.0], {"name": "dock"}),
    )


def rows(done):
    assert done.returncode == 0, done.stderr
    return [line.split("\t") for line in done.stdout.splitlines()]


def test_what_is_drawn_is_carried_onto_the_map(command_line, where, drawn, tmp_path):
    out, mask = tmp_path / "out.geojson", tmp_path / "mask.yaml"
    way, picture = tmp_path / "way.yaml", tmp_path / "picture.png"
    files = ["--out", out, "--keepout", mask, "--waypoints", way, "--overlay", picture]
    done = command_line("transfer", *ROOM, drawn, "--radius", 0.2, *files, *where)
    assert [row[:2] for row in rows(done)] == [
        ["patrol", "route"],
        ["no-go", "zone"],
        ["dock", "point"],
    ]
    assert all(0.01 < float(row[2]) < 0.5 for row in rows(done))
    found = read_features(out)
    patrol, zone, dock = found.features
    grid = read_source(LIVING_ROOM_MAP)
    clear = Obstacles.of_grid(grid, allow_unknown=False)
    assert clear.line_is_clear(patrol.points, 0.15)
    assert (patrol.speeds == 0.4).all()
    room = sketchmatch.read_scene(LIVING_ROOM_MAP)
    # Objects 2 and 5 of the map are piano and round table, between which the zone was drawn.
    area = shapely.Polygon(zone.points)
    assert all(area.distance(room.objects[k].polygon) < 0.2 for k in (1, 4))
    plant = room.objects[7].polygon
    assert plant.distance(shapely.Point(dock.points[0])) < 1.0
    forbidden = read_source(mask)
    assert (forbidden.resolution, forbidden.origin) == (grid.resolution, grid.origin)
    assert 0.8 < (forbidden.cells == 100).sum() * 0.05**2 / area.area < 1.6
    assert read_features(way).features[-1].points == pytest.approx(dock.points, abs=1e-6)
    with PIL.Image.open(picture) as drawing:
        assert drawing.size[0] == 1600


def test_the_message_of_the_contract_is_printed(command_line, drawn):
    done = command_line("transfer", *ROOM, drawn, "--json")
    answer = Parse(done.stdout, TransferResponse())
    assert [each.feature.name for each in answer.features] == ["patrol", "no-go", "dock"]
    assert len(answer.object_map) == len(answer.warp.weights) == 8
    assert answer.match.HasField("place_probability")


def test_a_route_that_is_drawn_in_the_sketch_is_carried_without_being_asked(command_line, tmp_path):
    boxes = [[0, 0, 2, 1], [6, 0, 7, 3], [0, 5, 1, 8], [5, 6, 8, 8]]
    rings = [[[a, b], [c, b], [c, d], [a, d], [a, b]] for a, b, c, d in boxes]
    strokes = [{"points": ring, "label": f"thing {k}"} for k, ring in enumerate(rings)]
    strokes.append({"points": [[4, -1], [4, 4], [3, 9]], "label": "route"})
    sketch, map_ = tmp_path / "sketch.json", tmp_path / "map.geojson"
    sketch.write_text(json.dumps({"strokes": strokes}))
    turned = [[[-2 * y, 2 * x] for x, y in ring] for ring in rings]
    written(map_, *(("Polygon", [ring], {}) for ring in turned))
    out = tmp_path / "out.geojson"
    done = command_line("transfer", sketch, map_, "--out", out)
    assert [row[:2] for row in rows(done)] == [["route", "route"]]
    (route,) = read_features(out).features
    assert route.points[[0, -1]] == pytest.approx(np.array([[2, 8], [-18, 6]]), abs=0.3)


def test_there_and_back_ends_within_the_stated_deviation(command_line, drawn, tmp_path):
    there, back = tmp_path / "there.geojson", tmp_path / "back.geojson"
    command_line("transfer", *ROOM, drawn, "--out", there)
    done = command_line("transfer", *ROOM, there, "--direction", "map-to-sketch", "--out", back)
    dock, again = (read_features(each).features[2] for each in (drawn, back))
    assert np.abs(dock.points - again.points).max() < 2.0 * float(rows(done)[2][2])


def test_zones_of_an_old_map_are_carried_to_a_turned_one(command_line, where, zones, tmp_path):
    grid = read_source(LIVING_ROOM_MAP)
    turned = OccupancyGrid(np.rot90(grid.cells, -1), grid.resolution, (10.0, -4.0, 0.0))
    rows_, columns = turned.cells.shape
    shades = np.select([turned.cells == 100, turned.cells == 0], [0, 254], 205).astype(np.uint8)
    (tmp_path / "new.pgm").write_bytes(
        b"P5\n%d %d\n255\n" % (columns, rows_) + shades[::-1].tobytes()
    )
    new = tmp_path / "new.yaml"
    new.write_text(
        "image: new.pgm\nresolution: 0.05\norigin: [10.0, -4.0, 0.0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    out = tmp_path / "out.geojson"
    done = command_line("carry", zones, LIVING_ROOM_MAP, new, "--out", out, *where)
    assert [row[0] for row in rows(done)] == ["carpet", "dock"]

    carpet, dock = (each.points - grid.origin[:2] for each in read_features(zones).features)
    height = grid.cells.shape[0] * grid.resolution
    # Rows grow upwards here, so that this quarter turn of the array is one counter-clockwise.
    true = shapely.Polygon([(10.0 + height - y, x - 4.0) for x, y in carpet])
    there, point = (each.points for each in read_features(out).features)
    area = shapely.Polygon(there)
    assert area.intersection(true).area / area.union(true).area > 0.9
    assert point == pytest.approx(
        np.array([[10.0 + height - dock[0, 1], dock[0, 0] - 4.0]]), abs=0.1
    )


BOXES = [[0, 0, 2, 1], [6, 0, 7, 3], [0, 5, 1, 8], [5, 6, 8, 8], [9, 4, 10, 5]]
CORNERS = [np.array([[a, b], [c, b], [c, d], [a, d], [a, b]], float) for a, b, c, d in BOXES]
CARPET = np.array([[2.0, 2.0], [5.0, 2.0], [5.0, 5.0], [2.0, 5.0], [2.0, 2.0]])


def globe(metres, x, y):
    """Return metres as longitudes and latitudes at a place."""
    unit = np.radians(6_371_008.8) * np.array([np.cos(np.radians(y)), 1.0])
    return (metres / unit + (x, y)).tolist()


def test_zones_in_degrees_are_carried_in_degrees(command_line, where, tmp_path):
    quarter = np.array([[0.0, 2.0], [-2.0, 0.0]])  # twice as large: not the same numbers
    old = written(
        tmp_path / "old.geojson", *(("Polygon", [globe(ring, 13.0, 52.0)], {}) for ring in CORNERS)
    )
    new = written(
        tmp_path / "new.geojson",
        *(("Polygon", [globe(ring @ quarter, 7.0, -35.0)], {}) for ring in CORNERS),
    )
    zones = written(tmp_path / "zones.geojson", ("Polygon", [globe(CARPET, 13.0, 52.0)], {}))
    out = tmp_path / "out.geojson"
    done = command_line("carry", zones, old, new, "--out", out, *where)
    assert float(rows(done)[0][2]) < 0.7
    assert "features: The coordinates are longitudes and latitudes" in done.stderr
    (found,) = json.loads(out.read_text())["features"]
    expected = globe(CARPET @ quarter, 7.0, -35.0)
    assert found["geometry"]["coordinates"][0] == pytest.approx(np.array(expected), abs=1e-6)


def test_what_is_in_degrees_is_carried_to_what_is_not_and_back(command_line, tmp_path):
    map_ = written(
        tmp_path / "map.geojson", *(("Polygon", [globe(ring, 13.0, 52.0)], {}) for ring in CORNERS)
    )
    sketch = tmp_path / "sketch.json"
    strokes = [{"points": (50.0 * ring).tolist()} for ring in CORNERS]
    sketch.write_text(json.dumps({"strokes": strokes}))
    there, back = tmp_path / "there.geojson", tmp_path / "back.geojson"
    zones = written(tmp_path / "zones.geojson", ("Polygon", [globe(CARPET, 13.0, 52.0)], {}))
    rows(
        command_line(
            "transfer", sketch, map_, zones, "--direction", "map-to-sketch", "--out", there
        )
    )
    drawn = read_features(there).features[0].points
    assert drawn == pytest.approx(50.0 * CARPET[:-1], abs=5.0)
    rows(command_line("transfer", sketch, map_, there, "--out", back))
    (found,) = json.loads(back.read_text())["features"]
    expected = globe(CARPET, 13.0, 52.0)
    assert found["geometry"]["coordinates"][0] == pytest.approx(np.array(expected), abs=1e-6)


def test_zones_in_degrees_of_a_map_in_metres_are_refused(command_line, tmp_path):
    zones = written(tmp_path / "zones.geojson", ("Polygon", [globe(CARPET, 13.0, 52.0)], {}))
    done = command_line("carry", zones, LIVING_ROOM_MAP, LIVING_ROOM_MAP)
    assert (done.returncode, done.stdout) == (ExitCode.INVALID_INPUT, "")
    assert done.stderr.startswith(f"sketchmatch: {zones} holds longitudes and latitudes")
    assert done.stderr.count("\n") == 1


def test_in_python_it_is_the_same(zones):
    given = read_features(zones).features
    found = sketchmatch.carry(given, LIVING_ROOM_MAP, LIVING_ROOM_MAP)
    carpet = shapely.Polygon(found.features[0].points)
    true = shapely.Polygon(given[0].points)
    assert carpet.intersection(true).area / carpet.union(true).area > 0.98
    assert "carried by a warp" in str(found)
    known = sketchmatch.transfer(
        *ROOM, [Feature("point", (np.array([BESIDE_THE_PLANT]),))], object_map={2: 7, 0: 6, 4: 1}
    )
    assert known.match is None
    assert known.object_map == ((2, 7), (0, 6), (4, 1))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["transfer", *ROOM], "features is empty, and the sketch has no route"),
        (["transfer", *ROOM, "nowhere.geojson"], "nowhere.geojson does not exist"),
        (["transfer", *ROOM, "DRAWN", "--radius", "-1"], "--radius"),
        (["transfer", *ROOM, "DRAWN", "--out", "out.txt"], "--out is 'out.txt'"),
        (["transfer", *ROOM, "DRAWN", "--keepout", "mask.png"], "--keepout is 'mask.png'"),
        (["transfer", *ROOM, "DRAWN", "--pin", "sofa=99"], "--pin sofa=99"),
        (
            ["transfer", LIVING_ROOM_SKETCH, LIVING_ROOM_SKETCH, "DRAWN", "--keepout", "mask.yaml"],
            "--keepout needs a map with cells",
        ),
        (["carry", "DRAWN", LIVING_ROOM_MAP, "gone.yaml"], "gone.yaml does not exist"),
        *(
            ([*command, option, value], words)
            for command in (["transfer", *ROOM, "DRAWN"], ["carry", "DRAWN", *ROOM[1:] * 2])
            for option, value, words in (
                ("--searcher", "luck", "'luck', which is not a searcher"),
                ("--judge", "solomon", "'solomon', which is not a judge"),
                ("--histogram", "none", "'none', which is not a histogram"),
                ("--similarity", "taste", "'taste', which is not a similarity"),
                ("--seed", "-1", "seed"),
                ("--time-budget", "0", "time_budget"),
                ("--weights", "1,2", "--weights '1,2' is not three, five or six numbers"),
                ("--unmatched-price", "-1", "unmatched_price"),
                ("--set", "searcher.maps=0", "maps"),
                ("--synonyms", "couch", "--synonyms 'couch' is not a list of two or more labels"),
            )
        ),
        (["carry", LIVING_ROOM_SKETCH, *ROOM[1:], *ROOM[1:]], "is not JSON"),
    ],
)
def test_what_cannot_be_carried_is_told_in_one_line(command_line, drawn, arguments, words):
    done = command_line(*(drawn if each == "DRAWN" else each for each in arguments))
    assert (done.returncode, done.stdout) == (ExitCode.INVALID_INPUT, "")
    assert done.stderr.startswith("sketchmatch: ")
    assert done.stderr.count("\n") == 1
    assert words in done.stderr


def test_a_mirrored_map_is_refused(command_line, tmp_path):
    boxes = [[0, 0, 2, 1], [6, 0, 7, 3], [0, 5, 1, 8], [5, 6, 8, 8], [9, 4, 10, 5]]
    rings = [[[a, b], [c, b], [c, d], [a, d], [a, b]] for a, b, c, d in boxes]
    plain = written(tmp_path / "plain.geojson", *(("Polygon", [r], {}) for r in rings))
    mirror = [[[x, -y] for x, y in ring] for ring in rings]
    mirrored = written(tmp_path / "mirrored.geojson", *(("Polygon", [r], {}) for r in mirror))
    point = written(tmp_path / "point.geojson", ("Point", [1, 1], {}))
    pins = [word for k in range(1, 6) for word in ("--pin", f"{k}={k}")]
    done = command_line("transfer", plain, mirrored, point, *pins)
    assert done.returncode == ExitCode.INVALID_INPUT
    assert "mirror image" in done.stderr
    assert done.stderr.count("\n") == 1
