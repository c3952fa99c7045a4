"""Putting a class to all contracts of its kind."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from sketchmatch.registry import Kind
from sketchmatch.testing.conformance import (
    every_kind,
    histograms,
    judges,
    searchers,
    segmenters,
    similarities,
)
from sketchmatch.testing.conformance.contract import (
    TIME_LIMIT,
    Contract,
    ContractViolationError,
    PluginCheck,
)

if TYPE_CHECKING:
    import pytest

__all__ = ["check_plugin", "parametrize_plugins", "plugin_checks"]

Reasons = Mapping[str, str]
"""By the name of a check why a class is expected to fail it."""

_NONE: Reasons = MappingProxyType({})
_COMPILING = 5
"""How many times longer a warm-up may take, in which kernels are compiled."""

_CONTRACTS: dict[Kind, Callable[[type[Any]], Sequence[Contract]]] = {
    Kind.SEGMENTER: segmenters.contracts,
    Kind.HISTOGRAM: lambda _: histograms.CONTRACTS,
    Kind.SIMILARITY: lambda _: similarities.CONTRACTS,
    Kind.SEARCHER: lambda _: searchers.CONTRACTS,
    Kind.JUDGE: lambda _: judges.CONTRACTS,
}


def check_plugin(
    algorithm: type[Any],
    expected_failures: Reasons = _NONE,
    time_limit: float | None = TIME_LIMIT,
) -> None:
    """Check a class against every contract of its kind.

    It is used with its default parameters, on small inputs made for the purpose; this takes some
    seconds per class.

    Parameters
    ----------
    algorithm
        A class that derives from one of the five interfaces in :mod:`sketchmatch.api`.
    expected_failures
        Names of checks that it fails, and why that is accepted.
    time_limit
        Seconds that each check may take, and its warm-up five times as many; None for no limit.

    Raises
    ------
    ContractViolationError
        At the first contract that it breaks, or whose check exceeds its time limit, or that it
        keeps although it was expected to fail.
    ValueError
        If an expected failure names no check.
    TypeError
        If the class is of no kind.

    Examples
    --------
    >>> import numpy as np
    >>> from sketchmatch.api import Similarity
    >>> class CityBlock(Similarity):
    ...     '''How far one has to walk from one histogram to the other, along streets.'''
    ...
    ...     name = "city-block"
    ...     summary = "One minus half the mean absolute difference."
    ...
    ...     def compare(self, aligned, argument):
    ...         return 1.0 - 0.5 * np.abs(aligned - argument).mean(axis=1)
    >>> check_plugin(CityBlock)
    """
    _refuse_unknown(algorithm, expected_failures)
    for check in plugin_checks(algorithm, time_limit):
        if check.name not in expected_failures:
            check()
        else:
            _must_fail(check)


def plugin_checks(
    algorithm: type[Any], time_limit: float | None = TIME_LIMIT
) -> Iterator[PluginCheck]:
    """Yield every contract of a class's kind as a check; each can be called by itself.

    Parameters
    ----------
    algorithm, time_limit
        As for :func:`check_plugin`.

    Examples
    --------
    >>> from sketchmatch.api import Searcher
    >>> [check.name for check in plugin_checks(Searcher)][:2]
    ['name-is-kebab-case', 'summary-is-one-sentence']
    """
    kind = every_kind.kind_of_class(algorithm)
    for contract in (*every_kind.CONTRACTS, *_CONTRACTS[kind](algorithm)):
        compiles = contract is every_kind.warm_up_can_be_repeated
        limit = time_limit and time_limit * (_COMPILING if compiles else 1)
        yield PluginCheck.of(contract, algorithm, limit)


def parametrize_plugins(
    classes: Sequence[type[Any]],
    expected_failures: Mapping[type[Any], Reasons] = MappingProxyType({}),
    time_limit: float | None = TIME_LIMIT,
) -> pytest.MarkDecorator:
    """Return a pytest decorator that makes one test of each class and check.

    The test takes ``check`` and calls it::

        @parametrize_plugins([MySearcher, MyHistogram])
        def test_it_keeps_the_contracts(check):
            check()

    Parameters
    ----------
    classes
        Classes of any kinds.
    expected_failures
        By class the names of checks that it fails and why that is accepted; such a test is
        marked ``xfail(strict=True)``, so that it fails once the check passes.
    time_limit
        As for :func:`check_plugin`.

    Raises
    ------
    ValueError
        If an expected failure names no check, or a class that is not among these.
    """
    import pytest

    for algorithm, reasons in expected_failures.items():
        if algorithm not in classes:
            raise ValueError(f"expected_failures names {algorithm.__name__}, which is not checked")
        _refuse_unknown(algorithm, reasons)
    cases = []
    for algorithm in classes:
        reasons = expected_failures.get(algorithm, _NONE)
        for check in plugin_checks(algorithm, time_limit):
            expected = pytest.mark.xfail(
                check.name in reasons,
                reason=reasons.get(check.name, ""),
                raises=ContractViolationError,
                strict=True,
            )
            name = f"{algorithm.__name__}-{check.name}"
            cases.append(pytest.param(check, id=name, marks=expected))
    return pytest.mark.parametrize("check", cases)


def _refuse_unknown(algorithm: type[Any], reasons: Reasons) -> None:
    known = {check.name for check in plugin_checks(algorithm)}
    for name in reasons:
        if name not in known:
            raise ValueError(
                f"expected_failures of {algorithm.__name__} names {name!r}, which is not a check; "
                f"choose one of: {', '.join(sorted(known))}"
            )


def _must_fail(check: PluginCheck) -> None:
    try:
        check()
    except ContractViolationError:
        return
    raise ContractViolationError(check, "it is expected to fail, and passes: expect it no longer")
