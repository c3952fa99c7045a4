"""Histograms as files for other programs: NumPy archives and tables."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sketchmatch.io._targets import check_target, writing
from sketchmatch.model import FloatArray

__all__ = ["HistogramTable", "check_histogram_path", "save_histograms"]


@dataclass(frozen=True)
class HistogramTable:
    """Some histograms of one scene.

    Attributes
    ----------
    histograms
        Shape (m, n): row (a, b) supports "a is in direction 2πk/n of b".
    pairs
        The objects (a, b) of each row, from 0.
    labels
        The names of all objects of the scene, empty where there is none.
    name
        Of the algorithm that made them.
    exponent
        r of its forces.
    """

    histograms: FloatArray
    pairs: Sequence[tuple[int, int]]
    labels: Sequence[str]
    name: str
    exponent: float


def check_histogram_path(path: str | Path, field: str = "out") -> None:
    """Refuse a path that no histograms can be saved under, before any work is done.

    Parameters
    ----------
    path
        Where they shall be.
    field
        What an error calls it.

    Raises
    ------
    InvalidInputError
        If the name's ending is not .npz or .csv, or its folder does not exist.
    """
    check_target(path, field, (".npz", ".csv"), ".npz or .csv")


def save_histograms(path: str | Path, table: HistogramTable, field: str = "out") -> None:
    """Save histograms in the format that the name's ending says.

    An archive (``.npz``, read by :func:`numpy.load` without pickle) holds ``histograms`` (m, n),
    ``pairs`` (m, 2) counted from 0, ``directions_radians`` (n,), ``labels`` of all objects,
    ``exponent`` and ``histogram``, the algorithm's name. A table (``.csv``) has one line for each
    pair: ``a``, ``b``, ``a_label``, ``b_label`` and a column for each direction, named by its
    degrees; its numbers read back exactly.

    Raises
    ------
    InvalidInputError
        If the name's ending is neither, or the file cannot be written.
    """
    check_histogram_path(path, field)
    path = Path(path)
    with writing(path, field):
        if path.suffix.lower() == ".csv":
            _write_csv(path, table)
        else:
            _write_npz(path, table)


def _write_npz(path: Path, table: HistogramTable) -> None:
    directions = table.histograms.shape[1]
    with path.open("wb") as file:
        np.savez(
            file,
            histograms=table.histograms,
            pairs=np.array(table.pairs, dtype=np.int64).reshape(-1, 2),
            directions_radians=2.0 * np.pi * np.arange(directions) / directions,
            labels=np.array(table.labels, dtype=np.str_),
            exponent=np.float64(table.exponent),
            histogram=np.str_(table.name),
        )


def _write_csv(path: Path, table: HistogramTable) -> None:
    directions = table.histograms.shape[1]
    degrees = [f"{360.0 * k / directions:.12g}" for k in range(directions)]
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["a", "b", "a_label", "b_label", *degrees])
        for (a, b), row in zip(table.pairs, table.histograms.tolist(), strict=True):
            writer.writerow([a, b, table.labels[a], table.labels[b], *map(repr, row)])
