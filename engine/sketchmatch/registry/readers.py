"""Which reader reads a file, and what it is to blame for."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from sketchmatch.api.reader import Reader
from sketchmatch.errors import InvalidInputError, PluginError, Reason
from sketchmatch.registry.distributions import OWN_DISTRIBUTION
from sketchmatch.registry.raised import passed_on, words_of

__all__ = ["RegisteredReader", "reader_by_keys", "reader_by_name"]


@dataclass(frozen=True)
class RegisteredReader:
    """One reader and where it comes from."""

    reader: type[Reader]
    distribution: str
    version: str

    @property
    def name(self) -> str:
        """What lists call it."""
        return self.reader.name

    @property
    def origin(self) -> str:
        """What it is and where it comes from, to begin a sentence with."""
        return f"reader {self.name} of {self.distribution} {self.version}".rstrip()

    def read(self, data: bytes, part: str = "") -> Any:
        """Return the source that a file holds.

        Raises
        ------
        InvalidInputError
            If the file cannot be used.
        PluginError
            If the reader fails in another way, or returns something else than it says.
        """
        try:
            source = self.reader().read(data, part)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # a plugin may raise anything, and exit
            told = passed_on(error)
            if told is not None:
                raise told from None
            raise self._failure(words_of(error)) from error
        if not isinstance(source, self.reader.source):
            expected = self.reader.source.__name__
            raise self._failure(f"it returned a {type(source).__name__}, not a {expected}")
        return source

    def _failure(self, cause: str) -> PluginError:
        return PluginError(f"{self.origin} failed ({cause}); report it to its author")


def reader_by_name(readers: Iterable[RegisteredReader], name: str) -> RegisteredReader | None:
    """Return the reader of files of a name: the one whose suffix of it is the longest.

    Raises
    ------
    InvalidInputError
        If there are two of them.
    """
    lower = name.lower()
    fits: dict[int, list[RegisteredReader]] = {}
    for each in readers:
        length = max((len(s) for s in each.reader.suffixes if lower.endswith(s)), default=0)
        fits.setdefault(length, []).append(each)
    longest = max(fits, default=0)
    return _one_of(fits[longest], "is of a kind") if longest else None


def reader_by_keys(
    readers: Iterable[RegisteredReader], keys: Iterable[str]
) -> RegisteredReader | None:
    """Return the reader of JSON documents with these keys: the one that asks for most of them.

    Raises
    ------
    InvalidInputError
        If there are two of them.
    """
    present = set(keys)
    fits: dict[int, list[RegisteredReader]] = {}
    for each in readers:
        if each.reader.keys and present.issuperset(each.reader.keys):
            fits.setdefault(len(each.reader.keys), []).append(each)
    return _one_of(fits[max(fits)], "has keys") if fits else None


def _one_of(fits: Sequence[RegisteredReader], what: str) -> RegisteredReader:
    own = [each for each in fits if each.distribution == OWN_DISTRIBUTION]
    if len(own or fits) == 1:
        return (own or fits)[0]
    names = " and ".join(each.origin for each in fits)
    raise InvalidInputError(
        Reason.INVALID_FILE, "", f"{what} that {names} read; put one of them into plugins.deny"
    )
