"""Polygons that are objects already."""

from __future__ import annotations

from sketchmatch.api import InvalidInputError, Reason, Segmentation, Segmenter
from sketchmatch.model import PolygonSet, Scene
from sketchmatch.model.outlines import objects_of

__all__ = ["PolygonSegmenter"]


class PolygonSegmenter(Segmenter):
    """Takes every polygon as one object, as it is.

    Nothing is repaired: a polygon that crosses itself or has no area is refused, because a program
    cannot know which shape was meant. The model is that of the OGC's simple features.

    References
    ----------
    OpenGIS Implementation Standard for Geographic information: Simple feature access, part 1,
    OGC 06-103r4, 2011.

    Examples
    --------
    >>> from sketchmatch.model import LabelledPolygon, PolygonSet
    >>> desk = LabelledPolygon(([[0, 0], [2, 0], [2, 1], [0, 1]],), "desk")
    >>> rug = LabelledPolygon(([[5, 0], [9, 0], [9, 4]],))
    >>> scene = PolygonSegmenter().segment(PolygonSet((desk, rug))).scene
    >>> [(item.label, item.area) for item in scene.objects]
    [('desk', 2.0), ('', 8.0)]
    """

    name = "polygons"
    summary = "Every polygon is one object."
    default = True
    sources = (PolygonSet,)

    def segment(self, source: PolygonSet) -> Segmentation:
        """Return the polygons as objects, in their order."""
        count, lines = len(source.polygons), len(source.lines)
        if count < 2:
            remedy = "a match compares relations between objects, so give at least two"
            if lines:
                remedy += (
                    f", or use the segmenter rooms, which takes its open lines ({lines}) as walls"
                )
            raise InvalidInputError(
                Reason.TOO_FEW_OBJECTS,
                "polygons",
                f"holds {'no polygon' if not count else 'one polygon'}; {remedy}",
            )
        left_out = f"Left out because they enclose no area: open lines ({lines})."
        return Segmentation(Scene(objects_of(source.polygons)), (left_out,) if lines else ())
