"""Turning template histograms onto argument histograms.

A turn is written as ``whole`` bins and the ``rest`` of a bin, 0 ≤ rest ≤ 1. Between bins a
histogram is read by periodic linear interpolation: turned by w + f it is
h₂[m] = (1−f)·h[m−w] + f·h[m−w−1]. So with C[w] = Σ h[m−w]·h'[m], S = Σ h[m]² and
D = ½ Σ (h[m] − h[m−1])²

    Σ h₂h' = (1−f)·C[w] + f·C[w+1]   and   Σ h₂² = S − 2f(1−f)·D.
"""

from __future__ import annotations

import numpy as np

from sketchmatch.kernels._jit import kernel
from sketchmatch.model.arrays import FloatArray, IntArray

__all__ = [
    "BLAS_MULTIPLICATIONS",
    "interpolated_products",
    "main_directions",
    "main_turns",
    "peak_turns",
    "rolled_rows",
    "roughness",
    "split_turns",
    "turned_rows",
]

BLAS_MULTIPLICATIONS = 2**18
"""What a product of matrices may take: OpenBLAS shares larger ones among threads of its own.

That is 3 to 10 times slower here, and sums in another order on a machine of more cores.
"""

_NO_DIRECTION = 1e-14
"""Of all forces: what the mean of their directions comes to by rounding alone."""


def main_directions(histograms: FloatArray) -> FloatArray:
    """Return the mean direction of each histogram, atan2(Σ h sin θ, Σ h cos θ).

    Parameters
    ----------
    histograms
        Shape (k, n).

    Returns
    -------
    ndarray
        Shape (k,), radians within (−π, π]; 0 for a histogram without any main direction.

    Examples
    --------
    Up, and half-way between right and up:

    >>> np.degrees(main_directions(np.array([[0.0, 3.0, 0.0, 0.0], [1.0, 1.0, 0.0, 0.0]])))
    array([90., 45.])
    """
    bins = histograms.shape[1]
    angles = 2.0 * np.pi * np.arange(bins) / bins
    cosines, sines = np.cos(angles), np.sin(angles)
    # Not as products of matrices, which sum a row otherwise in another place.
    along, across = (np.einsum("kn,n->k", histograms, each) for each in (cosines, sines))
    some = np.hypot(along, across) > _NO_DIRECTION * histograms.sum(axis=1)
    return np.where(some, np.arctan2(across, along), 0.0)


def split_turns(angles: FloatArray, bins: int) -> tuple[IntArray, FloatArray]:
    """Return angles as whole bins and rests of a bin.

    Parameters
    ----------
    angles
        Any shape, in radians.
    bins
        n, how many bins make a full turn.

    Returns
    -------
    whole, rest
        Of the same shape: whole bins within 0 … ``bins`` − 1, and rests within [0, 1).

    Examples
    --------
    >>> whole, rest = split_turns(np.radians([0.0, 100.0, -45.0]), 4)
    >>> whole, rest.round(3)
    (array([0, 1, 3]), array([0.   , 0.111, 0.5  ]))
    """
    places = np.mod(angles, 2.0 * np.pi) * bins / (2.0 * np.pi)
    whole = np.floor(places)
    return whole.astype(np.int64) % bins, places - whole


def roughness(histograms: FloatArray) -> FloatArray:
    """Return D = ½ Σ (h[m] − h[m−1])² of each histogram, the last bin being next to the first.

    Parameters
    ----------
    histograms
        Shape (k, n).

    Returns
    -------
    ndarray
        Shape (k,), 0 for a histogram that is the same in all directions.

    Examples
    --------
    >>> roughness(np.array([[0.0, 3.0, 0.0, 0.0], [2.0, 2.0, 2.0, 2.0]]))
    array([9., 0.])
    """
    steps = histograms - np.roll(histograms, 1, axis=1)
    halves: FloatArray = 0.5 * np.einsum("kn,kn->k", steps, steps)
    return halves


@kernel
def main_turns(
    template_whole: IntArray,
    template_rest: FloatArray,
    argument_whole: IntArray,
    argument_rest: FloatArray,
    bins: int,
) -> tuple[IntArray, FloatArray]:
    """Return the turns from template to argument main directions.

    Parameters
    ----------
    template_whole, template_rest
        Shape (k,), main directions as :func:`split_turns` gives them.
    argument_whole, argument_rest
        Shape (l,), the same.
    bins
        n.

    Returns
    -------
    whole, rest
        Shape (k, l).

    Examples
    --------
    From 3½ bins to half a bin it is one bin on, past the last of four; the other way three:

    >>> template, argument = (np.array([3]), np.array([0.5])), (np.array([0]), np.array([0.5]))
    >>> main_turns(*template, *argument, 4), main_turns(*argument, *template, 4)
    ((array([[1]]), array([[0.]])), (array([[3]]), array([[0.]])))
    """
    shape = (template_whole.size, argument_whole.size)
    whole, rest = np.empty(shape, np.int64), np.empty(shape)
    for i in range(shape[0]):
        for j in range(shape[1]):
            between = argument_rest[j] - template_rest[i]
            borrowed = 1 if between < 0.0 else 0
            steps = argument_whole[j] - template_whole[i] - borrowed
            whole[i, j] = steps if steps >= 0 else steps + bins
            rest[i, j] = between + borrowed
    return whole, rest


@kernel
def interpolated_products(
    products: FloatArray, template_rest: FloatArray, argument_rest: FloatArray
) -> FloatArray:
    """Return Σ h₂h' at the main turns, from C at the three whole turns about them.

    Parameters
    ----------
    products
        Shape (t, 3·k, width): C at a turn of argument minus template whole bins, and −1, 0, 1
        more, for k template histograms and t·width argument histograms.
    template_rest
        Shape (k,).
    argument_rest
        Shape (l,), l ≤ t·width.

    Returns
    -------
    ndarray
        Shape (k, l).

    Examples
    --------
    C is 2 one bin before, 6 at the whole turn and 4 one bin after. A quarter of a bin further on
    it is 6 and a quarter of the way to 4, and as far back a quarter of the way to 2:

    >>> products = np.array([[[2.0, 2.0], [6.0, 6.0], [4.0, 4.0]]])
    >>> interpolated_products(products, np.array([0.5]), np.array([0.75, 0.25]))
    array([[5.5, 5. ]])
    """
    count, width = template_rest.size, products.shape[2]
    result = np.empty((count, argument_rest.size))
    for tile in range(products.shape[0]):
        first = tile * width
        last = min(first + width, argument_rest.size)
        for i in range(count):
            for j in range(first, last):
                rest = argument_rest[j] - template_rest[i]
                here = products[tile, count + i, j - first]
                before = products[tile, i, j - first]
                after = products[tile, 2 * count + i, j - first]
                beside = after if rest >= 0.0 else before
                share = abs(rest)
                result[i, j] = (1.0 - share) * here + share * beside
    return result


@kernel
def peak_turns(
    products: FloatArray, squares: FloatArray, roughnesses: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the turns that make Σ h₂h' / (‖h₂‖‖h'‖) largest, whole or between bins.

    Between two bins h₂ lies in the plane of h turned by w and by w + 1, where the cosine with h' is
    largest along the projection of h', if that is between the two; else it is largest at one of
    them. Of turns that are equally good to 12 digits the smallest counts.

    Parameters
    ----------
    products
        Shape (k, l, n): C at every whole turn.
    squares, roughnesses
        Shape (k,): S and D of the template histograms.

    Returns
    -------
    whole, rest
        Shape (k, l).
    product
        Shape (k, l): Σ h₂h' there.

    Examples
    --------
    One spike against two that are as high, in bins 1 and 2: half-way between them is best.

    >>> template, argument = np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.0, 1.0, 1.0, 0.0])
    >>> products = np.array([[[np.roll(template, w) @ argument for w in range(4)]]])
    >>> peak_turns(products, np.array([1.0]), roughness(template[None]))
    (array([[1]]), array([[0.5]]), array([[1.]]))
    """
    shape, bins = products.shape[:2], products.shape[2]
    whole, rest, product = np.zeros(shape, np.int64), np.zeros(shape), np.empty(shape)
    for i in range(shape[0]):
        square, rough = squares[i], roughnesses[i]
        for j in range(shape[1]):
            best = -1.0
            for w in range(bins):
                here = max(products[i, j, w], 0.0)
                after = max(products[i, j, w + 1 if w + 1 < bins else 0], 0.0)
                early = square * (here - after) + rough * after
                late = square * (after - here) + rough * here
                between = early > 0.0 and late > 0.0
                if between:
                    steep = square * (here - after) ** 2 / rough
                    value = (steep + 2.0 * here * after) / (2.0 * square - rough)
                else:
                    value = here * here / square
                if value > best * (1.0 + 2e-12):
                    best = value
                    share = late / (early + late) if between else 0.0
                    whole[i, j], rest[i, j] = w, share
                    product[i, j] = (1.0 - share) * here + share * after
    return whole, rest, product


@kernel
def rolled_rows(histograms: FloatArray, whole: IntArray) -> FloatArray:
    """Return each histogram turned by its own number of whole bins.

    Parameters
    ----------
    histograms
        Shape (k, n).
    whole
        Shape (k,), any whole numbers.

    Returns
    -------
    ndarray
        Shape (k, n).

    Examples
    --------
    >>> rolled_rows(np.array([[1.0, 2.0, 3.0], [1.0, 2.0, 3.0]]), np.array([1, -1]))
    array([[3., 1., 2.],
           [2., 3., 1.]])
    """
    rows = np.empty(histograms.shape)
    bins = histograms.shape[1]
    for k in range(histograms.shape[0]):
        target = whole[k] % bins
        for m in range(bins):
            rows[k, target] = histograms[k, m]
            target = target + 1 if target + 1 < bins else 0
    return rows


@kernel
def turned_rows(histogram: FloatArray, whole: IntArray, rest: FloatArray) -> FloatArray:
    """Return one histogram turned in each of many ways.

    Parameters
    ----------
    histogram
        Shape (n,).
    whole, rest
        Shape (k,).

    Returns
    -------
    ndarray
        Shape (k, n).

    Examples
    --------
    A turn by a bin and a quarter leaves three quarters of a spike one bin further on:

    >>> turned_rows(np.array([4.0, 0.0, 0.0]), np.array([1, 2]), np.array([0.25, 0.0]))
    array([[0., 3., 1.],
           [0., 0., 4.]])
    """
    n = histogram.size
    # Entry m is h[m − 1], for two rounds, so that no turn meets an end.
    rounds = np.concatenate((histogram[n - 1 :], histogram, histogram))
    rows = np.empty((whole.size, n))
    for k in range(whole.size):
        late, early = rest[k], 1.0 - rest[k]
        start = n - whole[k] % n
        here, before, row = rounds[start + 1 :], rounds[start:], rows[k]
        for m in range(n):
            row[m] = early * here[m] + late * before[m]
    return rows
