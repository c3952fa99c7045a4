"""Choosing one picture of a file with annotations of many."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from sketchmatch.api import InvalidInputError, Reason
from sketchmatch.api.documents import listed

__all__ = ["chosen_picture"]


def chosen_picture(names: Mapping[str, str], annotated: Collection[str], part: str) -> str:
    """Return the id of a picture: the one that is named, or else the only one with annotations.

    Parameters
    ----------
    names
        The name of each picture, by its id.
    annotated
        The ids of those with annotations.
    part
        A name or an id; empty for the only one.

    Raises
    ------
    InvalidInputError
        If there is no such picture, or there are several and none is named.
    """
    shown = {key: names[key] or key for key in names}
    if part:
        fits = [key for key, name in shown.items() if name == part or name.endswith(f"/{part}")]
        if len(fits) == 1 or part in names:
            return fits[0] if len(fits) == 1 else part
        problem = (
            f"has no picture {listed([part])}, or several of that name; choose one of "
            f"{listed(shown.values())}"
        )
        raise InvalidInputError(Reason.INVALID_FILE, "", problem)
    known = [key for key in shown if key in annotated]
    if len(known) > 1:
        pictures = listed(shown[key] for key in known)
        raise InvalidInputError(
            Reason.INVALID_FILE,
            "",
            f"has objects in {len(known)} pictures; choose one as in FILE#PICTURE: {pictures}",
        )
    return known[0] if known else ""
