"""From two scenes' histograms to the table of how every pair compares with every other."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from sketchmatch.api import Similarity
from sketchmatch.kernels.alignment import main_directions, rotated_rows
from sketchmatch.model import RelationTable, SceneDescriptor
from sketchmatch.model.arrays import sealed
from sketchmatch.pipeline.plugins import checked_array
from sketchmatch.pipeline.slices import slices

__all__ = ["relate"]


def relate(
    template: SceneDescriptor, argument: SceneDescriptor, similarity: Similarity
) -> Generator[float, None, RelationTable]:
    """Compare every template histogram with every argument histogram.

    Each template histogram is dilated by L = (m'/m)^(1/(3−r)), m being the means, and turned by
    the difference R of the main directions before it is compared (thesis 3.2). A histogram that
    is zero everywhere compares with none: σ = 0, R = 0, L = 1.

    Yields
    ------
    float
        The share that is done.

    Returns
    -------
    RelationTable
        σ, R and L; the template must have at most as many objects as the argument.
    """
    power = 3.0 - template.exponent
    shape = (len(template.histograms), len(argument.histograms))
    sigma, rotation, dilation = np.zeros(shape), np.zeros(shape), np.ones(shape)
    template_means = template.histograms.mean(axis=1)
    argument_means = argument.histograms.mean(axis=1)
    template_angles = main_directions(template.histograms)
    argument_angles = main_directions(argument.histograms)
    present = argument_means > 0.0
    columns = argument.histograms if present.all() else argument.histograms[present]
    for first, last in slices(shape[0]):
        for i in range(first, last):
            if template_means[i] > 0.0:
                ratios = argument_means[present] / template_means[i]
                angles = np.mod(argument_angles[present] - template_angles[i], 2.0 * np.pi)
                aligned = rotated_rows(template.histograms[i], angles, ratios)
                alike = similarity.compare(aligned, columns)
                sigma[i, present] = checked_array(alike, angles.shape)
                rotation[i, present] = np.where(angles < 2.0 * np.pi, angles, 0.0)
                dilation[i, present] = ratios ** (1.0 / power)
        yield last / shape[0]
    return RelationTable(
        sealed(sigma), sealed(rotation), sealed(dilation), template.objects, argument.objects
    )
