"""What the caller knows of single objects, read for two scenes: pins, and labels."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from numbers import Integral
from typing import Any, NoReturn

import numpy as np

from sketchmatch.api import Searcher
from sketchmatch.errors import InvalidInputError, Reason, quoted
from sketchmatch.model import BoolArray, FloatArray, IntArray, Scene
from sketchmatch.model.arrays import sealed
from sketchmatch.model.labels import Synonyms, compare_labels, folded
from sketchmatch.pipeline.guard import FEWEST

__all__ = [
    "Knowledge",
    "Pin",
    "check_pins",
    "check_pins_obeyed",
    "check_synonyms",
    "knowledge",
    "matching",
]

_MOST_SYNONYMS = 500
_LABELS_LISTED = 8


@dataclass(frozen=True)
class Pin:
    """What the caller knows of a sketched object.

    Attributes
    ----------
    sketch
        The sketched object: its index, from 0, or its label, if it is unique.
    map
        The mapped object, in the same way; None if the sketched one is not on the map.
    excluded
        Whether it is known *not* to be this one: any other may be its partner, or none.
    """

    sketch: int | str
    map: int | str | None
    excluded: bool = False


@dataclass(frozen=True, eq=False)
class Knowledge:
    """What is known of the objects of two scenes, from template to argument.

    Attributes
    ----------
    allowed, pinned, names
        As in :class:`~sketchmatch.api.MatchProblem`.
    """

    allowed: BoolArray | None = None
    pinned: IntArray | None = None
    names: IntArray | None = None


def check_synonyms(synonyms: Any) -> tuple[tuple[str, ...], ...]:
    """Return groups of labels that mean the same, if that is what they are."""
    groups = []
    for k, group in enumerate(_items("synonyms", synonyms, "groups of labels")):
        field = f"synonyms[{k}].labels"
        labels = tuple(_items(field, group, "labels"))
        if len(labels) < 2:
            _refuse(field, "are fewer than two; give at least two that mean the same")
        for label in labels:
            if not isinstance(label, str) or not folded(label):
                _refuse(field, f"hold {quoted(label)}; give labels that are not empty")
        groups.append(labels)
    if sum(map(len, groups)) > _MOST_SYNONYMS:
        raise InvalidInputError(
            Reason.LIMIT_EXCEEDED,
            "synonyms",
            f"hold more than {_MOST_SYNONYMS} labels in all; give only labels of these scenes",
        )
    return tuple(groups)


def check_pins(pins: Any) -> tuple[Pin, ...]:
    """Return pins, if that is what they are."""
    return tuple(
        _check_pin(pin, f"pins[{k}]") for k, pin in enumerate(_items("pins", pins, "pins"))
    )


def check_pins_obeyed(pins: Sequence[Pin], searcher: Searcher) -> None:
    """Refuse pins where the search maps pairs and knows of no objects."""
    if pins and not searcher.object_consistent:
        _refuse(
            "pins",
            f"need a searcher that finds one object map, which {searcher.name!r} as set here need "
            "not do; choose another, such as 'auto', or drop the pins",
        )


def knowledge(
    pins: Sequence[Pin],
    synonyms: Synonyms,
    scenes: tuple[Scene, Scene],
    swapped: bool,
    partial: bool,
) -> Knowledge:
    """Return what is known of the objects of a sketch and a map.

    Parameters
    ----------
    pins, synonyms
        As requested.
    scenes
        Sketch and map.
    swapped
        Whether the template is the map.
    partial
        Whether template objects may stay without partner.

    Raises
    ------
    InvalidInputError
        If a pin names no object or several, or pins contradict each other or leave no map.
    """
    sketch, map_ = scenes
    template, argument = (map_, sketch) if swapped else (sketch, map_)
    names = compare_labels(template.labels, argument.labels, synonyms)
    if not pins:
        return Knowledge(names=names)
    allowed, known = _read_pins(pins, sketch, map_)
    pinned = np.full(len(sketch), -1)
    pinned[list(known)] = list(known.values())
    if swapped:
        allowed = allowed.T.copy()
        pinned = np.full(len(map_), -1)
        pinned[list(known.values())] = list(known)
    _check_possible(pins, allowed, swapped, partial)
    return Knowledge(sealed(allowed), sealed(pinned), names)


def matching(allowed: BoolArray, preference: FloatArray | None = None) -> IntArray:
    """Return an object map that holds nothing ruled out and leaves as few objects out as possible.

    Parameters
    ----------
    allowed
        Shape (N, N').
    preference
        Shape (N, N'): of the partners that an object may take, the greatest comes first, and of
        the objects that with the greatest of all.

    Returns
    -------
    ndarray
        Shape (N,): −1 for an object that is left out.

    References
    ----------
    H. W. Kuhn, "The Hungarian method for the assignment problem", Naval Research Logistics
    Quarterly 2, 1955; here, augmenting paths alone.

    Examples
    --------
    Both like the first best, which the second alone must have:

    >>> matching(np.array([[True, True], [True, False]]), np.array([[2.0, 1.0], [2.0, 1.0]]))
    array([1, 0])
    """
    value = np.zeros(allowed.shape) if preference is None else preference
    choices = [
        row[np.argsort(-value[a, row], kind="stable")].tolist()
        for a, row in enumerate(map(np.flatnonzero, allowed))
    ]
    holders: dict[int, int] = {}

    def place(a: int, seen: set[int]) -> bool:
        # Each object on the way takes what the one after it holds; the last one what nobody does.
        way, taken = [(a, iter(choices[a]))], list[int]()
        while way:
            last, rest = way[-1]
            free = next((c for c in choices[last] if c not in holders), None)
            c = next((c for c in rest if c not in seen), None) if free is None else free
            if c is None:
                way.pop()
                taken = taken[:-1]
                continue
            taken.append(c)
            if free is not None:
                holders.update((c, a) for c, (a, _) in zip(taken, way, strict=True))
                return True
            seen.add(c)
            way.append((holders[c], iter(choices[holders[c]])))
        return False

    for a in np.argsort(-value.max(axis=1), kind="stable").tolist():
        place(a, set())
    partners = np.full(len(choices), -1)
    partners[list(holders.values())] = list(holders)
    return partners


def _check_pin(pin: Any, field: str) -> Pin:
    """Return a pin, if it is one."""
    if not isinstance(pin, Pin):
        _refuse(field, f"is {quoted(pin)}; give a Pin")
    _check_reference(pin.sketch, f"{field}.sketch_object")
    if pin.map is not None:
        _check_reference(pin.map, f"{field}.map_object")
    if not isinstance(pin.excluded, bool | np.bool_):
        _refuse(f"{field}.excluded", f"is {quoted(pin.excluded)}; give True or False")
    if pin.excluded and pin.map is None:
        raise InvalidInputError(
            Reason.MISSING_FIELD,
            f"{field}.map_object",
            "is not set, though the pin excludes one; name the mapped object that is excluded",
        )
    return pin


def _read_pins(pins: Sequence[Pin], sketch: Scene, map_: Scene) -> tuple[BoolArray, dict[int, int]]:
    """Return the pairings from sketch to map that are not ruled out, and those that are known."""
    known: dict[int, tuple[int, int | None]] = {}
    holders: dict[int, tuple[int, int]] = {}
    excluded: dict[tuple[int, int], int] = {}
    for k, pin in enumerate(pins):
        a = _found(pin.sketch, sketch, f"pins[{k}].sketch_object", "sketch")
        c = None if pin.map is None else _found(pin.map, map_, f"pins[{k}].map_object", "map")
        field = f"pins[{k}].map_object"
        if pin.excluded:
            assert c is not None
            excluded[a, c] = k
            continue
        if known.setdefault(a, (k, c))[1] != c:
            _refuse(
                field,
                f"contradicts pins[{known[a][0]}], which gives the same sketched object another "
                "partner or none; drop one of the two",
            )
        if c is not None and holders.setdefault(c, (k, a))[1] != a:
            _refuse(
                field,
                f"is the partner of another sketched object in pins[{holders[c][0]}]; "
                "drop one of the two",
            )
    allowed = np.ones((len(sketch), len(map_)), dtype=np.bool_)
    for (a, c), k in excluded.items():
        allowed[a, c] = False
        if a in known and known[a][1] == c:
            _refuse(
                f"pins[{k}].excluded",
                f"contradicts pins[{known[a][0]}], which gives the sketched object this partner; "
                "drop one of the two",
            )
    partners = {a: c for a, (_, c) in known.items() if c is not None}
    for a in known:
        allowed[a] = False
    for c in partners.values():
        allowed[:, c] = False
    for a, c in partners.items():
        allowed[a, c] = True
    return allowed, partners


def _check_possible(pins: Sequence[Pin], allowed: BoolArray, swapped: bool, partial: bool) -> None:
    """Refuse pins that leave no map; ``allowed`` is from template to argument."""
    objects = len(allowed)
    needed = min(FEWEST, objects) if partial else objects
    if np.count_nonzero(matching(allowed) >= 0) >= needed:
        return
    alone = [k for k, pin in enumerate(pins) if pin.map is None]
    if alone and not partial and not swapped:
        _refuse(
            f"pins[{alone[0]}].map_object",
            "says that the object is not on the map, but every object of the sketch must find a "
            "partner; allow unmatched objects or drop the pin",
        )
    if partial:
        _refuse(
            "pins",
            f"leave no object map in which {needed} objects have a partner, which is the least "
            "that an answer needs; drop some",
        )
    smaller = "map" if swapped else "sketch"
    _refuse(
        "pins",
        f"leave no object map in which every object of the {smaller} has a partner; drop some or "
        "allow unmatched objects",
    )


def _found(reference: int | str, scene: Scene, field: str, side: str) -> int:
    """Return the index of the object that an index or a label names."""
    if not isinstance(reference, str):
        if reference >= len(scene):
            _refuse(
                field, f"names an object beyond the {len(scene)} of the {side}; name one of these"
            )
        return int(reference)
    wanted = folded(reference)
    alike = [k for k, label in enumerate(scene.labels) if folded(label) == wanted]
    exact = [k for k in alike if scene.labels[k] == reference]
    for candidates in (exact, alike):
        if len(candidates) == 1:
            return candidates[0]
    if alike:
        _refuse(
            field,
            f"names {quoted(reference)}, the label of {len(alike)} objects of the {side}; "
            "give the number of the one that is meant",
        )
    return _refuse(field, f"names {quoted(reference)}, but {_labels_of(scene, side)}")


def _labels_of(scene: Scene, side: str) -> str:
    """Say what labels there are."""
    counts = Counter(label for label in scene.labels if label)
    if not counts:
        return f"no object of the {side} has a label; give its number"
    listed = ", ".join(quoted(label) for label in sorted(counts)[:_LABELS_LISTED])
    more = ", …" if len(counts) > _LABELS_LISTED else ""
    return f"the labels of the {side} are {listed}{more}; give one of these, or a number"


def _check_reference(given: Any, field: str) -> None:
    if isinstance(given, str):
        if not folded(given):
            _refuse(field, "is an empty label; give a label or the number of an object")
    elif isinstance(given, bool | np.bool_) or not isinstance(given, Integral):
        _refuse(field, f"is {quoted(given)}; give a label or the number of an object")
    elif given < 0:
        _refuse(field, f"is {quoted(given)}; objects are counted from 0")


def _items(field: str, given: Any, what: str) -> Iterable[Any]:
    if isinstance(given, str) or not isinstance(given, Iterable):
        _refuse(field, f"is {quoted(given)}; give {what}")
    return given


def _refuse(field: str, words: str) -> NoReturn:
    raise InvalidInputError(Reason.INVALID_FIELD, field, words)
