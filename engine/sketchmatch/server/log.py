"""How a server's log looks, and that nobody waits for whoever reads it."""

from __future__ import annotations

import logging
import queue
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["logging_to_standard_error"]

_MOST_WAITING = 10_000
_LAST_LINES_SECONDS = 1.0


@contextmanager
def logging_to_standard_error() -> Iterator[None]:
    """Write what is told for the operator, and a line for each call, until the end of the block.

    Lines begin with the time, in UTC, and how grave it is. A thread writes them: where nobody
    reads standard error, lines are lost, and calls go on.
    """
    handler, root, ours = _Handler(), logging.getLogger(), logging.getLogger("sketchmatch")
    root.addHandler(handler)
    before = ours.level
    ours.setLevel(logging.INFO)
    try:
        yield
    finally:
        ours.setLevel(before)
        root.removeHandler(handler)
        handler.close()


def _is_news(record: logging.LogRecord) -> bool:
    """Whether a record tells more than that a caller was gone before the answer, which gRPC tells.

    The line of the call tells it too, and no operator needs a traceback for it.
    """
    return not (record.name.startswith("grpc") and "ExecuteBatchError" in record.getMessage())


class _Formatter(logging.Formatter):
    converter = staticmethod(time.gmtime)
    default_time_format = "%Y-%m-%dT%H:%M:%S"
    default_msec_format = "%s.%03dZ"


class _Handler(logging.Handler):
    def __init__(self) -> None:
        super().__init__()
        self.setFormatter(_Formatter("%(asctime)s %(levelname)s %(message)s"))
        self.addFilter(_is_news)
        self._lines: queue.Queue[str | None] = queue.Queue(_MOST_WAITING)
        self._writer = threading.Thread(target=self._write, name="sketchmatch-log", daemon=True)
        self._writer.start()

    def emit(self, record: logging.LogRecord) -> None:
        self._put(f"{self.format(record)}\n")

    def close(self) -> None:
        self._put(None)
        self._writer.join(_LAST_LINES_SECONDS)
        super().close()

    def _put(self, line: str | None) -> None:
        try:
            self._lines.put_nowait(line)
        except queue.Full:
            return

    def _write(self) -> None:
        while (line := self._lines.get()) is not None:
            try:
                sys.stderr.write(line)
                sys.stderr.flush()
            except OSError:  # nobody is left to read
                return
