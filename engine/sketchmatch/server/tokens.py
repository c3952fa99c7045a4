"""Bearer tokens: whoever shows one is the caller of its name.

A file holds a line for each, ``NAME:sha256:SALT:HASH`` in hexadecimal digits, of which no token can
be made. Tokens are made here alone, of 256 random bits: nobody guesses one, however fast the hash.
"""

from __future__ import annotations

import hashlib
import hmac
import re
import secrets
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from sketchmatch.errors import InvalidInputError, Reason, quoted
from sketchmatch.server.watched import content_of

__all__ = ["KnownToken", "Tokens", "check_name", "new_token", "parse_tokens", "read_tokens"]

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._@-]{0,63}")
_LINE = re.compile(rf"({_NAME.pattern}):sha256:([0-9a-f]{{32}}):([0-9a-f]{{64}})")
_SALT_BYTES, _SECRET_BYTES = 16, 32


@dataclass(frozen=True)
class KnownToken:
    """What is kept of a token.

    Attributes
    ----------
    name
        Of the caller whose it is.
    salt, digest
        The token's hash, and what was hashed with it.
    """

    name: str
    salt: bytes
    digest: bytes

    @property
    def line(self) -> str:
        """The line of a file."""
        return f"{self.name}:sha256:{self.salt.hex()}:{self.digest.hex()}"

    def fits(self, token: str) -> bool:
        """Whether a token is this one; it takes the same time whatever the token is."""
        return hmac.compare_digest(_digest(self.salt, token), self.digest)


_NOBODYS = KnownToken("", bytes(_SALT_BYTES), bytes(hashlib.sha256().digest_size))


class Tokens:
    """The tokens that a server knows."""

    def __init__(self, known: Iterable[KnownToken]) -> None:
        by_name: dict[str, list[KnownToken]] = {}
        for token in known:
            by_name.setdefault(token.name, []).append(token)
        self._by_name: Mapping[str, list[KnownToken]] = by_name

    def __len__(self) -> int:
        return sum(map(len, self._by_name.values()))

    def caller_of(self, token: str) -> str:
        """Return the name of the caller who shows a token; empty if it is nobody's."""
        name = token.rpartition(".")[0]
        # Who has no token takes as long as who has one.
        fitting = [known.fits(token) for known in self._by_name.get(name, (_NOBODYS,))]
        return name if any(fitting) else ""


def new_token(name: str) -> tuple[str, KnownToken]:
    """Return a token for a caller, to be shown once, and what is to be kept of it.

    Raises
    ------
    InvalidInputError
        If the name is none.

    Examples
    --------
    >>> token, known = new_token("robot-7")
    >>> token.startswith("robot-7."), known.fits(token), known.fits(token + "x")
    (True, True, False)
    """
    token = f"{check_name(name)}.{secrets.token_urlsafe(_SECRET_BYTES)}"
    salt = secrets.token_bytes(_SALT_BYTES)
    return token, KnownToken(name, salt, _digest(salt, token))


def check_name(name: str) -> str:
    """Return a caller's name.

    Raises
    ------
    InvalidInputError
        If it is none.
    """
    if not _NAME.fullmatch(name):
        allowed = "up to 64 letters, digits and . _ @ - as in robot-7"
        problem = f"cannot be the name of a caller; use {allowed}"
        raise InvalidInputError(Reason.INVALID_FIELD, quoted(name), problem)
    return name


def parse_tokens(text: str, place: str) -> list[KnownToken]:
    """Read the lines of a file of tokens; empty ones and those that begin with # are skipped.

    Parameters
    ----------
    text
        The lines.
    place
        What errors call the file.

    Raises
    ------
    InvalidInputError
        If a line has another form. What stands there is not told: it may be a token.
    """
    found = []
    for number, line in enumerate(text.splitlines(), 1):
        stripped = line.strip()
        if not stripped or stripped.startswith("#"):
            continue
        parts = _LINE.fullmatch(stripped)
        if parts is None:
            problem = (
                "is not of the form NAME:sha256:SALT:HASH; add tokens with "
                "`sketchmatch tokens add NAME`"
            )
            raise InvalidInputError(Reason.INVALID_FILE, f"{place}, line {number},", problem)
        found.append(KnownToken(parts[1], bytes.fromhex(parts[2]), bytes.fromhex(parts[3])))
    return found


def read_tokens(path: Path) -> Tokens:
    """Return the tokens of a file.

    Raises
    ------
    InvalidInputError
        If it cannot be read, or a line has another form.
    """
    data = content_of(path, "the file of tokens", "server.tokens")
    return Tokens(parse_tokens(data.decode("utf-8", "replace"), str(path)))


def _digest(salt: bytes, token: str) -> bytes:
    return hmac.digest(salt, token.encode("utf-8", "surrogateescape"), "sha256")
