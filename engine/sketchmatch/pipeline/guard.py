"""Not trusting plugins: what they raise and what they return is theirs to answer for."""

from __future__ import annotations

import math
import numbers
from collections.abc import Generator, Iterator
from contextlib import closing, contextmanager
from dataclasses import is_dataclass, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from sketchmatch.api import (
    Algorithm,
    Histogram,
    JudgeProblem,
    MatchProblem,
    Outcome,
    SearchProgress,
)
from sketchmatch.errors import InvalidInputError, PluginError, quoted
from sketchmatch.model import (
    FloatArray,
    Fmap,
    IntArray,
    RelationTable,
    Scene,
    SceneObject,
    Source,
)
from sketchmatch.model.arrays import real_floats
from sketchmatch.model.labels import cleaned_sentence
from sketchmatch.registry import Registry
from sketchmatch.registry.raised import passed_on, words_of

__all__ = [
    "FEWEST",
    "blamed",
    "blaming",
    "breaks_pins",
    "check_made",
    "check_map",
    "check_scene",
    "checked_array",
    "checked_outcome",
    "checked_progress",
    "inspecting",
]

_Told = TypeVar("_Told")
_Value = TypeVar("_Value")
FEWEST = 3
"""Template objects that find a partner in any case, where there are as many."""

_ROUNDING = 1e-9
_DOUBT = 1e-6
_COUNTABLE = 2**63
_OF_THE_HOST = (Outcome.TIME_BUDGET, Outcome.SERVER_STOPPING)
_ROW = 4096
_SMALL = 2**15
"""Bytes up to which an array is hashed whole: sums by column cost more."""


class blaming:  # noqa: N801
    """Turn what an algorithm raises into a PluginError that names it and where it comes from.

    Errors that it raises for the caller, such as InvalidInputError, pass. It is entered at every
    step of a match, for which a generator would take four times as long.
    """

    def __init__(self, algorithm: Algorithm | type[Algorithm], registry: Registry) -> None:
        self._algorithm = algorithm
        self._registry = registry

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: object, error: BaseException | None, traceback: object) -> None:
        if error is None or isinstance(error, KeyboardInterrupt):
            return
        told = passed_on(error)
        if told is error:
            return
        if told is not None:
            raise told from None
        raise PluginError(
            f"{self._registry.whose(self._algorithm)} failed ({words_of(error)}); report it to its "
            "author, or choose another"
        ) from error


def blamed(
    work: Generator[_Told, None, _Value], algorithm: Algorithm, registry: Registry
) -> Generator[_Told, None, _Value]:
    """Go on with work of an algorithm, which is to blame for what the work raises.

    What is raised where the work is watched, between two steps, passes.
    """
    with closing(work):
        while True:
            with blaming(algorithm, registry):
                try:
                    told = next(work)
                except StopIteration as stop:
                    return stop.value  # type: ignore[no-any-return]
            yield told


def check_made(algorithm: Algorithm) -> None:
    """Refuse an algorithm, as it is set up, of which a number is none.

    Raises
    ------
    TypeError
        With a sentence that tells what a plugin says.
    """
    if isinstance(algorithm, Histogram):
        exponent: Any = algorithm.exponent
        if not (isinstance(exponent, numbers.Real) and math.isfinite(exponent)):
            raise TypeError(f"its exponent is {quoted(exponent)}, not a finite number")


def checked_array(values: Any, shape: tuple[int, ...], most: float = math.inf) -> FloatArray:
    """Return what a plugin returned as an array, if it has that shape and is within 0 … most."""
    array = real_floats(values)
    if array.shape != shape:
        raise ValueError(f"it returned an array of shape {array.shape}, not {shape}")
    if not np.isfinite(array).all():
        raise ValueError("it returned values that are not finite")
    unit = most if most < math.inf else abs(float(array.max(initial=0.0)))
    if array.size and array.min() < -_ROUNDING * unit:
        raise ValueError(f"it returned {array.min():g}, which is less than 0")
    if array.size and array.max() > most + _ROUNDING:
        raise ValueError(f"it returned {array.max():g}, which is more than {most:g}")
    return array


def checked_progress(
    progress: Any, problem: MatchProblem, former: SearchProgress | None
) -> SearchProgress:
    """Return what a search yielded, if it keeps to the contract of searchers.

    Parameters
    ----------
    progress
        What it yielded.
    problem
        What it was given.
    former
        What it yielded before, if it did.
    """
    if not isinstance(progress, SearchProgress):
        raise TypeError(f"it yielded a {type(progress).__name__}, not a SearchProgress")
    if former is None or progress.fmap is not former.fmap:
        _check_legal(progress.fmap, problem.table)
    for fmap in progress.alternatives:
        _check_legal(fmap, problem.table)
    if former is None or progress.maps is not former.maps:
        for partners in progress.maps:
            check_map(partners, problem)
    _check_confidence(progress, problem, former)
    bound = progress.upper_bound
    if bound is not None and not progress.confidence - _DOUBT <= bound < math.inf:
        raise ValueError(f"its upper bound is {bound}, but its FMAP has ζ {progress.confidence:g}")
    for name in ("iteration", "evaluations"):
        count = getattr(progress, name)
        if not (isinstance(count, int | np.integer) and 0 <= count < _COUNTABLE):
            raise ValueError(f"its {name} is {quoted(count)}, not a count")
    if not isinstance(progress.note, str):
        raise TypeError(f"its note is a {type(progress.note).__name__}, not a string")
    note = cleaned_sentence(progress.note)
    return progress if note == progress.note else replace(progress, note=note)


def checked_outcome(returned: Any) -> Outcome:
    """Return why a search ended by itself, of which it need not say anything."""
    outcome = Outcome(returned or Outcome.CONVERGED)
    if outcome in _OF_THE_HOST:
        raise ValueError(f"it returned {outcome}, which only the host may say")
    return outcome


def check_map(partners: Any, problem: MatchProblem | JudgeProblem) -> None:
    """Refuse what is no object map that a problem allows.

    Raises
    ------
    TypeError, ValueError
        With a sentence that tells what a plugin did.
    """
    table = problem.table
    template, argument = table.template_objects, table.argument_objects
    if not (isinstance(partners, np.ndarray) and np.issubdtype(partners.dtype, np.integer)):
        raise TypeError(f"its object map is {quoted(partners)}, not an array of whole numbers")
    if partners.shape != (template,):
        raise ValueError(f"its object map has shape {partners.shape}, not ({template},)")
    if partners.min() < -1 or partners.max() >= argument:
        raise ValueError(f"its object map has a partner outside −1 … {argument - 1}")
    kept = np.flatnonzero(partners >= 0)
    if len(np.unique(partners[kept])) < len(kept):
        raise ValueError("its object map takes an object of the argument twice")
    partial = problem.price < math.inf if isinstance(problem, JudgeProblem) else problem.partial
    fewest = min(FEWEST, template) if partial else template
    if len(kept) < fewest:
        raise ValueError(f"its object map matches {len(kept)} objects, fewer than {fewest}")
    if problem.allowed is not None and not problem.allowed[kept, partners[kept]].all():
        raise ValueError("its object map has a pairing that is ruled out")
    if problem.pinned is not None and breaks_pins(partners, problem.pinned):
        raise ValueError("its object map leaves out a pairing that is known")


def check_scene(scene: Any) -> None:
    """Refuse a scene that is not made as :meth:`~sketchmatch.model.SceneObject.from_rings` does.

    Raises
    ------
    TypeError, ValueError
        With a sentence that tells what a plugin did.
    """
    if not isinstance(scene, Scene):
        raise TypeError(f"it found a {type(scene).__name__}, not a Scene")
    if not isinstance(scene.objects, tuple):
        raise TypeError(f"its objects are a {type(scene.objects).__name__}, not a tuple")
    for k, item in enumerate(scene.objects):
        if not isinstance(item, SceneObject):
            raise TypeError(f"its objects[{k}] is a {type(item).__name__}, not a SceneObject")
        try:
            made = SceneObject.from_rings(item.rings)
        except InvalidInputError as error:
            raise ValueError(f"its {error.within(f'objects[{k}]')}") from None
        for j, (ring, sound) in enumerate(zip(item.rings, made.rings, strict=True)):
            if fault := _fault_of_ring(ring, sound):
                place = f"its objects[{k}].rings[{j}]"
                raise ValueError(f"{place} {fault}; SceneObject.from_rings makes it right")


def _fault_of_ring(ring: Any, sound: FloatArray) -> str:
    """Say how a ring differs from what it should be; empty if it does not."""
    if not isinstance(ring, np.ndarray):
        return f"is a {type(ring).__name__}, not an array"
    if ring.dtype != np.float64:
        return f"is of {ring.dtype}, not float64"
    if len(ring) != len(sound):
        return "has a point twice in a row"
    return "" if np.array_equal(ring, sound) else "goes the wrong way round"


def breaks_pins(partners: IntArray, pinned: IntArray) -> bool:
    """Whether a map of the whole template gives an object another partner than the known one."""
    return bool(((pinned >= 0) & (partners != pinned)).any())


def _check_legal(fmap: Any, table: RelationTable) -> None:
    if not isinstance(fmap, Fmap):
        raise TypeError(f"it yielded a {type(fmap).__name__}, not an Fmap")
    entries = fmap.entries
    if entries.shape != (table.template_pairs,):
        raise ValueError(f"its FMAP has shape {entries.shape}, not ({table.template_pairs},)")
    if entries.min() < 0 or entries.max() >= 2 * table.argument_pairs:
        raise ValueError(f"its FMAP has an entry outside 0 … {2 * table.argument_pairs - 1}")
    if np.bincount(entries % table.argument_pairs).max() > 1:
        raise ValueError("its FMAP takes a pair of objects twice, or a pair and its dual")


def _check_confidence(
    progress: SearchProgress, problem: MatchProblem, former: SearchProgress | None
) -> None:
    claimed = progress.confidence
    if former is not None and progress.fmap is former.fmap and claimed == former.confidence:
        return
    # numba loads with it, and what only reads the configuration does without.
    from sketchmatch.pipeline.correspond import fmap_confidence

    confidence = fmap_confidence(progress.fmap, problem.table, problem.weights).total
    if not abs(claimed - confidence) <= _DOUBT:  # nor NaN
        raise ValueError(f"it says that its FMAP has ζ {claimed:g}, but that has {confidence:g}")
    if former is not None and claimed < former.confidence - _DOUBT:
        raise ValueError(f"its ζ fell from {former.confidence:g} to {claimed:g}")


@contextmanager
def inspecting(
    algorithm: Algorithm, registry: Registry, value: RelationTable | Scene | Source | JudgeProblem
) -> Iterator[None]:
    """Blame an algorithm if its input, read-only as it is, changes within the block.

    The engine's own are held to it by their tests: in a sketch in progress looking would take
    longer than finding objects does.
    """
    if registry.is_own(algorithm):
        yield
        return
    before = dict(_checksums(value))
    yield
    with blaming(algorithm, registry):
        after = dict(_checksums(value))
        changed = [name for name, checksum in before.items() if after.get(name) != checksum]
        if changed:
            raise ValueError(f"it changed its input: {', '.join(changed[:3])}")


def _checksums(value: Any, name: str = "") -> Iterator[tuple[str, int]]:
    """Yield a checksum for each array within a value, by its path."""
    if isinstance(value, np.ndarray):
        yield name, _checksum(value)
    elif isinstance(value, tuple):
        for index, item in enumerate(value):
            yield from _checksums(item, f"{name}[{index}]")
    elif is_dataclass(value):
        for field, item in vars(value).items():
            yield from _checksums(item, f"{name}.{field}" if name else field)


def _checksum(array: NDArray[Any]) -> int:
    """Return a number that changes with almost any change: as fast as memory, for large tables."""
    if array.nbytes <= _SMALL:
        return hash(array.tobytes())
    octets = np.ascontiguousarray(array).reshape(-1).view(np.uint8)
    whole = len(octets) - len(octets) % _ROW
    sums = octets[:whole].view(np.uint64).reshape(-1, _ROW // 8).sum(axis=0, dtype=np.uint64)
    return hash((sums.tobytes(), octets[whole:].tobytes()))
