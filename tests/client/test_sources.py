import codecs
import io

import numpy as np
import pytest

from sketchmatch_client import InvalidRequestError, sources
from sketchmatch_proto.v1 import source_pb2

TRIANGLE = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0)]
HOLE = [(1.0, 0.1), (1.5, 0.1), (1.5, 0.2)]


def corners(ring):
    return [(point.x, point.y) for point in ring.points]


class TestStrokes:
    def test_points_with_and_without_time(self):
        timed = [(x, y, k / 10) for k, (x, y) in enumerate(TRIANGLE)]
        drawn = sources.strokes([TRIANGLE, timed], ["sofa", "bed"], y_axis="down").stroke_set
        assert drawn.y_axis == source_pb2.Y_AXIS_DOWN
        assert [stroke.label for stroke in drawn.strokes] == ["sofa", "bed"]
        assert corners(drawn.strokes[0]) == corners(drawn.strokes[1]) == TRIANGLE
        assert not drawn.strokes[0].points[0].HasField("time_seconds")
        assert [point.time_seconds for point in drawn.strokes[1].points] == [0.0, 0.1, 0.2]
        assert drawn.strokes[1].points[0].HasField("time_seconds")

    def test_labels_may_be_numbers_and_none(self):
        given = [0, True, None, float("nan"), np.int64(3), np.bool_(False), "desk", np.str_("a")]
        for labels in (given, np.array(given, dtype=object)):
            drawn = sources.strokes([TRIANGLE] * 8, labels).stroke_set.strokes
            names = ["0", "True", "", "", "3", "False", "desk", "a"]
            assert [stroke.label for stroke in drawn] == names
        drawn = sources.polygons([TRIANGLE] * 2, [0, None]).polygon_set.polygons
        assert [polygon.label for polygon in drawn] == ["0", ""]

    def test_half_a_character_is_replaced(self):
        (drawn,) = sources.strokes([TRIANGLE], ["\ud83d desk \U0001f6cb"]).stroke_set.strokes
        assert drawn.label == "\N{REPLACEMENT CHARACTER} desk \U0001f6cb"

    @pytest.mark.parametrize(
        ("labels", "field", "remedy"),
        [
            (["a", b"b"], "labels[1]", "give text"),
            ([["a"], "b"], "labels[0]", "give text"),
            ("ab", "labels", "give a list of names"),
            ({"a": 1, "b": 2}, "labels", "give a list of names"),
            (["a"], "labels", "give one for each, or none"),
        ],
    )
    def test_what_is_no_label_is_refused(self, labels, field, remedy):
        for make in (sources.strokes, sources.polygons):
            with pytest.raises(InvalidRequestError, match=remedy) as caught:
                make([TRIANGLE] * 2, labels)
            assert (caught.value.reason, caught.value.field) == ("INVALID_FIELD", field)

    def test_arrays(self):
        assert sources.strokes([np.array(TRIANGLE)]) == sources.strokes([TRIANGLE])

    @pytest.mark.parametrize(
        ("strokes", "field"),
        [
            ([TRIANGLE, [(0, 0), (1,)]], "stroke_set.strokes[1].points[1]"),
            ([[(0, 0, 0, 0)]], "stroke_set.strokes[0].points[0]"),
            ([[("a", "b")]], "stroke_set.strokes[0].points[0]"),
            ([[1, 2, 3]], "stroke_set.strokes[0].points[0]"),
            ([7], "stroke_set.strokes[0].points"),
        ],
    )
    def test_bad_points_are_named(self, strokes, field):
        with pytest.raises(InvalidRequestError) as caught:
            sources.strokes(strokes)
        assert caught.value.field == field
        assert caught.value.reason == "INVALID_STROKE"
        assert str(caught.value).startswith(f"{field} is not ")

    def test_labels_must_fit(self):
        with pytest.raises(InvalidRequestError, match="labels has 1 names for 2 strokes"):
            sources.strokes([TRIANGLE, TRIANGLE], ["sofa"])

    def test_unknown_axis(self):
        with pytest.raises(InvalidRequestError, match="y_axis is 'left'; give 'up', or 'down'"):
            sources.strokes([TRIANGLE], y_axis="left")


class TestPolygons:
    def test_outlines_and_rings(self):
        drawn = sources.polygons([TRIANGLE, [TRIANGLE, HOLE]], ["a", "b"]).polygon_set
        assert drawn.y_axis == source_pb2.Y_AXIS_UP
        plain, holed = drawn.polygons
        assert (plain.label, holed.label) == ("a", "b")
        assert [corners(ring) for ring in plain.rings] == [TRIANGLE]
        assert [corners(ring) for ring in holed.rings] == [TRIANGLE, HOLE]

    @pytest.mark.parametrize("dtype", [np.float64, np.float32, np.int64])
    def test_arrays(self, dtype):
        outline = np.array([[0, 0], [2, 0], [2, 1]], dtype=dtype)
        assert sources.polygons([outline]) == sources.polygons([outline.tolist()])
        assert sources.polygons([[outline]]) == sources.polygons([outline.tolist()])

    @pytest.mark.parametrize("polygon", [[], [[]], [(0, 0, 0)], [("a", "b")], 5])
    def test_bad_polygons_are_named(self, polygon):
        with pytest.raises(InvalidRequestError) as caught:
            sources.polygons([TRIANGLE, polygon])
        assert caught.value.field == "polygon_set.polygons[1]"
        assert caught.value.reason == "INVALID_POLYGON"


class TestOccupancyGrid:
    ROWS = ([0, 100, -1], [0, 0, 100])
    BYTES = bytes([0, 100, 255, 0, 0, 100])

    @pytest.mark.parametrize(
        "cells",
        [
            [[0, 100, -1], [0, 0, 100]],
            np.array(ROWS, dtype=np.int8),
            np.array(ROWS, dtype=np.int64),
            np.asfortranarray(np.array(ROWS, dtype=np.int8)),
        ],
        ids=["lists", "int8", "int64", "columns first"],
    )
    def test_rows(self, cells):
        grid = sources.occupancy_grid(cells, 0.05, (1.0, 2.0, 0.5)).occupancy_grid
        assert (grid.rows, grid.columns, grid.cells) == (2, 3, self.BYTES)
        assert grid.resolution_meters == 0.05
        assert (grid.origin.x_meters, grid.origin.y_meters, grid.origin.yaw_radians) == (1, 2, 0.5)

    @pytest.mark.parametrize("cells", [BYTES, bytearray(BYTES), [0, 100, -1, 0, 0, 100]])
    def test_flat(self, cells):
        grid = sources.occupancy_grid(cells, 0.05, columns=3).occupancy_grid
        assert (grid.rows, grid.columns, grid.cells) == (2, 3, self.BYTES)

    @pytest.mark.parametrize("columns", [None, 4])
    def test_flat_cells_need_their_width(self, columns):
        with pytest.raises(InvalidRequestError, match="for 6 cells; give the number of cells"):
            sources.occupancy_grid(self.BYTES, 0.05, columns=columns)

    @pytest.mark.parametrize(
        "cells", [[[0, 1], [0]], [[0, 300]], [["a"]], [[0.5]], 7, None, np.zeros((2, 2, 2))]
    )
    def test_bad_cells(self, cells):
        with pytest.raises(InvalidRequestError) as caught:
            sources.occupancy_grid(cells, 0.05)
        assert caught.value.field == "occupancy_grid.cells"
        assert caught.value.reason == "INVALID_GRID"

    def test_bad_origin(self):
        with pytest.raises(InvalidRequestError, match="needs numbers for resolution and origin"):
            sources.occupancy_grid([[0]], 0.05, (0, 0))


class TestMapServerMap:
    @pytest.mark.parametrize(
        "line",
        [
            "image: room.pgm",
            "image:   room.pgm   ",
            'image: "room.pgm"',
            "image: 'room.pgm'  # the picture",
            "image: room.pgm # the picture",
            "image : ./room.pgm",
            "image: &picture room.pgm",
            "image: |-\n  room.pgm",
            "image:\n  room.pgm",
            'image: "r\\u006fom.pgm"',
            "'image': !!str room.pgm",
            "{image: room.pgm}",
            '{"image": "room.pgm"}',
        ],
    )
    def test_finds_the_picture(self, tmp_path, line):
        (tmp_path / "room.pgm").write_bytes(b"P5")
        others = "" if line.startswith("{") else "\nresolution: 0.05\nnegate: 0\n"
        yaml = f"# image: other.pgm\n{line}{others}"
        (tmp_path / "room.yaml").write_text(yaml, encoding="utf-8")
        made = sources.map_server_map(tmp_path / "room.yaml").map_server_map
        assert (made.yaml, made.image) == (yaml, b"P5")

    @pytest.mark.parametrize("name", ["my room.pgm", "room#2.pgm", "raum-ü.pgm"])
    def test_unusual_names(self, tmp_path, name):
        (tmp_path / name).write_bytes(b"P5")
        (tmp_path / "room.yaml").write_text(f"image: {name}\n", encoding="utf-8")
        assert sources.map_server_map(str(tmp_path / "room.yaml")).map_server_map.image == b"P5"

    def test_windows_line_ends(self, tmp_path):
        (tmp_path / "room.pgm").write_bytes(b"P5")
        (tmp_path / "room.yaml").write_bytes(b"image: room.pgm\r\nnegate: 0\r\n")
        assert sources.map_server_map(tmp_path / "room.yaml").map_server_map.image == b"P5"

    def test_absolute_path(self, tmp_path):
        picture = tmp_path / "elsewhere.pgm"
        picture.write_bytes(b"P5")
        folder = tmp_path / "maps"
        folder.mkdir()
        (folder / "room.yaml").write_text(f"image: {picture}\n", encoding="utf-8")
        assert sources.map_server_map(folder / "room.yaml").map_server_map.image == b"P5"

    @pytest.mark.parametrize("mark", [codecs.BOM_UTF8, codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE])
    def test_byte_order_marks(self, tmp_path, mark):
        coding = "utf-8" if mark == codecs.BOM_UTF8 else "utf-16-le"
        coding = "utf-16-be" if mark == codecs.BOM_UTF16_BE else coding
        (tmp_path / "büro.pgm").write_bytes(b"P5")
        (tmp_path / "room.yaml").write_bytes(mark + "image: büro.pgm\n".encode(coding))
        made = sources.map_server_map(tmp_path / "room.yaml").map_server_map
        assert (made.yaml, made.image) == ("image: büro.pgm\n", b"P5")

    @pytest.mark.parametrize(
        "image",
        [
            "/home/robot/maps/room.pgm",
            r"C:\Users\me\room.pgm",
            r".\room.pgm",
            "~/room.pgm",
            "|\n  room.pgm",
        ],
    )
    def test_a_path_of_another_machine_is_found_beside_the_file(self, tmp_path, image):
        (tmp_path / "room.pgm").write_bytes(b"P5")
        (tmp_path / "room.yaml").write_text(f"image: {image}\n", encoding="utf-8")
        with pytest.warns(UserWarning, match=r"does not exist, and room\.pgm beside room\.yaml"):
            made = sources.map_server_map(tmp_path / "room.yaml")
        assert made.map_server_map.image == b"P5"

    def test_the_picture_and_the_folder_lead_to_the_file(self, tmp_path):
        (tmp_path / "room.pgm").write_bytes(b"P5")
        text = "image: room.pgm\nresolution: 0.05\n"
        (tmp_path / "first floor.yaml").write_text(text, encoding="utf-8")
        for path in (tmp_path, tmp_path / "room.pgm"):
            assert sources.map_server_map(path).map_server_map.yaml == text

    def test_a_picture_without_a_file_and_a_folder_of_two(self, tmp_path):
        (tmp_path / "room.pgm").write_bytes(b"P5")
        with pytest.raises(InvalidRequestError, match=r"no \.yaml beside it names; give the map's"):
            sources.map_server_map(tmp_path / "room.pgm")
        for name in ("a.yaml", "b.yaml"):
            text = "image: room.pgm\nresolution: 0.05\n"
            (tmp_path / name).write_text(text, encoding="utf-8")
        for path in (tmp_path, tmp_path / "room.pgm"):
            with pytest.raises(InvalidRequestError, match=r"give one of them: a\.yaml, b\.yaml"):
                sources.map_server_map(path)

    @pytest.mark.parametrize(
        "text", ["resolution: 0.05\n", "image:\n", "image: ~", "images: a.pgm"]
    )
    def test_no_picture_named(self, tmp_path, text):
        (tmp_path / "room.yaml").write_text(text, encoding="utf-8")
        with pytest.raises(InvalidRequestError, match="names no picture; add a line"):
            sources.map_server_map(tmp_path / "room.yaml")

    @pytest.mark.parametrize("text", ["", "- image", "image: [", "image: a\n b: c"])
    def test_no_yaml_of_a_map(self, tmp_path, text):
        (tmp_path / "room.yaml").write_text(text, encoding="utf-8")
        with pytest.raises(
            InvalidRequestError, match="give the file that map_server saved"
        ) as error:
            sources.map_server_map(tmp_path / "room.yaml")
        assert error.value.field == "map_server_map.yaml"

    def test_missing_picture(self, tmp_path):
        (tmp_path / "room.yaml").write_text("image: gone.pgm\n", encoding="utf-8")
        with pytest.raises(InvalidRequestError, match=r"gone\.pgm.* cannot be read") as caught:
            sources.map_server_map(tmp_path / "room.yaml")
        assert caught.value.field == "map_server_map.image"

    def test_not_text(self, tmp_path):
        (tmp_path / "room.yaml").write_bytes(b"\xff\xfe\x00")
        with pytest.raises(InvalidRequestError, match="is not UTF-8 text; save it as UTF-8"):
            sources.map_server_map(tmp_path / "room.yaml")

    @pytest.mark.parametrize("name", ["gone.yaml", "gone/gone.yaml", "a\0b.yaml", "x" * 5000])
    def test_missing_file(self, tmp_path, name):
        with pytest.raises(
            InvalidRequestError, match=r"cannot be read: .*; check the path"
        ) as caught:
            sources.map_server_map(tmp_path / name)
        assert caught.value.field == "map_server_map.yaml"
        assert caught.value.reason == "INVALID_FILE"


class TestImage:
    def test_file_or_bytes(self, tmp_path):
        (tmp_path / "sketch.png").write_bytes(b"PNG")
        assert sources.image(tmp_path / "sketch.png") == sources.image(b"PNG")
        assert sources.image(str(tmp_path / "sketch.png")).image.data == b"PNG"

    @pytest.mark.parametrize("kind", [bytes, bytearray, memoryview])
    def test_bytes_of_any_kind(self, kind):
        assert sources.image(kind(b"PNG")).image.data == b"PNG"
        assert sources.file(kind(b"<svg/>"), name="a.svg").file.data == b"<svg/>"

    def test_missing_file(self, tmp_path):
        with pytest.raises(InvalidRequestError, match=r"gone\.png\) cannot be read: No such file"):
            sources.image(tmp_path / "gone.png")


def test_a_label_that_utf_8_cannot_hold_is_sent_as_well_as_can_be():
    square = [(0, 0), (1, 0), (1, 1)]
    sent = sources.polygons([square, square], ["\ud800x", "\ud83d\ude00"]).polygon_set
    assert [polygon.label for polygon in sent.polygons] == ["\N{REPLACEMENT CHARACTER}x", "😀"]


@pytest.mark.parametrize(
    "make",
    [
        lambda: sources.image(io.BytesIO(b"PNG")),
        lambda: sources.image(None),
        lambda: sources.file(io.BytesIO(b"<svg/>"), name="a.svg"),
        lambda: sources.map_server_map(b"room.yaml"),
        lambda: sources.map_server_map(None),
        lambda: sources.strokes(None),
        lambda: sources.polygons(3),
    ],
)
def test_what_is_no_source_at_all_is_refused_as_other_input_is(make):
    with pytest.raises(InvalidRequestError, match=r"give the path of a file|is not a list of"):
        make()
