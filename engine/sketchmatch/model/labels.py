"""Names for people, made fit to be shown anywhere: in a table, on a terminal, in a message."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Sequence
from functools import cache
from numbers import Number
from typing import Any

import numpy as np

from sketchmatch.errors import InvalidInputError, Reason, quoted
from sketchmatch.model.arrays import IntArray, sealed

__all__ = [
    "Synonyms",
    "cleaned_label",
    "cleaned_sentence",
    "cleaned_sentences",
    "compare_labels",
    "folded",
    "label_from",
]

Synonyms = Sequence[Sequence[str]]
"""Groups of words for the same thing."""

# A terminal would obey these: ESC [ … letter, ESC ] … BEL or ESC \, and ESC with one character.
_ESCAPES = re.compile(
    r"(?:\x1b\[|\x9b)[0-?]*[ -/]*[@-~]"
    r"|(?:\x1b[\]P^_X]|[\x9d\x90\x9e\x9f\x98])[^\x07\x1b\x90\x98\x9c-\x9f]*(?:\x07|\x1b\\|\x9c)"
    r"|\x1b[ -/]*[0-~]"
)
# Controls, and what is invisible and steers the text around it.
_UNSEEN = ("Cc", "Cf")
# Invisible, and yet part of words and of single pictures: joiners, and the tags in some flags.
_KEPT = frozenset("\u200c\u200d") | frozenset(map(chr, range(0xE0020, 0xE0080)))

_LONGEST, _MOST = 1000, 1000
"""Characters of a sentence, and sentences of a scene, that somebody may still read."""

# Numbers of one or two digits count things; longer ones name them, as in "room 101".
_COUNT = re.compile(r"(?<!\d)\d{1,2}$")
_GAPS = re.compile(r"[\s_#().,:;/-]+")
_IRREGULAR = {
    "children": "child",
    "feet": "foot",
    "men": "man",
    "mice": "mouse",
    "people": "person",
    "teeth": "tooth",
    "women": "woman",
}
# What a plural ends with, and what the singular may end with in its place.
_PLURALS = (
    ("ies", ("y", "ie")),
    ("ves", ("f", "fe", "ve")),
    ("ses", ("s", "se")),
    ("zes", ("z", "ze")),
    ("xes", ("x", "xe")),
    ("ches", ("ch", "che")),
    ("shes", ("sh", "she")),
    ("oes", ("o", "oe")),
    ("ss", ()),
    ("s", ("",)),
)


def cleaned_label(label: Any) -> str:
    r"""Return a name in one line: no escape sequences, controls or direction marks.

    Line breaks, tabs and runs of blanks become one blank, what UTF-8 cannot hold becomes U+FFFD.
    What is no text is written as text; None is no name.

    Examples
    --------
    >>> cleaned_label("desk\tleft\nside \x1b[31mred\x1b[0m")
    'desk left side red'
    >>> cleaned_label("\ud800sofa") == "\N{REPLACEMENT CHARACTER}sofa"
    True
    """
    text = label if isinstance(label, str) else "" if label is None else str(label)
    if text.isascii() and text.isprintable() and "  " not in text:
        return text.strip()
    text = text.encode("utf-16-le", "surrogatepass").decode("utf-16-le", "replace")
    text = _ESCAPES.sub("", text)
    shown = (c for c in text if c.isspace() or c in _KEPT or unicodedata.category(c) not in _UNSEEN)
    return " ".join("".join(shown).split())


def cleaned_sentence(text: str, longest: int = _LONGEST) -> str:
    r"""Return a sentence as :func:`cleaned_label` does a name, cut short where it is long.

    Examples
    --------
    >>> cleaned_sentence("two\nlines", 9), cleaned_sentence("x" * 10_000_000, 5)
    ('two lines', 'xxxxx…')
    """
    start = text[: 2 * longest]  # cleaning takes long where a text does
    cleaned = cleaned_label(start)
    if len(cleaned) <= longest and len(start) == len(text):
        return cleaned
    return f"{cleaned[:longest]}…"


def cleaned_sentences(texts: Sequence[str]) -> tuple[str, ...]:
    """Return sentences, each as :func:`cleaned_sentence` does; of very many the first thousand.

    Examples
    --------
    >>> cleaned_sentences(["A dot is left out."] * 300_000)[-1]
    '299000 more notes are left out.'
    """
    told = tuple(map(cleaned_sentence, texts[:_MOST]))
    more = len(texts) - len(told)
    return (*told, f"{more} more notes are left out.") if more else told


def label_from(given: Any) -> str:
    """Return what people give as a label as text: they number objects, from 0 or as ``True``.

    Raises
    ------
    InvalidInputError
        If it is neither text nor a number nor None.

    Examples
    --------
    >>> [label_from(given) for given in ("desk", 0, True, None, float("nan"))]
    ['desk', '0', 'True', '', '']
    """
    if isinstance(given, Number | np.bool_):
        return str(given) if given == given else ""  # noqa: PLR0124 (nan, as in tables with gaps)
    if given is None or isinstance(given, str):
        return str(given or "")
    raise InvalidInputError(
        Reason.INVALID_FIELD, "label", f"is {quoted(given)}; give text or a number"
    )


def folded(label: str) -> str:
    """Return a label without case, and with accents in their one usual form.

    Examples
    --------
    >>> folded(" Old  DESK")
    'old desk'
    """
    return unicodedata.normalize("NFC", cleaned_label(label).casefold())


def compare_labels(
    template: Iterable[str], argument: Iterable[str], synonyms: Synonyms = ()
) -> IntArray | None:
    """Return whether labels mean the same.

    They do where they are equal but for case, English plurals and numbers that count, or where a
    group of synonyms holds both. Groups that share a label are one.

    Parameters
    ----------
    template, argument
        Of N and of N' objects; empty for one without a label.
    synonyms
        Groups of labels that mean the same.

    Returns
    -------
    ndarray
        int64, shape (N, N'): 1 where they mean the same, −1 where they do not, 0 where one is
        empty; None where a side has no labels at all.

    Examples
    --------
    >>> compare_labels(["Chair 2", "couch", ""], ["shelves", "chairs", "sofa"], [("couch", "sofa")])
    array([[-1,  1, -1],
           [-1, -1,  1],
           [ 0,  0,  0]])
    """
    given = list(template), list(argument)
    if not all(map(any, given)):
        return None  # as most sketches have it
    drawn, mapped = (list(map(_meaning, labels)) for labels in given)
    if not any(drawn) or not any(mapped):
        return None
    groups = _grouped([[_meaning(label) for label in group] for group in synonyms])

    @cache
    def group_of(label: str) -> int:
        """Return the number of the group that a label is in, −1 for none."""
        held = groups.get(_initials(label), ())
        return next((k for other, k in held if _alike(label, other)), -1)

    @cache
    def compared(one: str, other: str) -> int:
        if not one or not other:
            return 0
        same = _alike(one, other) or group_of(one) == group_of(other) != -1
        return 1 if same else -1

    found = [[compared(one, other) for other in mapped] for one in drawn]
    return sealed(np.array(found, dtype=np.int64))


def _meaning(label: str) -> str:
    """Return a label as it is compared: its words alone, without a number that counts."""
    text = folded(label)
    words = [word for word in _GAPS.split(text) if word]
    if words:
        words[-1] = _COUNT.sub("", words[-1])
    return " ".join(word for word in words if word) or text


def _grouped(groups: Sequence[list[str]]) -> dict[str, list[tuple[str, int]]]:
    """Return labels and their groups, by initials; groups that share a label have one number."""
    number = list(range(len(groups)))
    held: dict[str, list[tuple[str, int]]] = {}
    for k, group in enumerate(groups):
        for label in group:
            alike = held.setdefault(_initials(label), [])
            for joined in {number[j] for other, j in alike if _alike(label, other)}:
                number = [number[k] if each == joined else each for each in number]
            alike.append((label, k))
    return {key: [(label, number[k]) for label, k in alike] for key, alike in held.items()}


def _initials(label: str) -> str:
    """Return the first letters of a label's words, which no plural changes."""
    return "".join(word[0] for word in label.split())


def _alike(one: str, other: str) -> bool:
    """Whether two labels are equal but for plurals."""
    pairs = list(zip(one.split(), other.split(), strict=False))
    return len(one.split()) == len(other.split()) and all(
        a == b or a in _singulars(b) or b in _singulars(a) for a, b in pairs
    )


@cache
def _singulars(word: str) -> frozenset[str]:
    """Return what a word may be the plural of."""
    if word in _IRREGULAR:
        return frozenset((_IRREGULAR[word],))
    for ending, singular in _PLURALS:
        if word.endswith(ending) and len(word) > len(ending):
            stem = word.removesuffix(ending)
            return frozenset(stem + each for each in singular)
    return frozenset()
