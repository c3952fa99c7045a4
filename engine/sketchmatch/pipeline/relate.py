"""From two scenes' histograms to the table of how every pair compares with every other."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Protocol
from weakref import WeakKeyDictionary

import numpy as np

from sketchmatch.api import Alignment, ProductSimilarity, Similarity
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.kernels.alignment import (
    BLAS_MULTIPLICATIONS,
    interpolated_products,
    main_directions,
    main_turns,
    peak_turns,
    rolled_rows,
    roughness,
    split_turns,
    turned_rows,
)
from sketchmatch.model import BoolArray, FloatArray, IntArray, RelationTable, SceneDescriptor
from sketchmatch.model.arrays import sealed
from sketchmatch.model.caching import cached_property
from sketchmatch.pipeline.guard import checked_array
from sketchmatch.pipeline.slices import in_slices

ComplexArray = np.ndarray[Any, np.dtype[np.complex128]]
Entries = tuple[FloatArray, FloatArray, FloatArray]
"""σ, R and L of some rows of a table."""

__all__ = ["Entries", "Histograms", "check_exponent", "relate"]

_LEAST_POWER = 0.5
_MOST_LOG_DILATION = 700.0
_PANEL_VALUES = 2**20
_TILE_VALUES = 2**17
_BLAS_ROWS = 8
"""Rows that one product of matrices takes.

Products of this height sum a row alike in whichever place it stands; of fewer rows they do not.
"""

_MEASURED: WeakKeyDictionary[SceneDescriptor, Histograms] = WeakKeyDictionary()
"""What maps that are matched again and again would otherwise be measured for each time."""


def check_exponent(exponent: float) -> None:
    """Refuse histograms that hardly change with size, so that no dilation follows from them.

    Raises
    ------
    InvalidInputError
        If the exponent r of the forces is within 0.5 of 3.
    """
    if not abs(3.0 - exponent) >= _LEAST_POWER:
        raise InvalidInputError(
            Reason.INVALID_PARAMETER,
            "pipeline.histogram",
            f"has forces of exponent r = {exponent:g}, which hardly change with size, so that no "
            "dilation follows from them; choose r at most 2.5 or at least 3.5",
        )


def relate(
    template: SceneDescriptor,
    argument: SceneDescriptor,
    similarity: Similarity,
    known: tuple[BoolArray, Entries] | None = None,
) -> Generator[float, None, RelationTable]:
    """Compare every template histogram with every argument histogram.

    Each template histogram is dilated by L = (m'/m)^(1/(3−r)), m being the means, and turned by R
    before it is compared. R is the difference of the main directions (thesis 3.2), or as the
    measure's ``alignment`` says. A histogram that is zero everywhere compares with none: σ = 0,
    R = 0, L = 1.

    Numbers stay in double precision, because the proofs of ``exact`` compare ζ to 12 digits. Duals
    are not computed: they have the same σ and L, and R + π.

    Parameters
    ----------
    template, argument, similarity
        What is compared with what, and by which measure.
    known
        Which rows are known already, shape (Q,), and σ, R and L of these rows, as
        :meth:`~sketchmatch.pipeline.memory.Memory.rows` returns them.

    Yields
    ------
    float
        The share that is done.

    Returns
    -------
    RelationTable
        σ, R and L; the template must have at most as many objects as the argument.

    Raises
    ------
    InvalidInputError
        If no dilation follows from forces of this exponent, or the two are described by different
        histograms.
    """
    check_exponent(template.exponent)
    _check_alike(template, argument)
    shape = (len(template.histograms), len(argument.histograms))
    if known is None:
        rows, entries = _measured(template), _empty(shape)
        yield from _related(rows, argument, similarity, entries)
    else:
        missing, entries = np.flatnonzero(~known[0]), known[1]
        rows, found = Histograms.of(template.histograms[missing]), _empty((missing.size, shape[1]))
        yield from _related(rows, argument, similarity, found)
        for whole, part in zip(entries, found, strict=True):
            whole[missing] = part
    sigma, rotation, dilation = map(sealed, entries)
    return RelationTable(sigma, rotation, dilation, template.objects, argument.objects)


def _related(
    rows: Histograms, argument: SceneDescriptor, similarity: Similarity, entries: Entries
) -> Generator[float, None, None]:
    """Compare some template histograms with every argument histogram, panel by panel."""
    columns = len(argument.histograms)
    panel = max(1, _PANEL_VALUES // argument.directions)
    for first in range(0, columns, panel):
        some = slice(first, min(first + panel, columns))
        whole = some == slice(0, columns)
        others = _measured(argument) if whole else Histograms.of(argument.histograms[some])
        parts = tuple(array[:, some] for array in entries)
        for share in _fill(rows, others, similarity, argument.exponent, *parts):
            yield (first + share * len(others)) / columns


def _empty(shape: tuple[int, int]) -> Entries:
    """Return room for σ, R and L."""
    return np.empty(shape), np.empty(shape), np.empty(shape)


def _measured(descriptor: SceneDescriptor) -> Histograms:
    """Return the histograms of a scene as they are compared, for as long as it is described so."""
    found = _MEASURED.get(descriptor)
    if found is None:
        found = Histograms.of(descriptor.histograms)
        if found.values.size <= _PANEL_VALUES:
            _MEASURED[descriptor] = found
    return found


def _check_alike(template: SceneDescriptor, argument: SceneDescriptor) -> None:
    """Refuse histograms of two kinds: what came of them would mean nothing."""
    kinds = [
        (
            each.described_by or f"histograms of forces of exponent {each.exponent:g}",
            each.directions,
        )
        for each in (template, argument)
    ]
    if kinds[0] != kinds[1]:
        (ours, our_directions), (theirs, their_directions) = kinds
        raise InvalidInputError(
            Reason.INVALID_PARAMETER,
            "argument",
            f"is described by {theirs} in {their_directions} directions, but the template by "
            f"{ours} in {our_directions}; describe both by the same histogram",
        )


def _fill(
    template: Histograms,
    argument: Histograms,
    similarity: Similarity,
    exponent: float,
    sigma: FloatArray,
    rotation: FloatArray,
    dilation: FloatArray,
) -> Generator[float, None, None]:
    """Compute σ, R and L of all pairs of histograms, tile by tile."""
    turns = _ALIGNMENTS[similarity.alignment](template, argument)
    tile_shape = (1, max(1, _TILE_VALUES // template.bins))
    if isinstance(similarity, ProductSimilarity):
        tile_shape = turns.tile_shape
    tiles = _Tiles(len(template), len(argument), *tile_shape)

    def work(first: int, last: int) -> None:
        for k in range(first, last):
            tile = rows, columns = tiles[k]
            sigma[tile], whole, rest = _compared(
                template, argument, turns, similarity, rows, columns
            )
            turned = (whole + rest) * (2.0 * np.pi / template.bins)
            rotation[tile] = np.where(turned < 2.0 * np.pi, turned, 0.0)
            growth = argument.log_means[columns] - template.log_means[rows, None]
            growth *= 1.0 / (3.0 - exponent)
            np.clip(growth, -_MOST_LOG_DILATION, _MOST_LOG_DILATION, out=growth)
            dilation[tile] = np.exp(growth)

    yield from in_slices(len(tiles), work)
    for array, nothing in ((sigma, 0.0), (rotation, 0.0), (dilation, 1.0)):
        array[template.absent] = nothing
        array[:, argument.absent] = nothing


def _compared(
    template: Histograms,
    argument: Histograms,
    turns: _Turns,
    similarity: Similarity,
    rows: slice,
    columns: slice,
) -> tuple[FloatArray, IntArray, FloatArray]:
    """Return σ of some rows and columns of the table, and their turns, whole and rest."""
    if isinstance(similarity, ProductSimilarity):
        whole, rest, product = turns.with_products(rows, columns)
        squares = rest * (1.0 - rest)
        squares *= -2.0 * template.roughness[rows, None]
        squares += template.squares[rows, None]
        sigma = similarity.combine(product, squares, argument.squares[columns])
        return checked_array(sigma, product.shape, most=1.0), whole, rest
    whole, rest = turns.alone(rows, columns)
    sigma = np.empty(rest.shape)
    others = argument.values[columns]
    for k, histogram in enumerate(template.values[rows]):
        aligned = turned_rows(histogram, whole[k], rest[k])
        found = similarity.compare(aligned, others)
        sigma[k] = checked_array(found, (len(others),), most=1.0)
    return sigma, whole, rest


@dataclass(frozen=True)
class _Tiles:
    """A table cut into tiles, row by row.

    A tile is always computed in the same way, whoever does it when: products of matrices of other
    shapes would differ in their last digits.
    """

    rows: int
    columns: int
    height: int
    width: int

    def __len__(self) -> int:
        return math.ceil(self.rows / self.height) * self._across

    def __getitem__(self, k: int) -> tuple[slice, slice]:
        down, across = divmod(k, self._across)
        top, left = down * self.height, across * self.width
        return (
            slice(top, min(top + self.height, self.rows)),
            slice(left, min(left + self.width, self.columns)),
        )

    @property
    def _across(self) -> int:
        return math.ceil(self.columns / self.width)


@dataclass(frozen=True)
class Histograms:
    """The histograms of one scene in units of their mean, which dilates each to every other.

    Attributes
    ----------
    values
        Shape (k, n); one that is zero everywhere is replaced by ones.
    log_means, absent
        Shape (k,): the logarithm of the mean, and whether the histogram is zero everywhere.
    """

    values: FloatArray
    log_means: FloatArray
    absent: np.ndarray[Any, np.dtype[np.bool_]]

    @classmethod
    def of(cls, histograms: FloatArray) -> Histograms:
        """Take histograms of shape (k, n), none of them negative."""
        largest = histograms.max(axis=1)
        absent = largest <= 0.0
        largest[absent] = 1.0
        values = histograms / largest[:, None]
        values[absent] = 1.0
        means = values.mean(axis=1)
        values /= means[:, None]
        return cls(values, np.log(means) + np.log(largest), absent)

    def __len__(self) -> int:
        return len(self.values)

    @property
    def bins(self) -> int:
        """The number n of directions."""
        return int(self.values.shape[1])

    @cached_property
    def squares(self) -> FloatArray:
        """S = Σ h², shape (k,)."""
        sums: FloatArray = np.einsum("kn,kn->k", self.values, self.values)
        return sums

    @cached_property
    def roughness(self) -> FloatArray:
        """D = ½ Σ (h[m] − h[m−1])², shape (k,)."""
        return roughness(self.values)

    @cached_property
    def main_turns(self) -> tuple[IntArray, FloatArray]:
        """Main directions in whole bins and rests."""
        return split_turns(main_directions(self.values), self.bins)

    @cached_property
    def ahead(self) -> FloatArray:
        """The values with the whole bins of the main directions turned away."""
        return rolled_rows(self.values, -self.main_turns[0])

    @cached_property
    def blocks(self) -> FloatArray:
        """Those in blocks that one product of matrices takes, the last one filled up with zeros."""
        block = max(1, BLAS_MULTIPLICATIONS // (3 * _BLAS_ROWS * self.bins))
        found = np.zeros((math.ceil(len(self) / block), block, self.bins))
        found.reshape(-1, self.bins)[: len(self)] = self.ahead
        return found

    @cached_property
    def spectra(self) -> ComplexArray:
        """The Fourier transforms of the values."""
        return np.fft.rfft(self.values)


class _Turns(Protocol):
    """How template histograms are turned onto argument histograms, for a tile of the table."""

    tile_shape: tuple[int, int]
    """Rows and columns of the tiles that ``with_products`` takes."""

    def alone(self, rows: slice, columns: slice) -> tuple[IntArray, FloatArray]:
        """Return whole bins and rests of the turns."""

    def with_products(self, rows: slice, columns: slice) -> tuple[IntArray, FloatArray, FloatArray]:
        """Return whole bins and rests of the turns, and Σ h₂h'."""


class _MainTurns:
    """Turns by the difference of main directions.

    Once the whole bins of both main directions are turned away, the whole turns about the wanted
    one are −1, 0 and 1 for all pairs, and each makes C a product of two matrices.
    """

    def __init__(self, template: Histograms, argument: Histograms) -> None:
        self.template, self.argument = template, argument
        self.blocks = argument.blocks
        _, block, bins = self.blocks.shape
        self.tile_shape = (_BLAS_ROWS, block * max(1, 8 * _TILE_VALUES // (block * bins)))

    def alone(self, rows: slice, columns: slice) -> tuple[IntArray, FloatArray]:
        whole, rest = self.template.main_turns
        other_whole, other_rest = self.argument.main_turns
        return main_turns(
            whole[rows], rest[rows], other_whole[columns], other_rest[columns], self.template.bins
        )

    def with_products(self, rows: slice, columns: slice) -> tuple[IntArray, FloatArray, FloatArray]:
        whole, rest = self.alone(rows, columns)
        count, block = len(rest), self.blocks.shape[1]
        ahead, rests = np.zeros((_BLAS_ROWS, self.template.bins)), np.zeros(_BLAS_ROWS)
        ahead[:count] = self.template.ahead[rows]
        rests[:count] = self.template.main_turns[1][rows]
        around = np.concatenate([ahead[:, -1:], ahead, ahead[:, :1]], axis=1)
        about = np.concatenate([around[:, 2:], ahead, around[:, :-2]])
        others = self.blocks[columns.start // block : math.ceil(columns.stop / block)]
        products = about @ others.swapaxes(1, 2)
        other_rests = self.argument.main_turns[1][columns]
        return whole, rest, interpolated_products(products, rests, other_rests)[:count]


class _PeakTurns:
    """Turns to the peak of the circular cross-correlation, which is a product of spectra."""

    def __init__(self, template: Histograms, argument: Histograms) -> None:
        self.template, self.argument = template, argument
        self.tile_shape = (1, max(1, _TILE_VALUES // template.bins))

    def alone(self, rows: slice, columns: slice) -> tuple[IntArray, FloatArray]:
        whole, rest, _ = self.with_products(rows, columns)
        return whole, rest

    def with_products(self, rows: slice, columns: slice) -> tuple[IntArray, FloatArray, FloatArray]:
        spectra = np.conj(self.template.spectra[rows, None]) * self.argument.spectra[columns]
        products = np.fft.irfft(spectra, self.template.bins)
        return peak_turns(products, self.template.squares[rows], self.template.roughness[rows])


_ALIGNMENTS: Mapping[Alignment, Callable[[Histograms, Histograms], _Turns]] = MappingProxyType(
    {Alignment.MAIN_DIRECTION: _MainTurns, Alignment.PEAK: _PeakTurns}
)
