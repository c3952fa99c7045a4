"""How a map's YAML is read, and what is refused before any of it becomes a value."""

from __future__ import annotations

from typing import Any

import yaml

from sketchmatch.errors import InvalidInputError, Reason

__all__ = ["LOADER", "check_header"]

LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""libyaml's where PyYAML has it: twenty times as fast."""
# A map's YAML has some hundred bytes, and PyYAML alone takes half a minute to read a megabyte.
_MOST_KIB = 64
# A map has one list in it; PyYAML alone takes minutes for ten thousand brackets.
_DEEPEST = 20
_REMEDY = "give the file that map_server saved"
# A few are harmless; with thirty a line grows to a gigabyte.
_MOST_ALIASES = 10


def check_header(text: str) -> None:
    """Refuse YAML that is too large or deep, repeats itself without end, or has types of its own.

    Raises
    ------
    InvalidInputError
        If it is or does so; what is no YAML at all passes, for its reader to say where.
    """
    size = len(text.encode("utf-8", "replace"))
    if size > 1024 * _MOST_KIB:
        raise InvalidInputError(
            Reason.LIMIT_EXCEEDED,
            "",
            f"has {size} bytes, more than the limit of {_MOST_KIB} KiB for a map's YAML; {_REMEDY}",
        )
    aliases, depth = 0, 0
    try:
        for event in yaml.parse(text, LOADER):
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if depth > _DEEPEST:
                raise _refused(f"has lists in lists, more than {_DEEPEST} deep; {_REMEDY}")
            aliases += isinstance(event, yaml.AliasEvent)
            if aliases > _MOST_ALIASES:
                raise _refused(f"has more than {_MOST_ALIASES} aliases; write out what they repeat")
            if getattr(event, "tag", None) not in (None, "!"):
                raise _refused("has types written with '!'; give plain values")
    except (yaml.YAMLError, RecursionError):
        return
    except InvalidInputError:
        raise
    except Exception:  # the parser stumbles over some characters
        raise _refused(f"is not YAML; {_REMEDY}") from None


def _refused(problem: str) -> InvalidInputError:
    return InvalidInputError(Reason.INVALID_GRID, "", problem)
