"""Which algorithm does each stage of a match, and with which parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, cast

from pydantic import ValidationError

from sketchmatch.api import Algorithm, Histogram, Searcher, Segmenter, Similarity
from sketchmatch.errors import InvalidInputError, Reason, quoted
from sketchmatch.model import Image, OccupancyGrid, PolygonSet, Source, StrokeSet
from sketchmatch.pipeline.plugins import blaming
from sketchmatch.registry import Kind, Registry

__all__ = ["DEFAULTS", "STAGES", "Choice", "Pipeline", "Selection", "resolve", "resolve_segmenter"]

STAGES = ("sketch_segmenter", "map_segmenter", "histogram", "similarity", "searcher")
"""The stages of a match, by the names that requests, options and errors use."""

_LONGEST_NAME = 60
_DEFAULT_SEGMENTERS: dict[type[Any], str] = {
    StrokeSet: "strokes",
    PolygonSet: "polygons",
    OccupancyGrid: "occupancy-grid",
    Image: "image",
}
DEFAULTS: Mapping[Kind, tuple[str, ...]] = MappingProxyType(
    {
        Kind.SEGMENTER: tuple(_DEFAULT_SEGMENTERS.values()),
        Kind.HISTOGRAM: ("constant",),
        Kind.SIMILARITY: ("cross-correlation",),
        Kind.SEARCHER: ("auto",),
    }
)
"""What is used where the caller chooses nothing: a segmenter for each type of source."""


@dataclass(frozen=True)
class Choice:
    """What a caller asks for in one stage; an empty name leaves it to the defaults."""

    name: str = ""
    parameters: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))


Selection = Mapping[str, Choice]
"""A choice for some or all of the :data:`STAGES`."""


@dataclass(frozen=True)
class Pipeline:
    """The algorithms of one match, each with all its parameters.

    A segmenter is None where the caller handed in a scene.
    """

    sketch_segmenter: Segmenter | None
    map_segmenter: Segmenter | None
    histogram: Histogram
    similarity: Similarity
    searcher: Searcher

    def stages(self) -> dict[str, Algorithm]:
        """Return the algorithm of each stage that there is."""
        chosen = {stage: getattr(self, stage) for stage in STAGES}
        return {stage: algorithm for stage, algorithm in chosen.items() if algorithm is not None}


def resolve(
    registry: Registry,
    selection: Selection,
    sketch: Source | None = None,
    map: Source | None = None,  # noqa: A002
) -> Pipeline:
    """Pick and set up the algorithms of a match.

    Parameters
    ----------
    registry
        The algorithms at hand.
    selection
        What the caller asks for.
    sketch, map
        What will be segmented, or None for what is a scene already.

    Raises
    ------
    InvalidInputError
        If a stage, algorithm or parameter is unknown, out of range, or does not fit the source.
    """
    for stage in selection:
        if stage not in STAGES:
            raise InvalidInputError(
                Reason.INVALID_PARAMETER, stage, f"is no stage; choose one of: {', '.join(STAGES)}"
            )
    segmenters: dict[str, Segmenter | None] = {}
    for stage, source in (("sketch_segmenter", sketch), ("map_segmenter", map)):
        choice = selection.get(stage, Choice())
        if source is None:
            if choice.name or choice.parameters:
                raise InvalidInputError(
                    Reason.WRONG_ALGORITHM, stage, "is set for a scene, which needs none; drop it"
                )
            segmenters[stage] = None
        else:
            segmenters[stage] = resolve_segmenter(registry, choice, source, stage)

    def pick(kind: Kind) -> Algorithm:
        (default,) = DEFAULTS[kind]
        return _resolve_stage(registry, kind, selection.get(kind, Choice()), default, kind)

    return Pipeline(
        **segmenters,
        histogram=cast(Histogram, pick(Kind.HISTOGRAM)),
        similarity=cast(Similarity, pick(Kind.SIMILARITY)),
        searcher=cast(Searcher, pick(Kind.SEARCHER)),
    )


def resolve_segmenter(
    registry: Registry, choice: Choice, source: Source, stage: str = "segmenter"
) -> Segmenter:
    """Pick the segmenter for one source.

    Raises
    ------
    InvalidInputError
        If it is unknown, cannot read the source, or a parameter is wrong.
    """
    default = _DEFAULT_SEGMENTERS[type(source)]
    segmenter = cast(Segmenter, _resolve_stage(registry, Kind.SEGMENTER, choice, default, stage))
    if not isinstance(source, segmenter.sources):
        fitting = ", ".join(
            item.name
            for item in registry.of_kind(Kind.SEGMENTER)
            if issubclass(type(source), cast(type[Segmenter], item.algorithm).sources)
        )
        raise InvalidInputError(
            Reason.WRONG_ALGORITHM,
            f"{stage}.name",
            f"is {segmenter.name!r}, which cannot read source {source.field}; "
            f"choose one of: {fitting}",
        )
    return segmenter


def _resolve_stage(
    registry: Registry, kind: Kind, choice: Choice, default: str, stage: str
) -> Algorithm:
    try:
        algorithm = registry.find(kind, choice.name or default).algorithm
    except InvalidInputError as error:
        raise error.within(stage) from None
    with blaming(algorithm, registry):
        try:
            params = algorithm.Params(**dict(choice.parameters))
        except ValidationError as error:
            raise _parameter_error(algorithm, error).within(f"{stage}.parameters") from None
        return algorithm(params)


def _parameter_error(algorithm: type[Algorithm], error: ValidationError) -> InvalidInputError:
    """Say the first fault of a validation in one sentence."""
    fault = error.errors(include_url=False)[0]
    path = ".".join(str(part)[:_LONGEST_NAME] for part in fault["loc"])
    if fault["type"] == "extra_forbidden":
        known = ", ".join(algorithm.Params.model_fields) or "none"
        problem = f"is no parameter of {algorithm.name}; it has: {known}"
    else:
        given = fault["input"]
        if isinstance(given, float) and given.is_integer():
            given = int(given)  # numbers of a protobuf Struct are all floating
        remedy = fault["msg"].removeprefix("Input ").removeprefix("Value error, ")
        problem = f"is {quoted(given)}; it {remedy}"
    return InvalidInputError(Reason.INVALID_PARAMETER, path, problem)
