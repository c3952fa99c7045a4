"""What an operator is told of a fault: of a plugin's, where it is in the plugin."""

from __future__ import annotations

import traceback
from pathlib import Path

import sketchmatch
from sketchmatch.errors import PluginError

__all__ = ["told"]

_OURS = str(Path(sketchmatch.__file__).parent)


def told(error: BaseException) -> str:
    """Return an error with what helps to find it, for a log.

    Of an error that nobody foresaw that is the whole traceback. Of a plugin's it is the sentence
    and the lines from the first that is the plugin's on: how we came there helps nobody.
    """
    if not isinstance(error, PluginError):
        return "".join(traceback.format_exception(error)).rstrip()
    notes: list[str] = getattr(error, "__notes__", [])
    return "\n".join([str(error), *(notes or _lines(error))])


def _lines(error: PluginError) -> list[str]:
    """Return the lines of a plugin's that led to an error; none if it was found from outside."""
    if error.__cause__ is None:
        return []
    frames = traceback.extract_tb(error.__cause__.__traceback__)
    while frames and frames[0].filename.startswith(_OURS):
        del frames[0]
    return "".join(traceback.format_list(frames)).splitlines()
