"""What must hold of every file, however broken."""

import resource
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path

from sketchmatch.errors import InvalidInputError
from sketchmatch.io import read_source
from sketchmatch.io.files import decode_file
from sketchmatch.io.ros_bag import SUFFIXES
from sketchmatch.pipeline.segment import segment
from sketchmatch.pipeline.selection import Choice, resolve_segmenter
from sketchmatch.registry import default_registry
from tests.fuzz.mutations import TOKENS
from tests.pace import slowness

KINDS = tuple(TOKENS)
SEEDS = Path(__file__).parent / "seeds"
LONGEST_SECONDS = 2.0
MOST_BYTES = 1024**3
PICTURE = b"P5\n6 5\n255\n" + bytes([254] * 7 + [0, 0] + [254] * 9 + [205, 0] + [254] * 10)


class BrokenError(AssertionError):
    """A file that was neither read nor refused as it should be."""


def seeds(kind: str) -> list[bytes]:
    """Return the valid files of a kind that mutations begin with."""
    return [path.read_bytes() for path in sorted((SEEDS / kind).iterdir())]


def check(kind: str, data: bytes, folder: Path, *, segmenting: bool = True) -> bool:
    """Read a file, find its objects, and return whether there was anything in it.

    Raises
    ------
    BrokenError
        If it is neither read nor refused in one sentence, or takes too much time or memory.
    """
    path = folder / f"input.{kind}"
    path.write_bytes(data)
    if kind == "yaml" and not (folder / "room.pgm").exists():
        (folder / "room.pgm").write_bytes(PICTURE)
    began, held = time.thread_time(), _fresh_peak()
    stage = "reading"
    try:
        signal.setitimer(signal.ITIMER_REAL, 20.0)
        # A bag is read from its file as its owner may, and from bytes as those of strangers are.
        source = decode_file(path.name, data) if path.suffix in SUFFIXES else read_source(path)
        stage = "segmenting"
        if segmenting:
            segmenter = resolve_segmenter(default_registry(), Choice(), source)
            segment(source, segmenter, default_registry(), f"source.{source.field}")
        return True
    except InvalidInputError as error:
        _check_sentence(stage, str(error))
        return False
    except (KeyboardInterrupt, BrokenError):
        raise
    except BaseException as error:
        raise BrokenError(f"{stage} raised {type(error).__name__}: {str(error)[:300]}") from error
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        took, most = time.thread_time() - began, peak_bytes() - held
        if sys.exc_info()[0] in (None, InvalidInputError):
            if took > LONGEST_SECONDS and took > LONGEST_SECONDS * slowness():
                raise BrokenError(f"{stage} took {took:.1f} s")
            if most > MOST_BYTES:
                raise BrokenError(f"{stage} took {most / 2**20:.0f} MiB")


def peak_bytes() -> int:
    """Return the most memory that this process has held, or since the peak was made a fresh one."""
    try:
        status = Path("/proc/self/status").read_text(encoding="ascii")
        return 1024 * int(status.partition("VmHWM:")[2].split()[0])
    except (OSError, IndexError):
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def _fresh_peak() -> int:
    """Forget the memory held at the most so far, where the system can, and return what is held."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    return peak_bytes()


def _check_sentence(stage: str, sentence: str) -> None:
    if "\n" in sentence or not sentence.strip() or len(sentence) > 1000 or "; " not in sentence:
        raise BrokenError(
            f"{stage} is refused in more or less than one sentence: {sentence[:2000]!r}"
        )
