"""The sketched route in the answers of a real server."""

from __future__ import annotations

import pytest

from sketchmatch_client import Client, sources
from tests.server.harness import shapes

WAY = [(-1.0, -1.0), (5.0, 2.0), (40.0, 41.0)]


def closed(polygon):
    return [*map(tuple, polygon), tuple(polygon[0])]


@pytest.mark.parametrize("y_axis", ["up", "down"])
def test_a_route_comes_with_the_scenes_and_with_segment(address, y_axis):
    strokes = [*map(closed, shapes(3)), WAY]
    sketch = sources.strokes(strokes, ["", "", "", "route"], y_axis=y_axis)
    upward = 1.0 if y_axis == "up" else -1.0
    with Client(address) as client:
        found = client.segment(sketch)
        matched = client.match(sketch, sources.polygons(shapes(3)))
    expected = [(x, upward * y) for x, y in WAY]
    assert [(point.x, point.y) for point in found.route] == expected
    assert [(point.x, point.y) for point in matched.scenes.sketch_route] == expected
    assert len(found.scene.objects) == 3


def test_without_a_route_it_is_empty(address):
    with Client(address) as client:
        assert not client.segment(sources.polygons(shapes(3))).route
