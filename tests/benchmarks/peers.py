"""Graph matching libraries of others, given the same similarities as our searchers.

Each solves a quadratic assignment problem, so each is given σ alone: ζR and ζL of a map are no
sums over its pairs, and no input of these libraries can hold them. σ is the same for a pair and
its dual, so they see no directions either.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from sketchmatch.model import FloatArray, IntArray, RelationTable, object_pairs

__all__ = ["PEERS", "Peer", "affinity", "contrast", "rank_one"]

_MOST_CANDIDATES = 2500
"""N·N' at most where memory grows with its square: 50 MB for K, 800 MB at 100 objects."""


@dataclass(frozen=True)
class Peer:
    """One solver of a package.

    Attributes
    ----------
    name
        As the table shows it.
    package
        The module to import; where it is missing, the peer is left out.
    prepare
        Turns a relation table into the solver's input and returns what runs the solver and
        returns its object map, with −1 for an object that it leaves out.
    limit
        N·N' at most.
    """

    name: str
    package: str
    prepare: Callable[[RelationTable], Callable[[], IntArray]]
    limit: float = np.inf

    @property
    def installed(self) -> bool:
        """Whether the package is there."""
        return importlib.util.find_spec(self.package) is not None


def contrast(table: RelationTable) -> FloatArray:
    """Return σ less each template pair's least, shape (Q, Q'/2).

    That takes the same from every map, and most peers do far better with it: σ varies little.
    """
    return table.similarity - table.similarity.min(axis=1, keepdims=True)


def affinity(table: RelationTable) -> FloatArray:
    """Return the contrast of (a, b) → (c, d) at [a, c, b, d], and 0 where a = b or c = d."""
    n, m = table.template_objects, table.argument_objects
    sigma = contrast(table)
    values = np.zeros((n, m, n, m))
    a, b = object_pairs(n).T[:, :, None]
    c, d = object_pairs(m).T[:, None, :]
    for first, second in ((a, b), (b, a)):
        values[first, c, second, d] = sigma
        values[first, d, second, c] = sigma
    return values


def rank_one(table: RelationTable) -> tuple[FloatArray, FloatArray]:
    """Return A, shape (N, N), and B, shape (N', N'), such that A[a, b]·B[c, d] is nearest to σ.

    Means that add the same to every map are taken from σ before: those over argument pairs, and
    those over template pairs where every argument pair is used.
    """
    from scipy.sparse.linalg import svds

    deviations = table.similarity - table.similarity.mean(axis=1, keepdims=True)
    if table.template_objects == table.argument_objects:
        deviations -= deviations.mean(axis=0)
    left, scale, right = svds(deviations, k=1, rng=0)
    return (
        _symmetric(scale[0] * left[:, 0], table.template_objects),
        _symmetric(right[0], table.argument_objects),
    )


def _symmetric(values: FloatArray, objects: int) -> FloatArray:
    matrix = np.zeros((objects, objects))
    a, b = object_pairs(objects).T
    matrix[a, b] = matrix[b, a] = values
    return matrix


def _pygmtools(solver: str, table: RelationTable) -> Callable[[], IntArray]:
    import pygmtools

    n, m = table.template_objects, table.argument_objects
    # The candidate a→c has number c·N + a there.
    matrix = affinity(table).transpose(1, 0, 3, 2).reshape(n * m, n * m)

    def run() -> IntArray:
        # IPFP divides by 0 where it stands still.
        with np.errstate(divide="ignore", invalid="ignore"):
            scores = getattr(pygmtools, solver)(matrix, n, m, backend="numpy")
        chosen: Any = pygmtools.hungarian(scores, backend="numpy")
        return np.where(chosen.any(axis=1), chosen.argmax(axis=1), -1)

    return run


def _pylibmgm(table: RelationTable) -> Callable[[], IntArray]:
    import pylibmgm

    n, m = table.template_objects, table.argument_objects
    model = pylibmgm.GmModel(
        pylibmgm.Graph(0, n), pylibmgm.Graph(1, m), n * m, 2 * table.similarity.size
    )
    for k in range(n * m):
        model.add_assignment(*divmod(k, m), 0.0)
    columns = object_pairs(m).tolist()
    for (a, b), row in zip(object_pairs(n).tolist(), contrast(table).tolist(), strict=True):
        for (c, d), sigma in zip(columns, row, strict=True):
            model.add_edge(a * m + c, b * m + d, -sigma)
            model.add_edge(a * m + d, b * m + c, -sigma)

    def run() -> IntArray:
        pylibmgm.QAPSolver.libmpopt_seed = 1  # 0, the default, draws one
        answer = pylibmgm.solver.solve_gm(model).to_list_with_none()
        return np.array([-1 if c is None else c for c in answer])

    return run


def _faq(table: RelationTable) -> Callable[[], IntArray]:
    from scipy.optimize import quadratic_assignment

    n, m = table.template_objects, table.argument_objects
    template, argument = rank_one(table)
    padded = np.pad(template, (0, m - n))

    def run() -> IntArray:
        # It draws nothing from this start, and without a generator of its own it may warn.
        options = {"maximize": True, "rng": np.random.default_rng(0)}
        answer = quadratic_assignment(padded, argument, method="faq", options=options)
        return answer.col_ind[:n]

    return run


PEERS = (
    Peer("pygmtools RRWM", "pygmtools", partial(_pygmtools, "rrwm"), _MOST_CANDIDATES),
    Peer("pygmtools IPFP", "pygmtools", partial(_pygmtools, "ipfp"), _MOST_CANDIDATES),
    Peer("pygmtools SM", "pygmtools", partial(_pygmtools, "sm"), _MOST_CANDIDATES),
    Peer("pylibmgm QAP", "pylibmgm", _pylibmgm, _MOST_CANDIDATES),
    Peer("scipy FAQ", "scipy", _faq),
)
