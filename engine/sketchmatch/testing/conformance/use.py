"""Contracts on one use of an algorithm, whatever it is given and whatever it answers."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sketchmatch.model.arrays import sealed
from sketchmatch.testing.conformance.contract import (
    BrokenError,
    Contract,
    require,
    writing_behind,
)
from sketchmatch.testing.conformance.time_limit import together

__all__ = ["Use", "contracts_of_use", "view_within"]

_THREADS = 4


@dataclass(frozen=True)
class Use:
    """One use of an algorithm.

    Attributes
    ----------
    given
        In words.
    inputs
        The memory of what the algorithm is given, by name; read-only, as all that the host gives.
    answer
        Uses an algorithm and returns its answer.
    """

    given: str
    inputs: Mapping[str, NDArray[Any]]
    answer: Callable[[Any], Hashable]


def view_within(array: NDArray[Any]) -> NDArray[Any]:
    """Return a read-only view of a copy of an array, the middle third of its base."""
    middle: NDArray[Any] = np.stack([array, array, array])[1]
    return sealed(middle)


def _made(algorithm: type[Any]) -> Any:
    return algorithm()


def contracts_of_use(
    uses: Callable[[], Iterable[Use]], made: Callable[[type[Any]], Any] = _made
) -> tuple[Contract, ...]:
    """Return the contracts that each use of an algorithm of some kind must keep.

    Parameters
    ----------
    uses
        Returns the same uses, two or more, each time in memory of their own.
    made
        Sets an algorithm up; with its default parameters, unless it is another.
    """

    def answers_repeat(algorithm: type[Any]) -> None:
        """Give the very same answer to the same input, and seed, bit by bit."""
        for use, again in zip(uses(), uses(), strict=True):
            same = use.answer(made(algorithm)) == again.answer(made(algorithm))
            require(same, f"two runs on {use.given} gave different answers")

    def threads_agree(algorithm: type[Any]) -> None:
        """Give each of several threads that use one object what it gives to one alone."""
        one = made(algorithm)

        def answers() -> list[Hashable]:
            return [use.answer(one) for use in (*uses(), *uses(), *uses())]

        alone = answers()
        require(
            all(each == alone for each in together(answers, _THREADS)),
            f"{_THREADS} threads with one object did not all get the answers of one alone",
        )

    def inputs_stay_untouched(algorithm: type[Any]) -> None:
        """Leave what it is given as it is, byte by byte."""
        for use, writable in zip(uses(), uses(), strict=True):
            try:
                _watched(made(algorithm), use)
            except BrokenError:
                raise
            except Exception as error:
                # Only then: kernels would be compiled once more for arrays that can be written to.
                if writing_behind(error):
                    for array in writable.inputs.values():
                        with suppress(ValueError):  # a part of what is read-only stays so
                            array.flags.writeable = True
                    try:
                        _watched(made(algorithm), writable)
                    except BrokenError as broken:
                        raise broken from None  # it names what was written to
                raise

    return (answers_repeat, threads_agree, inputs_stay_untouched)


def _watched(algorithm: Any, use: Use) -> None:
    """Use an algorithm, and say what it wrote to."""
    before = {name: _memory(array) for name, array in use.inputs.items()}
    try:
        use.answer(algorithm)
    finally:
        wrote = [name for name, array in use.inputs.items() if _memory(array) != before[name]]
        if wrote:
            raise BrokenError(f"it wrote to {' and '.join(wrote)} of {use.given}")


def _memory(array: NDArray[Any]) -> bytes:
    """Return the bytes of the whole array that this one is a part of."""
    while isinstance(array.base, np.ndarray):
        array = array.base
    return array.tobytes()
