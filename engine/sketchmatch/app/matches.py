"""The matches that are known: those that are done, and what came of the others."""

from __future__ import annotations

import asyncio
import base64
import binascii
import struct
from collections import OrderedDict
from dataclasses import replace
from typing import TypeVar

from sketchmatch.app.archive import Archive
from sketchmatch.app.orders import Wish
from sketchmatch.app.tasks import Record, State, Task
from sketchmatch.errors import (
    InvalidInputError,
    MatchCancelledError,
    NotFoundError,
    Reason,
    StoreError,
    quoted,
)

__all__ = ["Matches"]

_MOST_RECENT = 1000
_MOST_RECENT_BYTES = 32 * 1024 * 1024
_MOST_LISTED, _LISTED = 1000, 50
_TOKEN = struct.Struct("!d")
_Result = TypeVar("_Result")


class Matches:
    """All matches of a server, each of which exists for its own caller alone.

    The latest that have ended are in memory, all of them where they are kept at all. It belongs
    into the application's event loop.

    Parameters
    ----------
    archive
        Where they are kept; None for nowhere.
    """

    def __init__(self, archive: Archive | None) -> None:
        self._archive = archive
        self._live: dict[str, Task] = {}
        self._recent: OrderedDict[str, Record] = OrderedDict()
        self._recent_bytes = 0
        self._named: dict[tuple[str, str], str] = {}

    def begin(self, task: Task) -> None:
        """Know a match from now on."""
        self._forget(task.id)
        self._live[task.id] = task
        if task.wish.request_id:
            self._named[task.caller.name, task.wish.request_id] = task.id
        self.changed(task)

    def changed(self, task: Task) -> None:
        """Have a match kept as it is now; other tasks are not kept."""
        if self._archive is not None and task.id in self._live:
            self._archive.keep(task, task.id)

    def end(self, task: Task) -> None:
        """Hear that a match has ended."""
        if self._live.pop(task.id, None) is None:
            return
        self._remember(task.record())

    def cancelled(self, record: Record, error: MatchCancelledError) -> Record:
        """Return what becomes of a match that has ended when it is cancelled.

        One that was interrupted is not done again then.
        """
        if record.state is not State.INTERRUPTED:
            return record
        cancelled = replace(record, state=State.CANCELLED, error=error)
        self._forget(record.id)
        self._remember(cancelled)
        return cancelled

    def _remember(self, record: Record) -> None:
        """Keep a match that has ended."""
        self._recent[record.id] = record
        self._recent_bytes += record.size
        if record.wish.request_id:
            self._named[record.caller, record.wish.request_id] = record.id
        if self._archive is not None:
            self._archive.keep(record, record.id)
        while len(self._recent) > _MOST_RECENT or self._recent_bytes > _MOST_RECENT_BYTES:
            self._forget(next(iter(self._recent)))

    async def get(self, caller: str, name: str) -> Task | Record:
        """Return a caller's match.

        Raises
        ------
        InvalidInputError
            If there is no name.
        NotFoundError
            If there is none, or it is another caller's.
        StoreError
            If that cannot be told.
        """
        if not name:
            problem = "is not set; give the match_id from the event `accepted`"
            raise InvalidInputError(Reason.MISSING_FIELD, "match_id", problem)
        known = self._live.get(name) or self._recent.get(name)
        if known is not None and _caller(known) == caller:
            return known
        found = None
        if known is None and self._archive is not None:
            found = await asyncio.to_thread(self._archive.find, caller, name)
        if found is None:
            raise NotFoundError(
                f"you have no match {quoted(name)} on this server: it has another name, belongs to "
                "another caller, or was deleted; list your matches"
            )
        return found

    def known(self, caller: str, request_id: str) -> Task | Record | None:
        """Return the match in memory that a caller gave a name to."""
        name = self._named.get((caller, request_id), "")
        return self._live.get(name) or self._recent.get(name)

    async def same(self, caller: str, wish: Wish) -> Task | Record | None:
        """Return the match that a request asks for once more; None for a new one.

        Raises
        ------
        InvalidInputError
            If the caller gave the name to another request.
        """
        if not wish.request_id:
            return None
        found = self.known(caller, wish.request_id)
        archive = self._archive
        if found is None and archive is not None and archive.may_know(caller, wish.request_id):
            try:
                kept = await asyncio.to_thread(archive.same, caller, wish.request_id)
            except StoreError:
                kept = None  # it is done; the log tells that nothing is kept
            found = self.known(caller, wish.request_id) or kept
        if found is not None and found.wish.digest != wish.digest:
            raise InvalidInputError(
                Reason.INVALID_FIELD,
                "request_id",
                f"{quoted(wish.request_id)} already belongs to another request; give each its own",
            )
        return found

    async def page(self, caller: str, size: int, token: str) -> tuple[list[Record], str]:
        """Return some of a caller's matches, the latest first, and where the next ones begin.

        Raises
        ------
        InvalidInputError
            If size or token is of no use.
        StoreError
            If that cannot be told.
        """
        if size < 0:
            problem = f"is {size}; give a number of matches, or 0 for the default of {_LISTED}"
            raise InvalidInputError(Reason.INVALID_FIELD, "page_size", problem)
        size = min(size or _LISTED, _MOST_LISTED)
        before = _unpacked(token) if token else None
        found: dict[str, Record] = {}
        if (archive := self._archive) is not None:
            kept = await asyncio.to_thread(archive.page, caller, before, size + 1)
            found = {record.id: record for record in kept}
        in_memory: list[Task | Record] = [*self._recent.values(), *self._live.values()]
        for known in in_memory:
            if _caller(known) == caller:
                record = known.record()
                if before is None or _place(record) < before:
                    found[record.id] = record
        listed = sorted(found.values(), key=_place, reverse=True)
        more = len(listed) > size
        return listed[:size], _packed(listed[size - 1]) if more else ""

    async def close(self) -> None:
        """Write what is to be kept, and end."""
        if self._archive is not None:
            await asyncio.to_thread(self._archive.close)

    def _forget(self, name: str) -> None:
        record = self._recent.pop(name, None)
        if record is None:
            return
        self._recent_bytes -= record.size
        named = (record.caller, record.wish.request_id)
        if self._named.get(named) == name:
            del self._named[named]


def _caller(match: Task | Record) -> str:
    return match.caller if isinstance(match, Record) else match.caller.name


def _place(record: Record) -> tuple[float, str]:
    return record.created, record.id


def _packed(record: Record) -> str:
    place = _TOKEN.pack(record.created) + record.id.encode()
    return base64.urlsafe_b64encode(place).decode()


def _unpacked(token: str) -> tuple[float, str]:
    try:
        place = base64.urlsafe_b64decode(token.encode())
        (created,) = _TOKEN.unpack(place[: _TOKEN.size])
        return created, place[_TOKEN.size :].decode()
    except (binascii.Error, struct.error, ValueError):
        problem = f"is {quoted(token)}; give the next_page_token of the page before, or none"
        raise InvalidInputError(Reason.INVALID_FIELD, "page_token", problem) from None
