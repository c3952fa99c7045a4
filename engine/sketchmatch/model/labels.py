"""Names for people, made fit to be shown anywhere: in a table, on a terminal, in a message."""

from __future__ import annotations

import re
import unicodedata
from numbers import Number
from typing import Any

import numpy as np

from sketchmatch.errors import InvalidInputError, Reason, quoted

__all__ = ["cleaned_label", "label_from"]

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
        Reason.INVALID_FIELD, "label", f"is {quoted(given)}, which is no name; give text"
    )
