"""Judges maps by all that is known: relations, places, sizes, shapes, and what chance achieves."""

from __future__ import annotations

import math
import time

import numpy as np

from sketchmatch.api import Judge, JudgedMap, Judgement, JudgeProblem
from sketchmatch.model import FloatArray, IntArray, RelationTable, Scene
from sketchmatch_builtin.alignment import Late, never, sides_of
from sketchmatch_builtin.judges._described import described
from sketchmatch_builtin.judges._evidence import settled, weighed
from sketchmatch_builtin.judges.calibration import POSTERIOR

__all__ = ["Posterior"]

_TOLD = 20
"""Maps beside those wanted that are told, so that whoever asks for the likeliest knows them."""

_NEGLIGIBLE = 1e-6


class Posterior(Judge):
    """Weighs all evidence: how likely each map is, and whether this is the place.

    The maps are those met by the search and those found by laying the sketch on the map, as the
    searcher ``align`` does. A conditional logit [1]_ turns the score of each into a probability.
    The score covers how well places, sizes and shapes agree in one frame, outlines however they are
    stretched, the vectors between objects, their relations and the forces within them, how the page
    is stretched, what is left out on either side, labels if both sides have some, and how certain
    each mapped object is. It is computed by a network of two small layers over the lines of a map,
    in any order [2]_, so that a deviation counts the more, the better the others fit. That the
    right map is none of these has a probability as well.

    Whether the sketch shows this place at all follows from how far the best map exceeds what chance
    achieves on the same map, with decoys: the sketch mirrored, which nobody draws, and with its
    objects in each other's places. Star trackers verify by such a model of chance agreement [3]_.

    Where no time is left, it weighs the maps that were met and those of the poses that were tried
    so far, and one decoy.

    All of it was learned from simulated sketches, on the default relations. With others it judges
    by places, sizes and shapes alone.

    References
    ----------
    .. [1] D. McFadden, "Conditional logit analysis of qualitative choice behavior", 1974.
    .. [2] M. Zaheer et al., "Deep sets", Advances in Neural Information Processing Systems 30,
       2017.
    .. [3] D. Lang et al., "Astrometry.net: blind astrometric calibration of arbitrary
       astronomical images", The Astronomical Journal 139, 2010.

    Examples
    --------
    One of six things was not drawn, and it is sure of the five others and of the place:

    >>> from sketchmatch.testing import judging_problem
    >>> problem, truth = judging_problem(np.random.default_rng(0), objects=6, missing=1)
    >>> judged = Posterior().judge(problem)
    >>> judged.maps[0].partners.tolist() == truth.tolist()
    True
    >>> judged.maps[0].probability > 0.9, judged.elsewhere < 0.1
    (True, True)
    """

    name = "posterior"
    summary = "The default: the most likely map by all evidence, and whether this is the place."
    default = True

    @property
    def partial(self) -> bool:
        """It finds maps that leave objects out by itself."""
        return True

    @classmethod
    def warm_up(cls) -> None:
        """Compile the kernels."""
        box = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 2.0], [0.0, 2.0]])
        scene = Scene.from_polygons([box + place for place in ((0, 0), (4, 0), (0, 5), (7, 7))])
        flat = np.full((6, 6), 0.5)
        described(
            (scene, scene),
            sides_of((scene, scene), False, None, None, None),
            RelationTable(flat, flat, flat, 4, 4),
        )

    def judge(self, problem: JudgeProblem) -> Judgement:
        """Weigh the candidates, and maps of its own."""
        scenes = problem.template, problem.argument
        sides = sides_of(scenes, problem.swapped, problem.allowed, problem.pinned, problem.names)
        known = described(
            scenes[::-1] if problem.swapped else scenes,
            sides,
            problem.table,
            problem.names,
            [sides.drawn_partners(each.partners) for each in problem.candidates],
            partial=problem.price < math.inf,
            related=problem.usual,
            quick=problem.elsewhere is not None,
            late=_late_in(problem.time_budget),
        )
        found = weighed(known, POSTERIOR, problem.elsewhere)
        mapped = problem.template if problem.swapped else problem.argument
        # Of maps that are as likely, the first is what the search puts first.
        shares = settled(_as_certain(found.shares, known.maps, mapped))
        order = np.argsort(-shares, kind="stable")
        maps = [sides.template_partners(each) for each in known.maps[order]]
        told = problem.alternatives + 1
        # Whoever says that a sketched object is a mapped one says that this is the place.
        pinned = problem.pinned is not None and bool((problem.pinned >= 0).any())
        elsewhere = 0.0 if pinned else found.elsewhere
        here = 1.0 - elsewhere
        likely = here * (1.0 - found.lost) * shares[order]
        lines = _lines(maps, likely, problem.table)
        best = maps[0]
        lines[np.arange(len(best)), best] += here * found.lost * POSTERIOR.luck
        lines[:, -1] += elsewhere
        _state_known(lines, problem)
        told = max(told, min(told + _TOLD, int(np.count_nonzero(likely > _NEGLIGIBLE))))
        return Judgement(
            tuple(
                JudgedMap(each, float(probability))
                for each, probability in zip(maps[:told], likely[:told], strict=True)
            ),
            np.clip(lines, 0.0, 1.0),
            elsewhere,
        )


def _late_in(seconds: float | None) -> Late:
    if seconds is None:
        return never
    end = time.monotonic() + seconds
    return lambda: time.monotonic() >= end


def _as_certain(shares: FloatArray, maps: IntArray, mapped: Scene) -> FloatArray:
    """Return the maps' shares after what is no thing of the map can be no partner either.

    The share of a map falls with the certainty of each mapped object in it.
    """
    certain = np.array([*(item.certainty for item in mapped.objects), 1.0])  # −1 is no partner
    # Of many objects in doubt the product alone would be nothing for all maps.
    likely = np.log(certain)[maps].sum(axis=1)
    weighted = shares * np.exp(likely - likely[shares > 0.0].max())
    return np.asarray(weighted * (shares.sum() / weighted.sum()))


def _lines(maps: list[IntArray], likely: FloatArray, table: RelationTable) -> FloatArray:
    """Return how likely each template object has each partner, or, last, none."""
    shape = table.template_objects, table.argument_objects + 1
    columns = np.stack(maps) % shape[1]  # −1 is the last one
    cells = shape[1] * np.arange(shape[0]) + columns
    added = np.bincount(cells.reshape(-1), np.repeat(likely, shape[0]), math.prod(shape))
    return np.asarray(added.reshape(shape))


def _state_known(lines: FloatArray, problem: JudgeProblem) -> None:
    """Make certain what the caller knows."""
    if problem.allowed is not None:
        nobodys = np.flatnonzero(~problem.allowed.any(axis=1))
        lines[nobodys] = 0.0
        lines[nobodys, -1] = 1.0
    if problem.pinned is not None:
        known = np.flatnonzero(problem.pinned >= 0)
        lines[known] = 0.0
        lines[known, problem.pinned[known]] = 1.0
