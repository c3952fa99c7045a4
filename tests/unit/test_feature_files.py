"""Points, routes and zones in files: GeoJSON, and what nav2 reads."""

import json
import math

import numpy as np
import pytest
import shapely

from sketchmatch.cli.carried import Carriage, save
from sketchmatch.errors import InvalidInputError
from sketchmatch.io.ros_map import MapServerHeader, decode_map_server
from sketchmatch.model import Landmark, OccupancyGrid
from sketchmatch.transfers.features import Carried, Change, ChangeReason, Feature
from sketchmatch.transfers.files import (
    check_targets,
    encode_carried,
    encode_keepout,
    encode_waypoints,
    landmarks_of,
    read_features,
    save_keepout,
)
from sketchmatch.transfers.obstacles import Obstacles
from sketchmatch_map_files import parse
from sketchmatch_proto.v1.transfer_service_pb2 import TransferResponse

ZONE = np.array([[1.0, 1.0], [3.0, 1.0], [3.0, 2.5], [1.0, 2.5]])
HOLE = np.array([[1.5, 1.5], [2.0, 1.5], [2.0, 2.0]])


def kept(kind, *rings, name="", speeds=None, changes=()):
    """Return a feature that came to where it was."""
    feature = Feature(kind, tuple(np.array(ring) for ring in rings), name, speeds)
    lengths = [len(ring) for ring in feature.rings]
    return Carried(
        feature.kind,
        name,
        feature,
        tuple(np.full(n, 0.25) for n in lengths),
        tuple(np.arange(float(n)) for n in lengths),
        changes,
    )


def written(tmp_path, document, name="features.geojson"):
    path = tmp_path / name
    path.write_text(document if isinstance(document, str) else json.dumps(document), "utf-8")
    return path


def feature(kind, coordinates, **properties):
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def collection(*features):
    return {"type": "FeatureCollection", "features": list(features)}


def test_geojson_is_read_kind_by_kind(tmp_path):
    ring = [*ZONE.tolist(), ZONE[0].tolist()]
    document = collection(
        feature("Point", [1, 2, 9], name="dock", yaw=0.5),
        feature("LineString", [[0, 0], [1, 0], [2, 1]], label="patrol", speed=0.5),
        feature("LineString", [[0, 0], [1, 0]], speeds=[0.5, 0.25]),
        feature("Polygon", [ring, HOLE.tolist()], name="no-go"),
        feature("MultiPolygon", [[ring], [(ZONE + 5).tolist()]], name="both"),
        {"type": "Feature", "properties": None, "geometry": None},
        {"type": "Feature", "properties": {"name": "attic"}, "geometry": None},
    )
    found = read_features(written(tmp_path, document))
    kinds = [str(each.kind) for each in found.features]
    assert kinds == ["point", "route", "route", "zone", "zone", "zone"]
    assert [each.name for each in found.features] == ["dock", "patrol", "", "no-go", "both", "both"]
    assert found.features[0].points.tolist() == [[1.0, 2.0]]
    assert found.features[1].speeds.tolist() == [0.5, 0.5, 0.5]
    assert found.features[2].speeds.tolist() == [0.5, 0.25]
    assert [ring.tolist() for ring in found.features[3].rings] == [ZONE.tolist(), HOLE.tolist()]
    assert found.features[5].points.tolist() == (ZONE + 5).tolist()
    assert found.properties[0] == {"name": "dock", "yaw": 0.5}
    assert found.notes == (
        "features[5] was left out: it has no place.",
        "features[6] 'attic' was left out: it has no place.",
    )


@pytest.mark.parametrize(
    ("document", "words"),
    [
        ("{", "is not JSON"),
        ([], r"is a list of 0; give GeoJSON"),
        ({"type": "Curve"}, "type is not a geometry"),
        (collection(), "holds no point, route or zone"),
        (collection(feature("Point", [1])), r"features\[0\]\.geometry\.coordinates\[0\] has fewer"),
        (collection(feature("LineString", [[1, 2]])), "has 1 point; a route has 2 or more"),
        (
            collection(feature("Polygon", [[[0, 0], [1, "x"], [1, 1]]])),
            r"coordinates\[0\]\[1\]\[1\] is \"x\"; give a finite number",
        ),
        (
            collection(feature("LineString", [[0, 0], [1, 0]], speeds=[1])),
            r"features\[0\]\.properties\.speeds are 1 for 2 points",
        ),
        (
            collection(feature("LineString", [[0, 0], [1, 0]], speeds=[1, "slow"])),
            r"features\[0\]\.properties\.speeds\[1\] is \"slow\"; give a finite number",
        ),
        (
            feature("LineString", [[0, 0], [1, 0]], speed="fast"),
            r": properties\.speed is \"fast\"; give a finite number",
        ),
        (
            collection(feature("Point", [1, 2], yaw="1.57")),
            r"features\[0\]\.properties\.yaw is \"1.57\"; give a finite number",
        ),
        (collection(3), r"features\[0\] is 3; give a feature"),
    ],
)
def test_geojson_that_cannot_be_carried_is_refused_in_a_sentence(tmp_path, document, words):
    path = written(tmp_path, document)
    with pytest.raises(InvalidInputError, match=words) as refused:
        read_features(path)
    assert refused.value.field.startswith(str(path))


def test_what_was_carried_is_written_with_what_it_had_and_reads_back(tmp_path):
    changes = (Change(ChangeReason.OBSTACLE, 0, 1, "Led around sofa."),)
    carried = [
        kept(
            "route", [[0, 0], [2, 1]], name="patrol", speeds=np.array([0.5, 0.1]), changes=changes
        ),
        kept("zone", ZONE, HOLE, name="no-go"),
        kept("point", [[4, 5]], name="dock"),
        Carried("route", "attic", None, (), (), changes),
    ]
    said = [{"name": "patrol", "speed": 0.5}, {"colour": "red"}, {"yaw": 3.0}, {"changes": 7}]
    text = encode_carried(carried, said, math.pi / 2)
    patrol, zone, dock, attic = json.loads(text)["features"]
    assert patrol["properties"] == {
        "name": "patrol",
        "speeds": [0.5, 0.1],
        "deviation": 0.25,
        "deviations": [[0.25, 0.25]],
        "changes": [{"reason": "obstacle", "first": 0, "last": 1, "sentence": "Led around sofa."}],
    }
    assert zone["properties"]["colour"] == "red"
    assert dock["properties"]["yaw"] == pytest.approx(3.0 + math.pi / 2 - 2 * math.pi, abs=1e-5)
    assert attic["geometry"] is None
    assert attic["properties"]["changes"][0]["reason"] == "obstacle"
    found = read_features(written(tmp_path, text))
    assert [each.name for each in found.features] == ["patrol", "no-go", "dock"]
    for each, was in zip(found.features, carried, strict=False):
        assert [r.tolist() for r in each.rings] == [r.tolist() for r in was.feature.rings]


BERLIN = (13.4, 52.5)
CRS84 = {"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}
WGS84 = {"type": "name", "properties": {"name": "EPSG:4326"}}


def test_speeds_and_headings_of_other_things_are_properties_as_all_others():
    zone, point = {"speed": 0.3, "yaw": "any"}, {"speeds": [1, 2], "name": "post"}
    lost = {"speed": 0.5, "name": "attic"}
    carried = [kept("zone", ZONE), kept("point", [[4, 5]]), Carried("route", "attic", None, (), ())]
    text = encode_carried(carried, [zone, point, lost], 0.0)
    for each, said in zip(json.loads(text)["features"], (zone, point, lost), strict=True):
        assert said.items() <= each["properties"].items()


def around(middle, metres):
    """Return the longitude and latitude of points in metres east and north of a place."""
    unit = 2 * math.pi * 6_371_008.8 / 360.0
    x, y = middle
    wide = unit * math.cos(math.radians(y))
    return [[x + east / wide, y + north / unit] for east, north in metres]


@pytest.mark.parametrize("said", [{}, {"crs": CRS84}, {"crs": WGS84}])
def test_longitudes_and_latitudes_of_features_are_metres_where_those_of_their_map_are(
    tmp_path, said
):
    document = collection(
        feature("Polygon", [around(BERLIN, ZONE)], name="no-go"),
        feature("Point", around(BERLIN, [(-4.0, 7.5)])[0], name="dock"),
    )
    found = read_features(written(tmp_path, {**document, **said}), BERLIN)
    zone, dock = found.features
    assert zone.points == pytest.approx(ZONE, abs=1e-6)
    assert dock.points == pytest.approx(np.array([[-4.0, 7.5]]), abs=1e-6)
    assert found.notes == (
        "The coordinates are longitudes and latitudes, and were turned into metres.",
    )


@pytest.mark.parametrize(
    ("said", "points"),
    [
        ({"crs": None}, around(BERLIN, ZONE)),  # of which our own files say that they are not
        ({}, ZONE.tolist()),
        ({"crs": CRS84}, ZONE.tolist()),  # as tools say of what is in metres
        ({}, [[400.0, 52.5], [401.0, 52.5], [401.0, 53.5]]),
    ],
)
@pytest.mark.parametrize("origin", [None, BERLIN])
def test_other_coordinates_of_features_stay_as_they_are(tmp_path, said, points, origin):
    document = {**collection(feature("Polygon", [points])), **said}
    found = read_features(written(tmp_path, document), origin)
    assert found.features[0].points.tolist() == points
    assert found.notes == ()


@pytest.mark.parametrize("said", [{}, {"crs": CRS84}])
@pytest.mark.parametrize(
    ("origin", "words"), [(None, "has none; give"), ((52.5, 13.4), "lies elsewhere; give")]
)
def test_longitudes_and_latitudes_of_no_place_on_the_map_are_refused(tmp_path, said, origin, words):
    document = {**collection(feature("Polygon", [around(BERLIN, ZONE)])), **said}
    path = written(tmp_path, document)
    with pytest.raises(InvalidInputError, match=words) as refused:
        read_features(path, origin)
    assert str(refused.value).startswith(f"{path} holds longitudes and latitudes")


def test_a_point_alone_is_in_metres_of_what_is_and_else_has_to_say_so(tmp_path):
    document = collection(feature("Point", [2.35, 48.85]))
    path = written(tmp_path, document)
    assert read_features(path).features[0].points.tolist() == [[2.35, 48.85]]
    with pytest.raises(InvalidInputError, match="lies elsewhere; give"):
        read_features(path, BERLIN)
    found = read_features(written(tmp_path, {**document, "crs": None}), BERLIN)
    assert found.features[0].points.tolist() == [[2.35, 48.85]]


def test_what_is_carried_onto_a_map_in_degrees_is_written_in_degrees(tmp_path):
    carried = [kept("zone", ZONE, HOLE, name="no-go"), kept("point", [[4, 5]], name="dock")]
    text = encode_carried(carried, [{}, {}], 0.0, BERLIN)
    zone, dock = json.loads(text)["features"]
    first = around(BERLIN, ZONE[:1])[0]
    assert zone["geometry"]["coordinates"][0][0] == pytest.approx(first, abs=1e-11)
    assert dock["geometry"]["coordinates"] == pytest.approx(around(BERLIN, [(4, 5)])[0], abs=1e-11)
    assert zone["properties"]["deviation"] == 0.25
    found = read_features(written(tmp_path, text), BERLIN)
    for each, was in zip(found.features, carried, strict=True):
        for ring, true in zip(each.rings, was.feature.rings, strict=True):
            assert ring == pytest.approx(true, abs=1e-6)


GRID = OccupancyGrid(np.zeros((40, 60), dtype=np.int8), 0.1, (-1.0, -0.5, 0.0))


def mask(*carried, properties=None):
    said = [{}] * len(carried) if properties is None else properties
    text, picture = encode_keepout(carried, said, GRID, "mask.pgm")
    return decode_map_server(text, picture), text, picture


def test_a_keepout_mask_forbids_each_cell_that_a_zone_reaches_into():
    found, text, _ = mask(kept("zone", ZONE), kept("route", [[0, 0], [1, 1]]))
    assert (found.resolution, found.origin, found.cells.shape) == (0.1, GRID.origin, (40, 60))
    assert 'image: "mask.pgm"\n' in text
    rows, columns = np.mgrid[:40, :60]
    cells = shapely.box(
        columns / 10 - 1.0, rows / 10 - 0.5, (columns + 1) / 10 - 1.0, (rows + 1) / 10 - 0.5
    )
    zone = shapely.Polygon(ZONE)
    forbidden = found.cells == 100
    assert forbidden[shapely.intersects(zone.buffer(-1e-6), cells)].all()
    assert not forbidden[shapely.distance(zone, cells) > 0.1].any()
    assert (found.cells[~forbidden] == 0).all()


def test_a_slanted_zone_on_a_turned_map_leaves_no_cell_free_that_it_covers_a_part_of():
    rng = np.random.default_rng(3)
    grid = OccupancyGrid(np.zeros((50, 60), dtype=np.int8), 0.1, (-3.0, 1.0, 0.7))
    rows, columns = np.mgrid[:50, :60]
    c, s = math.cos(0.7), math.sin(0.7)
    cells = shapely.transform(
        shapely.box(columns / 10, rows / 10, (columns + 1) / 10, (rows + 1) / 10),
        lambda p: p @ np.array([[c, s], [-s, c]]) + (-3.0, 1.0),
    )
    for _ in range(20):
        angles = np.sort(rng.uniform(0.0, 2 * np.pi, 6))
        ring = np.stack([-2.5 + 2 * np.cos(angles), 4.8 + 2 * np.sin(angles)], axis=1)
        text, picture = encode_keepout([kept("zone", ring)], [{}], grid, "mask.pgm")
        forbidden = decode_map_server(text, picture).cells == 100
        covered = shapely.area(shapely.intersection(cells, shapely.Polygon(ring)))
        assert ((covered > 1e-8) <= forbidden).all()
        assert (forbidden <= (covered > 0.0)).all()


NAMES = ["floor #2", "a: b", 'it\'s "this"', "- [x", "Küche \N{SLICE OF PIZZA}", "yes", "a\\b"]
NUMBERS = ["12", "1e5", "nan"]


@pytest.mark.parametrize("name", NAMES)
def test_a_mask_names_its_picture_whatever_that_is_called(tmp_path, name):
    text, picture = encode_keepout([kept("zone", ZONE)], [{}], GRID, f"{name}.pgm")
    assert parse(text).values["image"] == f"{name}.pgm"
    path = tmp_path / f"{name}.yaml"
    save_keepout(path, text, picture, "--keepout")
    assert len(read_features(path).features) == 1


@pytest.mark.parametrize("name", [*NAMES, *NUMBERS])
def test_waypoints_have_their_names_whatever_these_are(tmp_path, name):
    text = encode_waypoints([kept("point", [[4, 5]], name=name)], [{}], 0.0)
    (found,) = read_features(written(tmp_path, text, "waypoints.yaml")).features
    assert found.name == name


def test_a_zone_that_is_none_to_keep_out_of_is_left_out_of_the_mask():
    found, _, _ = mask(kept("zone", ZONE), properties=[{"keepout": False}])
    assert (found.cells == 0).all()


def test_a_mask_is_read_as_zones(tmp_path):
    ring = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 2.0], [0.0, 2.0]])
    hole = np.array([[1.0, 0.6], [2.0, 0.6], [2.0, 1.4], [1.0, 1.4]])
    other = np.array([[3.5, 0.5], [4.7, 0.5], [4.7, 2.5], [3.5, 2.5]])
    _, text, picture = mask(kept("zone", ring, hole), kept("zone", other))
    (tmp_path / "mask.pgm").write_bytes(picture)
    found = read_features(written(tmp_path, text, "mask.yaml"))
    areas = [shapely.Polygon(each.rings[0], each.rings[1:]) for each in found.features]
    assert sorted(len(each.rings) for each in found.features) == [1, 2]
    for true in (shapely.Polygon(ring, [hole]), shapely.Polygon(other)):
        best = max(areas, key=lambda each: true.intersection(each).area)
        shared = true.intersection(best).area / true.union(best).area
        assert shared > 0.8


def test_what_a_mask_forbids_in_part_is_said_to_be_left_out(tmp_path):
    _, text, picture = mask(kept("zone", ZONE))
    shades = bytearray(picture)
    shades[-2:] = 128, 128
    (tmp_path / "mask.pgm").write_bytes(shades)
    path = written(tmp_path, text.replace("trinary", "scale"), "mask.yaml")
    found = read_features(path)
    assert len(found.features) == 1
    assert found.notes == (
        "2 cells of the mask are neither free nor forbidden, and were left out.",
    )


@pytest.mark.parametrize("seed", range(12))
def test_zones_of_a_mask_cover_each_forbidden_cell_and_hardly_more(tmp_path, seed):
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:30, :40]
    forbidden = rng.random((30, 40)) < rng.choice([0.0, 0.02, 0.3])
    forbidden |= np.abs(y - rng.uniform(-1.0, 1.0) * x - 12.0) < rng.uniform(0.3, 4.0)
    row, column = rng.integers(0, 20, 2)
    forbidden[row : row + 8, column : column + 15] = True
    forbidden[row + 3 : row + 5, column + 3 : column + 9] = False
    shades = np.where(forbidden[::-1], 0, 254).astype(np.uint8)
    (tmp_path / "mask.pgm").write_bytes(b"P5\n40 30\n255\n" + shades.tobytes())
    header = MapServerHeader(0.25, (-3.0, 1.0, 0.7), False, 0.65, 0.25, "trinary")
    path = written(tmp_path, header.text("mask.pgm"), "mask.yaml")
    cells = Obstacles(forbidden, header.resolution, header.origin)
    local = [[cells.local(ring) for ring in zone.rings] for zone in read_features(path).features]
    found = shapely.union_all([shapely.Polygon(outline, holes) for outline, *holes in local])
    rows, columns = np.argwhere(forbidden).T
    true = shapely.union_all(shapely.box(rows, columns, rows + 1.0, columns + 1.0))
    assert found.buffer(1e-6).covers(true)
    assert true.buffer(1.5).covers(found)
    assert found.area < true.area + 0.25 * true.length


def test_zones_of_a_mask_have_the_corners_of_what_is_straight(tmp_path):
    ring = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 2.0], [0.0, 2.0]])
    _, text, picture = mask(kept("zone", ring))
    (tmp_path / "mask.pgm").write_bytes(picture)
    (zone,) = read_features(written(tmp_path, text, "mask.yaml")).features
    assert sorted(zone.points.round(9).tolist()) == sorted(ring.tolist())


def test_waypoints_are_written_in_order_and_read_back(tmp_path):
    carried = [
        kept("point", [[4, 5]], name="dock"),
        kept("zone", ZONE),
        kept("route", [[0, 0], [0, 2], [-1, 2]], speeds=np.array([0.5, 0.25, 0.1])),
    ]
    text = encode_waypoints(carried, [{"yaw": 0.5}, {}, {}], 0.25)
    assert text.splitlines()[:4] == [
        "waypoints:",
        "  waypoint0:",
        "    pose: [4.000000, 5.000000, 0.0]",
        "    orientation: [0.930508, 0.0, 0.0, 0.366273]",
    ]
    assert [line for line in text.splitlines() if "speed" in line] == [
        "    speed: 0.5",
        "    speed: 0.25",
        "    speed: 0.1",
    ]
    found = read_features(written(tmp_path, text, "waypoints.yaml"))
    assert [each.points[0].tolist() for each in found.features] == [
        [4.0, 5.0],
        [0.0, 0.0],
        [0.0, 2.0],
        [-1.0, 2.0],
    ]
    assert [each.name for each in found.features] == ["dock", "waypoint1", "waypoint2", "waypoint3"]
    assert [said.get("speed") for said in found.properties] == [None, 0.5, 0.25, 0.1]
    again = [kept("point", each.points, name=each.name) for each in found.features]
    speeds = [line for line in text.splitlines() if "speed" in line]
    text = encode_waypoints(again, found.properties, 0.0)
    assert [line for line in text.splitlines() if "speed" in line] == speeds
    headings = [said["yaw"] for said in found.properties]
    expected = [0.75, math.pi / 2, math.pi, math.pi]
    assert np.cos(headings) == pytest.approx(np.cos(expected), abs=1e-5)
    assert np.sin(headings) == pytest.approx(np.sin(expected), abs=1e-5)


@pytest.mark.parametrize(
    ("points", "expected"),
    [
        ([[0, 0], [0, 0], [0, 1], [-1, 1], [-1, 1], [-1, 1]], [0.5, 0.5, 1, 1, 1, 1]),
        ([[0, 0], [-1, 0], [-1, 0], [-1, -1]], [1, -0.5, -0.5, -0.5]),
        ([[2, 2], [2, 2]], [0, 0]),
    ],
)
def test_a_waypoint_where_a_route_stays_looks_to_where_it_goes_on(tmp_path, points, expected):
    text = encode_waypoints([kept("route", points)], [{}], 0.0)
    found = read_features(written(tmp_path, text, "waypoints.yaml"))
    yaws = [said["yaw"] for said in found.properties]
    assert yaws == pytest.approx(np.pi * np.array(expected), abs=1e-5)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("waypoints: [1, 2]", "waypoints is a list of 2; give waypoints by name"),
        ("waypoints: {a: {pose: [1, x, 0]}}", r"waypoints\.a\.pose\[0\]\[1\] is \"x\""),
        (
            "waypoints: {a: {pose: [1, 2, 0], orientation: [1, 0, 0]}}",
            r"waypoints\.a\.orientation has 3 numbers; give \[w, x, y, z\]",
        ),
        (
            "waypoints: {a: {pose: [1, 2, 0], speed: fast}}",
            r"waypoints\.a\.speed is \"fast\"; give a finite number",
        ),
        ("waypoints: {}", "holds no point, route or zone"),
        ("key: [", "YAML"),
    ],
)
def test_a_yaml_that_is_neither_waypoints_nor_a_mask_is_refused(tmp_path, text, words):
    path = written(tmp_path, text, "given.yaml")
    with pytest.raises(InvalidInputError, match=words) as refused:
        read_features(path)
    assert refused.value.field.startswith(str(path))


@pytest.mark.parametrize(("yaw", "said"), [(0.0, ""), (0.4, "origin is turned by 0.4 rad")])
def test_that_nav2_takes_no_notice_of_a_turned_mask_is_said(tmp_path, capsys, yaw, said):
    text = MapServerHeader(0.5, (0.0, 0.0, yaw), False, 0.65, 0.25, "trinary").text("map.pgm")
    (tmp_path / "map.pgm").write_bytes(b"P5\n8 6\n255\n" + bytes([254] * 48))
    path, out = written(tmp_path, text, "map.yaml"), tmp_path / "mask.yaml"
    found = Carriage(TransferResponse(), (None,), (kept("zone", ZONE),), ({},), True)
    save(found, path, None, out, None)
    assert read_features(out).features
    assert said in capsys.readouterr().err


def test_mask_and_waypoints_do_not_overwrite_each_other(tmp_path):
    mask, way = tmp_path / "nav2.yaml", tmp_path / "way.yaml"
    check_targets(None, mask, way)
    with pytest.raises(InvalidInputError, match="under which --keepout is saved") as refused:
        check_targets(None, mask, tmp_path / ".." / tmp_path.name / "nav2.yaml")
    assert refused.value.field == "--waypoints"


def test_what_a_map_names_are_points_and_no_waypoints():
    grid = OccupancyGrid(
        np.zeros((2, 2)), 1.0, landmarks=(Landmark("desk", (1.0, 2.0), "furniture"),)
    )
    found = landmarks_of(grid)
    assert found.features[0].name == "desk"
    assert found.features[0].points.tolist() == [[1.0, 2.0]]
    assert found.properties == ({"name": "desk", "type": "furniture", "waypoint": False},)
    carried = [kept("point", each.points, name=each.name) for each in found.features]
    assert encode_waypoints(carried, found.properties, 0.0) == "waypoints: {}\n"
