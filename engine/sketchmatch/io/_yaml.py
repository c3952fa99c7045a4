"""What is refused of a map's YAML before any of it becomes a value."""

from __future__ import annotations

import yaml

from sketchmatch.errors import InvalidInputError, Reason

__all__ = ["check_header"]

# A map's YAML has some hundred bytes, and reading a megabyte of it takes half a minute.
_MOST_KIB = 64
# A few are harmless; with thirty a line grows to a gigabyte.
_MOST_ALIASES = 10


def check_header(text: str) -> None:
    """Refuse YAML that is too large, repeats itself without end, or asks for types of its own.

    Raises
    ------
    InvalidInputError
        If it does; what is no YAML at all passes, for its reader to say where.
    """
    size = len(text.encode("utf-8", "replace"))
    if size > 1024 * _MOST_KIB:
        raise InvalidInputError(
            Reason.LIMIT_EXCEEDED,
            "",
            f"has {size} bytes, more than the limit of {_MOST_KIB} KiB for a map's YAML; give the "
            "file that map_server saved",
        )
    aliases = 0
    try:
        for event in yaml.parse(text, yaml.SafeLoader):
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
        raise _refused("is not YAML; give the file that map_server saved") from None


def _refused(problem: str) -> InvalidInputError:
    return InvalidInputError(Reason.INVALID_GRID, "", problem)
