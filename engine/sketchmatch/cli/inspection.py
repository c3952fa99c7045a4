"""What ``describe`` and ``relate`` show, asked of the engine in this process.

Imported by the commands when they run: numba and OpenCV come with it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sketchmatch.api import Histogram, Segmentation, Segmenter, Similarity
from sketchmatch.cli import display
from sketchmatch.cli.options import say
from sketchmatch.config import load, open_engine
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.io import read_source
from sketchmatch.model import FloatArray, Pairs, Scene, Source, object_pairs
from sketchmatch.pipeline.describe import with_directions
from sketchmatch.pipeline.result import Correspondence
from sketchmatch.pipeline.selection import SIDES, Choice
from sketchmatch.pipeline.warmup import announcing_compilation
from sketchmatch.pipeline.words import DirectionalRelation, directional_relations

__all__ = ["Description", "Listing", "compared", "described"]


@dataclass(frozen=True)
class Description:
    """The relations of some pairs of objects of one scene.

    Attributes
    ----------
    scene, source
        The objects, and what they were found in.
    segmenter, histogram
        What found and described them.
    pairs
        (a, b), from 0.
    histograms
        Shape (m, n), of each pair.
    relations
        Each in words.
    directions
        Shape (m,), the main direction of each in radians within (−π, π].
    """

    scene: Scene
    source: Source
    segmenter: Segmenter
    histogram: Histogram
    pairs: Pairs
    histograms: FloatArray
    relations: tuple[DirectionalRelation, ...]
    directions: FloatArray


@dataclass(frozen=True)
class Listing:
    """The most similar relations of a sketch and a map.

    Attributes
    ----------
    sketch, map
        The objects.
    histogram, similarity
        What described and compared them.
    best
        The most similar ones, best first.
    total
        How many there are.
    """

    sketch: Scene
    map: Scene
    histogram: Histogram
    similarity: Similarity
    best: tuple[Correspondence, ...]
    total: int


def described(
    file: Path,
    names: Mapping[str, str],
    params: Mapping[str, Any],
    pairs: Pairs,
    profile: str = "",
    config: Path | None = None,
    *,
    verbose: bool = False,
) -> Description:
    """Describe pairs of the objects in a file, all pairs a < b if none are chosen.

    Raises
    ------
    InvalidInputError
        If the file, an algorithm, a parameter or a pair cannot be used.
    """
    engine = open_engine(load(config))
    chosen = _choices(("segmenter", "histogram"), names, params)
    with engine.limited(), announcing_compilation(say):
        source = read_source(file, engine.registry.readers)
        segmenter = engine.resolve_segmenter(chosen.pop("segmenter"), source, profile)
        histogram = engine.resolve(chosen, profile=profile).histogram
        scene = _told(engine.segment(source, segmenter, f"scene.{source.field}"), "", verbose)
        _check_pairs(pairs, scene, "--pair", "scene")
        work = engine.describe(scene, histogram)
        descriptor = display.follow(work, "describing relations")
        histogram = with_directions(histogram, engine.registry, scene)
    pairs = pairs or [(a, b) for a, b in object_pairs(len(scene)).tolist()]
    rows = np.stack([descriptor.histogram(a, b) for a, b in pairs])
    turns = np.exp(2j * np.pi * np.arange(rows.shape[1]) / rows.shape[1])
    return Description(
        scene,
        source,
        segmenter,
        histogram,
        pairs,
        rows,
        directional_relations(rows),
        np.angle(rows @ turns),
    )


def compared(
    sketch: Path,
    map_: Path,
    names: Mapping[str, str],
    params: Mapping[str, Any],
    sketch_pairs: Pairs,
    map_pairs: Pairs,
    limit: int,
    profile: str = "",
    config: Path | None = None,
    *,
    verbose: bool = False,
) -> Listing:
    """Compare pairs of a sketch with pairs of a map, all pairs a < b where none are chosen.

    Raises
    ------
    InvalidInputError
        If a file, an algorithm, a parameter or a pair cannot be used.
    """
    engine = open_engine(load(config))
    with engine.limited(), announcing_compilation(say):
        readers = engine.registry.readers
        sources = (read_source(sketch, readers), read_source(map_, readers))
        pipeline = engine.resolve(_choices((*names,), names, params), *sources, profile)
        drawn, mapped = (
            _told(engine.segment_side(side, source, pipeline), side, verbose)
            for side, source in zip(SIDES, sources, strict=True)
        )
        _check_pairs(sketch_pairs, drawn, "--sketch-pair", "sketch")
        _check_pairs(map_pairs, mapped, "--map-pair", "map")
        work = engine.compare((drawn, mapped), pipeline.histogram, pipeline.similarity)
        found = display.follow(work, "describing and comparing relations")
        histogram = with_directions(pipeline.histogram, engine.registry, drawn, mapped)
    counts = [
        len(pairs) or len(object_pairs(len(scene)))
        for pairs, scene in ((sketch_pairs, drawn), (map_pairs, mapped))
    ]
    return Listing(
        drawn,
        mapped,
        histogram,
        pipeline.similarity,
        found.most_similar(sketch_pairs, map_pairs, limit),
        counts[0] * counts[1],
    )


def _choices(
    stages: Sequence[str], names: Mapping[str, str], params: Mapping[str, Any]
) -> dict[str, Choice]:
    return {stage: Choice(names.get(stage, ""), params.get(stage, {})) for stage in stages}


def _told(found: Segmentation, side: str, verbose: bool) -> Scene:
    """Return the objects that were found, and tell what was left out."""
    display.say_notes(side, found.warnings, verbose)
    return found.scene


def _check_pairs(pairs: Pairs, scene: Scene, option: str, what: str) -> None:
    for pair in pairs:
        for index in pair:
            if not 0 <= index < len(scene):
                raise InvalidInputError(
                    Reason.INVALID_FIELD,
                    option,
                    f"'{pair[0] + 1},{pair[1] + 1}' names object {index + 1}, but the {what} has "
                    f"objects 1 … {len(scene)}; `sketchmatch segment` shows them",
                )
