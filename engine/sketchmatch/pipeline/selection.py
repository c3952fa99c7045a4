"""Which algorithm does each stage of a match, and with which parameters.

Four levels say it, each over the one before: what is built in, the defaults of the configuration, a
profile, and the request. A level that names another algorithm drops the parameters of those below.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from typing import Any, cast

from pydantic import ValidationError

from sketchmatch.api import Algorithm, Histogram, Judge, Searcher, Segmenter, Similarity
from sketchmatch.errors import InvalidInputError, Reason, quoted
from sketchmatch.model import (
    Image,
    OccupancyGrid,
    PolygonSet,
    RequestWeights,
    Source,
    StrokeSet,
)
from sketchmatch.pipeline.guard import blaming, check_made
from sketchmatch.registry import Kind, Registered, Registry

__all__ = [
    "SIDES",
    "STAGES",
    "UNCONFIGURED",
    "Choice",
    "Defaults",
    "Pipeline",
    "Profile",
    "Selection",
    "chosen_algorithms",
    "default_names",
    "default_parameters",
    "fault_of",
    "kind_of",
    "profile_faults",
    "resolve",
    "resolve_segmenter",
    "set_up",
    "set_up_faults",
    "stage_of",
]

SIDES = ("sketch", "map")
"""The two sources of a match, by the names that requests and errors use."""

_LONGEST_NAME = 60

# A source alone, without a match, is taken for what such a source mostly is.
_MOSTLY: dict[type[Any], str] = {
    StrokeSet: "sketch_segmenter",
    PolygonSet: "map_segmenter",
    OccupancyGrid: "map_segmenter",
    Image: "sketch_segmenter",
}


_SOURCES = tuple(_MOSTLY)


@dataclass(frozen=True)
class Choice:
    """What is asked for in one stage; an empty name leaves it to the levels below."""

    name: str = ""
    parameters: Mapping[str, Any] = field(default_factory=dict)


Selection = Mapping[str, Choice]
"""A choice for some or all of the :data:`STAGES`."""


@dataclass(frozen=True)
class Profile:
    """A pipeline that a request can name.

    Attributes
    ----------
    name
        What it is named by.
    summary
        One line for lists.
    stages
        Its choices.
    weights
        Of the parts of ζ, as in a request; None for 1, 1, 1.
    allow_unmatched
        Whether objects may stay without partner on both sides; None leaves it to searcher and
        judge.
    """

    name: str
    summary: str = ""
    stages: Selection = field(default_factory=dict)
    weights: RequestWeights | None = None
    allow_unmatched: bool | None = None


@dataclass(frozen=True)
class Defaults:
    """What a configuration says about the stages; nothing, unless it is given.

    Attributes
    ----------
    pipeline
        Choices for some stages. A segmenter is used for the sources that it reads.
    parameters
        Parameters of algorithms, by kind and name, wherever they are chosen.
    profiles
        The pipelines that a request can name.
    profile
        The one for requests that name none; empty for none.
    """

    pipeline: Selection = field(default_factory=dict)
    parameters: Mapping[Kind, Mapping[str, Mapping[str, Any]]] = field(default_factory=dict)
    profiles: tuple[Profile, ...] = ()
    profile: str = ""

    def named(self, profile: str) -> Profile:
        """Return a profile by its name; an empty name stands for the default one.

        Raises
        ------
        InvalidInputError
            If there is none of this name.
        """
        wanted = profile or self.profile
        if not wanted:
            return Profile("")
        for known in self.profiles:
            if known.name == wanted:
                return known
        names = ", ".join(sorted(known.name for known in self.profiles)) or "none"
        problem = f"is {quoted(wanted)}, which is not a profile; choose one of: {names}"
        raise InvalidInputError(Reason.UNKNOWN_PROFILE, "profile", problem)


UNCONFIGURED = Defaults()
"""What holds where nobody configured anything."""


@dataclass(frozen=True)
class Pipeline:
    """The algorithms of one match, each with all its parameters.

    A segmenter is None where the caller handed in a scene; ``profile`` names the profile in force,
    if there is one.
    """

    sketch_segmenter: Segmenter | None
    map_segmenter: Segmenter | None
    histogram: Histogram
    similarity: Similarity
    searcher: Searcher
    judge: Judge
    profile: str = ""

    def segmenter(self, side: str) -> Segmenter | None:
        """Return the segmenter of the sketch or of the map."""
        return {"sketch": self.sketch_segmenter, "map": self.map_segmenter}[side]

    def stages(self) -> dict[str, Algorithm]:
        """Return the algorithm of each stage that there is."""
        chosen = {stage: getattr(self, stage) for stage in STAGES}
        return {stage: algorithm for stage, algorithm in chosen.items() if algorithm is not None}


STAGES = tuple(each.name for each in fields(Pipeline) if each.name != "profile")
"""The stages of a match, by the names that requests, options and errors use."""


def stage_of(source: type[Source]) -> str:
    """Return the stage that sources of a type are mostly segmented in, where nothing is matched."""
    return next(_MOSTLY[base] for base in source.__mro__ if base in _MOSTLY)


def kind_of(stage: str) -> Kind:
    """Return what kind of algorithm does a stage.

    Examples
    --------
    >>> str(kind_of("map_segmenter"))
    'segmenter'
    """
    return Kind.SEGMENTER if stage.endswith("segmenter") else Kind(stage)


def resolve(
    registry: Registry,
    selection: Selection,
    sketch: Source | None = None,
    map: Source | None = None,  # noqa: A002
    defaults: Defaults = UNCONFIGURED,
    profile: str = "",
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
    defaults
        What the configuration says where the caller says nothing.
    profile
        The profile that the caller names; empty for the default one.

    Raises
    ------
    InvalidInputError
        If a stage, algorithm, parameter or profile is unknown, out of range, or does not fit the
        source.
    """
    for stage in selection:
        if stage not in STAGES:
            raise InvalidInputError(
                Reason.INVALID_PARAMETER,
                stage,
                f"is not a stage; choose one of: {', '.join(STAGES)}",
            )
    levels = _Levels(registry, defaults, profile)
    levels.check_profile()
    segmenters: dict[str, Segmenter | None] = {}
    for stage, source in (("sketch_segmenter", sketch), ("map_segmenter", map)):
        choice = selection.get(stage, Choice())
        if source is None:
            if choice.name or choice.parameters:
                raise InvalidInputError(
                    Reason.WRONG_ALGORITHM,
                    stage,
                    "is set for a scene, which needs no segmenter; drop it",
                )
            segmenters[stage] = None
        else:
            segmenters[stage] = levels.segmenter(stage, choice, source, stage)

    def pick(kind: Kind) -> Algorithm:
        return set_up(registry, kind, levels.folded(kind, selection.get(kind, Choice())), kind)

    return Pipeline(
        **segmenters,
        histogram=cast(Histogram, pick(Kind.HISTOGRAM)),
        similarity=cast(Similarity, pick(Kind.SIMILARITY)),
        searcher=cast(Searcher, pick(Kind.SEARCHER)),
        judge=cast(Judge, pick(Kind.JUDGE)),
        profile=levels.profile,
    )


def resolve_segmenter(
    registry: Registry,
    choice: Choice,
    source: Source,
    defaults: Defaults = UNCONFIGURED,
    profile: str = "",
) -> Segmenter:
    """Pick the segmenter for one source that is not to be matched.

    What the configuration says about the sketch holds for strokes and images, what it says about
    the map for polygons and grids.

    Raises
    ------
    InvalidInputError
        If it is unknown, cannot read the source, or a parameter is wrong.
    """
    levels = _Levels(registry, defaults, profile)
    levels.check_profile()
    return levels.segmenter(stage_of(type(source)), choice, source, "segmenter")


def chosen_algorithms(
    registry: Registry,
    selection: Selection,
    sources: Mapping[str, type[Source]],
    defaults: Defaults = UNCONFIGURED,
    profile: str = "",
) -> tuple[Registered, ...]:
    """Return which algorithms a caller asks for, without setting any of them up.

    Those that the profile names are among them: it is checked whole, whatever the caller adds.

    Parameters
    ----------
    registry, selection, defaults, profile
        As in :func:`resolve`.
    sources
        Of which type is what will be segmented, by the stage that does it.

    Raises
    ------
    InvalidInputError
        If an algorithm or the profile is unknown.
    """
    levels = _Levels(registry, defaults, profile)
    asked = (levels.registered(stage, selection, sources.get(stage)) for stage in selection)
    return tuple(dict.fromkeys((*asked, *levels.named_by_profile())))


def set_up(registry: Registry, kind: Kind, choice: Choice, stage: str) -> Algorithm:
    """Return the algorithm that a choice names, with its parameters.

    Raises
    ------
    InvalidInputError
        With a path that begins with ``stage``, if it is unknown or a parameter is wrong.
    """
    for fault in set_up_faults(registry, kind, choice, stage):
        raise fault
    algorithm = registry.find(kind, choice.name).algorithm
    with blaming(algorithm, registry):
        made = algorithm(algorithm.Params(**dict(choice.parameters)))
        check_made(made)
        return made


def set_up_faults(
    registry: Registry, kind: Kind, choice: Choice, stage: str
) -> Iterator[InvalidInputError]:
    """Yield whatever is wrong with a choice, each with a path that begins with ``stage``."""
    try:
        algorithm = registry.find(kind, choice.name).algorithm
    except InvalidInputError as error:
        yield error.within(stage)
        return
    with blaming(algorithm, registry):
        try:
            algorithm.Params(**dict(choice.parameters))
        except ValidationError as error:
            faults = list(_parameter_errors(algorithm, error))
        else:
            return
    yield from (fault.within(f"{stage}.parameters") for fault in faults)


def profile_faults(
    registry: Registry, defaults: Defaults, profile: str
) -> Iterator[InvalidInputError]:
    """Yield what is wrong with a profile, each with a path that begins with the stage.

    Raises
    ------
    InvalidInputError
        If the profile is unknown.
    """
    return _Levels(registry, defaults, profile).profile_faults()


def default_names(registry: Registry, defaults: Defaults) -> Mapping[Kind, tuple[str, ...]]:
    """Return what is used where a request chooses nothing: a segmenter for each type of source."""
    levels = _Levels(registry, defaults, "")
    return {
        Kind.SEGMENTER: tuple(
            dict.fromkeys(
                levels.folded(stage, Choice(), source).name
                for source in _SOURCES
                for stage in ("sketch_segmenter", "map_segmenter")
            )
        ),
        **{
            kind: (levels.folded(kind, Choice()).name,)
            for kind in Kind
            if kind is not Kind.SEGMENTER
        },
    }


def default_parameters(
    registry: Registry, defaults: Defaults, item: Registered
) -> Mapping[str, Any]:
    """Return the parameters of an algorithm that the configuration sets where a request names it.

    Of a segmenter, those for the first type of source that it reads.
    """
    levels, named = _Levels(registry, defaults, ""), Choice(item.name)
    if not issubclass(item.algorithm, Segmenter):
        return levels.folded(item.kind, named).parameters
    source = item.algorithm.sources[0]
    return levels.folded(stage_of(source), named, source).parameters


def fault_of(given: Any, message: str) -> str:
    """Say what a validation found about a value, to follow its path.

    Examples
    --------
    >>> fault_of(-1.0, "Input should be greater than 0")
    'is -1; it should be greater than 0'
    """
    if isinstance(given, float) and given.is_integer():
        given = int(given)  # numbers of a protobuf Struct are all floating
    remedy = re.sub(r"^\w+ (?=should )", "", message).removeprefix("Value error, ")
    return f"is {quoted(given)}; it {remedy}"


class _Levels:
    """What configuration and profile say, ready for a request to be laid over it."""

    def __init__(self, registry: Registry, defaults: Defaults, profile: str) -> None:
        self.registry = registry
        self.parameters = defaults.parameters
        chosen = defaults.named(profile)
        self.profile = chosen.name
        self.below: tuple[Selection, ...] = (defaults.pipeline, chosen.stages)

    def check_profile(self) -> None:
        """Refuse a profile of which a stage is of no use, whatever a request adds."""
        with self._blaming_profile():
            for fault in self.profile_faults():
                raise fault

    def profile_faults(self) -> Iterator[InvalidInputError]:
        """Yield what is wrong with the stages of the profile."""
        for stage, choice in self.below[-1].items():
            kind = kind_of(stage)
            levels = [level.get(stage, Choice()) for level in self.below]
            name = "" if kind is Kind.SEGMENTER else self.registry.default(kind)
            chosen = _folded(name, levels, self.parameters.get(kind, {}))
            if chosen.name and (choice.name or choice.parameters):
                yield from set_up_faults(self.registry, kind, chosen, stage)

    def folded(self, stage: str, choice: Choice, source: type[Any] | None = None) -> Choice:
        """Return what all levels together choose in a stage."""
        kind = kind_of(stage)
        name = self.registry.default(kind, source)
        below = [level.get(stage, Choice()) for level in self.below]
        if source is not None:
            below = [level for level in below if self._reads(level, source)]
        return _folded(name, (*below, choice), self.parameters.get(kind, {}))

    def registered(
        self, stage: str, selection: Selection, source: type[Source] | None
    ) -> Registered:
        """Return the algorithm that is chosen in a stage."""
        choice = self.folded(stage, selection[stage], source)
        try:
            return self.registry.find(kind_of(stage), choice.name)
        except InvalidInputError as error:
            if choice.name == selection[stage].name:
                raise error.within(stage) from None
            with self._blaming_profile():
                raise error.within(stage) from None

    def named_by_profile(self) -> Iterator[Registered]:
        """Yield the algorithms that the profile names."""
        for stage, choice in self.below[-1].items():
            if choice.name:
                with self._blaming_profile():
                    try:
                        found = self.registry.find(kind_of(stage), choice.name)
                    except InvalidInputError as error:
                        raise error.within(stage) from None
                yield found

    def segmenter(self, stage: str, choice: Choice, source: Source, path: str) -> Segmenter:
        """Return the segmenter of a stage for a source; of a mended map, that of its objects."""
        if isinstance(source, OccupancyGrid) and source.objects is not None and choice == Choice():
            source = source.objects
        chosen = self.folded(stage, choice, type(source))
        segmenter = cast(Segmenter, set_up(self.registry, Kind.SEGMENTER, chosen, path))
        if not isinstance(source, segmenter.sources):
            fitting = ", ".join(
                item.name
                for item in self.registry.of_kind(Kind.SEGMENTER)
                if item.reads(type(source))
            )
            raise InvalidInputError(
                Reason.WRONG_ALGORITHM,
                f"{path}.name",
                f"is {segmenter.name!r}, which cannot read a source of type {source.field}; "
                f"choose one of: {fitting}",
            )
        return segmenter

    def _reads(self, choice: Choice, source: type[Any]) -> bool:
        """Whether a configured segmenter, if there is any, is one for such sources."""
        if not choice.name:
            return True
        try:
            return self.registry.find(Kind.SEGMENTER, choice.name).reads(source)
        except InvalidInputError:
            return True  # it is refused when it is set up

    @contextmanager
    def _blaming_profile(self) -> Iterator[None]:
        """Put what the configuration does wrong down to the profile in force, if there is one."""
        try:
            yield
        except InvalidInputError as error:
            if not self.profile:
                raise
            problem = f"is {self.profile!r}, whose {error}"
            raise InvalidInputError(error.reason, "profile", problem) from None


def _folded(
    name: str, levels: Sequence[Choice], parameters: Mapping[str, Mapping[str, Any]]
) -> Choice:
    """Return what the levels, lowest first, choose together where ``name`` is the default."""
    chosen: dict[str, Any] = {}
    for level in levels:
        if level.name not in ("", name):
            name, chosen = level.name, {}
        chosen |= level.parameters
    return Choice(name, {**parameters.get(name, {}), **chosen})


def _parameter_errors(
    algorithm: type[Algorithm], error: ValidationError
) -> Iterator[InvalidInputError]:
    """Say each fault of a validation in one sentence."""
    for fault in error.errors(include_url=False):
        path = ".".join(str(part)[:_LONGEST_NAME] for part in fault["loc"])
        if fault["type"] == "extra_forbidden":
            known = ", ".join(algorithm.Params.model_fields) or "none"
            problem = f"is not a parameter of {algorithm.name}; it has: {known}"
        else:
            problem = fault_of(fault["input"], fault["msg"])
        yield InvalidInputError(Reason.INVALID_PARAMETER, path, problem)
