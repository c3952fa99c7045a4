"""What a contract is: a function of a class that says where the class breaks it."""

from __future__ import annotations

import inspect
import re
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import FrozenInstanceError, dataclass
from enum import StrEnum
from functools import partial
from pathlib import Path
from time import perf_counter  # the real one, whatever a check does to the module
from typing import Any

from sketchmatch.registry.raised import words_of
from sketchmatch.testing.conformance.time_limit import OverdueError, in_time

__all__ = [
    "TIME_LIMIT",
    "BrokenError",
    "CheckResult",
    "CheckState",
    "Contract",
    "ContractViolationError",
    "NotApplicableError",
    "PluginCheck",
    "refused_as_broken",
    "require",
    "require_applicable",
    "writing_behind",
]

TIME_LIMIT = 120.0
"""Seconds that one check may take, unless a caller says otherwise."""

Contract = Callable[[type[Any]], None]
"""Raises :class:`BrokenError` if a class does not keep it.

Its name is the check's, its docstring says what it demands.
"""

_METHODS = ("segment", "describe", "compare", "combine", "search", "judge", "read")
_LONGEST = 1000
_READ_ONLY = re.compile(r"read.?only", re.IGNORECASE)


class ContractViolationError(AssertionError):
    """An algorithm breaks a contract; the sentence names both, what was seen and what is expected.

    Attributes
    ----------
    check
        The check that found it.
    seen
        What the algorithm did.
    overdue
        Whether the check was stopped by its time limit.
    """

    def __init__(self, check: PluginCheck, seen: str, *, overdue: bool = False) -> None:
        algorithm = f"{check.algorithm.__module__}.{check.algorithm.__qualname__}"
        super().__init__(f"{algorithm} breaks {check.name}: {seen}; expected: {check.demand}")
        self.check = check
        self.seen = seen
        self.overdue = overdue


class CheckState(StrEnum):
    """The result of a check."""

    PASSED = "passed"
    FAILED = "failed"
    SKIPPED = "skipped"


@dataclass(frozen=True)
class CheckResult:
    """The result of one check of a class.

    Attributes
    ----------
    name, demand
        As in :class:`PluginCheck`.
    state
        Whether the contract is kept.
    seen
        What the algorithm did if it failed, or why there was nothing to check; otherwise empty.
    seconds
        How long it took.
    overdue
        Whether it was stopped by its time limit.
    """

    name: str
    demand: str
    state: CheckState
    seen: str = ""
    seconds: float = 0.0
    overdue: bool = False


@dataclass(frozen=True)
class PluginCheck:
    """One contract, put to one class; calling it checks.

    Attributes
    ----------
    algorithm
        The class.
    name
        The name for expected failures, in kebab-case.
    demand
        What is expected, in one sentence.
    contract
        What finds out.
    time_limit
        Seconds after which the check is stopped and has failed. None for no limit; the check then
        runs in the calling thread, which suits a debugger.
    """

    algorithm: type[Any]
    name: str
    demand: str
    contract: Contract
    time_limit: float | None = TIME_LIMIT

    @classmethod
    def of(
        cls, contract: Contract, algorithm: type[Any], time_limit: float | None = TIME_LIMIT
    ) -> PluginCheck:
        """Return the check of a class against a contract."""
        name = contract.__name__.replace("_", "-")
        demand = " ".join((inspect.getdoc(contract) or "").split())
        return cls(algorithm, name, demand, contract, time_limit)

    def __call__(self) -> None:
        """Check.

        Raises
        ------
        ContractViolationError
            If the class breaks the contract, raises what nobody expects, or does not end in time.
        """
        with suppress(NotApplicableError):
            self._put()

    def result(self) -> CheckResult:
        """Check, and return what came of it."""
        state, seen, overdue = CheckState.PASSED, "", False
        began = perf_counter()
        try:
            self._put()
        except NotApplicableError as reason:
            state, seen = CheckState.SKIPPED, str(reason)
        except ContractViolationError as violation:
            state, seen, overdue = CheckState.FAILED, violation.seen, violation.overdue
        return CheckResult(self.name, self.demand, state, seen, perf_counter() - began, overdue)

    def _put(self) -> None:
        """Put the contract to the class, within the time limit."""
        work = partial(self.contract, self.algorithm)
        try:
            if self.time_limit is None:
                work()
            else:
                in_time(work, self.time_limit)
        except NotApplicableError:
            raise
        except OverdueError as overdue:
            seen = f"it did not end within {self.time_limit:g} s{self._place(overdue.stack)}"
            seen += "" if overdue.ended else ", and goes on in a thread that cannot be ended"
            raise ContractViolationError(self, seen, overdue=True) from None
        except BrokenError as broken:
            writing = writing_behind(broken)
            seen = self._said(writing) if writing else str(broken)
            raise ContractViolationError(self, seen) from writing
        except (Exception, SystemExit) as error:  # a plugin may raise anything, and exit
            raise ContractViolationError(self, self._said(error)) from error

    def _said(self, error: BaseException) -> str:
        """Say what an error shows that the class did, and where."""
        writing = writing_behind(error)
        did = "wrote to what it is given, which is read-only, and" if writing else ""
        cause = writing or error
        words = f"{did} raised {words_of(cause, _LONGEST)}".strip()
        return f"it {words}{self._place(traceback.extract_tb(cause.__traceback__))}"

    def _place(self, stack: traceback.StackSummary) -> str:
        """Say where in the plugin a stack is: its last line in a folder that the class is from."""
        methods = (getattr(self.algorithm, name, None) for name in _METHODS)
        codes = (getattr(method, "__code__", None) for method in methods)
        folders = {Path(code.co_filename).parent for code in codes if code}
        for frame in reversed(stack):
            if Path(frame.filename).parent in folders:
                return f" at {Path(frame.filename).name}, line {frame.lineno}, in {frame.name}"
        return ""


class BrokenError(Exception):
    """What an algorithm did that a contract forbids."""


class NotApplicableError(Exception):
    """Why a contract says nothing about an algorithm."""


def require(holds: Any, seen: str) -> None:
    """Raise what was seen unless it holds."""
    if not holds:
        raise BrokenError(seen)


def require_applicable(applies: Any, reason: str) -> None:
    """Leave a contract unchecked, for a reason, unless it applies."""
    if not applies:
        raise NotApplicableError(reason)


@contextmanager
def refused_as_broken() -> Iterator[None]:
    """Take what the host refuses within the block, with a sentence, for a broken contract."""
    try:
        yield
    except (TypeError, ValueError) as error:
        raise BrokenError(str(error)) from None


def writing_behind(error: BaseException) -> BaseException | None:
    """Return the error that comes from writing to what is read-only, if that is behind another."""
    cause: BaseException | None = error
    while cause is not None:
        ours = isinstance(cause, OSError | BrokenError)
        read_only = not ours and _READ_ONLY.search(words_of(cause, _LONGEST))
        if read_only or isinstance(cause, FrozenInstanceError):
            return cause
        cause = cause.__cause__ or (None if cause.__suppress_context__ else cause.__context__)
    return None
