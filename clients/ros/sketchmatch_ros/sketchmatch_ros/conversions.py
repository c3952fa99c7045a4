"""From ROS messages to what the client sends, and from its answers to ROS messages."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Iterator, Sequence
from itertools import accumulate, chain, pairwise

from geometry_msgs.msg import Point, Point32, Polygon, Pose, PoseStamped, Quaternion
from nav2_msgs.msg import CostmapFilterInfo
from nav_msgs.msg import MapMetaData, OccupancyGrid, Path
from sketchmatch_msgs.action import MatchSketch
from sketchmatch_msgs.msg import MatchedObject, ObjectGroup, ObjectMap, Sketch, Stroke
from sketchmatch_msgs.srv import Carry
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from sketchmatch_client import Match, Progress, SketchmatchError, sources
from sketchmatch_proto.v1.match_pb2 import Phase
from sketchmatch_proto.v1.source_pb2 import Source
from sketchmatch_ros.matching import Features
from sketchmatch_views import PAIR_COLOURS

__all__ = [
    "carried",
    "drawn_features",
    "failure",
    "feedback",
    "filter_info",
    "keepout_mask",
    "map_source",
    "markers",
    "object_map",
    "route_path",
    "sketch_source",
    "upright",
]

XY = Sequence[float]

_KEEPOUT = 0  # nav2's type of filter
_OCCUPIED = 100
_TOUCH = 1e-6  # in cells: what reaches no farther into one touches it, up to rounding
_NAN = math.nan
_LINE_METRES, _LETTER_METRES = 0.05, 0.3


def map_source(grid: OccupancyGrid) -> Source:
    """Return a map as the server reads it, in the frame that it is published in.

    Raises
    ------
    InvalidRequestError
        If it has no cells.
    """
    origin = grid.info.origin
    place = (origin.position.x, origin.position.y, yaw_of(origin.orientation))
    return sources.occupancy_grid(grid.data, grid.info.resolution, place, columns=grid.info.width)


def sketch_source(sketch: Sketch) -> Source:
    """Return a sketch as the server reads it."""
    return sources.strokes(
        [[(point.x, point.y) for point in stroke.points] for stroke in sketch.strokes],
        [stroke.label for stroke in sketch.strokes],
        y_axis="down" if sketch.y_axis == Sketch.Y_AXIS_DOWN else "up",
    )


def upright(strokes: Iterable[Stroke], y_axis: int) -> list[list[XY]]:
    """Return the points of strokes as the objects of their sketch lie, y upwards."""
    up = -1.0 if y_axis == Sketch.Y_AXIS_DOWN else 1.0
    return [[(point.x, up * point.y) for point in stroke.points] for stroke in strokes]


def drawn_features(sketch: Sketch, match: Match) -> Features:
    """Return what is to be carried of a sketch: the route that was found in it, and its zones."""
    route = [(point.x, point.y) for point in match.scenes.sketch_route]
    return Features([route] if route else [], upright(sketch.zones, sketch.y_axis))


def feedback(progress: Progress) -> MatchSketch.Feedback:
    """Return how far a match is."""
    elapsed = progress.elapsed
    return MatchSketch.Feedback(
        phase=Phase.Name(progress.phase).removeprefix("PHASE_"),
        confidence=_known(progress.confidence),
        evaluations=progress.evaluations,
        elapsed=elapsed.seconds + elapsed.nanos / 1e9,
    )


def failure(error: SketchmatchError, answer: ObjectMap) -> MatchSketch.Result:
    """Return what an aborted goal says of why, with the object map as far as there is one."""
    return MatchSketch.Result(
        object_map=answer,
        error=str(error),
        error_reason=error.reason,
        error_field=getattr(error, "field", ""),
        retry_after=float(getattr(error, "retry_after", None) or 0.0),
    )


def object_map(match: Match, header: Header) -> ObjectMap:
    """Return an answer in the map's frame."""
    result = match.result
    grouped = {k for group in result.object_groups for k in group.sketch_objects}
    return ObjectMap(
        header=header,
        match_id=result.match_id,
        objects=[
            MatchedObject(
                sketch_object=row["sketch_object"],
                map_object=row["map_object"],
                sketch_label=row["sketch_label"],
                map_label=row["map_label"],
                confidence=row["confidence"],
                probability=_known(row["probability"]),
                center=Point(x=row["map_x"], y=row["map_y"], z=0.0),
                outline=_points(_outline(match, row["map_object"])),
            )
            for row in match.rows()
            if row["map_object"] is not None
        ],
        groups=[
            ObjectGroup(
                sketch_objects=list(group.sketch_objects),
                map_objects=list(group.map_objects),
                probability=group.probability if group.HasField("probability") else _NAN,
            )
            for group in result.object_groups
        ],
        unmatched_sketch_objects=[k for k in result.unmatched_sketch_objects if k not in grouped],
        probability=_known(match.probability),
        place_probability=_known(match.place_probability),
        ask_about=list(result.ambiguity.deciding_sketch_objects),
        outcome=match.outcome,
        warnings=[*match.scenes.sketch_warnings, *match.scenes.map_warnings],
    )


def markers(answer: ObjectMap) -> MarkerArray:
    """Return matched objects as RViz shows them: outlines and names, in place of earlier ones."""
    shown = [Marker(header=answer.header, action=Marker.DELETEALL)]
    for k, item in enumerate(answer.objects):
        r, g, b = (value / 255 for value in PAIR_COLOURS[k % len(PAIR_COLOURS)])
        colour = ColorRGBA(r=r, g=g, b=b, a=1.0)
        name = item.sketch_label or item.map_label or str(item.sketch_object)
        outline = Marker(
            header=answer.header,
            ns="outlines",
            id=k,
            type=Marker.LINE_STRIP,
            action=Marker.ADD,
            points=[*item.outline, *item.outline[:1]],
            color=colour,
        )
        outline.pose.orientation.w = 1.0
        outline.scale.x = _LINE_METRES
        text = Marker(
            header=answer.header,
            ns="names",
            id=k,
            type=Marker.TEXT_VIEW_FACING,
            action=Marker.ADD,
            pose=Pose(position=item.center, orientation=Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)),
            color=colour,
            text=name,
        )
        text.scale.z = _LETTER_METRES
        shown += [outline, text]
    return MarkerArray(markers=shown)


def route_path(points: Sequence[XY], header: Header) -> Path:
    """Return a route as nav2 follows it: poses look to the next elsewhere, the last as before."""
    poses = []
    for (x, y), heading in zip(points, _headings(points), strict=True):
        turned = Quaternion(x=0.0, y=0.0, z=math.sin(heading / 2), w=math.cos(heading / 2))
        place = Pose(position=Point(x=float(x), y=float(y), z=0.0), orientation=turned)
        poses.append(PoseStamped(header=header, pose=place))
    return Path(header=header, poses=poses)


def keepout_mask(zones: Iterable[Sequence[XY]], grid: OccupancyGrid) -> OccupancyGrid:
    """Return zones as a filter mask of nav2's keepout filter, on the cells of a map.

    Parameters
    ----------
    zones
        The outline of each, in the map's frame. A cell that an outline goes through or that is
        within one is occupied, all others are free: whoever keeps out may not cut a corner.
    grid
        The map, of which header and info are taken.
    """
    info = grid.info
    cells = array("b", bytes(info.width * info.height))
    for zone in filter(None, zones):
        outline = [_in_cells(point, info) for point in zone]
        for row, column in chain(_inside(outline, info), _along(outline, info)):
            cells[row * info.width + column] = _OCCUPIED
    return OccupancyGrid(header=grid.header, info=info, data=cells)


def carried(features: Features, header: Header) -> Carry.Response:
    """Return what was carried, as the service answers it."""
    outlines = [
        Polygon(points=[Point32(x=float(x), y=float(y), z=0.0) for x, y in zone])
        for zone in features.zones
    ]
    return Carry.Response(
        routes=[route_path(route, header) for route in features.routes],
        zones=outlines,
        notes=list(features.notes),
    )


def filter_info(mask_topic: str, header: Header) -> CostmapFilterInfo:
    """Return what tells nav2 that a mask is of zones to keep out of."""
    return CostmapFilterInfo(
        header=header, type=_KEEPOUT, filter_mask_topic=mask_topic, base=0.0, multiplier=1.0
    )


def yaw_of(turned: Quaternion) -> float:
    """Return the angle about z, in radians counter-clockwise."""
    return math.atan2(
        2.0 * (turned.w * turned.z + turned.x * turned.y),
        1.0 - 2.0 * (turned.y * turned.y + turned.z * turned.z),
    )


def _headings(points: Sequence[XY]) -> list[float]:
    steps = [(bx - ax, by - ay) for (ax, ay), (bx, by) in pairwise(points)]
    moving = [math.atan2(y, x) for x, y in steps if x or y] or [0.0]
    gone = accumulate((bool(x or y) for x, y in steps), initial=0)
    return [moving[min(k, len(moving) - 1)] for k in gone][: len(points)]


def _known(value: float | None) -> float:
    return _NAN if value is None else value


def _outline(match: Match, index: int) -> list[XY]:
    return [(point.x, point.y) for point in match.scenes.map.objects[index].rings[0].points]


def _points(places: Iterable[XY]) -> list[Point]:
    return [Point(x=x, y=y, z=0.0) for x, y in places]


def _in_cells(point: XY, info: MapMetaData) -> tuple[float, float]:
    """Return (column, row) of a place, with fractions."""
    origin = info.origin
    yaw = yaw_of(origin.orientation)
    x, y = point[0] - origin.position.x, point[1] - origin.position.y
    along, across = x * math.cos(yaw) + y * math.sin(yaw), y * math.cos(yaw) - x * math.sin(yaw)
    return along / info.resolution, across / info.resolution


def _inside(outline: Sequence[XY], info: MapMetaData) -> Iterator[tuple[int, int]]:
    """Yield (row, column) of the cells whose middle is within an outline, by the even-odd rule."""
    edges = list(zip(outline, [*outline[1:], *outline[:1]], strict=True))
    lowest = max(0, math.floor(min(y for _, y in outline)))
    highest = min(info.height, math.ceil(max(y for _, y in outline)))
    for row in range(lowest, highest):
        middle = row + 0.5
        crossed = sorted(
            ax + (middle - ay) / (by - ay) * (bx - ax)
            for (ax, ay), (bx, by) in edges
            if (ay > middle) != (by > middle)
        )
        for first, last in zip(crossed[::2], crossed[1::2], strict=True):
            left, right = max(0, math.ceil(first - 0.5)), math.floor(last - 0.5)
            for column in range(left, min(info.width, right + 1)):
                yield row, column


def _along(outline: Sequence[XY], info: MapMetaData) -> Iterator[tuple[int, int]]:
    """Yield (row, column) of the cells that an outline goes through, beyond their edges."""
    for start, end in zip(outline, [*outline[1:], *outline[:1]], strict=True):
        (ax, ay), (bx, by) = sorted((start, end), key=lambda point: point[1])
        run, rise = bx - ax, by - ay
        first, last = math.floor(ay + _TOUCH), math.ceil(by - _TOUCH)
        for row in range(max(0, first), min(info.height, last)):
            enters = max(0.0, (row - ay) / rise) if rise else 0.0
            leaves = min(1.0, (row + 1 - ay) / rise) if rise else 1.0
            left, right = sorted((ax + enters * run, ax + leaves * run))
            first_column, last_column = math.floor(left + _TOUCH), math.ceil(right - _TOUCH)
            for column in range(max(0, first_column), min(info.width, last_column)):
                yield row, column
