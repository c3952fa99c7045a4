"""Pixels inside outlines, and outlines of pixels."""

import numpy as np
import pytest
import shapely

from sketchmatch.kernels.raster import filled_pixels, pixel_edges


def centres(rows, columns):
    x, y = np.meshgrid(np.arange(columns) + 0.5, np.arange(rows) + 0.5)
    return x, y


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("place", [(4.0, 3.0), (0.3, 0.2), (8.9, 5.6), (-20.0, 3.0), (4.0, 30.0)])
def test_pixels_are_inside_whose_centres_are_however_much_lies_beyond_the_grid(seed, place):
    rng = np.random.default_rng(seed)
    angles = np.sort(rng.uniform(0.0, 2 * np.pi, 9))
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1) * rng.uniform(1, 4, (9, 1)) + place
    ring = ring[:: 1 if seed % 2 else -1]
    found = filled_pixels(ring, np.roll(ring, -1, axis=0), 6, 9)
    expected = shapely.contains_xy(shapely.Polygon(ring), *centres(6, 9))
    assert found.tolist() == expected.tolist()


def test_outlines_that_share_an_edge_share_no_pixel():
    # The corners lie on centres of pixels.
    left = np.array([[0.5, 0.5], [2.5, 0.5], [2.5, 3.5], [0.5, 3.5]])
    both = [
        filled_pixels(r, np.roll(r, -1, axis=0), 4, 5) for r in (left, left + np.array([2.0, 0.0]))
    ]
    assert both[0].astype(int).sum() == both[1].astype(int).sum() == 6
    assert not (both[0] & both[1]).any()


@pytest.mark.parametrize("seed", range(6))
def test_the_outline_of_pixels_encloses_them_and_keeps_them_on_its_left(seed):
    mask = np.random.default_rng(seed).random((5, 7)) < 0.5
    starts, ends = pixel_edges(mask)
    assert filled_pixels(starts, ends, 5, 7).tolist() == mask.tolist()
    doubled = starts[:, 0] * ends[:, 1] - starts[:, 1] * ends[:, 0]
    assert doubled.sum() / 2 == mask.sum()
    assert (((ends - starts) != 0).sum(axis=1) == 1).all()
    # No edge goes on where another ends straight: as long as they can be.
    along = {(*end, *np.sign(end - start)) for start, end in zip(starts, ends, strict=True)}
    again = {(*start, *np.sign(end - start)) for start, end in zip(starts, ends, strict=True)}
    assert not along & again
