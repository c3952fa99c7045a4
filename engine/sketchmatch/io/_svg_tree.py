"""The elements of an SVG document: their names, and how a person finds them in the file."""

from __future__ import annotations

from xml.etree import ElementTree

from sketchmatch.errors import InvalidInputError, Reason

__all__ = ["LONGEST_CAUSE", "invalid", "named_element", "tag_of"]

LONGEST_CAUSE = 100


def tag_of(element: ElementTree.Element) -> str:
    """Return an element's name without its namespace."""
    # Comments and processing instructions have a function for a tag.
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""


def named_element(element: ElementTree.Element) -> str:
    """Return an element as it stands in the file: its name and identity."""
    own = " ".join(element.get("id", "").split())[:LONGEST_CAUSE]
    name = f' id="{own}"' if own else ""
    return f"<{tag_of(element)[:LONGEST_CAUSE]}{name}>"


def invalid(field: str, problem: str) -> InvalidInputError:
    """Return what says that a file cannot be used."""
    return InvalidInputError(Reason.INVALID_FILE, field, problem)
