"""TLS: certificates from files, read again when these change; no call under way notices."""

from __future__ import annotations

import ssl
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import grpc

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.server.watched import Watched, content_of

__all__ = ["Pems", "TlsFiles", "newest_context", "server_credentials", "watched_pems"]

_OLDEST = ssl.TLSVersion.TLSv1_2


@dataclass(frozen=True)
class TlsFiles:
    """What a server shows, and whom it asks to show what.

    Attributes
    ----------
    certificate
        PEM file of the server's certificate, and of those between it and the authority's.
    key
        PEM file of its private key.
    client_ca
        PEM file of the authorities of clients: each client must show a certificate of one of them.
        None: clients show none.
    """

    certificate: Path
    key: Path
    client_ca: Path | None = None


@dataclass(frozen=True, repr=False)
class Pems:
    """What is in such files, and the same as Python takes it."""

    certificate: bytes
    key: bytes
    client_ca: bytes | None
    context: ssl.SSLContext

    @property
    def expires(self) -> datetime | None:
        """When the server's certificate does; None where that cannot be read."""
        try:
            return _not_after(ssl.PEM_cert_to_DER_cert(_first_block(self.certificate)))
        except (ValueError, IndexError, StopIteration):
            return None

    @property
    def validity(self) -> str:
        """Until when it is good, for people."""
        expires = self.expires
        if expires is None:
            return "it cannot be told until when the server's certificate is valid"
        if expires < datetime.now(UTC):
            problem = f"the server's certificate expired on {expires:%Y-%m-%d}"
            return f"{problem}, so no client trusts it; renew it"
        return f"the server's certificate is valid until {expires:%Y-%m-%d}"

    @property
    def configuration(self) -> grpc.ServerCertificateConfiguration:
        """The same as gRPC takes it."""
        return grpc.ssl_server_certificate_configuration(
            [(self.key, self.certificate)], self.client_ca
        )


def watched_pems(files: TlsFiles, say: Callable[[str], None]) -> Watched[Pems]:
    """Return what is in the files, whenever they change, and say until when that is good.

    Raises
    ------
    InvalidInputError
        If a file cannot be used.
    """
    paths = [files.certificate, files.key, *([files.client_ca] if files.client_ca else [])]
    pems = Watched("the certificates", paths, lambda: _read(files), say, lambda pems: pems.validity)
    say(pems.value.validity)
    return pems


def server_credentials(pems: Watched[Pems]) -> grpc.ServerCredentials:
    """Return credentials of which each handshake takes the newest."""
    shown = pems.value

    def newest() -> grpc.ServerCertificateConfiguration | None:
        nonlocal shown
        found = pems.value
        if found is shown:
            return None  # gRPC goes on with what it has, though its types do not know
        shown = found
        return found.configuration

    mutual = shown.client_ca is not None
    return grpc.dynamic_ssl_server_credentials(
        shown.configuration,
        newest,  # type: ignore[arg-type]
        require_client_authentication=mutual,
    )


def newest_context(pems: Watched[Pems]) -> ssl.SSLContext:
    """Return a context of which each handshake takes the newest in its place."""

    def newest(connection: ssl.SSLSocket | ssl.SSLObject, *_: object) -> None:
        connection.context = pems.value.context

    first = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    first.minimum_version, first.verify_mode = _OLDEST, pems.value.context.verify_mode
    first.sni_callback = newest  # whether or not the client gives a name
    # Who resumes a session is shown no certificate, and shows none, though others hold by now.
    first.num_tickets, first.options = 0, first.options | ssl.OP_NO_TICKET
    return first


def _read(files: TlsFiles) -> Pems:
    found = _contents(files)
    context = _context(files)
    if _contents(files) != found:  # they were replaced meanwhile, and what was checked is another
        return _read(files)
    return Pems(*found, context)


def _contents(files: TlsFiles) -> tuple[bytes, bytes, bytes | None]:
    certificate = content_of(files.certificate, "the certificate", "server.tls_certificate")
    key = content_of(files.key, "the private key", "server.tls_key")
    authorities = None
    if files.client_ca is not None:
        authorities = content_of(
            files.client_ca, "the authorities of clients", "server.tls_client_ca"
        )
    return certificate, key, authorities


def _context(files: TlsFiles) -> ssl.SSLContext:
    """Return a context, or refuse files that gRPC would not take, and say no more than that."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = _OLDEST
    try:
        context.load_cert_chain(files.certificate, files.key, password=_refuse_password)
    except ssl.SSLError as error:
        if error.reason == "KEY_VALUES_MISMATCH":
            problem = f"is not the key of the certificate in {files.certificate}; give that key"
            raise InvalidInputError(Reason.INVALID_FILE, str(files.key), problem) from None
        problem = (
            f"and {files.key} are not a certificate and a private key in PEM; "
            "give files that begin with -----BEGIN"
        )
        raise InvalidInputError(Reason.INVALID_FILE, str(files.certificate), problem) from None
    except _EncryptedError:
        problem = "is encrypted; give a key without a passphrase, which only the server may read"
        raise InvalidInputError(Reason.INVALID_FILE, str(files.key), problem) from None
    if files.client_ca is not None:
        try:
            context.load_verify_locations(files.client_ca)
        except ssl.SSLError:
            problem = "has no certificate in PEM; give those of the authorities of clients"
            raise InvalidInputError(Reason.INVALID_FILE, str(files.client_ca), problem) from None
        context.verify_mode = ssl.CERT_REQUIRED
    return context


def _first_block(pem: bytes) -> str:
    """Return the first certificate in PEM: the server's own, before those of authorities."""
    text = pem.decode("ascii", "replace")
    begin = text.index(ssl.PEM_HEADER)
    return text[begin : text.index(ssl.PEM_FOOTER, begin) + len(ssl.PEM_FOOTER)]


def _not_after(der: bytes) -> datetime:
    """Return until when a certificate is good (RFC 5280, 4.1): Python's own ssl does not tell."""
    _, certificate = next(_fields(der))
    _, signed = next(_fields(certificate))
    fields = [field for field in _fields(signed) if field[0] != _VERSION]
    validity = fields[3][1]  # after serial number, algorithm and issuer
    _, (kind, text) = _fields(validity)
    form = "%y%m%d%H%M%SZ" if kind == _UTC_TIME else "%Y%m%d%H%M%SZ"
    return datetime.strptime(text.decode("ascii"), form).replace(tzinfo=UTC)


_VERSION, _UTC_TIME = 0xA0, 0x17


def _fields(der: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield the tag and the content of each field of a DER sequence."""
    at = 0
    while at < len(der):
        tag, size, at = der[at], der[at + 1], at + 2
        if size >= 0x80:
            digits = size - 0x80
            size, at = int.from_bytes(der[at : at + digits]), at + digits
        yield tag, der[at : at + size]
        at += size


class _EncryptedError(Exception):
    """A key wants a passphrase."""


def _refuse_password() -> str:
    raise _EncryptedError
