"""Pictures of results: a sketch and a map side by side, partners in one colour and number.

Everything is laid out in design units, 1600 across an overlay and 1000 across a single scene,
and drawn at any width; a picture twice as wide shows the same, finer.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.io._targets import check_target, writing
from sketchmatch.model import FloatArray, OccupancyGrid, Scene
from sketchmatch.pictures._canvas import printable
from sketchmatch.pictures._page import Entry, Page
from sketchmatch.pictures._panel import Panel, badge_size
from sketchmatch.pictures._plots import MOST_PLOTS, Plot, RelationsPage

__all__ = [
    "MOST_PLOTS",
    "OverlayMatch",
    "OverlayRelation",
    "check_picture_path",
    "draw_overlay",
    "draw_relations",
    "draw_scene",
    "save_overlay",
]

_FORMATS = {".png": "PNG", ".jpg": "JPEG", ".jpeg": "JPEG", ".webp": "WEBP"}

_OVERLAY, _SINGLE = 1600.0, 1000.0


@dataclass(frozen=True)
class OverlayMatch:
    """One pair of an object map.

    Attributes
    ----------
    sketch_object, map_object
        Indices of the objects, from 0.
    confidence
        How sure the pair is, 0 … 1.
    """

    sketch_object: int
    map_object: int
    confidence: float


@dataclass(frozen=True, eq=False)
class OverlayRelation:
    """How one object of a scene lies to another.

    Attributes
    ----------
    a, b
        Indices of the objects, from 0.
    phrase
        Completes "a is … b".
    degree
        How well it describes the histogram, 0 … 1.
    histogram
        Shape (n,): entry k supports "a is in direction 2πk/n of b".
    direction
        The main direction in radians, or None where none shall be marked.
    """

    a: int
    b: int
    phrase: str
    degree: float
    histogram: FloatArray
    direction: float | None


def draw_overlay(
    sketch: Scene,
    map: Scene,  # noqa: A002
    matches: Sequence[OverlayMatch],
    *,
    title: str | None = None,
    caption: str = "",
    facts: Sequence[tuple[str, str]] = (),
    underlay: OccupancyGrid | None = None,
    metres: bool | None = None,
    width: int = 1600,
) -> Image.Image:
    """Draw both scenes side by side, matched objects in the same colour and number.

    Parameters
    ----------
    sketch, map
        The scenes.
    matches
        The pairs of the object map, in any order. A pair has the number of its sketched object,
        counted from 1; objects without a partner are grey, hatched and without a number.
    title, caption
        The headline, which counts the matches when left out, and a line below it.
    facts
        Names and values for the header, e.g. ``[("OMAP confidence", "0.93")]``.
    underlay
        The grid that the map was made from, drawn softly under its objects.
    metres
        Whether the map is in metres and gets a scale bar; with an underlay when left out.
    width
        Of the picture, in pixels, 400 … 6400. The height follows from the content.

    Returns
    -------
    PIL.Image.Image
        RGB.

    Raises
    ------
    InvalidInputError
        If a pair names an object that is not there or twice, or the width is out of range.
    """
    _check_width(width)
    _check_matches(sketch, map, matches)
    matches = sorted(matches, key=lambda match: match.sketch_object)
    numbers = {match.sketch_object: match.sketch_object + 1 for match in matches}
    partners = {match.map_object: match.sketch_object + 1 for match in matches}
    metres = underlay is not None if metres is None else metres
    badge = badge_size(max(len(sketch), len(map)))
    panels = [
        Panel("Sketch", sketch, numbers, pen=True, badge=badge),
        Panel("Map", map, partners, underlay, metres=metres, badge=badge),
    ]
    entries = [_entry(match, sketch, map) for match in matches]
    if title is None:
        title = f"{len(matches)} of {len(sketch)} objects matched"
    page = Page(_OVERLAY, panels, entries, _note(panels))
    return page.drawn(title, caption, facts, width)


def draw_scene(
    scene: Scene,
    *,
    title: str | None = None,
    caption: str = "",
    underlay: OccupancyGrid | None = None,
    metres: bool | None = None,
    pen: bool = False,
    route: FloatArray | None = None,
    width: int = 1000,
) -> Image.Image:
    """Draw one scene, its objects numbered from 1.

    Parameters
    ----------
    scene
        The objects.
    title, caption
        The headline, which counts the objects when left out, and a line below it.
    underlay
        The grid that the scene was made from, drawn softly under the objects.
    metres
        Whether the scene is in metres and gets a scale bar; with an underlay when left out.
    pen
        Draw outlines as a pen does.
    route
        Shape (k, 2), two points or more: a way through the scene, drawn as a light dashed arrow.
    width
        Of the picture, in pixels, 400 … 6400.

    Returns
    -------
    PIL.Image.Image
        RGB.

    Raises
    ------
    InvalidInputError
        If the width is out of range.
    """
    _check_width(width)
    metres = underlay is not None if metres is None else metres
    numbers = {k: k + 1 for k in range(len(scene))}
    panel = Panel("", scene, numbers, underlay, pen, metres, badge_size(len(scene)), route)
    title = f"{len(scene)} objects" if title is None else title
    return Page(_SINGLE, [panel], _labelled(scene), "").drawn(title, caption, (), width)


def draw_relations(
    scene: Scene,
    relations: Sequence[OverlayRelation],
    *,
    left_out: int = 0,
    title: str | None = None,
    caption: str = "",
    underlay: OccupancyGrid | None = None,
    metres: bool | None = None,
    pen: bool = False,
    width: int = 1600,
) -> Image.Image:
    """Draw one scene and beside it polar plots of the histograms of its pairs.

    Each plot is as large as its own peak allows; the pointer marks the main direction.

    Parameters
    ----------
    scene
        The objects.
    relations
        1 to 16 of them, in the order of the plots.
    left_out
        How many others are not drawn, which the headline tells.
    title, caption
        The headline, which counts the relations when left out, and a line below it.
    underlay, metres, pen
        As :func:`draw_scene` takes them.
    width
        Of the picture, in pixels, 400 … 6400. The height follows from the content.

    Returns
    -------
    PIL.Image.Image
        RGB.

    Raises
    ------
    InvalidInputError
        If there are too many relations or none, one names an object that is not there, or the
        width is out of range.
    """
    _check_width(width)
    _check_relations(scene, relations)
    numbers = {k: k + 1 for k in range(len(scene))}
    metres = underlay is not None if metres is None else metres
    panel = Panel("", scene, numbers, underlay, pen, metres, badge_size(len(scene)))
    plots = [
        Plot((item.a + 1, item.b + 1), item.phrase, item.degree, item.histogram, item.direction)
        for item in relations
    ]
    if title is None:
        total = len(relations) + left_out
        counted = f"{total} relation" if total == 1 else f"{total} relations"
        rest = f", {left_out} of them not drawn" if left_out else ""
        title = f"{counted} of {len(scene)} objects{rest}"
    return RelationsPage(panel, _labelled(scene), plots).drawn(title, caption, width)


def check_picture_path(path: str | Path, field: str = "overlay") -> None:
    """Refuse a path that no picture can be saved under, before any work is done.

    Parameters
    ----------
    path
        Where the picture shall be.
    field
        What an error calls it.

    Raises
    ------
    InvalidInputError
        If the name's ending is no picture's, or its folder does not exist.
    """
    check_target(path, field, _FORMATS, ".png, .jpg or .webp")


def save_overlay(path: str | Path, image: Image.Image, field: str = "overlay") -> None:
    """Save a picture, in the format that its name's ending says.

    Parameters
    ----------
    path, field
        As :func:`check_picture_path` takes them.
    image
        The picture.

    Raises
    ------
    InvalidInputError
        If the name's ending is no picture's, or the file cannot be written.
    """
    check_picture_path(path, field)
    with writing(path, field):
        image.save(path, _FORMATS[Path(path).suffix.lower()], quality=92)


def _check_width(width: int) -> None:
    if not 400 <= width <= 6400:
        raise InvalidInputError(
            Reason.INVALID_PARAMETER, "width", f"is {width}; give 400 … 6400 pixels"
        )


def _check_matches(sketch: Scene, map: Scene, matches: Sequence[OverlayMatch]) -> None:  # noqa: A002
    seen: set[tuple[str, int]] = set()
    for k, match in enumerate(matches):
        sides = (("sketch", match.sketch_object, sketch), ("map", match.map_object, map))
        for side, index, scene in sides:
            field = f"matches[{k}].{side}_object"
            if not 0 <= index < len(scene):
                problem = f"is {index}; the {side} has objects 0 … {len(scene) - 1}"
                raise InvalidInputError(Reason.INVALID_FIELD, field, problem)
            if (side, index) in seen:
                problem = f"is {index} again; give each object one partner at most"
                raise InvalidInputError(Reason.INVALID_FIELD, field, problem)
            seen.add((side, index))
        if not math.isfinite(match.confidence):
            field = f"matches[{k}].confidence"
            raise InvalidInputError(
                Reason.INVALID_FIELD, field, "is not finite; give a number from 0 to 1"
            )


def _check_relations(scene: Scene, relations: Sequence[OverlayRelation]) -> None:
    if not 1 <= len(relations) <= MOST_PLOTS:
        raise InvalidInputError(
            Reason.INVALID_FIELD,
            "relations",
            f"are {len(relations)}; give 1 … {MOST_PLOTS}, and the number left out",
        )
    for k, relation in enumerate(relations):
        for name, index in (("a", relation.a), ("b", relation.b)):
            if not 0 <= index < len(scene):
                problem = f"is {index}; the scene has objects 0 … {len(scene) - 1}"
                raise InvalidInputError(Reason.INVALID_FIELD, f"relations[{k}].{name}", problem)


def _labelled(scene: Scene) -> list[Entry]:
    """Return a legend of the objects that have labels."""
    return [Entry(k + 1, printable(name)) for k, name in enumerate(scene.labels) if name]


def _entry(match: OverlayMatch, sketch: Scene, map: Scene) -> Entry:  # noqa: A002
    names = (sketch.labels[match.sketch_object], map.labels[match.map_object])
    name = " · ".join(dict.fromkeys(printable(name) for name in names if name.strip()))
    return Entry(match.sketch_object + 1, name, match.confidence)


def _note(panels: Sequence[Panel]) -> str:
    """Return what the legend says about objects without a partner; nothing if there is none."""
    sketched, mapped = (len(panel.scene) - len(panel.numbers) for panel in panels)
    parts = [f"{sketched} sketched"] * (sketched > 0) + [f"{mapped} mapped"] * (mapped > 0)
    return f"no partner: {' and '.join(parts)}" if parts else ""
