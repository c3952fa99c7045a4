"""What was carried, as the command line saves, draws and shows it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sketchmatch.cli import output, sources
from sketchmatch.cli.display import doubt, say_notes
from sketchmatch.cli.options import say
from sketchmatch.cli.pictures import grid_in, grouped, matched_pairs, scene_of
from sketchmatch.cli.tables import Column, Rows, plain
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.io.files import JSON_SUFFIXES, file_and_part, read_here
from sketchmatch.model import FloatArray, PolygonSet
from sketchmatch.pictures.overlay import Marking, OverlayMatch, draw_overlay, save_overlay
from sketchmatch.transfers import files
from sketchmatch.transfers.features import Carried, Change, ChangeReason, Feature, FeatureKind
from sketchmatch_client import InvalidRequestError, Match
from sketchmatch_proto.v1 import match_pb2, source_pb2, transfer_service_pb2
from sketchmatch_proto.v1.transfer_service_pb2 import TransferResponse

__all__ = [
    "Carriage",
    "check_keepout",
    "check_targets",
    "draw",
    "messages",
    "named_in",
    "origin_of",
    "places_of",
    "read",
    "save",
    "segmenters",
    "show",
    "unsureness",
]

_UNSURE = 0.5
_ROOMS = "rooms"


@dataclass(frozen=True, eq=False)
class Carriage:
    """An answer with what was asked.

    Attributes
    ----------
    answer
        The message.
    given
        What was given, after the route of the sketch, if there is one: one for each of ``carried``;
        None for that route, whose points the answer has among its scenes.
    carried
        The features where they were carried to.
    properties
        What else is said of each.
    forth
        Whether it went from sketch to map.
    """

    answer: TransferResponse
    given: tuple[Feature | None, ...]
    carried: tuple[Carried, ...]
    properties: tuple[Mapping[str, Any], ...]
    forth: bool

    @classmethod
    def of(cls, answer: TransferResponse, given: files.FeatureFile, forth: bool) -> Carriage:
        """Read an answer."""
        drawn = sum(each.drawn for each in answer.features)
        return cls(
            answer,
            (*[None] * drawn, *given.features),
            tuple(
                _carried(message, None if k < drawn else given.features[k - drawn])
                for k, message in enumerate(answer.features)
            ),
            (*[{}] * drawn, *given.properties),
            forth,
        )

    @property
    def rotation(self) -> float:
        """By how much the whole was turned."""
        return self.answer.warp.rotation_radians


def messages(features: Sequence[Feature]) -> list[transfer_service_pb2.Feature]:
    """Return features as messages."""
    return [_message(each) for each in features]


def named_in(path: Path) -> files.FeatureFile:
    """Return what a robot's map names itself."""
    grid = grid_in(path)
    return files.FeatureFile((), ()) if grid is None else files.landmarks_of(grid)


def origin_of(path: Path) -> tuple[float, float] | None:
    """Return longitude and latitude of what is (0, 0) in a scene, if its file has such."""
    file, _ = file_and_part(path)
    if sources.is_kept(path) or file.suffix.lower() not in JSON_SUFFIXES:
        return None
    source = read_here(path)
    return source.geographic_origin if isinstance(source, PolygonSet) else None


def read(path: Path, of: Path, verbose: bool) -> files.FeatureFile:
    """Read features of a scene, and say what was decided in that."""
    found = files.read_features(path, origin_of(of))
    say_notes("features", found.notes, verbose)
    return found


def segmenters(chosen: str, tries_rooms: bool) -> tuple[str, ...]:
    """Return the segmenters that are tried on both of two maps."""
    if chosen:
        return (chosen,)
    return ("", _ROOMS) if tries_rooms else ("",)


def unsureness(answer: TransferResponse) -> tuple[bool, float]:
    """Return how little an answer tells: whether it is another place, and its mean deviation."""
    elsewhere = (
        answer.match.HasField("place_probability") and answer.match.place_probability < _UNSURE
    )
    deviations = [
        each for feature in answer.features for line in feature.lines for each in line.deviations
    ]
    return elsewhere, float(np.mean(deviations)) if deviations else np.inf


@contextmanager
def places_of(path: Path | None) -> Iterator[None]:
    """Let errors about features, which were read from a file, begin with its path."""
    try:
        yield
    except (InvalidInputError, InvalidRequestError) as error:
        if path is None or not error.field.startswith("features["):
            raise
        problem = str(error).removeprefix(error.field).lstrip()
        raise InvalidInputError(Reason.INVALID_FILE, f"{path}: {error.field}", problem) from None


def check_targets(
    out: Path | None, keepout: Path | None, waypoints: Path | None, *given: Path | None
) -> None:
    """Refuse paths that nothing can be saved under, and those of what is given."""
    files.check_targets(out, keepout, waypoints)
    picture = None if keepout is None else keepout.with_suffix(".pgm")
    for path, field in (
        (out, "--out"),
        (keepout, "--keepout"),
        (picture, "--keepout"),
        (waypoints, "--waypoints"),
    ):
        if path is not None:
            sources.check_spared(path, field, *given)


def check_keepout(keepout: Path | None, target: Path) -> None:
    """Refuse a mask of what has no cells, before any work is done."""
    if keepout is not None and grid_in(target) is None:
        raise InvalidInputError(
            Reason.INVALID_FIELD,
            "--keepout",
            f"needs a map with cells, but {str(target)!r} has none; give the map's .yaml",
        )


def save(
    found: Carriage,
    target: Path,
    out: Path | None,
    keepout: Path | None,
    waypoints: Path | None,
) -> None:
    """Save what was carried into the files that were asked for."""
    if out is not None:
        text = files.encode_carried(
            found.carried, found.properties, found.rotation, origin_of(target)
        )
        files.save_text(out, text, "--out")
    if keepout is not None:
        grid = grid_in(target)
        assert grid is not None
        picture = keepout.with_suffix(".pgm").name
        document, cells = files.encode_keepout(found.carried, found.properties, grid, picture)
        files.save_keepout(keepout, document, cells, "--keepout")
        if yaw := grid.origin[2]:
            say(
                f"the map's origin is turned by {yaw:.3g} rad, and so is the mask's, but nav2's "
                "costmaps ignore this: save the map upright for them"
            )
    if waypoints is not None:
        text = files.encode_waypoints(found.carried, found.properties, found.rotation)
        files.save_text(waypoints, text, "--waypoints")


def draw(found: Carriage, names: tuple[str, str], paths: tuple[Path, Path], target: Path) -> None:
    """Draw both scenes with what was carried, and save the picture."""
    answer = found.answer
    scale = answer.warp.scale
    drawn = np.array([(point.x, point.y) for point in answer.scenes.sketch_route])
    before, after = [], []
    for given, each in zip(found.given, found.carried, strict=True):
        rings = (drawn,) if given is None else given.rings
        if each.feature is None:
            before.append(Marking(each.kind, rings, (), each.name))
            continue
        deviations = tuple(
            np.interp(np.arange(len(ring)), sources, deviation) / scale
            for ring, sources, deviation in zip(rings, each.sources, each.deviations, strict=True)
        )
        before.append(Marking(each.kind, rings, deviations, each.name))
        after.append(Marking(each.kind, each.feature.rings, each.deviations, each.name))
    sides = (before, after) if found.forth else (after, before)
    picture = draw_overlay(
        scene_of(answer.scenes.sketch),
        scene_of(answer.scenes.map),
        matched_pairs(answer.match) or _pairs(answer),
        groups=grouped(answer.match),
        facts=[
            ("Carried", f"{len(after)} of {len(found.carried)}"),
            ("Median deviation", _median(found)),
        ],
        alert=_doubt(answer),
        footnote="Shaded: two standard deviations around what was drawn and carried.",
        underlay=grid_in(paths[1]),
        sketch_underlay=grid_in(paths[0]),
        names=names,
        markings=sides,
    )
    save_overlay(target, picture)


def show(found: Carriage, json: bool, verbose: bool) -> None:
    """Write what was carried: JSON, or a table on a terminal, or tab-separated lines."""
    answer = found.answer
    say_notes("sketch", answer.scenes.sketch_warnings, verbose)
    say_notes("map", answer.scenes.map_warnings, verbose)
    if said := _doubt(answer):
        say(said)
    if json:
        output.write_message(answer)
        return
    rows = [
        (
            each.name,
            str(each.kind),
            "" if each.feature is None else f"{each.deviation:.3g}",
            str(sum(map(len, each.deviations))),
            " ".join(change.sentence for change in each.changes),
        )
        for each in found.carried
    ]
    if not output.for_people():
        for row in rows:
            output.write_line(*row)
        return
    columns = [
        Column("name", least=6),
        Column("kind"),
        Column("± one σ", right=True),
        Column("points", right=True, dispensable=1),
        Column("changes", least=20, wraps=True),
    ]
    matched = len(answer.object_map)
    title = f"{len(rows)} carried through {matched} matched objects"
    output.show(Rows(title, columns, [tuple(map(plain, row)) for row in rows]))


def _median(found: Carriage) -> str:
    known = [each.deviation for each in found.carried if each.feature is not None]
    return f"{float(np.median(known)):.2g}" if known else "none"


def _doubt(answer: TransferResponse) -> str:
    if not answer.HasField("match"):
        return ""
    return doubt(Match(match_pb2.MatchAccepted(), answer.scenes, answer.match))


def _pairs(answer: TransferResponse) -> list[OverlayMatch]:
    return [
        OverlayMatch(pair.sketch_object, pair.map_object, weight)
        for pair, weight in zip(answer.object_map, answer.warp.weights, strict=True)
    ]


def _message(feature: Feature) -> transfer_service_pb2.Feature:
    message = transfer_service_pb2.Feature(name=feature.name)
    lines = [[source_pb2.Point(x=x, y=y) for x, y in ring.tolist()] for ring in feature.rings]
    if feature.kind is FeatureKind.POINT:
        message.point.CopyFrom(lines[0][0])
    elif feature.kind is FeatureKind.ROUTE:
        message.route.points.extend(lines[0])
        if feature.speeds is not None:
            message.route.speeds_meters_per_second.extend(feature.speeds.tolist())
    else:
        message.zone.rings.extend(source_pb2.Ring(points=line) for line in lines)
    return message


def _carried(message: transfer_service_pb2.CarriedFeature, given: Feature | None) -> Carried:
    there = message.feature
    kind = FeatureKind.ROUTE if given is None else given.kind
    feature = None
    match there.WhichOneof("kind"):
        case "point":
            feature = Feature(kind, (_points([there.point]),), there.name)
        case "route":
            speeds = there.route.speeds_meters_per_second
            feature = Feature(
                kind,
                (_points(there.route.points),),
                there.name,
                np.array(speeds) if speeds else None,
            )
        case "zone":
            rings = tuple(_points(ring.points) for ring in there.zone.rings)
            feature = Feature(kind, rings, there.name)
    prefix = "CHANGE_REASON_"
    changes = tuple(
        Change(
            ChangeReason[transfer_service_pb2.ChangeReason.Name(each.reason).removeprefix(prefix)],
            each.first_point,
            each.last_point,
            each.sentence,
        )
        for each in message.changes
    )
    return Carried(
        kind,
        there.name,
        feature,
        tuple(np.array(line.deviations) for line in message.lines),
        tuple(np.array(line.sources) for line in message.lines),
        changes,
    )


def _points(points: Sequence[source_pb2.Point]) -> FloatArray:
    return np.array([(point.x, point.y) for point in points], dtype=np.float64).reshape(-1, 2)
