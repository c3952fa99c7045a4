"""Colours for pairs of objects, told apart by people with and without colour vision deficiency."""

from __future__ import annotations

from functools import cache

import numpy as np

from sketchmatch.model import FloatArray
from sketchmatch_views import PAIR_COLOURS

__all__ = ["Colour", "mixed", "pair_colour", "readable_on"]

Colour = tuple[int, int, int]

_COUNT = 128

# Simulated protanopia and deuteranopia, linear RGB: Machado et al., 2009, Table 1.
_DEFICIENT = (
    np.array(
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ]
    ),
    np.array(
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ]
    ),
)

# Linear RGB → LMS → OKLab: Ottosson, 2020, https://bottosson.github.io/posts/oklab.
_LMS = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
_LAB = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)


def pair_colour(number: int) -> Colour:
    """Return the colour of the pair with this number, counted from 1; it repeats after 128."""
    return _palette()[(number - 1) % _COUNT]


def mixed(colour: Colour, other: Colour, share: float) -> Colour:
    """Return ``colour`` with ``share`` of ``other`` in it."""
    r, g, b = (round(a + share * (c - a)) for a, c in zip(colour, other, strict=True))
    return (r, g, b)


def readable_on(colour: Colour) -> Colour:
    """Return white or a dark ink, whichever reads better on ``colour``."""
    luminance = _linear(np.array([colour], dtype=np.float64))[0] @ [0.2126, 0.7152, 0.0722]
    return (255, 255, 255) if luminance < 0.36 else (23, 32, 51)


@cache
def _palette() -> tuple[Colour, ...]:
    """Return the first colours and, one by one, the candidate furthest from all before it."""
    candidates = _candidates()
    views = [_views(candidates), _views(np.array(PAIR_COLOURS, dtype=np.float64))]
    nearest = np.min([_apart(views[0], seen) for seen in views[1].swapaxes(0, 1)], axis=0)
    colours = list(PAIR_COLOURS)
    while len(colours) < _COUNT:
        best = int(np.argmax(nearest))
        r, g, b = candidates[best].tolist()
        colours.append((int(r), int(g), int(b)))
        nearest = np.minimum(nearest, _apart(views[0], views[0][:, best]))
    return tuple(colours)


def _candidates() -> FloatArray:
    """Return RGB rows, 0 … 255, neither pale nor near black, neither grey nor garish."""
    steps = np.linspace(0.0, 255.0, 16).round()
    colours = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
    lightness, a, b = _oklab(_linear(colours)).T
    chroma = np.hypot(a, b)
    calm = (lightness > 0.40) & (lightness < 0.80) & (chroma > 0.07) & (chroma < 0.19)
    return np.asarray(colours[calm])


def _views(colours: FloatArray) -> FloatArray:
    """Return OKLab as seen with full, protanope and deuteranope vision, shape (3, n, 3)."""
    linear = _linear(colours)
    seen = [linear, *(np.clip(linear @ view.T, 0.0, 1.0) for view in _DEFICIENT)]
    return np.stack([_oklab(view) for view in seen])


def _apart(views: FloatArray, one: FloatArray) -> FloatArray:
    """Return the distance of each colour from one, most of it as full vision sees it."""
    distances = np.linalg.norm(views - one[:, None, :], axis=2)
    return np.asarray(distances[0] + distances[1:].min(axis=0))


def _linear(colours: FloatArray) -> FloatArray:
    values = colours / 255.0
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def _oklab(linear: FloatArray) -> FloatArray:
    return np.asarray(np.cbrt(linear @ _LMS.T) @ _LAB.T)
