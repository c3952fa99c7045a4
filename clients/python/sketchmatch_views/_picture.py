"""A sketch and a map side by side, as SVG that a notebook or a web page shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

__all__ = ["PAIR_COLOURS", "Panel", "drawn"]

# Okabe and Ito's colours without yellow and black, which drown on white and among outlines
# (https://jfly.uni-koeln.de/color), then purple, olive and teal of the same strength.
PAIR_COLOURS: tuple[tuple[int, int, int], ...] = (
    (0, 114, 178),
    (213, 94, 0),
    (0, 158, 115),
    (204, 121, 167),
    (230, 159, 0),
    (86, 180, 233),
    (120, 72, 168),
    (140, 112, 20),
)
"""Colours of pairs, told apart by people with and without colour vision deficiency."""

_ALONE = (150, 150, 150)
_SIDE, _MARGIN, _TITLE, _LETTERS = 300.0, 12.0, 18.0, 24
Point = Sequence[float]


@dataclass(frozen=True)
class Panel:
    """One scene of a picture.

    Attributes
    ----------
    title
        What stands above it.
    objects
        Of each object its rings, where its name stands, and its name.
    pairs
        Of objects with a partner the number of their pair.
    route
        A line through it.
    """

    title: str
    objects: Sequence[tuple[Sequence[Sequence[Point]], Point, str]]
    pairs: Mapping[int, int]
    route: Sequence[Point] = ()


def drawn(*panels: Panel) -> str:
    """Return panels side by side."""
    width, height = _SIDE * len(panels), _SIDE + _TITLE
    parts = [part for k, panel in enumerate(panels) for part in _panel(panel, k * _SIDE)]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}" height="{height:g}" '
        f'viewBox="0 0 {width:g} {height:g}" font-family="sans-serif" font-size="11" '
        f'role="img"><rect width="100%" height="100%" fill="#fff"/>{"".join(parts)}</svg>'
    )


def _panel(panel: Panel, left: float) -> list[str]:
    frame = _Frame.around(panel, left)
    areas, names = [], []
    for k, (rings, centre, name) in enumerate(panel.objects):
        r, g, b = PAIR_COLOURS[panel.pairs[k] % len(PAIR_COLOURS)] if k in panel.pairs else _ALONE
        outline = " ".join(f"M{frame.line(ring)}Z" for ring in rings)
        areas.append(
            f'<path d="{outline}" fill="rgb({r},{g},{b})" fill-opacity=".35" fill-rule="evenodd" '
            f'stroke="rgb({r},{g},{b})" stroke-width="1.5"/>'
        )
        names.append(_text(frame.place(centre), name, "middle"))
    way = frame.line(panel.route) if len(panel.route) else ""
    return [
        _text((left + _MARGIN, _TITLE - 4), panel.title, "start"),
        *areas,
        *([f'<path d="M{way}" fill="none" stroke="#333" stroke-dasharray="5 4"/>'] if way else []),
        *names,
    ]


def _text(place: tuple[float, float], text: str, anchor: str) -> str:
    shown = text if len(text) <= _LETTERS else f"{text[: _LETTERS - 1]}…"
    x, y = place
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="#222">{escape(shown)}</text>'
    )


@dataclass(frozen=True)
class _Frame:
    """Where a scene lies in the picture, where y grows downwards."""

    x: float
    y: float
    scale: float

    @classmethod
    def around(cls, panel: Panel, left: float) -> _Frame:
        points = [point for rings, _, _ in panel.objects for ring in rings for point in ring]
        points += panel.route
        xs, ys = [point[0] for point in points] or [0.0], [point[1] for point in points] or [0.0]
        width, height = max(xs) - min(xs), max(ys) - min(ys)
        scale = (_SIDE - 2 * _MARGIN) / (max(width, height) or 1.0)
        middle = left + _SIDE / 2, _TITLE + _SIDE / 2
        return cls(
            middle[0] - scale * (min(xs) + width / 2),
            middle[1] + scale * (min(ys) + height / 2),
            scale,
        )

    def place(self, point: Point) -> tuple[float, float]:
        return self.x + self.scale * point[0], self.y - self.scale * point[1]

    def line(self, points: Sequence[Point]) -> str:
        """Return points as a path has them, without those that nobody could tell apart."""
        shown = [f"{x:.1f} {y:.1f}" for x, y in map(self.place, points)]
        kept = [each for k, each in enumerate(shown) if k == 0 or each != shown[k - 1]]
        return "L".join(kept)
