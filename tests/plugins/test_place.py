"""Whether a sketch shows a place, far from what was learned from: exact copies and many objects."""

import numpy as np
import pytest

from sketchmatch import Scene, match


def room(objects, seed):
    """Rectangles of all sizes, turned anyhow, about as far from each other everywhere."""
    rng = np.random.default_rng(seed)
    side, middles = 2.2 * np.sqrt(objects), []
    while len(middles) < objects:
        middle = rng.uniform(0.0, side, 2)
        if all(np.hypot(*(middle - other)) > 1.2 for other in middles):
            middles.append(middle)
    return [
        rectangle(middle, *rng.uniform(0.4, 1.6, 2), rng.uniform(0.0, 3.0)) for middle in middles
    ]


def rectangle(middle, width, height, turn):
    corners = 0.5 * np.array(
        [(-width, -height), (width, -height), (width, height), (-width, height)]
    )
    sine, cosine = np.sin(turn), np.cos(turn)
    return corners @ np.array([(cosine, sine), (-sine, cosine)]) + middle


@pytest.mark.parametrize(("drawn", "mapped"), [(8, 8), (16, 16), (20, 20), (20, 40), (40, 40)])
def test_an_exact_copy_shows_the_place_however_much_it_shows(drawn, mapped):
    place = room(mapped, 0)
    result = match(Scene.from_polygons(place[:drawn]), Scene.from_polygons(place))
    assert result.object_map == {k: k for k in range(drawn)}
    assert result.place_probability > 0.9


@pytest.mark.parametrize("objects", [16, 40])
def test_another_place_of_many_objects_is_none(objects):
    sketch, place = (Scene.from_polygons(room(objects, seed)) for seed in (1, 2))
    assert match(sketch, place).place_probability < 0.5


def test_the_better_somebody_draws_the_more_each_deviation_tells():
    sizes = [(1e-6, 1e-6), (1e6, 1.0), (1.0, 1e-3), (2.0, 2.0), (1.0, 3.0)]
    middles = [(0, 0), (1, 3), (5, 2), (9, -4), (4, -9)]
    place = Scene.from_polygons(
        [
            rectangle(np.array(middle), *size, 0.0)
            for middle, size in zip(middles, sizes, strict=True)
        ]
    )
    assert match(place, place).object_map == {k: k for k in range(5)}
