"""Pictures of results: a sketch and a map side by side, partners in one colour.

A number in a picture is that of the object in its own scene, counted from 1, whatever is matched:
the same as in all tables. Everything is laid out in design units, 1600 across an overlay and 1000
across a single scene, and drawn at any width; a picture twice as wide shows the same, finer.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from sketchmatch.errors import InvalidInputError, Reason, counted
from sketchmatch.io._targets import check_target, writing
from sketchmatch.model import FloatArray, OccupancyGrid, Scene
from sketchmatch.pictures._canvas import printable
from sketchmatch.pictures._markings import Marking
from sketchmatch.pictures._page import Entry, Page
from sketchmatch.pictures._palette import pair_colour
from sketchmatch.pictures._panel import Panel, badge_size
from sketchmatch.pictures._plots import MOST_PLOTS, Plot, RelationsPage

__all__ = [
    "MOST_PLOTS",
    "Marking",
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
        How sure the pair is, 0 … 1: the length of its bar.
    said
        The same in words, beside the bar; the number where empty.
    """

    sketch_object: int
    map_object: int
    confidence: float
    said: str = ""


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
    groups: Sequence[tuple[Sequence[int], Sequence[int]]] = (),
    title: str | None = None,
    caption: str = "",
    facts: Sequence[tuple[str, str]] = (),
    alert: str = "",
    footnote: str = "",
    underlay: OccupancyGrid | None = None,
    metres: bool | None = None,
    route: FloatArray | None = None,
    names: tuple[str, str] = ("Sketch", "Map"),
    sketch_underlay: OccupancyGrid | None = None,
    markings: tuple[Sequence[Marking], Sequence[Marking]] = ((), ()),
    width: int = 1600,
) -> Image.Image:
    """Draw both scenes side by side, matched objects in the same colour.

    Parameters
    ----------
    sketch, map
        The scenes.
    matches
        The pairs of the object map, in any order. Objects are numbered from 1, as their scenes
        count them, and those without a partner are grey and hatched.
    groups
        Which objects of the sketch are, together, which of the map: they have one colour.
    title, caption
        The headline, which counts the matches when left out, and a line below it.
    facts
        Names and values for the header, e.g. ``[("OMAP confidence", "0.93")]``.
    alert
        What must be seen before all else, in a box below the header.
    footnote
        What the figures mean, in small letters at the bottom.
    underlay
        The grid that the map was made from, drawn softly under its objects.
    metres
        Whether the map is in metres and gets a scale bar; with an underlay when left out.
    route
        Shape (k, 2), two points or more: a way through the sketch, drawn as a light dashed arrow.
    names
        What the two scenes are called.
    sketch_underlay
        The grid that the sketch was made from, where it is a map too.
    markings
        Points, routes and zones in both, with how sure their places are: a shade reaches to two
        standard deviations.
    width
        Of the picture, in pixels, 400 … 6400. The height follows from the content.

    Returns
    -------
    PIL.Image.Image
        RGB.

    Raises
    ------
    InvalidInputError
        If a pair names an object that is not there or twice, a group one that is not there, or the
        width is out of range.
    """
    _check_width(width)
    _check_matches(sketch, map, matches)
    _check_groups((sketch, map), groups)
    matches = sorted(matches, key=lambda match: match.sketch_object)
    colours = [pair_colour(match.sketch_object + 1) for match in matches]
    drawn = {match.sketch_object: colour for match, colour in zip(matches, colours, strict=True)}
    mapped = {match.map_object: colour for match, colour in zip(matches, colours, strict=True)}
    for ours, theirs in groups:
        colour = next((drawn[k] for k in ours if k in drawn), pair_colour(min(ours) + 1))
        drawn |= dict.fromkeys(ours, colour)
        mapped |= dict.fromkeys(theirs, colour)
    badge = badge_size(max(len(sketch), len(map)))
    panels = [
        Panel(
            names[0],
            sketch,
            drawn,
            sketch_underlay,
            pen=sketch_underlay is None,
            route=route,
            badge=badge,
            markings=markings[0],
        ),
        Panel(
            names[1],
            map,
            mapped,
            underlay,
            metres=_in_metres(metres, underlay),
            badge=badge,
            markings=markings[1],
        ),
    ]
    entries = [
        Entry(
            (match.sketch_object + 1, match.map_object + 1),
            drawn[match.sketch_object],
            _name(match, sketch, map, groups),
            match.confidence,
            match.said,
        )
        for match in matches
    ]
    if title is None:
        title = f"{len(drawn)} of {len(sketch)} objects matched"
    page = Page(_OVERLAY, panels, entries, _note(panels), alert, footnote)
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
    panel = _single(scene, underlay, metres, pen, route)
    title = f"{len(scene)} objects" if title is None else title
    return Page(_SINGLE, [panel], _labelled(scene), "").drawn(title, caption, (), width)


def draw_relations(
    scene: Scene,
    relations: Sequence[OverlayRelation],
    *,
    left_out: Sequence[tuple[int, int]] = (),
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
        The pairs (a, b) of others that are not drawn: the headline counts them, and the last line
        lists them as far as there is room.
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
    panel = _single(scene, underlay, metres, pen)
    plots = [
        Plot((item.a + 1, item.b + 1), item.phrase, item.degree, item.histogram, item.direction)
        for item in relations
    ]
    if title is None:
        total = len(relations) + len(left_out)
        rest = f", {len(left_out)} of them not drawn" if left_out else ""
        title = f"{counted(total, 'relation')} of {len(scene)} objects{rest}"
    others = [f"{a + 1},{b + 1}" for a, b in left_out]
    return RelationsPage(panel, _labelled(scene), plots, others).drawn(title, caption, width)


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
                problem = f"is {index}, but the {side} has objects 0 … {len(scene) - 1}"
                raise InvalidInputError(Reason.INVALID_FIELD, field, problem)
            if (side, index) in seen:
                problem = f"is {index} again; give each object at most one partner"
                raise InvalidInputError(Reason.INVALID_FIELD, field, problem)
            seen.add((side, index))
        if not math.isfinite(match.confidence):
            field = f"matches[{k}].confidence"
            raise InvalidInputError(
                Reason.INVALID_FIELD, field, "is not finite; give a number from 0 to 1"
            )


def _check_groups(
    scenes: tuple[Scene, Scene], groups: Sequence[tuple[Sequence[int], Sequence[int]]]
) -> None:
    for k, group in enumerate(groups):
        for side, scene, indices in zip(("sketch", "map"), scenes, group, strict=True):
            wrong = [index for index in indices if not 0 <= index < len(scene)]
            if wrong or not indices:
                problem = f"are {[*indices]}, but the {side} has objects 0 … {len(scene) - 1}"
                field = f"groups[{k}].{side}_objects"
                raise InvalidInputError(Reason.INVALID_FIELD, field, problem)


def _check_relations(scene: Scene, relations: Sequence[OverlayRelation]) -> None:
    if not 1 <= len(relations) <= MOST_PLOTS:
        raise InvalidInputError(
            Reason.INVALID_FIELD,
            "relations",
            f"are {len(relations)}; give 1 … {MOST_PLOTS}, and the others as left_out",
        )
    for k, relation in enumerate(relations):
        for name, index in (("a", relation.a), ("b", relation.b)):
            if not 0 <= index < len(scene):
                problem = f"is {index}, but the scene has objects 0 … {len(scene) - 1}"
                raise InvalidInputError(Reason.INVALID_FIELD, f"relations[{k}].{name}", problem)


def _single(
    scene: Scene,
    underlay: OccupancyGrid | None,
    metres: bool | None,
    pen: bool,
    route: FloatArray | None = None,
) -> Panel:
    """Return the panel of a scene by itself, each object in a colour of its own."""
    return Panel(
        "",
        scene,
        {k: pair_colour(k + 1) for k in range(len(scene))},
        underlay,
        pen,
        _in_metres(metres, underlay),
        badge_size(len(scene)),
        route,
    )


def _in_metres(metres: bool | None, underlay: OccupancyGrid | None) -> bool:
    return underlay is not None if metres is None else metres


def _labelled(scene: Scene) -> list[Entry]:
    """Return a legend of the objects that have labels."""
    names = enumerate(map(printable, scene.labels))
    return [Entry((k + 1,), pair_colour(k + 1), name) for k, name in names if name]


def _name(
    match: OverlayMatch,
    sketch: Scene,
    map: Scene,  # noqa: A002
    groups: Sequence[tuple[Sequence[int], Sequence[int]]],
) -> str:
    names = (sketch.labels[match.sketch_object], map.labels[match.map_object])
    said = [printable(name) for name in names if name.strip()]
    for ours, theirs in groups:
        if match.sketch_object in ours:
            others = [(ours, match.sketch_object, "sketched"), (theirs, match.map_object, "mapped")]
            for indices, own, word in others:
                if rest := [str(k + 1) for k in indices if k != own]:
                    said.append(f"with {word} {' and '.join(rest)}")
    return " · ".join(dict.fromkeys(said))


def _note(panels: Sequence[Panel]) -> str:
    """Return what the legend says about objects without a partner; nothing if there is none."""
    sketched, mapped = (len(panel.scene) - len(panel.colours) for panel in panels)
    parts = [f"{sketched} sketched"] * (sketched > 0) + [f"{mapped} mapped"] * (mapped > 0)
    return f"no partner: {' and '.join(parts)}" if parts else ""
