"""A match as plain values, and what is made of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypedDict

from sketchmatch_views._picture import Panel, drawn

__all__ = ["Line", "MatchRow", "MatchView", "Shape"]

Point = Sequence[float]


class MatchRow(TypedDict):
    """One sketched object and its partner: a row of a table, with None where nothing is known.

    Attributes
    ----------
    sketch_object, sketch_label
        The sketched object: its index, from 0, and its label, empty if it has none. None and empty
        for a mapped object without partner, which only :meth:`MatchView.geojson` lists.
    map_object, map_label
        Its partner in the same way; None and empty if it has none.
    map_x, map_y
        Where its partner is: the centre of its area in the map's frame.
    confidence, margin
        As in the object map.
    probability
        How likely this is its partner; of one without partner, how likely that it has none.
    relation, reference_object
        How it lies in the sketch, e.g. "to the left of", and the index of the object that it is
        seen from.
    """

    sketch_object: int | None
    sketch_label: str
    map_object: int | None
    map_label: str
    map_x: float | None
    map_y: float | None
    confidence: float | None
    probability: float | None
    margin: float | None
    relation: str | None
    reference_object: int | None


@dataclass(frozen=True)
class Shape:
    """An object of a scene.

    Attributes
    ----------
    rings
        The outer ring counter-clockwise, then the holes clockwise, y up, without a repeated last
        point.
    centroid
        Centre of its area.
    label
        A name for people.
    """

    rings: Sequence[Sequence[Point]]
    centroid: Point
    label: str = ""


@dataclass(frozen=True)
class Line:
    """One line of an object map; what is None is unknown.

    Attributes
    ----------
    sketch_object, map_object
        Indices from 0.
    confidence, probability, margin, relation, reference_object
        As in :class:`MatchRow`.
    """

    sketch_object: int
    map_object: int
    confidence: float
    probability: float | None = None
    margin: float | None = None
    relation: str | None = None
    reference_object: int | None = None


@dataclass(frozen=True)
class MatchView:
    """A match, to be shown.

    Attributes
    ----------
    sketch, map
        The objects of both scenes.
    lines
        The object map.
    alone
        The sketched objects without partner, and how likely each has none, or None.
    route
        The way drawn through the sketch, or nothing.
    groups
        Objects of the sketch, and of the map, that are one place together.

    Examples
    --------
    >>> square = [(0, 0), (2, 0), (2, 2), (0, 2)]
    >>> bed, bunk = Shape([square], (1, 1), "bed"), Shape([square], (1, 1), "bunk")
    >>> view = MatchView([bed, bed], [bunk], [Line(0, 0, 0.75)], {1: 0.5})
    >>> [(row["sketch_object"], row["map_label"], row["probability"]) for row in view.rows()]
    [(0, 'bunk', None), (1, '', 0.5)]
    """

    sketch: Sequence[Shape]
    map: Sequence[Shape]
    lines: Sequence[Line]
    alone: Mapping[int, float | None] = field(default_factory=dict)
    route: Sequence[Point] = ()
    groups: Sequence[tuple[Sequence[int], Sequence[int]]] = ()

    def rows(self) -> list[MatchRow]:
        """Return a row for each sketched object, in the order of the sketch."""
        rows = [self._row(line.sketch_object, line.map_object, line) for line in self.lines]
        for k, probability in self.alone.items():
            row = self._row(k, None)
            row["probability"] = probability
            rows.append(row)
        return sorted(rows, key=lambda row: row["sketch_object"] or 0)

    def geojson(self) -> dict[str, Any]:
        """Return a FeatureCollection in the map's frame.

        One feature for each row, whose properties it has, with the polygon of its partner or no
        geometry; then one for each mapped object without partner.
        """
        rows = self.rows()
        taken = {row["map_object"] for row in rows}
        rows += [self._row(None, k) for k in range(len(self.map)) if k not in taken]
        features = [
            {
                "type": "Feature",
                "geometry": _polygon(_at(self.map, row["map_object"])),
                "properties": {"label": row["map_label"] or row["sketch_label"], **row},
            }
            for row in rows
        ]
        # Says that the numbers are metres of the map, and no degrees of longitude and latitude.
        return {"type": "FeatureCollection", "crs": None, "features": features}

    def svg(self) -> str:
        """Return a picture: the sketch at the left, the map at the right, partners in one colour.

        Objects have their index, from 0, and their label; what has no partner, and is nothing
        together with others, is grey.
        """
        sketched = {line.sketch_object: k for k, line in enumerate(self.lines)}
        mapped = {line.map_object: k for k, line in enumerate(self.lines)}
        for n, members in enumerate(self.groups, len(self.lines)):
            sides = tuple(zip((sketched, mapped), members, strict=True))
            colour = min((known[k] for known, some in sides for k in some if k in known), default=n)
            for known, some in sides:
                known.update({k: colour for k in some if k not in known})
        return drawn(
            Panel("sketch", _drawing(self.sketch), sketched, self.route),
            Panel("map", _drawing(self.map), mapped),
        )

    def _row(
        self, sketch_object: int | None, map_object: int | None, line: Line | None = None
    ) -> MatchRow:
        sketched, mapped = _at(self.sketch, sketch_object), _at(self.map, map_object)
        return {
            "sketch_object": sketch_object,
            "sketch_label": sketched.label if sketched else "",
            "map_object": map_object,
            "map_label": mapped.label if mapped else "",
            "map_x": mapped.centroid[0] if mapped else None,
            "map_y": mapped.centroid[1] if mapped else None,
            "confidence": line.confidence if line else None,
            "probability": line.probability if line else None,
            "margin": line.margin if line else None,
            "relation": line.relation if line else None,
            "reference_object": line.reference_object if line else None,
        }


def _at(shapes: Sequence[Shape], index: int | None) -> Shape | None:
    """Return an object; None where the scenes of a match are not known."""
    return None if index is None or index >= len(shapes) else shapes[index]


def _polygon(shape: Shape | None) -> dict[str, Any] | None:
    if shape is None:
        return None
    rings = [[list(point) for point in (*ring, ring[0])] for ring in shape.rings]
    return {"type": "Polygon", "coordinates": rings}


def _drawing(shapes: Sequence[Shape]) -> list[tuple[Sequence[Sequence[Point]], Point, str]]:
    return [
        (shape.rings, shape.centroid, f"{k} {shape.label}".rstrip())
        for k, shape in enumerate(shapes)
    ]
