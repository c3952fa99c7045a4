"""What a contract is: a function of a class that says where the class breaks it."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

__all__ = ["BrokenError", "Contract", "ContractViolationError", "PluginCheck", "require"]

Contract = Callable[[type[Any]], None]
"""Raises :class:`BrokenError` if a class does not keep it.

Its name is the check's, its docstring says what it demands.
"""


class ContractViolationError(AssertionError):
    """An algorithm breaks a contract; the sentence names both, what was seen and what is expected.

    Attributes
    ----------
    check
        The check that found it.
    seen
        What the algorithm did.
    """

    def __init__(self, check: PluginCheck, seen: str) -> None:
        algorithm = f"{check.algorithm.__module__}.{check.algorithm.__qualname__}"
        super().__init__(f"{algorithm} breaks {check.name}: {seen}; expected: {check.demand}")
        self.check = check
        self.seen = seen


@dataclass(frozen=True)
class PluginCheck:
    """One contract, put to one class; calling it checks.

    Attributes
    ----------
    algorithm
        The class.
    name
        What an expected failure names it by, in kebab-case.
    demand
        What is expected, in one sentence.
    contract
        What finds out.
    """

    algorithm: type[Any]
    name: str
    demand: str
    contract: Contract

    @classmethod
    def of(cls, contract: Contract, algorithm: type[Any]) -> PluginCheck:
        """Put a contract to a class."""
        name = contract.__name__.replace("_", "-")
        return cls(algorithm, name, " ".join((inspect.getdoc(contract) or "").split()), contract)

    def __call__(self) -> None:
        """Check.

        Raises
        ------
        ContractViolationError
            If the class breaks the contract, or raises what nobody expects.
        """
        try:
            self.contract(self.algorithm)
        except BrokenError as broken:
            raise ContractViolationError(self, str(broken)) from None
        except Exception as error:  # a plugin may raise anything
            text = " ".join(f"{type(error).__name__}: {error}".split())
            raise ContractViolationError(self, f"it raised {text}") from error


class BrokenError(Exception):
    """What an algorithm did that a contract forbids."""


def require(holds: Any, seen: str) -> None:
    """Raise what was seen unless it holds."""
    if not holds:
        raise BrokenError(seen)
