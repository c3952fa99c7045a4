"""Contracts of similarity measures."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from functools import partial
from typing import Any

import numpy as np

from sketchmatch.api import Alignment, ProductSimilarity, Similarity
from sketchmatch.model import FloatArray
from sketchmatch.model.arrays import sealed
from sketchmatch.testing.conformance.contract import Contract, require, require_applicable
from sketchmatch.testing.conformance.use import Use, contracts_of_use, view_within

__all__ = ["CONTRACTS"]

_CLOSE = 1e-9
_ROWS, _DIRECTIONS = 12, 36


def alignment_is_known(algorithm: type[Any]) -> None:
    """Have an alignment out of sketchmatch.api.Alignment."""
    require(isinstance(algorithm.alignment, Alignment), f"alignment is {algorithm.alignment!r}")


def similarity_is_within_0_and_1(algorithm: type[Any]) -> None:
    """Return one float64 within [0, 1] for each pair of rows."""
    for first, second in (_histograms(), _alone(), _histograms(4)):
        values = _compared(algorithm, first, second)
        fits = isinstance(values, np.ndarray) and values.dtype == np.float64
        require(fits, f"compare() returned {type(values).__name__}s of {np.asarray(values).dtype}")
        require(values.shape == (len(first),), f"it has shape {values.shape} for {len(first)} rows")
        inside = (values >= 0.0) & (values <= 1.0)
        require(inside.all(), f"a value is {values[~inside][:1]}")


def equal_rows_have_similarity_1(algorithm: type[Any]) -> None:
    """Return 1 for equal histograms, to 1e-9."""
    for rows in (*_histograms(), _alone()[0]):
        values = _compared(algorithm, rows, rows)
        off = np.abs(values - 1.0).max()
        require(off <= _CLOSE, f"equal rows have {values[np.abs(values - 1.0).argmax()]:.9f}")


def rows_are_compared_alone(algorithm: type[Any]) -> None:
    """Give a pair of rows the same value whatever rows come with it."""
    first, second = _histograms()
    whole = _compared(algorithm, first, second)
    for size in (1, 5):
        parts = [
            _compared(algorithm, first[k : k + size], second[k : k + size])
            for k in range(0, _ROWS, size)
        ]
        off = np.abs(np.concatenate(parts) - whole).max()
        require(off <= _CLOSE, f"compared {size} at a time, a value differs by {off:.2g}")


def combine_agrees_with_compare(algorithm: type[Any]) -> None:
    """Combine sums of products, of any shape, to what compare() gives for the rows."""
    product = issubclass(algorithm, ProductSimilarity)
    require_applicable(product, "it derives from Similarity, and not from ProductSimilarity")
    first, second = _histograms()
    squares = (first * first).sum(axis=1), (second * second).sum(axis=1)
    table = algorithm().combine(first @ second.T, squares[0][:, None], squares[1])
    require(table.shape == (_ROWS, _ROWS), f"combine() returned shape {table.shape} for a table")
    for k in range(_ROWS):
        rows = _compared(algorithm, first, np.tile(second[k], (_ROWS, 1)))
        off = np.abs(table[:, k] - rows).max()
        require(off <= _CLOSE, f"combine() and compare() differ by {off:.2g}")


def _uses() -> Iterator[Use]:
    first, second = _histograms()
    for one, other in ((first, second), (second, second[::-1])):
        aligned, argument = view_within(one), view_within(other)
        rows = {"aligned": aligned, "argument": argument}
        yield Use(f"{_ROWS} pairs of rows", rows, partial(_answer, aligned, argument))


def _answer(first: FloatArray, second: FloatArray, similarity: Similarity) -> Hashable:
    return np.asarray(similarity.compare(first, second)).tobytes()


CONTRACTS: tuple[Contract, ...] = (
    alignment_is_known,
    similarity_is_within_0_and_1,
    equal_rows_have_similarity_1,
    rows_are_compared_alone,
    combine_agrees_with_compare,
    *contracts_of_use(_uses),
)


def _histograms(directions: int = _DIRECTIONS) -> tuple[FloatArray, FloatArray]:
    """Return random histograms of mean 1, some with many empty bins."""
    rng = np.random.default_rng(9)
    rows = rng.uniform(0.0, 1.0, (2, _ROWS, directions)) ** 2
    rows[:, ::2] *= rng.random((_ROWS // 2, directions)) < 0.5
    rows[..., 0] += 0.01  # no row is all zero
    rows /= rows.mean(axis=2, keepdims=True)
    return rows[0], rows[1]


def _compared(algorithm: type[Any], aligned: FloatArray, argument: FloatArray) -> Any:
    """Compare copies that cannot be written to."""
    return algorithm().compare(sealed(aligned.copy()), sealed(argument.copy()))


def _alone() -> tuple[FloatArray, FloatArray]:
    """Return histograms of one bin each, the first rows with the same, the last with others."""
    first = _DIRECTIONS * np.eye(_DIRECTIONS)[:_ROWS]
    return first, np.roll(first, _ROWS // 2, axis=0)
