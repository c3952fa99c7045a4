"""Values of an instance that are computed once, without keeping other threads waiting."""

from __future__ import annotations

import functools
from typing import Any, Self, TypeVar, overload

__all__ = ["cached_property"]

_Value = TypeVar("_Value")


class cached_property(functools.cached_property[_Value]):  # noqa: N801
    """:func:`functools.cached_property` as it is from Python 3.12 on, without a lock.

    In Python 3.11 one lock serves all instances of a class, so that who computes a large one stops
    everybody else. Here threads that come at the same time compute the same value each, and one of
    them stays.
    """

    @overload
    def __get__(self, instance: None, owner: type[Any] | None = None) -> Self: ...
    @overload
    def __get__(self, instance: object, owner: type[Any] | None = None) -> _Value: ...
    def __get__(self, instance: object | None, owner: type[Any] | None = None) -> Any:
        """Return the value of an instance."""
        if instance is None:
            return self
        kept, name = instance.__dict__, self.attrname
        if name is None:
            raise TypeError("a cached_property must be given its name by the class that has it")
        if name not in kept:
            kept.setdefault(name, self.func(instance))
        return kept[name]
