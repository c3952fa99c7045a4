"""How a client gets in: encryption, certificates and tokens, from arguments or the environment."""

from __future__ import annotations

import os
import ssl
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn, TypedDict, cast

import grpc

from sketchmatch_client._channel import ChannelOptions, check_address, is_here
from sketchmatch_client.errors import InvalidRequestError

__all__ = ["Access", "AccessOptions", "Pem", "access_to"]

Pem = str | os.PathLike[str] | bytes
"""A file in PEM, or what is in it."""


class AccessOptions(TypedDict, total=False):
    """Access options of :class:`Client`; environment variables replace those not given.

    Attributes
    ----------
    token
        Sent with every call: it identifies the caller.
    token_file
        A file with the token, instead.
    tls
        Whether to encrypt; by default if there are certificates. True alone trusts the authorities
        that gRPC trusts.
    root_certificates
        Certificate authorities to trust instead of these.
    certificate, key
        Client certificate and its private key: they identify the caller.
    server_name
        The name in the server's certificate, if it is not in the address.
    """

    token: str | None
    token_file: str | os.PathLike[str] | None
    tls: bool | None
    root_certificates: Pem | None
    certificate: Pem | None
    key: Pem | None
    server_name: str | None


@dataclass(frozen=True)
class Access:
    """What a channel and its calls need to be let in."""

    credentials: grpc.ChannelCredentials | None = None
    options: ChannelOptions = ()
    metadata: tuple[tuple[str, str], ...] = field(default=(), repr=False)


_SWITCH = {"": None, "1": True, "true": True, "0": False, "false": False}
_PEMS = {"root_certificates": b" CERTIFICATE-----", "certificate": b" CERTIFICATE-----"}
_PEMS["key"] = b"PRIVATE KEY-----"


@dataclass(frozen=True)
class _Said:
    """Something that was said, and where: the name of an argument, or a variable."""

    name: str
    place: str
    value: str | os.PathLike[str] | bytes | bool

    def refuse(self, problem: str) -> NoReturn:
        raise InvalidRequestError(f"{self.place} {problem}", "INVALID_FIELD", self.place) from None

    def read(self) -> bytes:
        """Return what is in the file that was named."""
        path = cast("str | os.PathLike[str]", self.value)
        try:
            return Path(path).read_bytes()
        except (OSError, ValueError, TypeError) as error:
            why = (getattr(error, "strerror", None) or str(error)).lower()
            self.refuse(f"names {path}, which cannot be read ({why}); check the path")


def access_to(
    address: str, credentials: grpc.ChannelCredentials | None, options: AccessOptions
) -> Access:
    """Return how to get in at an address.

    Parameters
    ----------
    address
        Of the server.
    credentials
        Those of gRPC, in place of ours.
    options
        What the caller says; where they say nothing, the environment does.

    Raises
    ------
    InvalidRequestError
        If the address is none, a file cannot be read, parts contradict each other, or others
        could read the token.
    """
    if unknown := set(options) - set(AccessOptions.__annotations__):
        raise TypeError(f"{min(unknown)!r} is not an argument of a client")
    if credentials is None:
        credentials = _credentials(options)
    else:
        for name in ("tls", *_PEMS):
            if options.get(name) is not None:
                _Said(name, name, "").refuse("cannot be used with credentials; drop one of the two")
    check_address(address, credentials is not None)
    other = _said("server_name", options)
    named: ChannelOptions = (("grpc.ssl_target_name_override", other.value),) if other else ()
    said, token = _token(options)
    if said is None:
        return Access(credentials, named)
    if credentials is None and not is_here(address):
        said.refuse(
            f"would go to {address} without encryption, so others could read it; give the "
            "root_certificates of the server's authority, or switch on tls"
        )
    return Access(credentials, named, (("authorization", f"Bearer {token}"),))


def _credentials(options: AccessOptions) -> grpc.ChannelCredentials | None:
    """Return what encrypts, or None for no encryption."""
    tls = _tls(options)
    if tls is False:
        for name in _PEMS:
            if options.get(name) is not None:
                _Said(name, name, "").refuse("needs encryption; leave out tls=False")
        return None
    said = {name: _said(name, options) for name in _PEMS}
    roots, certificate, key = (_pem(item) for item in said.values())
    for name, other in (("certificate", "key"), ("key", "certificate")):
        if (item := said[name]) is not None and said[other] is None:
            item.refuse(f"is given without {other}; give both")
    if said["certificate"] and said["key"]:
        _check_pair(said["certificate"], said["key"])
    if tls or roots or certificate:
        return grpc.ssl_channel_credentials(roots, key, certificate)
    return None


def _check_pair(certificate: _Said, key: _Said) -> None:
    """Refuse the key of another certificate; of what is no file, gRPC tells in the first call."""
    if isinstance(certificate.value, bytes) or isinstance(key.value, bytes):
        return
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    first, second = cast("tuple[str, str]", (certificate.value, key.value))
    try:
        # An empty password is wrong, and nobody at the terminal is asked for another.
        context.load_cert_chain(first, second, password="")
    except ssl.SSLError:
        own = f"is not the key of {certificate.place}, or has a passphrase"
        key.refuse(f"{own}; give the key of that certificate, without a passphrase")


def _said(name: str, options: AccessOptions) -> _Said | None:
    """Return what was said, by argument or else by the environment."""
    given = options.get(name)
    if given is not None:
        return _Said(name, name, cast("Pem | bool", given)) if given != "" else None
    variable = f"SKETCHMATCH_{name.upper()}"
    text = os.environ.get(variable, "")
    return _Said(name, variable, text) if text else None


def _tls(options: AccessOptions) -> bool | None:
    said = _said("tls", options)
    if said is None or isinstance(said.value, bool):
        return cast("bool | None", said and said.value)
    text = cast("str", said.value).strip().lower()
    if text not in _SWITCH:
        said.refuse(f"is {text!r}; give 1 or 0")
    return _SWITCH[text]


def _token(options: AccessOptions) -> tuple[_Said | None, str]:
    """Return what was said of a token, if anything, and the token."""
    if options.get("token") is not None and options.get("token_file") is not None:
        _Said("token_file", "token_file", "").refuse(
            "cannot be used with token; drop one of the two"
        )
    here = options.get("token") is not None
    said = _said("token", options)
    if not here and (said is None or options.get("token_file") is not None):
        said = _said("token_file", options)
    if said is None:
        return None, ""
    text = said.read().decode("utf-8", "replace") if said.name == "token_file" else said.value
    token = text.strip() if isinstance(text, str) else ""
    # What it is instead is not told: it may be a secret all the same.
    if not token or not token.isascii() or not token.isprintable() or " " in token:
        said.refuse("is not a token; give what `sketchmatch tokens add` printed")
    return said, token


def _pem(said: _Said | None) -> bytes | None:
    """Return what is in a file, or was given as its content."""
    if said is None:
        return None
    data = said.value if isinstance(said.value, bytes) else said.read()
    if _PEMS[said.name] not in data:
        what = "private key, without a passphrase," if said.name == "key" else "certificate"
        said.refuse(f"holds no {what} in PEM; give a file that begins with -----BEGIN")
    return data
