"""The arms of the study of what people really draw, and what came of each sketch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from tests.experiments.people import Shapes

__all__ = ["ARMS", "Arm", "Judged"]


@dataclass(frozen=True)
class Arm:
    """A kind of case.

    Attributes
    ----------
    name
        What tables call it.
    objects, missing, extra, wrong_place, shapes
        As for :func:`tests.experiments.generators.sample`; eight neighbours are seen.
    """

    name: str
    objects: int
    missing: int = 0
    extra: int = 0
    wrong_place: bool = False
    shapes: Shapes = Shapes.OUTLINES


ARMS: Mapping[str, tuple[Arm, ...]] = {
    "parts": (
        Arm("8 of 8", 8),
        *(Arm(f"7 of 8, {shapes}", 8, missing=1, shapes=shapes) for shapes in Shapes),
        Arm("7 of 8 and 1 extra", 8, missing=1, extra=1),
        Arm("6 of 8 and 2 extra", 8, missing=2, extra=2),
        Arm("8 of 20", 20),
        Arm("7 of 20 and 1 extra", 20, missing=1, extra=1),
        Arm("6 of 20 and 2 extra", 20, missing=2, extra=2),
        Arm("8 of 36", 36),
        Arm("8 of 60", 60),
    ),
    "places": tuple(
        Arm(f"8 of another {objects}", objects, wrong_place=True) for objects in (8, 20, 36, 60)
    ),
}
"""The arms of the study, by the experiments that they belong to."""


@dataclass(frozen=True)
class Judged:
    """What a method made of a sketch, and how sure it was.

    Attributes
    ----------
    kind, arm, number, method
        What was done.
    objects, right
        How many sketched objects there are, and of how many the partner, or that there is none, is
        as it should be.
    among
        Whether the right map is the answer or among the next best hundred.
    probability, place
        That the map is right, and that the place is; None where unknown.
    lines
        For each sketched object the probability of what the answer says of it, where one is given,
        and whether that is so.
    seconds
        Of the match, from the scenes on.
    """

    kind: str
    arm: Arm
    number: int
    method: str
    objects: int
    right: int
    among: bool
    probability: float | None
    place: float | None
    lines: tuple[tuple[float, bool], ...]
    seconds: float

    @property
    def perfect(self) -> bool:
        """Whether the answer is wholly right; of a wrong place none is."""
        return self.right == self.objects and not self.arm.wrong_place
