"""What people in a notebook use; everything here is importable from ``sketchmatch``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.io import read_source
from sketchmatch.model import FloatArray, Scene, SceneObject, Source, Weights
from sketchmatch.pipeline.match import Finished, MatchRequest, Progress, run_match
from sketchmatch.pipeline.plugins import segmented
from sketchmatch.pipeline.result import MatchResult
from sketchmatch.pipeline.selection import STAGES, Choice, Selection, resolve, resolve_segmenter
from sketchmatch.registry import default_registry

__all__ = ["force_histogram", "match", "read_scene"]


def match(
    sketch: Scene | Source | str | Path,
    map: Scene | Source | str | Path,  # noqa: A002
    *,
    searcher: str = "auto",
    histogram: str = "constant",
    similarity: str = "cross-correlation",
    params: Mapping[str, Mapping[str, Any]] | None = None,
    seed: int = 0,
    time_budget: float | None = None,
    weights: Weights = (1.0, 1.0, 1.0),
    alternatives: int | None = None,
    on_progress: Callable[[Progress], None] | None = None,
) -> MatchResult:
    """Find which sketched object is which mapped object.

    Parameters
    ----------
    sketch, map
        Scenes, sources, or paths of files that hold them: SVG or stroke JSON sketches, GeoJSON
        polygons, ROS map YAML, images.
    searcher, histogram, similarity
        Names of the algorithms.
    params
        Parameters by stage, e.g. ``{"searcher": {"population": 400}}``; beside the three above
        ``"sketch_segmenter"`` and ``"map_segmenter"``.
    seed
        The same arguments with the same seed give the same result.
    time_budget
        Seconds after which the best answer so far is given, or None for no limit.
    weights
        Of ζσ, ζR and ζL in ζ.
    alternatives
        How many of the next best object maps the result shall hold; None for 3, or as many as
        there are.
    on_progress
        Called with the state of the match, at most 20 times a second.

    Returns
    -------
    MatchResult
        ``object_map`` is a dict from sketch index to map index, both from 0.

    Raises
    ------
    InvalidInputError
        If something cannot be used; the sentence says what, where and what would help.
    AnswerUnavailableError
        If the time budget ends before there is any answer.

    Examples
    --------
    >>> box, bar = [[0, 0], [2, 0], [2, 2], [0, 2]], [[5, 0], [9, 0], [9, 1]]
    >>> dot = [[1, 6], [2, 6], [2, 7]]
    >>> scene = Scene.from_polygons([box, bar, dot])
    >>> turned = Scene.from_polygons([[[-y, x] for x, y in p] for p in (dot, box, bar)])
    >>> match(scene, turned).object_map
    {0: 1, 1: 2, 2: 0}
    """
    names = {"searcher": searcher, "histogram": histogram, "similarity": similarity}
    request = MatchRequest(
        sketch=_loaded("sketch", sketch),
        map=_loaded("map", map),
        selection=_selection(names, params or {}),
        seed=seed,
        time_budget=time_budget,
        weights=weights,
        alternatives=alternatives,
    )
    for event in run_match(request, default_registry()):
        if isinstance(event, Finished):
            return event.result
        if isinstance(event, Progress) and on_progress is not None:
            on_progress(event)
    raise AssertionError("a match ends with a result or an error")


def read_scene(path: str | Path) -> Scene:
    """Read the scene in a file, segmented as its kind is by default.

    Raises
    ------
    InvalidInputError
        If the file cannot be read or holds fewer than two objects.
    """
    source = read_source(Path(path))
    registry = default_registry()
    segmenter = resolve_segmenter(registry, Choice(), source)
    return segmented(source, segmenter, registry, f"{path}: {source.field}").scene


def force_histogram(a: Any, b: Any, *, r: float = 0.0, directions: int = 180) -> FloatArray:
    """Return the exact histogram of forces of object ``a`` on object ``b``.

    Parameters
    ----------
    a, b
        Polygons: each a (k, 2) array-like, a list of such rings (outer, holes …), or a
        :class:`~sketchmatch.model.SceneObject`.
    r
        Exponent of the force; constant forces, r = 0, are built in.
    directions
        Number of directions over the full turn, even, 4 … 3600.

    Returns
    -------
    ndarray
        Shape (directions,): entry k supports "a is in direction 2πk/directions of b".

    References
    ----------
    P. Matsakis, L. Wendling, "A new way to represent the relative position between areal
    objects", IEEE TPAMI 21(7), 1999.

    Examples
    --------
    Two unit squares side by side: along the x axis each line meets both in sections of length 1.

    >>> left = [[0, 0], [1, 0], [1, 1], [0, 1]]
    >>> right = [[3, 0], [4, 0], [4, 1], [3, 1]]
    >>> float(force_histogram(right, left)[0])
    1.0
    """
    if r != 0.0:
        raise InvalidInputError(
            Reason.INVALID_PARAMETER, "r", f"is {r:g}; only constant forces, r = 0, are built in"
        )
    chosen = {"histogram": Choice("constant", {"directions": directions})}
    histogram = resolve(default_registry(), chosen).histogram
    scene = Scene((_object("a", a), _object("b", b)))
    (row,) = histogram.describe(scene, np.array([[0, 1]]))
    return np.asarray(row)


def _object(name: str, polygon: Any) -> SceneObject:
    if isinstance(polygon, SceneObject):
        return polygon
    try:
        return SceneObject.from_polygon(polygon)
    except InvalidInputError as error:
        raise error.within(name) from None


def _loaded(side: str, given: Scene | Source | str | Path) -> Scene | Source:
    if not isinstance(given, str | Path):
        return given
    try:
        return read_source(Path(given))
    except InvalidInputError as error:
        raise error.within(side) from None


def _selection(names: Mapping[str, str], params: Mapping[str, Mapping[str, Any]]) -> Selection:
    for stage in params:
        if stage not in STAGES:
            raise InvalidInputError(
                Reason.INVALID_PARAMETER,
                f"params.{stage}",
                f"is no stage; choose one of: {', '.join(STAGES)}",
            )
    return {
        stage: Choice(names.get(stage, ""), params.get(stage, {})) for stage in {*names, *params}
    }
