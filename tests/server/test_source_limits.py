"""Sources that are too large or meant to harm, over gRPC."""

import io
import os
import sys
import threading

import numpy as np
import PIL.Image
import pytest

from sketchmatch.model.limits import SourceLimits
from sketchmatch_client import Client, InvalidRequestError, sources
from sketchmatch_proto.v1 import source_pb2
from tests.server.harness import scene, serving

YAML = """image: {image}
resolution: 0.05
origin: [0, 0, 0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""


@pytest.fixture(scope="module")
def client():
    limits = SourceLimits(max_bytes=5000, max_pixels=20_000, max_vertices=50, max_objects=4)
    with serving(sources=limits) as host, Client(host.address) as connected:
        yield connected


def picture(width=100, height=80):
    pixels = np.full((height, width), 254, np.uint8)
    pixels[10:30, 10:30] = pixels[40:60, 40:60] = 0
    file = io.BytesIO()
    PIL.Image.fromarray(pixels).save(file, "PNG")
    return file.getvalue()


def robots(yaml, image):
    return source_pb2.Source(map_server_map=source_pb2.MapServerMap(yaml=yaml, image=image))


def strokes(count, points):
    return sources.strokes([[(k, j) for j in range(points)] for k in range(count)])


@pytest.mark.parametrize(
    ("source", "field", "words"),
    [
        (strokes(3, 20), "stroke_set", "has 60 vertices, more than the limit of 50 vertices"),
        (scene(5), "polygon_set", "has 5 objects, more than the limit of 4 objects"),
        (
            sources.occupancy_grid(bytes(20_200), 0.05, columns=200),
            "occupancy_grid",
            "has 200 × 101 pixels, more than the limit of 20000 pixels",
        ),
        (sources.image(picture(200, 101)), "image.data", "has 200 × 101 pixels, more than"),
        (sources.image(b"x" * 5001), "image.data", "has 5001 bytes, more than the limit of 5000"),
        (
            robots(YAML.format(image="a.png"), picture(200, 101)),
            "map_server_map.image",
            "has 200 × 101 pixels, more than the limit of 20000 pixels",
        ),
        (
            robots("#" * 70_000 + "\n" + YAML, picture()),
            "map_server_map.yaml",
            "more than the limit of 64 KiB for a map's YAML",
        ),
    ],
)
def test_a_source_above_a_limit_is_refused_with_its_path(client, source, field, words):
    with pytest.raises(InvalidRequestError) as raised:
        client.segment(source)
    assert raised.value.reason == "LIMIT_EXCEEDED"
    assert raised.value.field == f"source.{field}"
    assert words in str(raised.value)


def test_the_server_tells_how_many_objects_it_takes(client):
    assert client.server_info().limits.max_objects == 4


def test_one_servers_limits_are_not_anothers(client):
    assert client.segment(robots(YAML.format(image="a.png"), picture())).scene.objects
    with serving() as host, Client(host.address) as other:
        assert len(other.segment(scene(5)).scene.objects) == 5


opened = None


def _note(event, arguments):
    if event == "open" and opened is not None:
        opened.append(str(arguments[0]))


@pytest.mark.parametrize(
    "name", ["{folder}/secret.pgm", "../../../../../../../..{folder}/secret.pgm", "/dev/zero"]
)
def test_no_path_that_comes_over_the_network_is_opened(client, tmp_path, name):
    global opened  # noqa: PLW0603 (audit hooks cannot be taken back)
    os.mkfifo(tmp_path / "secret.pgm")  # whoever opens it waits until the test's end
    if opened is None:
        sys.addaudithook(_note)
    opened = []
    found = client.segment(robots(YAML.format(image=name.format(folder=tmp_path)), picture()))
    assert len(found.scene.objects) == 2, "the picture that was sent is the one that is read"
    assert not [path for path in opened if "secret" in path or "zero" in path]
    assert threading.active_count() > 1, "the server is in this process, where the hook sees it"
