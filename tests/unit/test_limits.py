"""How large sources may be: by configuration, by server, in files, requests and values."""

import io
import json
import struct
import zlib

import numpy as np
import PIL.Image
import pytest

from sketchmatch import read_scene
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.io import read_source
from sketchmatch.io.images import decode_image
from sketchmatch.io.svg import decode_svg
from sketchmatch.model import Image, LabelledPolygon, OccupancyGrid, PolygonSet, Stroke, StrokeSet
from sketchmatch.model.limits import (
    SourceLimits,
    check_bytes,
    check_objects,
    check_pixels,
    check_source,
    check_vertices,
    limited_to,
    source_limits,
)

SQUARE = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])


def refused(call, **limits):
    with limited_to(SourceLimits(**limits)), pytest.raises(InvalidInputError) as caught:
        call()
    assert caught.value.reason == Reason.LIMIT_EXCEEDED
    (name,) = limits
    assert f"or raise limits.{name} (SKETCHMATCH_LIMITS__{name.upper()})" in caught.value.problem
    return caught.value


@pytest.mark.parametrize("value", [0, -1, 1.5, True, "9", None])
def test_a_bad_limit_is_refused(value):
    with pytest.raises(InvalidInputError, match="max_objects is"):
        SourceLimits(max_objects=value)


def test_others_hold_within_a_block_alone():
    with limited_to(SourceLimits(max_objects=5)):
        assert source_limits().max_objects == 5
    assert source_limits() == SourceLimits()


@pytest.mark.parametrize(
    ("source", "limits", "words"),
    [
        (StrokeSet((Stroke(SQUARE), Stroke(SQUARE))), {"max_vertices": 7}, "has 8 vertices"),
        (PolygonSet((LabelledPolygon((SQUARE, SQUARE)),)), {"max_vertices": 7}, "has 8 vertices"),
        (PolygonSet((LabelledPolygon((SQUARE,)),) * 3), {"max_objects": 2}, "has 3 objects"),
        (OccupancyGrid(np.zeros((3, 4), np.int8), 0.1), {"max_pixels": 11}, "has 4 × 3 pixels"),
        (Image(np.zeros((3, 4), np.uint8)), {"max_pixels": 11}, "has 4 × 3 pixels"),
        (Image(np.zeros((3, 4, 3), np.uint8)), {"max_pixels": 11}, "has 4 × 3 pixels"),
        (Image(np.zeros((3, 4), np.uint8)), {"max_side": 3}, "has 4 × 3 pixels"),
    ],
)
def test_values_made_in_python_have_the_same_limits(source, limits, words):
    assert words in refused(lambda: check_source(source), **limits).problem
    (limit,) = limits.values()
    with limited_to(SourceLimits(**dict.fromkeys(limits, limit + 1))):
        check_source(source)


@pytest.mark.parametrize(
    ("name", "check"),
    [
        ("max_bytes", lambda size: check_bytes(size, "sketch")),
        ("max_pixels", lambda count: check_pixels(count, 1, "sketch")),
        ("max_side", lambda side: check_pixels(side, 1, "sketch")),
        ("max_side", lambda side: check_pixels(1, side, "sketch")),
        ("max_vertices", lambda count: check_vertices(count, "sketch")),
        ("max_objects", lambda count: check_objects(count, "sketch")),
    ],
)
def test_as_much_as_the_limit_passes_and_one_more_does_not(name, check):
    with limited_to(SourceLimits(**{name: 9})):
        check(9)
    refused(lambda: check(10), **{name: 9})


@pytest.mark.parametrize(
    ("name", "least"),
    [("max_bytes", 1), ("max_pixels", 1), ("max_side", 1), ("max_vertices", 1), ("max_objects", 2)],
)
def test_a_limit_lets_something_pass_at_least(name, least):
    assert getattr(SourceLimits(**{name: least}), name) == least
    with pytest.raises(InvalidInputError, match=f"{name} is {least - 1}; .* at least {least}"):
        SourceLimits(**{name: least - 1})


def test_a_drawing_has_one_element_for_every_ten_vertices():
    shapes = "<circle r='0'/>" * 4  # and the root
    with limited_to(SourceLimits(max_vertices=50)), pytest.raises(InvalidInputError) as caught:
        decode_svg(f"<svg>{shapes}</svg>".encode())
    assert caught.value.reason == Reason.INVALID_FILE  # nothing is drawn, but it was looked at
    refused(lambda: decode_svg(f"<svg>{shapes}</svg>".encode()), max_vertices=49)
    assert SourceLimits(max_vertices=9).max_elements == 1


def test_a_scene_of_too_many_objects_is_refused(tmp_path):
    path = tmp_path / "many.json"
    closed = [*SQUARE.tolist(), [0, 0]]
    drawn = [{"points": [[x + 3 * k, y] for x, y in closed]} for k in range(5)]
    path.write_text(json.dumps({"strokes": drawn}))
    assert (
        "has 5 objects, more than the limit of 4 objects"
        in refused(lambda: read_scene(path), max_objects=4).problem
    )


@pytest.mark.parametrize(
    "name", ["sketch.svg", "sketch.json", "map.geojson", "map.yaml", "map.png"]
)
def test_a_file_above_the_limit_is_not_read(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(b" " * 2049)
    error = refused(lambda: read_source(path), max_bytes=2048)
    assert error.problem.startswith("has 2049 bytes, more than the limit of 2048 bytes; reduce it")
    assert error.field == str(path)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("sketch.json", '{"strokes": [' + "[" * 40 + "]" * 40 + "]}"),
        ("map.geojson", "[" + ", ".join("1" * 900) + "]"),
    ],
)
def test_json_of_too_many_values_is_refused_before_it_is_parsed(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text)
    assert (
        "more than the limit of 4 vertices"
        in refused(lambda: read_source(path), max_vertices=4).problem
    )


@pytest.mark.parametrize(
    "body",
    [
        '<path d="' + "M0 0" + " h1 v1" * 1000 + '"/>',
        '<path d="M0 0' + " L 1.5 1e1" * 500 + '"/>',
        '<polygon points="' + "1,2 " * 500 + '"/>',
        "<circle r='5'/>" * 30,
        "<g/>" * 50,
    ],
)
def test_a_drawing_of_too_many_vertices_is_refused(body):
    with limited_to(SourceLimits(max_vertices=400)), pytest.raises(InvalidInputError) as caught:
        decode_svg(f"<svg>{body}</svg>".encode())
    assert caught.value.reason == Reason.LIMIT_EXCEEDED
    assert "(SKETCHMATCH_LIMITS__MAX_VERTICES)" in caught.value.problem


def png(width, height):
    def chunk(kind, data):
        return (
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        )

    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", b"") + chunk(b"IEND", b"")


def bmp(width, height):
    header = struct.pack("<IiiHHIIiiII", 40, width, height, 1, 24, 0, 0, 0, 0, 0, 0)
    return b"BM" + struct.pack("<IHHI", 54, 0, 0, 54) + header


def tiff(width, height):
    tags = [(256, width), (257, height), (258, 8), (259, 1), (262, 1), (273, 8), (279, 9)]
    body = b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in tags)
    return struct.pack("<2sHIH", b"II", 42, 8, len(tags)) + body + bytes(4)


def jpeg(width, height):
    file = io.BytesIO()
    PIL.Image.new("L", (8, 8)).save(file, "JPEG")
    data = file.getvalue()
    at = data.index(b"\xff\xc0") + 5
    return data[:at] + struct.pack(">HH", height, width) + data[at + 4 :]


@pytest.mark.parametrize("size", [(9000, 9000), (60_000, 60_000)])
@pytest.mark.parametrize("made", [png, bmp, tiff, jpeg, lambda w, h: b"P5 %d %d 255\n" % (w, h)])
def test_a_small_header_cannot_announce_a_huge_picture(made, size):
    with pytest.raises(InvalidInputError) as caught:
        decode_image(made(*size))
    assert (caught.value.field, caught.value.reason) == ("data", Reason.LIMIT_EXCEEDED)
    width, height = size
    assert caught.value.problem == (
        f"has {width} × {height} pixels, more than the limit of 64 million pixels; scale it down, "
        "or raise limits.max_pixels (SKETCHMATCH_LIMITS__MAX_PIXELS)"
    )


def test_a_sliver_is_refused():
    with pytest.raises(InvalidInputError) as caught:
        decode_image(bmp(5_063_184, 12))
    assert (caught.value.field, caught.value.reason) == ("data", Reason.LIMIT_EXCEEDED)
    assert caught.value.problem == (
        "has 5063184 × 12 pixels, more than the limit of 65535 pixels along a side; scale it "
        "down, or raise limits.max_side (SKETCHMATCH_LIMITS__MAX_SIDE)"
    )


def test_the_limit_may_be_above_pillows_own():
    with limited_to(SourceLimits(max_pixels=10**10)), pytest.raises(InvalidInputError) as caught:
        decode_image(bmp(60_000, 60_000))
    assert "is damaged or cut short" in caught.value.problem
