"""Scenes: the polygons that stand for the objects of a sketch or of a map."""

from __future__ import annotations

import itertools
import numbers
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from hashlib import sha256
from html import escape
from typing import Any, NamedTuple, Self

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry
from shapely.validation import explain_validity

from sketchmatch.errors import InvalidInputError, Reason, quoted
from sketchmatch.model.arrays import (
    FloatArray,
    IntArray,
    frozen_floats,
    real_floats,
    sealed,
    settled_middle,
)
from sketchmatch.model.caching import cached_property
from sketchmatch.model.labels import cleaned_label, label_from
from sketchmatch.model.text import listed, name, shortened

__all__ = ["DOUBTFUL", "FARTHEST", "FLAT", "Edges", "Scene", "SceneObject"]

DOUBTFUL = 0.5
"""Below this certainty it is in doubt that an object is one thing."""

FLAT = 1e-9
"""Below this share of its squared extent an area is rounding, not a shape."""

FARTHEST = 1e15
"""Beyond this, forces and areas would leave the range of floating-point numbers."""

_LITTLE = np.dtype("<f8")


@dataclass(frozen=True, eq=False)
class SceneObject:
    """One object: a polygon with holes, x right, y up.

    Build it with :meth:`from_rings`, which checks and orients the rings.

    Attributes
    ----------
    rings
        The outer ring, counter-clockwise, then the holes, clockwise; each a read-only array of
        shape (k, 2), k ≥ 3, in metres or sketch units, without a repeated last point.
    label
        A name for people, in one line, as :func:`~sketchmatch.model.labels.cleaned_label` returns
        it. Labels are evidence if both scenes have some.
    certainty
        How certain it is that this is one thing, and not part of a wall, shadow or speckle: above 0
        and at most 1. Objects in doubt, below :data:`DOUBTFUL`, are drawn hollow.
    """

    rings: tuple[FloatArray, ...]
    label: str = ""
    certainty: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "label", cleaned_label(self.label))
        object.__setattr__(self, "certainty", _checked_certainty(self.certainty))

    @classmethod
    def from_rings(cls, rings: Iterable[Any], label: Any = "", certainty: float = 1.0) -> Self:
        """Check rings and turn them into an object.

        Parameters
        ----------
        rings
            Outer ring first, then holes; each (k, 2) and array-like, in either orientation,
            closed or not.
        label
            A name for people: text or a number; None and nan are no name.
        certainty
            How sure it is that this is one thing.

        Raises
        ------
        InvalidInputError
            If a ring has fewer than three distinct points, is not finite or crosses itself, if
            the polygon has no area, if its holes leave it or overlap, if the label is no name, or
            if the certainty is no number above 0 and up to 1.
        """
        arrays = [_clean_ring(ring, f"rings[{k}]") for k, ring in enumerate(rings)]
        if not arrays:
            raise InvalidInputError(
                Reason.INVALID_POLYGON, "rings", "is empty; give at least an outer ring"
            )
        outer, areas = arrays[0], [signed_area(ring) for ring in arrays]
        extent = float((outer.max(axis=0) - outer.min(axis=0)).max())
        if abs(areas[0]) <= FLAT * extent * extent and not _crosses_itself(outer):
            raise InvalidInputError(
                Reason.INVALID_POLYGON, "", "has no area; give three corners not on one line"
            )
        oriented = tuple(
            frozen_floats(ring if (area > 0) == (k == 0) else ring[::-1])
            for k, (ring, area) in enumerate(zip(arrays, areas, strict=True))
        )
        polygon = shapely.Polygon(oriented[0], oriented[1:])
        if not polygon.is_valid:
            raise InvalidInputError(
                Reason.INVALID_POLYGON, "", _explain(shapely.Polygon(outer, arrays[1:]))
            )
        if polygon.area <= FLAT * extent * extent:
            raise InvalidInputError(
                Reason.INVALID_POLYGON, "", "has no area left between its holes; remove a hole"
            )
        made = cls(oriented, label_from(label), certainty)
        vars(made)["polygon"] = polygon  # which is what the property would make again
        return made

    @classmethod
    def from_polygon(cls, polygon: Any, label: Any = "") -> Self:
        """Turn a polygon, in any of the forms that people have them in, into an object.

        Parameters
        ----------
        polygon
            One (k, 2) array-like; a list of such rings, outer ring first, then holes; or a
            ``Polygon`` or ``LinearRing`` of shapely, or a ``MultiPolygon`` of one part. Heights
            are left out.
        label
            A name for people.

        Raises
        ------
        InvalidInputError
            As :meth:`from_rings`, or if it is a shape of shapely that is not one polygon.

        Examples
        --------
        >>> desk = shapely.box(0, 0, 2, 1).difference(shapely.box(0.5, 0.25, 1.5, 0.75))
        >>> SceneObject.from_polygon(desk, "desk").area
        1.5
        """
        if isinstance(polygon, BaseGeometry):
            return cls.from_rings(_rings_of(polygon), label)
        return cls.from_rings([polygon] if _is_ring(polygon) else list(polygon), label)

    @cached_property
    def polygon(self) -> shapely.Polygon:
        """The object as a shapely polygon."""
        return shapely.Polygon(self.rings[0], self.rings[1:])

    @property
    def doubtful(self) -> bool:
        """Whether it is less than :data:`DOUBTFUL` that this is one thing."""
        return self.certainty < DOUBTFUL

    @cached_property
    def area(self) -> float:
        """Area without the holes, in squared scene units."""
        return float(sum(signed_area(ring) for ring in self.rings))

    @cached_property
    def centroid(self) -> tuple[float, float]:
        """Centre of the area."""
        point = self.polygon.centroid
        return (point.x, point.y)

    def __repr__(self) -> str:
        x, y = self.centroid
        called, corners = shortened(self.label), sum(map(len, self.rings))
        shape = f"{corners} vertices, area {self.area:.3g}, around ({x:.3g}, {y:.3g})"
        sure = f", certainty {self.certainty:.2g}" if self.certainty < 1.0 else ""
        return f"<{type(self).__name__}: {called}{', ' if called else ''}{shape}{sure}>"


class Edges(NamedTuple):
    """The outlines of several objects as directed edges, the object on their left.

    Attributes
    ----------
    starts, ends
        Shape (e, 2).
    offsets
        Shape (objects + 1,): object k owns the edges offsets[k] … offsets[k+1].
    """

    starts: FloatArray
    ends: FloatArray
    offsets: IntArray


@dataclass(frozen=True, eq=False)
class Scene:
    """Two or more objects in one frame.

    Attributes
    ----------
    objects
        The objects; their order is their index everywhere, from 0.
    """

    objects: tuple[SceneObject, ...]

    def __post_init__(self) -> None:
        if len(self.objects) < 2:
            count = "no object" if not self.objects else "one object"
            raise InvalidInputError(
                Reason.TOO_FEW_OBJECTS,
                "",
                f"has {count}; a match compares relations between objects and needs at least two",
            )

    @classmethod
    def from_polygons(cls, polygons: Iterable[Any], labels: Iterable[Any] | None = None) -> Self:
        """Build a scene from polygons.

        Parameters
        ----------
        polygons
            Each as :meth:`SceneObject.from_polygon` takes it: a (k, 2) array-like, a list of such
            rings, outer ring first, then holes, or a polygon of shapely.
        labels
            One name for each polygon, text or a number; None and nan are no name, here or of one.

        Raises
        ------
        InvalidInputError
            If a polygon or a label cannot be used or there are fewer than two polygons.

        Examples
        --------
        >>> square = [[0, 0], [1, 0], [1, 1], [0, 1]]
        >>> triangle = [[3, 0], [5, 0], [4, 2]]
        >>> Scene.from_polygons([square, triangle], labels=["desk", "plant"]).objects[1].area
        2.0
        """
        if isinstance(labels, str | bytes | Mapping):
            raise InvalidInputError(
                Reason.INVALID_FIELD, "labels", f"is {quoted(labels)}; give a list of names"
            )
        given = _items("polygons", polygons)
        names = [""] * len(given) if labels is None else _items("labels", labels)
        if len(names) != len(given):
            raise InvalidInputError(
                Reason.INVALID_FIELD,
                "labels",
                f"has {len(names)} names for {len(given)} polygons; give one for each",
            )
        objects = []
        for k, polygon in enumerate(given):
            try:
                objects.append(SceneObject.from_polygon(polygon, names[k]))
            except InvalidInputError as error:
                raise error.within(f"polygons[{k}]") from None
        return cls(tuple(objects))

    def __len__(self) -> int:
        return len(self.objects)

    def __repr__(self) -> str:
        x0, y0, x1, y1 = self.bounds
        named = listed(self.labels)
        size = f"{len(self)} objects, {x1 - x0:.3g} x {y1 - y0:.3g}"
        return f"<{type(self).__name__}: {size}{': ' if named else ''}{named}>"

    def _repr_svg_(self) -> str:
        """Return a picture for a notebook; the names show under the pointer."""
        x0, y0, x1, y1 = self.bounds
        margin = 0.02 * max(x1 - x0, y1 - y0)
        box = (x0 - margin, -y1 - margin, x1 - x0 + 2 * margin, y1 - y0 + 2 * margin)
        outlines = "".join(
            f"<path d='{_path(item)}'><title>{escape(name(k, item.label))}</title></path>"
            for k, item in enumerate(self.objects)
        )
        return (
            f"<svg xmlns='http://www.w3.org/2000/svg' width='400' height='300' "
            f"viewBox='{' '.join(f'{value:.6g}' for value in box)}'>"
            f"<g transform='scale(1,-1)' fill='#9ecae1' stroke='#08519c' fill-rule='evenodd' "
            f"stroke-width='{margin / 4:.3g}'>{outlines}</g></svg>"
        )

    @cached_property
    def edges(self) -> Edges:
        """The edges of all objects, ring by ring."""
        rings = [ring for item in self.objects for ring in item.rings]
        counts = [sum(map(len, item.rings)) for item in self.objects]
        starts, stops = np.concatenate(rings), np.cumsum(list(map(len, rings)))
        after = np.arange(1, len(starts) + 1)
        after[stops - 1] = [0, *stops[:-1]]
        offsets = np.array([0, *itertools.accumulate(counts)], dtype=np.int64)
        return Edges(sealed(starts), sealed(starts[after]), sealed(offsets))

    @cached_property
    def identity(self) -> str:
        """A hash of outlines and certainties, in hexadecimal: the same for those described alike.

        Labels are not part of it, since histograms do not depend on them.

        Examples
        --------
        >>> square, far = [[0, 0], [1, 0], [1, 1]], [[5, 5], [6, 5], [6, 6]]
        >>> named = Scene.from_polygons([square, far], labels=["desk", "plant"])
        >>> named.identity == Scene.from_polygons([square, far]).identity
        True
        """
        content = sha256()
        for item in self.objects:
            content.update(b"object")
            if item.certainty < 1.0:
                content.update(np.array(item.certainty, dtype=_LITTLE).tobytes())
            for ring in item.rings:
                content.update(len(ring).to_bytes(8, "little"))
                content.update(ring.astype(_LITTLE, copy=False).tobytes())
        return content.hexdigest()

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """The objects' names, empty where there is none."""
        return tuple(item.label for item in self.objects)

    @cached_property
    def bounds(self) -> tuple[float, float, float, float]:
        """Smallest x, smallest y, largest x, largest y."""
        points = np.concatenate([item.rings[0] for item in self.objects])
        (x0, y0), (x1, y1) = points.min(axis=0), points.max(axis=0)
        return (float(x0), float(y0), float(x1), float(y1))

    @cached_property
    def middle(self) -> tuple[float, float]:
        """A point near the middle of the bounds, which most changes of the scene leave there."""
        x0, y0, x1, y1 = self.bounds
        x, y = settled_middle(np.array([x0, y0]), np.array([x1, y1]))
        return (float(x), float(y))


def _items(field: str, given: Any) -> list[Any]:
    """Return what a list, or anything else that can be gone through, holds."""
    try:
        items = iter(given)
    except TypeError:
        problem = f"is {quoted(given)}; give a list of {field}"
        raise InvalidInputError(Reason.INVALID_FIELD, field, problem) from None
    return list(items)


def _checked_certainty(value: Any) -> float:
    number = isinstance(value, numbers.Real) and not isinstance(value, bool)
    # Comparisons with nan are false.
    if not (number and 0.0 < value <= 1.0):
        raise InvalidInputError(
            Reason.INVALID_FIELD,
            "certainty",
            f"is {quoted(value)}; give a number above 0 and up to 1, or leave it out",
        )
    return float(value)


def _rings_of(shape: BaseGeometry) -> list[FloatArray]:
    """Return the rings of a shape that is one polygon, without heights."""
    if isinstance(shape, shapely.MultiPolygon) and len(shape.geoms) == 1:
        shape = shape.geoms[0]
    if shape.is_empty:
        problem = f"is an empty {shape.geom_type}; leave it out"
    elif isinstance(shape, shapely.Polygon):
        return [shapely.get_coordinates(ring) for ring in (shape.exterior, *shape.interiors)]
    elif isinstance(shape, shapely.LinearRing):
        return [shapely.get_coordinates(shape)]
    elif isinstance(shape, shapely.MultiPolygon):
        problem = (
            f"has {len(shape.geoms)} parts, but an object has one outline; make an object of each "
            "of its .geoms, or take its convex_hull"
        )
    else:
        problem = f"is a {shape.geom_type}, which has no area; give a Polygon"
    raise InvalidInputError(Reason.INVALID_POLYGON, "", problem)


def _path(item: SceneObject) -> str:
    """Return an outline as SVG draws it."""
    rings = ("L".join(f"{x:.6g},{y:.6g}" for x, y in ring) for ring in item.rings)
    return "".join(f"M{ring}Z" for ring in rings)


def _is_ring(polygon: Any) -> bool:
    """Whether it is one ring of points, and not a list of rings."""
    try:
        return bool(np.ndim(polygon[0][0]) == 0)
    except (IndexError, KeyError, TypeError):
        return True


def _clean_ring(ring: Any, field: str) -> FloatArray:
    try:
        points = real_floats(ring)
    except (TypeError, ValueError):
        points = np.empty(0)
    if points.ndim != 2 or points.shape[1] != 2:
        raise InvalidInputError(
            Reason.INVALID_POLYGON, field, "is not a list of points; give [x, y] pairs of numbers"
        )
    if not np.isfinite(points).all():
        k = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
        raise InvalidInputError(
            Reason.INVALID_POLYGON, f"{field}.points[{k}]", "is not finite; give plain numbers"
        )
    if np.abs(points).max(initial=0.0) > FARTHEST:
        raise InvalidInputError(
            Reason.INVALID_POLYGON, field, f"reaches beyond ±{FARTHEST:g}; use a larger unit"
        )
    before = np.concatenate([points[-1:], points[:-1]])
    points = np.compress((points != before).any(axis=1), points, axis=0)
    if len(points) < 3:
        raise InvalidInputError(
            Reason.INVALID_POLYGON,
            field,
            f"has {len(points)} distinct points; a ring needs at least three",
        )
    return points


def _crosses_itself(ring: FloatArray) -> bool:
    """Whether a closed ring touches itself other than by lying on one line."""
    hull = shapely.MultiPoint(ring).convex_hull
    extent = float(np.ptp(ring, axis=0).max())
    return bool(hull.area > FLAT * extent * extent)


def _explain(polygon: shapely.Polygon) -> str:
    message = explain_validity(polygon)
    where = message[message.find("[") :].strip("[]").replace(" ", ", ") if "[" in message else ""
    if message.startswith(("Self-intersection", "Ring Self-intersection")):
        if polygon.interiors:
            return f"crosses itself or a hole at ({where}); keep holes inside and apart"
        return f"crosses itself at ({where}); draw its outline without crossing"
    return f"is not a polygon ({message}); keep holes inside the outer ring and apart"


def signed_area(ring: FloatArray) -> float:
    around = ring - ring[0]
    after = np.concatenate([around[1:], around[:1]])  # a tenth of what np.roll takes
    (x, y), (u, v) = around.T, after.T
    return float(np.dot(x, v) - np.dot(y, u)) / 2.0
