"""Contracts on one use of an algorithm, whatever it is given and whatever it answers."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sketchmatch.testing.conformance.contract import Contract, require

__all__ = ["Use", "contracts_of_use", "writable_view"]

_THREADS = 4


@dataclass(frozen=True)
class Use:
    """One use of an algorithm.

    Attributes
    ----------
    given
        In words.
    inputs
        The memory of what the algorithm is given.
    answer
        Uses an algorithm and returns its answer.
    """

    given: str
    inputs: tuple[NDArray[Any], ...]
    answer: Callable[[Any], Hashable]


def writable_view(array: NDArray[Any]) -> NDArray[Any]:
    """Return a view of a copy of an array, the middle third of its base."""
    middle: NDArray[Any] = np.stack([array, array, array])[1]
    return middle


def contracts_of_use(uses: Callable[[], Iterable[Use]]) -> tuple[Contract, ...]:
    """Return the contracts that each use of an algorithm of some kind must keep.

    Parameters
    ----------
    uses
        Returns the same uses, two or more, each time in memory of their own.
    """

    def answers_repeat(algorithm: type[Any]) -> None:
        """Give the very same answer to the same input, and seed, bit by bit."""
        for use, again in zip(uses(), uses(), strict=True):
            same = use.answer(algorithm()) == again.answer(algorithm())
            require(same, f"two runs on {use.given} gave different answers")

    def threads_agree(algorithm: type[Any]) -> None:
        """Give each of several threads that use one object what it gives to one alone."""
        one = algorithm()

        def answers() -> list[Hashable]:
            return [use.answer(one) for use in (*uses(), *uses(), *uses())]

        alone = answers()
        with ThreadPoolExecutor(_THREADS) as pool:
            together = [each.result() for each in [pool.submit(answers) for _ in range(_THREADS)]]
        require(
            all(each == alone for each in together),
            f"{_THREADS} threads with one object did not all get the answers of one alone",
        )

    def inputs_stay_untouched(algorithm: type[Any]) -> None:
        """Leave what it is given as it is, byte by byte."""
        for use in uses():
            before = [_memory(array) for array in use.inputs]
            use.answer(algorithm())
            for k, (array, memory) in enumerate(zip(use.inputs, before, strict=True)):
                require(_memory(array) == memory, f"it changed array {k} of {use.given}")

    return (answers_repeat, threads_agree, inputs_stay_untouched)


def _memory(array: NDArray[Any]) -> bytes:
    """Return the bytes of the whole array that this one is a part of."""
    while isinstance(array.base, np.ndarray):
        array = array.base
    return array.tobytes()
