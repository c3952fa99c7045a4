"""Contracts on what every algorithm says about itself, and on its parameters."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

from pydantic import ValidationError

from sketchmatch.api import InvalidInputError, Params, Reason
from sketchmatch.pipeline.selection import Choice, set_up
from sketchmatch.registry import Kind, Registered, Registry
from sketchmatch.testing.conformance.bad_values import bad_values, bound_values, fields_of
from sketchmatch.testing.conformance.contract import BrokenError, Contract, require

__all__ = ["CONTRACTS", "kind_of_class"]

_NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")
_LONGEST_NAME, _LONGEST_SENTENCE = 60, 500
_NOBODY = "no_such_parameter"


def kind_of_class(algorithm: type[Any]) -> Kind:
    """Return which of the five kinds a class is of.

    Raises
    ------
    TypeError
        If it is of none.
    """
    for kind in Kind:
        if inspect.isclass(algorithm) and issubclass(algorithm, kind.interface):
            return kind
    raise TypeError(
        f"{algorithm!r} derives from none of Segmenter, Histogram, Similarity, Searcher and Judge "
        "of sketchmatch.api"
    )


def name_is_kebab_case(algorithm: type[Any]) -> None:
    """Have a name of at most 60 lower-case letters and digits, words joined by hyphens."""
    name = getattr(algorithm, "name", None)
    fits = isinstance(name, str) and len(name) <= _LONGEST_NAME and _NAME.fullmatch(name)
    require(fits, f"its name is {name!r}")


def summary_is_one_sentence(algorithm: type[Any]) -> None:
    """Have a summary of one line that ends with a full stop."""
    summary = getattr(algorithm, "summary", None)
    fits = isinstance(summary, str) and re.fullmatch(r"\S.*\S\.", summary)
    require(fits, f"its summary is {summary!r}")


def docstring_says_more(algorithm: type[Any]) -> None:
    """Have a docstring of its own, longer than the summary: how it works, and its source."""
    own = inspect.cleandoc(vars(algorithm).get("__doc__") or "")
    require(
        len(own) > len(getattr(algorithm, "summary", "")),
        f"its docstring has {len(own)} characters",
    )


def params_derive_from_params(algorithm: type[Any]) -> None:
    """Have a nested class Params that derives from sketchmatch.api.Params."""
    params = algorithm.Params
    fits = inspect.isclass(params) and issubclass(params, Params)
    require(fits, f"Params is {params!r}")


def params_are_frozen(algorithm: type[Any]) -> None:
    """Have parameters that cannot be changed once they are set."""
    require(algorithm.Params.model_config.get("frozen"), "Params is not frozen")


def params_forbid_others(algorithm: type[Any]) -> None:
    """Refuse a parameter of an unknown name with one sentence."""
    _refused(algorithm, _NOBODY, 1)


def parameters_are_described(algorithm: type[Any]) -> None:
    """Describe every parameter, for the catalogue, the command line and the form."""
    fields = algorithm.Params.model_fields
    silent = [name for name, field in fields.items() if not (field.description or "").strip()]
    require(not silent, f"parameter {', '.join(silent)} has no description")


def defaults_are_valid(algorithm: type[Any]) -> None:
    """Have a default for every parameter, within its own bounds."""
    fields = algorithm.Params.model_fields
    needed = [name for name, field in fields.items() if field.is_required()]
    require(not needed, f"parameter {', '.join(needed)} has no default")
    defaults = algorithm.Params().model_dump()
    try:
        algorithm.Params(**defaults)
    except ValidationError as error:
        fault = error.errors(include_url=False)[0]
        where = ".".join(map(str, fault["loc"]))
        raise BrokenError(f"the default of {where} is refused: {fault['msg']}") from None


def parameters_reach_the_object(algorithm: type[Any]) -> None:
    """Have the defaults when made without parameters, and otherwise those given."""
    require(algorithm().params == algorithm.Params(), "without parameters it has other ones")
    for name, value in _outermost(algorithm):
        with suppress(ValidationError):
            given = algorithm.Params(**{name: value})
            require(algorithm(given).params == given, f"given {name} = {value!r}, it has others")


def bounds_are_accepted(algorithm: type[Any]) -> None:
    """Take the outermost values that the schema of each parameter allows."""
    for name, value in _outermost(algorithm):
        try:
            algorithm.Params(**{name: value})
        except ValidationError as error:
            fault = error.errors(include_url=False)[0]
            joint = not fault["loc"] or _names_another(algorithm, name, fault["msg"])
            require(joint, f"{name} = {value!r} is refused: {fault['msg']}")


def bad_parameters_are_refused(algorithm: type[Any]) -> None:
    """Refuse values out of bounds, not finite and of other types, in one sentence."""
    for name, options in _fields(algorithm).items():
        for value in bad_values(options):
            _refused(algorithm, name, value)


def warm_up_can_be_repeated(algorithm: type[Any]) -> None:
    """Return None from warm_up(), however often it runs."""
    for _ in range(2):
        returned = algorithm.warm_up()
        require(returned is None, f"warm_up() returned {returned!r}")


CONTRACTS: tuple[Contract, ...] = (
    name_is_kebab_case,
    summary_is_one_sentence,
    docstring_says_more,
    params_derive_from_params,
    params_are_frozen,
    params_forbid_others,
    parameters_are_described,
    defaults_are_valid,
    parameters_reach_the_object,
    bounds_are_accepted,
    bad_parameters_are_refused,
    warm_up_can_be_repeated,
)


def _fields(algorithm: type[Any]) -> dict[str, Any]:
    return fields_of(algorithm.Params.model_json_schema())


def _outermost(algorithm: type[Any]) -> Iterator[tuple[str, Any]]:
    for name, options in _fields(algorithm).items():
        for value in bound_values(options):
            yield name, value


def _names_another(algorithm: type[Any], name: str, sentence: str) -> bool:
    """Whether a sentence is about another parameter too: a rule on both may refuse a bound."""
    words = set(re.findall(r"\w+", sentence))
    return bool(words & (set(algorithm.Params.model_fields) - {name}))


def _refused(algorithm: type[Any], name: str, value: Any) -> None:
    """Ask for a value as a request does, and require a sentence that names the parameter."""
    kind = kind_of_class(algorithm)
    registry = Registry([Registered(kind, algorithm, "the plugin under test", "")])
    try:
        set_up(registry, kind, Choice(algorithm.name, {name: value}), str(kind))
    except InvalidInputError as error:
        sentence = str(error)
        fits = (
            error.reason is Reason.INVALID_PARAMETER
            and error.field.startswith(f"{kind}.parameters.{name}")
            and "\n" not in sentence
            and len(sentence) <= _LONGEST_SENTENCE
        )
        require(fits, f"{name} = {value!r} is refused with {sentence!r}")
    else:
        raise BrokenError(f"{name} = {value!r} is accepted")
