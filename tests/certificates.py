"""Certificates for tests, made by ``openssl`` in a few milliseconds each."""

import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

from tests.tools import require

_KEY = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes")
HERE = "DNS:localhost,IP:127.0.0.1"


@dataclass(frozen=True)
class Pair:
    """Files of a certificate and its private key."""

    certificate: Path
    key: Path

    def replace(self, other: "Pair") -> None:
        """Put another pair into the place of this one, as tools that renew certificates do."""
        for old, new in ((self.certificate, other.certificate), (self.key, other.key)):
            scratch = old.with_suffix(".new")
            shutil.copy(new, scratch)
            scratch.replace(old)


class Authority:
    """One that signs certificates."""

    def __init__(self, folder: Path, name: str) -> None:
        require(shutil.which("openssl"), "the program openssl")
        self._folder, self._name, self._count = folder, name, 0
        self.certificate, self._key = folder / f"{name}.pem", folder / f"{name}.key"
        _openssl(
            *("req", "-x509", *_KEY, "-days", "30", "-subj", f"/CN={name}"),
            *("-addext", "keyUsage=critical,keyCertSign,cRLSign"),
            *("-keyout", self._key, "-out", self.certificate),
        )

    def issue(self, name: str, *, days: int = 30, alternatives: str = HERE) -> Pair:
        """Sign a certificate for a name; with days below 0 it has expired."""
        self._count += 1
        stem = self._folder / f"{self._name}-{self._count}"
        pair = Pair(stem.with_suffix(".pem"), stem.with_suffix(".key"))
        request, extensions = stem.with_suffix(".csr"), stem.with_suffix(".ext")
        extensions.write_text(f"subjectAltName={alternatives}\n" if alternatives else "")
        _openssl("req", *_KEY, "-subj", f"/CN={name}", "-keyout", pair.key, "-out", request)
        _openssl(
            *("x509", "-req", "-in", request, "-out", pair.certificate, "-days", days),
            *("-CA", self.certificate, "-CAkey", self._key, "-CAcreateserial"),
            *("-extfile", extensions),
        )
        return pair


def _openssl(*arguments) -> None:
    command = ["openssl", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
