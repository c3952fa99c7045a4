"""Not trusting plugins: what they raise and what they return is theirs to answer for."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from sketchmatch.api import Algorithm, SearchProgress, Segmentation, Segmenter
from sketchmatch.errors import InvalidInputError, PluginError, SketchmatchError
from sketchmatch.model import FloatArray, RelationTable, Scene, Source
from sketchmatch.model.limits import check_objects, check_source
from sketchmatch.registry import Registry

__all__ = ["blaming", "checked_array", "checked_progress", "segmented"]

_LONGEST = 200


@contextmanager
def blaming(algorithm: Algorithm | type[Algorithm], registry: Registry) -> Iterator[None]:
    """Turn what an algorithm raises into a PluginError that names it and where it comes from.

    Errors that it raises for the caller, such as InvalidInputError, pass.
    """
    try:
        yield
    except SketchmatchError:
        raise
    except Exception as error:  # a plugin may raise anything
        text = " ".join(f"{type(error).__name__}: {error}".split())
        cause = text if len(text) <= _LONGEST else f"{text[:_LONGEST]}…"
        raise PluginError(
            f"{registry.whose(algorithm)} failed ({cause}); tell its author or choose another"
        ) from error


def checked_array(values: Any, shape: tuple[int, ...]) -> FloatArray:
    """Return what a plugin returned as an array, if it is one of that shape and finite."""
    array = np.asarray(values, dtype=np.float64)
    if array.shape != shape:
        raise ValueError(f"it returned an array of shape {array.shape}, not {shape}")
    if not np.isfinite(array).all():
        raise ValueError("it returned values that are not finite")
    return array


def checked_progress(progress: Any, table: RelationTable) -> SearchProgress:
    """Return what a search yielded, if it holds an FMAP into the table and its confidence."""
    if not isinstance(progress, SearchProgress):
        raise TypeError(f"it yielded a {type(progress).__name__}, not a SearchProgress")
    entries = progress.fmap.entries
    if entries.shape != (table.template_pairs,):
        raise ValueError(f"its FMAP has shape {entries.shape}, not ({table.template_pairs},)")
    if entries.min() < 0 or entries.max() >= 2 * table.argument_pairs:
        raise ValueError(f"its FMAP has an entry outside 0 … {2 * table.argument_pairs - 1}")
    if not math.isfinite(progress.confidence):
        raise ValueError(f"its confidence is {progress.confidence}")
    return progress


def segmented(source: Source, segmenter: Segmenter, registry: Registry, field: str) -> Segmentation:
    """Find the objects of a source.

    Raises
    ------
    InvalidInputError
        If nothing usable is in it, or too much, with a path that begins with ``field``.
    PluginError
        If the segmenter breaks its contract.
    """
    check_source(source, field)
    with blaming(segmenter, registry):
        try:
            found = segmenter.segment(source)
        except InvalidInputError as error:
            raise error.within(field) from None
        if not isinstance(found, Segmentation):
            raise TypeError(f"it returned a {type(found).__name__}, not a Segmentation")
        if not isinstance(found.scene, Scene):
            raise TypeError(f"it found a {type(found.scene).__name__}, not a Scene")
        if found.route is not None:
            checked_array(found.route, (len(found.route), 2))
    check_objects(len(found.scene), field)
    return found
