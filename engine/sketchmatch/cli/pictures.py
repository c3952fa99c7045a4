"""Pictures of answers, drawn from the messages of the contract."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sketchmatch.cli.display import doubt, facts, likely
from sketchmatch.cli.options import say
from sketchmatch.cli.sources import check_spared, is_kept
from sketchmatch.errors import counted
from sketchmatch.io.files import read_map_files
from sketchmatch.io.ros_bag import bag_and_topic, is_bag, read_bag
from sketchmatch.model import FloatArray, OccupancyGrid, Scene, SceneObject, StrokeSet
from sketchmatch.model.arrays import frozen_floats
from sketchmatch.pictures.overlay import (
    MOST_PLOTS,
    OverlayMatch,
    OverlayRelation,
    check_picture_path,
    draw_overlay,
    draw_relations,
    draw_scene,
    save_overlay,
)
from sketchmatch_client import Match
from sketchmatch_proto.v1 import match_pb2, scene_pb2
from sketchmatch_proto.v1.scene_service_pb2 import SegmentResponse
from sketchmatch_proto.v1.source_pb2 import Point

if TYPE_CHECKING:
    from sketchmatch.cli.inspection import Description

__all__ = [
    "check_path",
    "draw_description",
    "draw_match",
    "draw_segmentation",
    "grid_in",
    "matched_pairs",
    "scene_of",
]


def check_path(path: Path, *given: Path | None, field: str = "--overlay") -> None:
    """Refuse a path that no picture can be saved under, and one of what is given, or part of it.

    Parameters
    ----------
    path
        Where the picture shall be.
    given
        The files that are read.
    field
        What an error calls the path.
    """
    check_picture_path(path, field)
    check_spared(path, field, *given)


def draw_match(match: Match, map_path: Path, target: Path, metres: bool) -> None:
    """Draw both scenes of a match, a robot's map under its objects, and save the picture."""
    picture = draw_overlay(
        scene_of(match.scenes.sketch),
        scene_of(match.scenes.map),
        matched_pairs(match.result),
        groups=grouped(match.result),
        facts=facts(match.result, metres),
        alert=doubt(match),
        footnote=_meaning(match.result),
        underlay=None if is_kept(map_path) else grid_in(map_path),
        route=_way(match.scenes.sketch_route),
    )
    save_overlay(target, picture)


def matched_pairs(result: match_pb2.MatchResult) -> list[OverlayMatch]:
    """Return the lines of an object map as pictures show them."""
    return [
        OverlayMatch(
            line.sketch_object, line.map_object, line.probability, likely(line.probability)
        )
        if line.HasField("probability")
        else OverlayMatch(line.sketch_object, line.map_object, line.confidence)
        for line in result.object_matches
    ]


def grouped(result: match_pb2.MatchResult) -> list[tuple[list[int], list[int]]]:
    """Return which objects are together one, as pictures show it."""
    return [([*each.sketch_objects], [*each.map_objects]) for each in result.object_groups]


def draw_segmentation(response: SegmentResponse, source: Path, target: Path, pen: bool) -> None:
    """Draw the objects of one scene, by a pen or not, numbered, and the route; save the picture."""
    grid = grid_in(source)
    route = _way(response.route)
    scene = scene_of(response.scene)
    doubted = sum(item.doubtful for item in scene.objects)
    caption = f"{counted(doubted, 'doubtful object')}, drawn hollow" if doubted else ""
    picture = draw_scene(scene, caption=caption, underlay=grid, pen=pen, route=route)
    save_overlay(target, picture)


def draw_description(found: Description, source: Path, target: Path) -> None:
    """Draw a scene and the histograms of its pairs: where not all fit, those of most force."""
    most = np.argsort(-found.histograms.sum(axis=1), kind="stable")
    shown, left_out = (sorted(part.tolist()) for part in (most[:MOST_PLOTS], most[MOST_PLOTS:]))
    relations = []
    for k in shown:
        (a, b), relation, row = found.pairs[k], found.relations[k], found.histograms[k]
        main = None if relation.direction is None else float(found.directions[k])
        relations.append(OverlayRelation(a, b, relation.phrase, relation.degree, row, main))
    directions = found.histograms.shape[1]
    kind = f"{found.histogram.name} histograms, {directions} directions"
    if left_out:
        kind += f", of the {MOST_PLOTS} pairs with the strongest forces"
        say(
            f"--plot draws the {MOST_PLOTS} of {len(found.pairs)} relations with the strongest "
            "forces, as between large objects close together; choose others by --pair A,B"
        )
    picture = draw_relations(
        found.scene,
        relations,
        left_out=[found.pairs[k] for k in left_out],
        caption=f"{kind}, each scaled to its peak; an arrow marks the main direction",
        underlay=grid_in(source),
        pen=isinstance(found.source, StrokeSet),
    )
    save_overlay(target, picture, "--plot")


def scene_of(message: scene_pb2.Scene) -> Scene:
    """Return the scene that a message holds, to the last digit."""
    return Scene(
        tuple(
            SceneObject(
                tuple(
                    frozen_floats(np.array([(point.x, point.y) for point in ring.points]))
                    for ring in item.rings
                ),
                item.label,
                item.certainty if item.HasField("certainty") else 1.0,
            )
            for item in message.objects
        )
    )


def _meaning(result: match_pb2.MatchResult) -> str:
    """Return what the probabilities of a result mean, those that it has."""
    if not result.HasField("probability"):
        return ""
    said = "Bars: probability of each pair.  Probability: of the whole answer."
    if result.HasField("place_probability"):
        said += "  This place: probability that the sketch shows this place."
    return said


def _way(points: Sequence[Point]) -> FloatArray | None:
    """Return a route, if there is one."""
    return np.array([(point.x, point.y) for point in points]) if points else None


def grid_in(path: Path) -> OccupancyGrid | None:
    """Return the robot's map in a file, if it is one; of a kept scene the file is elsewhere."""
    if is_kept(path):
        return None
    if (files := read_map_files(path)) is not None:
        return files.grid()
    bag, topic = bag_and_topic(path)
    return read_bag(bag, topic) if is_bag(bag) else None
