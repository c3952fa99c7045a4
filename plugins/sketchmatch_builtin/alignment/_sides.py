"""A sketch and a map as alignment sees them, whichever of the two is the template."""

from __future__ import annotations

from dataclasses import dataclass
from hashlib import sha256

import numpy as np

from sketchmatch.model import BoolArray, FloatArray, IntArray, Scene
from sketchmatch_builtin.alignment._things import Things, things_of

__all__ = ["Sides", "sides_of"]

_PINNED = 50.0
"""What speaks for a pairing that is known: more than anything against it."""

_SAME, _OTHER = 2.0, -2.0
"""What labels that mean the same, or do not, speak for a pairing."""


@dataclass(frozen=True, eq=False)
class Sides:
    """What is laid upon what.

    Attributes
    ----------
    drawn, mapped
        The n objects of the sketch and the m of the map.
    bonus
        Shape (n, m): what speaks for each pairing beside places, sizes and shapes; −inf where it
        is ruled out.
    swapped
        Whether the template is the map.
    """

    drawn: Things
    mapped: Things
    bonus: FloatArray
    swapped: bool

    @property
    def identity(self) -> str:
        """The same for two that are the same."""
        digest = sha256(repr((self.bonus.shape, self.swapped)).encode())
        for side in (self.drawn, self.mapped):
            for each in (side.places, side.sizes, side.shapes):
                digest.update(each.tobytes())
        digest.update(self.bonus.tobytes())
        return digest.hexdigest()

    def drawn_partners(self, partners: IntArray) -> IntArray:
        """Return a map of the template as one of the sketch."""
        return inverse(partners, len(self.drawn.places)) if self.swapped else partners

    def template_partners(self, partners: IntArray) -> IntArray:
        """Return a map of the sketch as one of the template."""
        return inverse(partners, len(self.mapped.places)) if self.swapped else partners


def sides_of(
    scenes: tuple[Scene, Scene],
    swapped: bool,
    allowed: BoolArray | None,
    pinned: IntArray | None,
    names: IntArray | None,
) -> Sides:
    """Return what alignment knows of a template and an argument.

    Parameters
    ----------
    scenes
        The template and the argument.
    swapped
        Whether the template is the map.
    allowed, pinned, names
        As in :class:`sketchmatch.api.MatchProblem`.
    """
    template, argument = (things_of(scene) for scene in scenes)
    bonus = np.zeros((len(template.places), len(argument.places)))
    if names is not None:
        bonus += np.where(names > 0, _SAME, np.where(names < 0, _OTHER, 0.0))
    if pinned is not None:
        known = np.flatnonzero(pinned >= 0)
        bonus[known, pinned[known]] += _PINNED
    if allowed is not None:
        bonus[~allowed] = -np.inf
    if swapped:
        return Sides(argument, template, np.ascontiguousarray(bonus.T), True)
    return Sides(template, argument, bonus, False)


def inverse(partners: IntArray, others: int) -> IntArray:
    """Return who has each of the others as partner, −1 for nobody."""
    found = np.full(others, -1, dtype=np.int64)
    matched = np.flatnonzero(partners >= 0)
    found[partners[matched]] = matched
    return found
