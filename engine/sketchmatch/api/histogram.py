"""The interface of histograms: from a scene to its spatial relations."""

from __future__ import annotations

from abc import ABC, abstractmethod

from pydantic import Field

from sketchmatch.api import _algorithm
from sketchmatch.model import FloatArray, IntArray, Scene

__all__ = ["Histogram", "HistogramParams"]


_DIRECTIONS = 180


class HistogramParams(_algorithm.Params):
    """What every histogram is asked for: ``directions``, how many there are over the full turn."""

    directions: int | None = Field(
        default=None,
        ge=4,
        le=3600,
        multiple_of=2,
        description="Number of directions over the full turn; direction k is 2πk/n from +x. By "
        "default as many as the narrow relations of the scene with fewer objects need, 180 to 720.",
    )


class Histogram(_algorithm.Algorithm, ABC):
    """Describes the relation of two objects by a histogram over directions.

    The host calls :meth:`describe` for slices of a scene's pairs, from threads and with a check
    for cancellation between the slices; an implementation only computes.
    """

    class Params(HistogramParams):
        """The number of directions alone."""

    params: HistogramParams

    @property
    def directions(self) -> int:
        """n, how many directions there are over the full turn.

        The host fills in what the parameters leave open before it describes a scene, so that they
        hold a number too; without a host it is 180.
        """
        return self.params.directions or _DIRECTIONS

    @property
    def of_pairs(self) -> bool:
        """Whether a pair's histogram follows from its two objects and the scene's ``middle``.

        If so, the host may keep it while other objects of the scene change.
        """
        return False

    @property
    @abstractmethod
    def exponent(self) -> float:
        """r: scaling both objects by λ multiplies the histogram by λ^(3−r)."""

    @abstractmethod
    def describe(self, scene: Scene, pairs: IntArray) -> FloatArray:
        """Return the histograms of pairs of objects.

        Parameters
        ----------
        scene
            The scene; it must not be changed.
        pairs
            Shape (k, 2), indices into ``scene.objects``.

        Returns
        -------
        ndarray
            Shape (k, directions): for each pair (a, b) the support in every direction for
            "a is in this direction of b". The dual of a pair is its histogram turned by π.
        """
