"""A whole transfer in Python: what it takes, what it refuses by field, and what it returns."""

import re

import numpy as np
import pytest

from sketchmatch import Feature, InvalidInputError, Scene, carry, transfer
from sketchmatch.model import OccupancyGrid, Stroke, StrokeSet

BOXES = [(0, 0, 2, 1), (6, 0, 7, 3), (0, 5, 1, 8), (5, 6, 8, 8), (9, 4, 10, 5)]
RINGS = [np.array([(a, b), (c, b), (c, d), (a, d)], dtype=float) for a, b, c, d in BOXES]
SCENE = Scene.from_polygons(RINGS)
TURNED = Scene.from_polygons([ring @ [[0.0, 2.0], [-2.0, 0.0]] for ring in RINGS])
KNOWN = {k: k for k in range(5)}
HERE = Feature("point", ([[4.0, 4.0]],), "here")
WAY = Feature("route", ([[4.0, -1.0], [4.0, 4.0], [3.0, 9.0]],), "way")


def test_what_is_known_needs_no_match():
    found = transfer(SCENE, TURNED, [HERE], object_map=KNOWN)
    assert found.match is None
    assert found.object_map == tuple(KNOWN.items())
    assert found.features[0].points == pytest.approx(np.array([[-8.0, 8.0]]), abs=1e-6)
    assert found.warp.scale == pytest.approx(2.0)


def test_a_match_finds_what_is_not_known_and_says_how_sure_it_is():
    seen = []
    found = transfer(SCENE, TURNED, [HERE], on_progress=seen.append)
    assert found.match is not None
    assert dict(found.object_map) == found.match.object_map == KNOWN
    assert found.features[0].points == pytest.approx(np.array([[-8.0, 8.0]]), abs=0.1)


def test_it_goes_back_too():
    found = transfer(
        SCENE,
        TURNED,
        [Feature("point", ([[-8.0, 8.0]],))],
        object_map=KNOWN,
        direction="map-to-sketch",
    )
    assert found.features[0].points == pytest.approx(np.array([[4.0, 4.0]]), abs=1e-6)
    assert found.warp.scale == pytest.approx(0.5)


def test_the_route_of_a_sketch_comes_first_forth_and_not_back():
    closed = [np.vstack([ring, ring[:1]]) for ring in RINGS]
    sketch = StrokeSet((*map(Stroke, closed), Stroke(WAY.points, label="route")))
    forth = transfer(sketch, TURNED, [HERE], object_map=KNOWN)
    assert [each.name for each in forth.carried] == ["route", "here"]
    assert forth.drawn == 1
    back = transfer(sketch, TURNED, [HERE], object_map=KNOWN, direction="map-to-sketch")
    assert [each.name for each in back.carried] == ["here"]


def test_a_radius_keeps_routes_out_of_the_objects_of_a_map_without_cells():
    through = Feature("route", ([[-1.0, 2.5], [3.0, 1.5], [8.5, 1.5]],))
    left = transfer(SCENE, TURNED, [through], object_map=KNOWN)
    kept = transfer(SCENE, TURNED, [through], object_map=KNOWN, radius=0.5)
    assert left.carried[0].changes == ()
    assert [str(change.reason) for change in kept.carried[0].changes] == ["obstacle"]


@pytest.mark.parametrize("others", [[], [WAY]])
def test_of_a_map_without_cells_nothing_lies_beyond_and_its_objects_are_no_places(others):
    far = Feature("point", ([[40.0, 40.0]],), "far")
    within = Feature("point", ([[1.0, 0.5]],), "within")
    zone = Feature("zone", ([[40.0, 40.0], [45.0, 40.0], [45.0, 45.0]],), "zone")
    found = transfer(SCENE, SCENE, [far, within, zone, *others], object_map=KNOWN, radius=0.3)
    reasons = [[str(change.reason) for change in each.changes] for each in found.carried[:3]]
    assert reasons == [[], ["blocked"], []]


def test_a_table_sums_it_up():
    text = str(transfer(SCENE, TURNED, [HERE, WAY], object_map=KNOWN))
    assert text.splitlines()[0].startswith("2 features carried by a warp of kind ")
    assert [line.split()[:2] for line in text.splitlines()[2:]] == [
        ["here", "point"],
        ["way", "route"],
    ]


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"direction": "sideways"}, "direction"),
        ({"radius": -1.0}, "radius"),
        ({"radius": float("nan")}, "radius"),
        ({"object_map": {0: 0}}, "object_map"),
        ({"object_map": {}}, "object_map"),
        ({"object_map": {0: 0, 1: 9}}, "object_map[1].map_object"),
        ({"object_map": {0: 0, 7: 1}}, "object_map[1].sketch_object"),
        ({"object_map": {0: 0, 1: 0}}, "object_map[1].map_object"),
        ({"object_map": {0: 0, -1: 1}}, "object_map[1].sketch_object"),
        ({"features": []}, "features"),
        ({"map_segmenter": "none-such"}, "pipeline.map_segmenter"),
    ],
)
def test_what_cannot_be_used_is_refused_by_field(options, field):
    features = options.pop("features", [HERE])
    with pytest.raises(InvalidInputError) as refused:
        transfer(SCENE, TURNED, features, **options)
    assert refused.value.field.startswith(field)


def test_a_radius_beyond_its_bound_is_told_the_bound():
    transfer(SCENE, TURNED, [HERE], object_map=KNOWN, radius=1e6)
    with pytest.raises(InvalidInputError, match=r"is 2e\+06; give a number from 0 to 1e\+06$"):
        transfer(SCENE, TURNED, [HERE], object_map=KNOWN, radius=2e6)


@pytest.mark.parametrize("far", [2e9, float("inf"), float("nan")])
def test_a_feature_that_is_too_far_away_is_told_how_far_it_may_be(far):
    with pytest.raises(InvalidInputError, match=re.escape(f"(1, {far:g})")) as refused:
        Feature("route", (np.array([[0.0, 0.0], [1.0, far]]),))
    assert str(refused.value).endswith("; give finite numbers up to 1e+09")


def test_a_mirrored_object_map_is_refused():
    mirrored = Scene.from_polygons([ring * [1.0, -1.0] for ring in RINGS])
    with pytest.raises(InvalidInputError, match="mirror image") as refused:
        transfer(SCENE, mirrored, [HERE], object_map=KNOWN)
    assert refused.value.field == "object_map"


def grid_of(rings):
    """Return a walled grid with things in it."""
    cells = np.zeros((160, 200), dtype=np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 100
    for x0, y0, x1, y1 in rings:
        cells[int(10 * y0) + 30 : int(10 * y1) + 30, int(10 * x0) + 30 : int(10 * x1) + 30] = 100
    return OccupancyGrid(cells, 0.1, (-3.0, -3.0, 0.0))


def test_a_zone_does_not_follow_one_thing_that_was_moved():
    moved = [*BOXES[:4], (11, 8, 12, 9)]
    zone = Feature("zone", ([[3.0, 2.0], [5.0, 2.0], [5.0, 5.0], [3.0, 5.0]],), "carpet")
    found = carry([zone], grid_of(BOXES), grid_of(moved))
    assert found.features[0].points[0] == pytest.approx(np.array([3.0, 2.0]), abs=0.15)
    assert found.features[0].name == "carpet"


def test_of_two_ways_to_see_a_map_the_one_that_tells_more_is_taken():
    zone = Feature("zone", ([[3.0, 2.0], [5.0, 2.0], [5.0, 5.0]],))
    grid = grid_of(BOXES)
    both = carry([zone], grid, grid)
    objects = carry([zone], grid, grid, segmenter="occupancy-grid")
    assert both.unsureness <= objects.unsureness
