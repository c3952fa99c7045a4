"""What people in a notebook use; everything here is importable from ``sketchmatch``."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pydantic import ValidationError

from sketchmatch.api.forces import (
    ForceParams,
    force_histograms,
    refuse_infinite,
    scene_relations,
)
from sketchmatch.api.pixels import PixelObject, outlines, pixel_object, pixel_relations
from sketchmatch.config import load, open_engine
from sketchmatch.errors import InvalidInputError, Reason, quoted
from sketchmatch.io import read_source
from sketchmatch.model import (
    BoolArray,
    FloatArray,
    OccupancyGrid,
    RequestWeights,
    Scene,
    SceneObject,
    Source,
    object_pairs,
)
from sketchmatch.model.labels import Synonyms
from sketchmatch.model.limits import source_limits
from sketchmatch.pipeline.compare import Comparison
from sketchmatch.pipeline.engine import Engine
from sketchmatch.pipeline.events import Finished, MatchEvent, Progress
from sketchmatch.pipeline.knowledge import Pin
from sketchmatch.pipeline.request import MatchRequest
from sketchmatch.pipeline.result import MatchResult
from sketchmatch.pipeline.selection import SIDES, STAGES, Choice, Selection, fault_of
from sketchmatch.pipeline.slices import finish, retold
from sketchmatch.transfers.features import Feature
from sketchmatch.transfers.transfer import TransferRequest, TransferResult, run_transfer

__all__ = [
    "carry",
    "compare",
    "force_histogram",
    "label_force_histograms",
    "match",
    "read_scene",
    "transfer",
]


def match(
    sketch: Scene | Source | str | Path,
    map: Scene | Source | str | Path,  # noqa: A002
    *,
    profile: str | None = None,
    sketch_segmenter: str | None = None,
    map_segmenter: str | None = None,
    histogram: str | None = None,
    similarity: str | None = None,
    searcher: str | None = None,
    judge: str | None = None,
    params: Mapping[str, Mapping[str, Any]] | None = None,
    seed: int = 0,
    time_budget: float | None = None,
    weights: RequestWeights | None = None,
    allow_unmatched: bool | None = None,
    unmatched_price: float | None = None,
    alternatives: int | None = None,
    pins: Mapping[Any, int | str | None] | Iterable[Pin] | None = None,
    synonyms: Synonyms | None = None,
    on_progress: Callable[[Progress], None] | None = None,
    config: str | Path | None = None,
) -> MatchResult:
    """Find which sketched object is which mapped object.

    Parameters
    ----------
    sketch, map
        Scenes, sources, or paths of files: SVG or stroke JSON sketches, GeoJSON polygons, ROS map
        YAML, images, and whatever plugins read; ``"plan.dxf#walls"`` selects a part of a file.
    profile
        A named pipeline to start from, e.g. ``"proof"``; other arguments override it.
    sketch_segmenter, map_segmenter
        Names of the algorithms that find the objects, e.g. ``map_segmenter="rooms"``; not used for
        scenes. By default those of the profile, the configuration, or the kind of source.
    histogram, similarity, searcher, judge
        Names of the algorithms. By default those of the profile, the configuration, or
        ``"constant"``, ``"cross-correlation"``, ``"align"`` and ``"posterior"``.
    params
        Parameters by stage, the six above, e.g. ``{"searcher": {"population": 400}}``; they need no
        name beside them if the stage keeps its algorithm.
    seed
        The same arguments with the same seed give the same result.
    time_budget
        Seconds after which the search stops with the best answer so far; None for no limit.
    weights
        Weights of ζσ, ζR and ζL in ζ; two more are those of ζS and ζM, which compare each object
        with its partner in shape and in size; a sixth is an exponent β: in ζR, the rotation of two
        objects at distance d counts d^β. By default those of the profile, or else 1, 1, 1.
    allow_unmatched
        Whether objects may stay without partner on both sides where that is more likely. By default
        as the profile says, or else as searcher and judge do by themselves: ``"align"`` and
        ``"posterior"`` leave objects out, others match the smaller scene completely.
    unmatched_price
        Price of a map that leaves out all objects of the smaller scene, in units of ζ; in
        proportion if it leaves out some. By default the judge's own.
    alternatives
        Number of next best object maps in the result; None for 3. There may be fewer.
    pins
        What is known of single objects: a dict from sketched objects to their partners, or to None
        for one that is not on the map, e.g. ``{"desk": 3, 0: "sofa", 5: None}``. Objects are given
        by index, from 0, or by a label that is unique in the scene. Or a list of
        :class:`~sketchmatch.Pin`, which can also state that one is *not* another. The answer obeys.
    synonyms
        Labels that mean the same, besides those that differ only in case, plural or a counting
        number: ``[("couch", "sofa")]``. Labels are evidence if both scenes have some, for
        algorithms that use them, and never force a line.
    on_progress
        Called with the state of the match, at most 20 times a second.
    config
        A configuration file. By default no file is read, not even one in the usual places;
        environment variables and the built-in profiles always apply.

    Returns
    -------
    MatchResult
        ``object_map`` is a dict from sketch index to map index, both from 0.

    Raises
    ------
    InvalidInputError
        If something cannot be used; the message states what, where and what would help.
    AnswerUnavailableError
        If the time budget ends before there is an answer.

    Examples
    --------
    >>> box, bar = [[0, 0], [2, 0], [2, 2], [0, 2]], [[5, 0], [9, 0], [9, 1]]
    >>> dot = [[1, 6], [2, 6], [2, 7]]
    >>> scene = Scene.from_polygons([box, bar, dot])
    >>> turned = Scene.from_polygons([[[-y, x] for x, y in p] for p in (dot, box, bar)])
    >>> match(scene, turned).object_map
    {0: 1, 1: 2, 2: 0}
    """
    engine = _engine(config)
    names = {
        "sketch_segmenter": sketch_segmenter,
        "map_segmenter": map_segmenter,
        "histogram": histogram,
        "similarity": similarity,
        "searcher": searcher,
        "judge": judge,
    }
    with engine.limited():
        request = MatchRequest(
            sketch=_loaded("sketch", sketch, engine),
            map=_loaded("map", map, engine),
            selection=_selection(names, params),
            seed=seed,
            time_budget=time_budget,
            weights=weights,
            allow_unmatched=allow_unmatched,
            unmatched_price=unmatched_price,
            alternatives=alternatives,
            profile=_profile(profile),
            pins=_pins(pins),
            synonyms=() if synonyms is None else synonyms,  # type: ignore[arg-type]  # it checks
        )
    for event in engine.match(request):
        if isinstance(event, Finished):
            return event.result
        if isinstance(event, Progress) and on_progress is not None:
            on_progress(event)
    raise AssertionError("a match ends with a result or an error")


def transfer(
    sketch: Scene | Source | str | Path,
    map: Scene | Source | str | Path,  # noqa: A002
    features: Iterable[Feature] = (),
    *,
    object_map: Mapping[int, int] | None = None,
    direction: str = "sketch-to-map",
    radius: float | None = None,
    allow_unknown: bool = False,
    profile: str | None = None,
    sketch_segmenter: str | None = None,
    map_segmenter: str | None = None,
    params: Mapping[str, Mapping[str, Any]] | None = None,
    seed: int = 0,
    time_budget: float | None = None,
    pins: Mapping[Any, int | str | None] | Iterable[Pin] | None = None,
    synonyms: Synonyms | None = None,
    on_progress: Callable[[Progress], None] | None = None,
    config: str | Path | None = None,
) -> TransferResult:
    """Transfer points, routes and zones from a sketch to a map, or back, by the matched objects.

    Parameters
    ----------
    sketch, map
        As for :func:`match`.
    features
        The features to transfer, in the coordinates of their scene, y upwards; if its file has
        longitudes and latitudes, in metres around ``PolygonSet.geographic_origin``. A route that is
        drawn in the sketch is always transferred.
    object_map
        Which sketched object is which mapped one, if known, e.g. ``match(…).object_map``: then
        nothing is matched.
    direction
        ``"sketch-to-map"`` or ``"map-to-sketch"``.
    radius
        Distance of routes from obstacles: half the width of the robot. By default 0 on a grid;
        elsewhere routes then do not avoid objects.
    allow_unknown
        Whether routes may cross unknown cells.
    profile, sketch_segmenter, map_segmenter, params, seed, time_budget, pins, synonyms
        As for :func:`match`.
    on_progress
        Called with the state of the match.
    config
        As for :func:`match`.

    Returns
    -------
    TransferResult
        ``carried`` has each transferred feature, the standard deviation of each of its points, and
        what was changed and why.

    Raises
    ------
    InvalidInputError
        If something cannot be used, or the matched objects lie so that every warp folds the plane
        or mirrors it.
    AnswerUnavailableError
        If the time budget ends before there is any map.

    Examples
    --------
    >>> box, bar, dot = [[0, 0], [2, 0], [2, 2]], [[5, 0], [9, 0], [9, 1]], [[1, 6], [2, 6], [2, 7]]
    >>> scene = Scene.from_polygons([box, bar, dot])
    >>> turned = Scene.from_polygons([[[-y, x] for x, y in p] for p in (dot, box, bar)])
    >>> found = transfer(scene, turned, [Feature("point", ([[3.0, 1.0]],), "here")])
    >>> found.features[0].points.round(6).tolist()
    [[-1.0, 3.0]]
    """
    engine = _engine(config)
    names = {"sketch_segmenter": sketch_segmenter, "map_segmenter": map_segmenter}
    with engine.limited():
        matching = MatchRequest(
            sketch=_loaded("sketch", sketch, engine),
            map=_loaded("map", map, engine),
            selection=_selection(names, params),
            seed=seed,
            time_budget=time_budget,
            profile=_profile(profile),
            pins=_pins(pins),
            synonyms=() if synonyms is None else synonyms,  # type: ignore[arg-type]  # it checks
        )
    request = TransferRequest(
        matching,
        _features(features),
        None if object_map is None else tuple(object_map.items()),
        direction,  # type: ignore[arg-type]  # it checks
        radius,
        allow_unknown,
    )
    return finish(_told(run_transfer(request, engine), on_progress))


def carry(
    features: Iterable[Feature],
    old: Scene | Source | str | Path,
    new: Scene | Source | str | Path,
    *,
    segmenter: str | None = None,
    **options: Any,
) -> TransferResult:
    """Transfer points, routes and zones from an old map to a new one of the same place.

    Parameters
    ----------
    features
        The features to transfer, in the coordinates of the old map.
    old, new
        The maps, as :func:`match` takes them. The new one may have another origin, be rotated, and
        show some objects elsewhere.
    segmenter
        Algorithm that finds the objects on both maps. By default two grids are compared by objects
        and by rooms, and the more informative result is returned.
    **options
        As for :func:`transfer`.

    Returns
    -------
    TransferResult
        As :func:`transfer`; the old map is its sketch.

    Raises
    ------
    InvalidInputError
        As :func:`transfer`.
    """
    given = _features(features)
    engine = _engine(options.get("config"))
    with engine.limited():
        maps = _loaded("old", old, engine), _loaded("new", new, engine)
    known = options.get("object_map") is not None or options.get("pins") is not None
    names: tuple[str | None, ...] = (segmenter,)
    if segmenter is None and not known and all(isinstance(each, OccupancyGrid) for each in maps):
        names = (None, "rooms")
    found: list[TransferResult] = []
    problems: list[InvalidInputError] = []
    for name in names:
        try:
            found.append(
                transfer(*maps, given, sketch_segmenter=name, map_segmenter=name, **options)
            )
        except InvalidInputError as error:
            problems.append(error)
    if not found:
        raise problems[0]
    return min(found, key=lambda each: each.unsureness)


def read_scene(
    path: str | Path,
    *,
    segmenter: str | None = None,
    params: Mapping[str, Any] | None = None,
    profile: str | None = None,
    config: str | Path | None = None,
) -> Scene:
    """Read the scene in a file.

    Parameters
    ----------
    path
        A sketch or a map, as :func:`match` takes them.
    segmenter
        Name of the algorithm that finds the objects, e.g. ``"rooms"``. By default that of the
        profile, the configuration, or the kind of source.
    params
        Its parameters, e.g. ``{"min_size": 0.3}``.
    profile, config
        As for :func:`match`.

    Raises
    ------
    InvalidInputError
        If the file cannot be read or has fewer than two objects, or the segmenter or a parameter
        cannot be used for it.
    """
    engine = _engine(config)
    with engine.limited():
        source = read_source(path, engine.registry.readers)
    choice = Choice(_name("segmenter", segmenter), _mapping("params", params))
    chosen = engine.resolve_segmenter(choice, source, _profile(profile))
    return engine.segment(source, chosen, f"{path}: {source.field}").scene


def compare(
    sketch: Scene | Source | str | Path,
    map: Scene | Source | str | Path,  # noqa: A002
    *,
    profile: str | None = None,
    sketch_segmenter: str | None = None,
    map_segmenter: str | None = None,
    histogram: str | None = None,
    similarity: str | None = None,
    params: Mapping[str, Mapping[str, Any]] | None = None,
    config: str | Path | None = None,
) -> Comparison:
    """Compare the relations within a sketch with those on a map, without a search.

    Parameters
    ----------
    sketch, map, profile, sketch_segmenter, map_segmenter, histogram, similarity, params, config
        As for :func:`match`.

    Returns
    -------
    Comparison
        Scenes, histograms and the table of σ, R and L; ``most_similar`` lists it from sketch to
        map.

    Raises
    ------
    InvalidInputError
        If something cannot be used; the message states what, where and what would help.

    Examples
    --------
    >>> box, bar = [[0, 0], [2, 0], [2, 2], [0, 2]], [[5, 0], [9, 0], [9, 1]]
    >>> scene = Scene.from_polygons([box, bar, [[1, 6], [2, 6], [2, 7]]])
    >>> found = compare(scene, scene)
    >>> sorted((each.sketch_pair, each.map_pair) for each in found.most_similar(limit=3))
    [((0, 1), (0, 1)), ((0, 2), (0, 2)), ((1, 2), (1, 2))]
    """
    engine = _engine(config)
    with engine.limited():
        given = _loaded("sketch", sketch, engine), _loaded("map", map, engine)
    names = {
        "sketch_segmenter": sketch_segmenter,
        "map_segmenter": map_segmenter,
        "histogram": histogram,
        "similarity": similarity,
    }
    selection = _selection(names, params)
    unread = [None if isinstance(each, Scene) else each for each in given]
    pipeline = engine.resolve(selection, unread[0], unread[1], _profile(profile))
    drawn, mapped = (
        engine.segment_side(side, each, pipeline).scene
        for side, each in zip(SIDES, given, strict=True)
    )
    return finish(engine.compare((drawn, mapped), pipeline.histogram, pipeline.similarity))


def force_histogram(a: Any, b: Any, *, r: float = 0.0, directions: int = 180) -> FloatArray:
    """Return the exact histogram of the forces d^−r of object ``a`` on object ``b``.

    Parameters
    ----------
    a, b
        Polygons: each a (k, 2) array-like, a list of such rings (outer, holes …), or a
        :class:`~sketchmatch.model.SceneObject`. Or two boolean arrays of one shape: masks of an
        image, whose pixel at row i and column j is the unit square with its lower left corner at
        (j, rows − 1 − i).
    r
        Exponent of the force: 0 for constant forces, 2 for gravitational ones, −1 for the
        histogram of angles, any real number −10 … 10.
    directions
        Number of directions over the full turn, even, 4 … 3600.

    Returns
    -------
    ndarray
        Shape (directions,): entry k supports "a is in direction 2πk/directions of b", in units of
        length to the power 3 − r.

    Raises
    ------
    InvalidInputError
        If an argument cannot be used, or the force is infinite: objects that overlap for r ≥ 1,
        or that touch for r ≥ 2.

    References
    ----------
    P. Matsakis, L. Wendling, "A new way to represent the relative position between areal
    objects", IEEE TPAMI 21(7), 1999.

    Examples
    --------
    Two unit squares side by side: along the x axis each line meets both in sections of length 1,
    with a gap of 2 between them.

    >>> left = [[0, 0], [1, 0], [1, 1], [0, 1]]
    >>> right = [[3, 0], [4, 0], [4, 1], [3, 1]]
    >>> float(force_histogram(right, left)[0])
    1.0
    >>> round(float(force_histogram(right, left, r=2)[0]), 6)  # ln (3² / (2 · 4))
    0.117783
    """
    params = _forces(r, directions)
    if _is_mask(a) or _is_mask(b):
        masks = [_mask(name, mask) for name, mask in (("a", a), ("b", b))]
        if masks[0].shape != masks[1].shape:
            raise InvalidInputError(
                Reason.INVALID_IMAGE, "b", "has another shape than a; cut both from one image"
            )
        objects = [pixel_object(mask[::-1]) for mask in masks]
        return np.asarray(_pixel_forces(objects, params, "ab".__getitem__)[0])
    scene = Scene((_object("a", a), _object("b", b)))
    relations = scene_relations(scene, _PAIR)
    refuse_infinite(relations, _PAIR, params.r, "ab".__getitem__)
    (row,) = force_histograms(scene.edges, _PAIR, params.directions, params.r, relations)
    return np.asarray(row)


def label_force_histograms(labels: Any, *, r: float = 0.0, directions: int = 180) -> FloatArray:
    """Return the histograms of forces of all pairs of objects in a label image.

    Parameters
    ----------
    labels
        Integers, shape (rows, columns): 0 for the background, 1 … N for the objects, each of
        which has at least one pixel; row 0 is the top.
    r, directions
        As in :func:`force_histogram`.

    Returns
    -------
    ndarray
        Shape (N(N−1)/2, directions), in units of pixels: the pairs (1, 2), (1, 3) … (2, 3) … in
        this order, entry k of (a, b) supporting "a is in direction 2πk/directions of b".

    Raises
    ------
    InvalidInputError
        If the image cannot be used, or two objects touch and r ≥ 2.

    Examples
    --------
    >>> label_force_histograms([[1, 0, 2]], directions=4).tolist()
    [[0.0, 0.0, 1.0, 0.0]]
    """
    params = _forces(r, directions)
    try:
        image = np.asarray(labels)
    except ValueError:  # of rows that are not equally long
        image = np.empty(0)
    if image.ndim != 2 or not np.issubdtype(image.dtype, np.integer):
        raise InvalidInputError(
            Reason.INVALID_IMAGE, "labels", "are not a grid of integers; give rows of labels"
        )
    present = np.setdiff1d(image, [0])
    if present.size < 2 or (present != np.arange(1, present.size + 1)).any():
        raise InvalidInputError(
            Reason.INVALID_IMAGE,
            "labels",
            "are not 0 and 1 … N without a gap, N at least 2; number the objects from 1",
        )
    objects = [pixel_object((image == label)[::-1]) for label in present]
    return _pixel_forces(objects, params, lambda k: f"labels {k + 1}")


_PAIR = object_pairs(2)


def _told(
    work: Generator[MatchEvent, None, TransferResult],
    on_progress: Callable[[Progress], None] | None,
) -> Generator[MatchEvent, None, TransferResult]:
    """Go on with a transfer, calling back with its progress."""

    def tell(event: MatchEvent) -> tuple[MatchEvent, ...]:
        if isinstance(event, Progress) and on_progress is not None:
            on_progress(event)
        return (event,)

    return retold(work, tell)


def _engine(config: str | Path | None = None) -> Engine:
    """Return the engine of a configuration; limits that are in force hold for it too."""
    if config is not None and not (isinstance(config, str | Path) and str(config)):
        problem = f"is {quoted(config)}; give the path of a file, or leave it out"
        raise InvalidInputError(Reason.INVALID_FIELD, "config", problem)
    engine = open_engine(load(config, search=False))
    return replace(engine, limits=source_limits(engine.limits))


class _Forces(NamedTuple):
    """Which histogram is asked for: its exponent, and how many directions."""

    r: float
    directions: int


def _forces(r: float, directions: int) -> _Forces:
    try:
        params = ForceParams(r=r, directions=directions)
    except ValidationError as error:
        fault = error.errors(include_url=False)[0]
        raise InvalidInputError(
            Reason.INVALID_PARAMETER, str(fault["loc"][0]), fault_of(fault["input"], fault["msg"])
        ) from None
    if params.directions is None:
        raise InvalidInputError(
            Reason.INVALID_PARAMETER,
            "directions",
            "is None; give an even number, as there is no scene to choose it by",
        )
    return _Forces(params.r, params.directions)


def _is_mask(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.dtype == np.bool_


def _mask(name: str, value: Any) -> BoolArray:
    if not _is_mask(value) or value.ndim != 2 or not value.any():
        raise InvalidInputError(
            Reason.INVALID_IMAGE,
            name,
            "is not a mask with any pixel in it; give two boolean arrays of shape (rows, columns)",
        )
    return np.asarray(value)


def _pixel_forces(
    objects: list[PixelObject], params: _Forces, name: Callable[[int], str]
) -> FloatArray:
    pairs = object_pairs(len(objects))
    relations = pixel_relations(objects, pairs)
    refuse_infinite(relations, pairs, params.r, name)
    return force_histograms(outlines(objects), pairs, params.directions, params.r, relations)


def _object(name: str, polygon: Any) -> SceneObject:
    if isinstance(polygon, SceneObject):
        return polygon
    try:
        return SceneObject.from_polygon(polygon)
    except InvalidInputError as error:
        raise error.within(name) from None


def _loaded(side: str, given: Scene | Source | str | Path, engine: Engine) -> Scene | Source:
    if isinstance(given, Scene | Source):
        return given
    if not isinstance(given, str | Path):
        raise InvalidInputError(
            Reason.INVALID_FIELD,
            side,
            f"is {quoted(given)}; give a Scene, as Scene.from_polygons makes it, a source or the "
            "path of a file",
        )
    try:
        return read_source(given, engine.registry.readers)
    except InvalidInputError as error:
        raise InvalidInputError(error.reason, f"{side}: {error.field}", error.problem) from None


def _selection(
    names: Mapping[str, str | None], params: Mapping[str, Mapping[str, Any]] | None
) -> Selection:
    named = {stage: _name(stage, name) for stage, name in names.items()}
    params = _mapping("params", params)
    for stage in params:
        if stage not in STAGES:
            raise InvalidInputError(
                Reason.INVALID_PARAMETER,
                f"params.{stage}",
                f"is not a stage; choose one of: {', '.join(STAGES)}",
            )
    return {
        stage: Choice(named.get(stage, ""), _mapping(f"params.{stage}", params.get(stage)))
        for stage in {*named, *params}
    }


def _profile(given: str | None) -> str:
    return _name("profile", given, "a profile")


def _name(field: str, given: Any, what: str = "an algorithm") -> str:
    """Return a name, empty where it is left out, as None alone does: no unset variable."""
    if given is None:
        return ""
    if not isinstance(given, str) or not given:
        problem = f"is {quoted(given)}; give the name of {what}, or leave it out"
        raise InvalidInputError(Reason.INVALID_FIELD, field, problem)
    return given


def _features(given: Iterable[Feature]) -> tuple[Feature, ...]:
    found = tuple(given) if isinstance(given, Iterable) and not isinstance(given, str) else None
    if found is None or not all(isinstance(each, Feature) for each in found):
        problem = f"is {quoted(given)}; give a list of Feature"
        raise InvalidInputError(Reason.INVALID_FIELD, "features", problem)
    return found


def _pins(given: Mapping[Any, int | str | None] | Iterable[Pin] | None) -> tuple[Pin, ...]:
    """Return pins as a request has them, which checks them."""
    if isinstance(given, Mapping):
        return tuple(Pin(sketched, mapped) for sketched, mapped in given.items())
    return () if given is None else given  # type: ignore[return-value]


def _mapping(field: str, given: Mapping[str, Any] | None) -> Mapping[str, Any]:
    if given is not None and not isinstance(given, Mapping):
        raise InvalidInputError(
            Reason.INVALID_PARAMETER,
            field,
            f"is {quoted(given)}; give a dict of parameters, as in {{'min_size': 0.3}}",
        )
    return given or {}
