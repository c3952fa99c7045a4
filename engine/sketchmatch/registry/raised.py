"""What a plugin raises, fit to be told: nothing of it is trusted, not even its text."""

from __future__ import annotations

from sketchmatch.errors import InvalidInputError, Reason, SketchmatchError
from sketchmatch.model.labels import cleaned_sentence

__all__ = ["passed_on", "words_of"]

_LONGEST = 200
_LONGEST_PROBLEM = 4000


def words_of(error: BaseException, longest: int = _LONGEST) -> str:
    r"""Return type and text of an exception in one line, cut short where it is long.

    Examples
    --------
    >>> words_of(ValueError("two\nlines"))
    'ValueError: two lines'
    """
    try:
        text = str(error)
    except Exception as failure:
        text = f"its __str__ raised {type(failure).__name__}"
    kind = type(error).__name__
    return cleaned_sentence(f"{kind}: {text}" if text else kind, longest)


def passed_on(error: BaseException) -> SketchmatchError | None:
    """Return what a plugin raises for its caller, or None for what is the plugin's own fault.

    Of an InvalidInputError that is reason, path and sentence alone, whatever class it is of.
    """
    if not isinstance(error, InvalidInputError):
        return error if isinstance(error, SketchmatchError) else None
    try:
        reason, told = Reason(error.reason), (error.field, error.problem)
    except (AttributeError, ValueError):
        return None
    if not all(isinstance(text, str) for text in told):
        return None
    field, problem = (cleaned_sentence(text, _LONGEST_PROBLEM) for text in told)
    if type(error) is InvalidInputError and told == (field, problem):
        return error
    return InvalidInputError(reason, field, problem)
