"""From a source to the scene in it."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from sketchmatch.api import Segmentation, Segmenter
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.model import OccupancyGrid, Scene, Source
from sketchmatch.model.arrays import real_floats
from sketchmatch.model.labels import cleaned_sentences
from sketchmatch.model.limits import check_objects, check_source
from sketchmatch.pipeline.guard import blaming, check_scene, inspecting
from sketchmatch.pipeline.selection import Pipeline
from sketchmatch.registry import Registry

__all__ = ["cuts_of_side", "segment", "segment_side"]

_LONGEST = 400


def segment(source: Source, segmenter: Segmenter, registry: Registry, field: str) -> Segmentation:
    """Find the objects of a source.

    Raises
    ------
    InvalidInputError
        If nothing usable is in it, or too much, with a path that begins with ``field``.
    PluginError
        If the segmenter breaks its contract.
    """
    return next(_cuts(source, segmenter, registry, field))


def segment_side(
    side: str, given: Source | Scene | Segmentation, pipeline: Pipeline, registry: Registry
) -> Segmentation:
    """Find the objects of one side of a match; what is segmented already is what it is.

    Raises
    ------
    InvalidInputError, PluginError
        As :func:`segment` does.
    """
    return next(cuts_of_side(side, given, pipeline, registry))


def cuts_of_side(
    side: str, given: Source | Scene | Segmentation, pipeline: Pipeline, registry: Registry
) -> Iterator[Segmentation]:
    """Yield the objects of one side of a match, then what else they may be.

    What is segmented already, and what people mended, is what it is.

    Raises
    ------
    InvalidInputError, PluginError
        As :func:`segment` does.
    """
    if isinstance(given, Segmentation):
        yield given
    elif isinstance(given, Scene):
        yield Segmentation(given)
    else:
        segmenter = pipeline.segmenter(side)
        assert segmenter is not None
        yield from _cuts(given, segmenter, registry, f"{side}.{given.field}")


def _cuts(
    source: Source, segmenter: Segmenter, registry: Registry, field: str
) -> Iterator[Segmentation]:
    check_source(source, field)
    read, place = _read_by(segmenter, source, field)
    check_source(read, place)
    cuts = _checked(segmenter, read, registry)
    try:
        found = next(cuts)
    except InvalidInputError as error:
        raise _with_reasons(error, read).within(place) from None
    if read is not source:
        found = _with_notes(found, read)
    check_objects(len(found.scene), field)
    yield _with_notes(found, source)
    if read is source:
        with suppress(InvalidInputError):  # the first is there, whatever else it may be
            for other in cuts:
                check_objects(len(other.scene), field)
                yield _with_notes(other, source)


def _checked(segmenter: Segmenter, source: Source, registry: Registry) -> Iterator[Segmentation]:
    """Yield what a segmenter finds, if it is what the contract says."""
    with blaming(segmenter, registry):
        cuts = iter(segmenter.cuts(source))
    for number in itertools.count():
        with blaming(segmenter, registry):
            with inspecting(segmenter, registry, source):
                found: Any = next(cuts, None)
            if found is None and number:
                return
            _check_contract(found)
            if not registry.is_own(segmenter):  # ours are held to it by their tests
                check_scene(found.scene)
        yield found


def _read_by(segmenter: Segmenter, source: Source, field: str) -> tuple[Source, str]:
    """Return what a segmenter reads of a source, and its path: of a mended map, the objects."""
    if isinstance(source, OccupancyGrid) and not isinstance(source, segmenter.sources):
        assert source.objects is not None
        return source.objects, f"{field}.objects"
    return source, field


def _with_notes(found: Segmentation, source: Source) -> Segmentation:
    """Put what a file's reader noted before the warnings, unless the segmenter handed it on."""
    warnings = cleaned_sentences(found.warnings)
    notes = (note for note in _notes(source) if note not in warnings)
    return replace(found, warnings=(*notes, *warnings))


def _with_reasons(error: InvalidInputError, source: Source) -> InvalidInputError:
    """Let the refusal of too few objects tell what a file's reader had left out."""
    notes = " ".join(_notes(source))
    if error.reason is not Reason.TOO_FEW_OBJECTS or not notes:
        return error
    return InvalidInputError(error.reason, error.field, f"{error.problem} ({notes[:_LONGEST]})")


def _notes(source: Source) -> tuple[str, ...]:
    """Return what a file's reader noted, in which names of the file may stand as they were."""
    return cleaned_sentences(getattr(source, "notes", ()))


def _check_contract(found: Any) -> None:
    if not isinstance(found, Segmentation):
        raise TypeError(f"it returned a {type(found).__name__}, not a Segmentation")
    if not isinstance(found.scene, Scene):
        raise TypeError(f"it found a {type(found.scene).__name__}, not a Scene")
    if found.route is not None:
        _check_route(found.route)
    if not isinstance(found.warnings, tuple | list):
        raise TypeError(f"its warnings are a {type(found.warnings).__name__}, not a tuple")
    if not all(isinstance(warning, str) for warning in found.warnings):
        raise TypeError("its warnings are not all strings")
    _check_passages(found.passages, len(found.scene))


def _check_route(route: Any) -> None:
    points = real_floats(route)
    if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
        raise ValueError(f"its route has shape {points.shape}, not (k, 2), or is not finite")


def _check_passages(passages: Any, objects: int) -> None:
    for pair in passages:
        if not (len(pair) == 2 and pair[0] != pair[1] and all(0 <= k < objects for k in pair)):
            raise ValueError(f"its passages join {pair}, not two of its {objects} objects")
