"""Options that several commands share, and how they are read."""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, cast

import typer

from sketchmatch.cli.output import clean, tell
from sketchmatch.errors import InvalidInputError, Reason

if TYPE_CHECKING:
    from sketchmatch.model import RequestWeights
    from sketchmatch_client import MatchOptions, Pin

__all__ = [
    "HERE",
    "Access",
    "Config",
    "Exclusions",
    "FormerMapSegmenter",
    "FormerSketchSegmenter",
    "Histogram",
    "Json",
    "JsonDocument",
    "MapFile",
    "MapSegmenter",
    "Overlay",
    "OwnServer",
    "Pins",
    "Profile",
    "Search",
    "Server",
    "Settings",
    "SketchFile",
    "SketchSegmenter",
    "Synonyms",
    "Timeout",
    "Verbose",
    "asking",
    "parse_pairs",
    "parse_pins",
    "parse_settings",
    "parse_synonyms",
    "parse_weights",
    "pins_as_typed",
    "refuse_config",
    "say",
    "say_renamed",
    "to_path",
]

HERE = "127.0.0.1:50051"


def to_path(text: str) -> Path:
    """Return what was typed for a file or a folder.

    Raises
    ------
    typer.BadParameter
        If it is empty, as a variable is that nobody set: that would be the folder one is in.
    """
    if not str(text):
        raise typer.BadParameter("it is empty; give the path of a file")
    return Path(text)


SketchFile = Annotated[
    Path,
    typer.Argument(
        metavar="SKETCH", help="Sketch, in any format that `match` reads.", parser=to_path
    ),
]
MapFile = Annotated[
    Path,
    typer.Argument(metavar="MAP", help="Map, in any format that `match` reads.", parser=to_path),
]
Timeout = Annotated[
    float,
    typer.Option("--timeout", metavar="SECONDS", min=0.001, help="Longest wait for an answer."),
]
Server = Annotated[
    str | None,
    typer.Option(
        "--server",
        metavar="ADDRESS",
        help="Ask the server at HOST:PORT or unix:PATH instead of computing locally.",
    ),
]
OwnServer = Annotated[
    str,
    typer.Option(
        "--server",
        metavar="ADDRESS",
        help="Server that keeps them: HOST:PORT or unix:PATH.",
        show_default=True,
    ),
]
Config = Annotated[
    Path | None,
    typer.Option(
        "--config",
        metavar="FILE",
        help="Configuration file; by default sketchmatch.toml here or in your configuration "
        "folder.",
        parser=to_path,
    ),
]
Profile = Annotated[
    str,
    typer.Option(
        "--profile",
        metavar="NAME",
        help="Named pipeline to start from: proof, thesis, thesis-easm, thesis-fsnn or one of your "
        "own.",
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="STAGE.PARAMETER=VALUE",
        help="Set a parameter, e.g. searcher.population=400; may be repeated. `sketchmatch plugins "
        "show NAME` lists them.",
    ),
]
Pins = Annotated[
    list[str] | None,
    typer.Option(
        "--pin",
        metavar="SKETCHED=MAPPED",
        help="State which mapped object a sketched one is, by label or by number (from 1, as in "
        "tables and pictures); desk=none: it is not on the map. Put labels that contain = or look "
        "like numbers in double quotes. May be repeated.",
    ),
]
Exclusions = Annotated[
    list[str] | None,
    typer.Option(
        "--no-pin",
        metavar="SKETCHED=MAPPED",
        help="State which mapped object a sketched one is not; as --pin.",
    ),
]
Synonyms = Annotated[
    list[str] | None,
    typer.Option(
        "--synonyms",
        metavar="LABEL,LABEL…",
        help="Labels that mean the same, e.g. couch,sofa; may be repeated.",
    ),
]
Json = Annotated[
    bool,
    typer.Option("--json", help="Print the answer as the gRPC contract's message in JSON."),
]
JsonDocument = Annotated[
    bool, typer.Option("--json", help="Print one JSON document; objects are numbered from 0.")
]
SketchSegmenter = Annotated[
    str,
    typer.Option(
        "--sketch-segmenter",
        help="Segmenter of the sketch; depends on its kind by default.",
    ),
]
MapSegmenter = Annotated[
    str,
    typer.Option("--map-segmenter", help="Segmenter of the map; depends on its kind by default."),
]
FormerSketchSegmenter = Annotated[str, typer.Option("--segmenter-sketch", hidden=True)]
FormerMapSegmenter = Annotated[str, typer.Option("--segmenter-map", hidden=True)]
Histogram = Annotated[
    str, typer.Option(help="Histogram; by default `constant` or the configured one.")
]
Overlay = Annotated[
    Path | None,
    typer.Option(
        "--overlay", metavar="FILE", help="Draw the answer into this picture.", parser=to_path
    ),
]

Verbose = Annotated[
    bool,
    typer.Option("--verbose", "-v", help="Show all notes on the files, not one of each kind."),
]


_Value = TypeVar("_Value")


@dataclass(frozen=True)
class Access:
    """How a command gets in at a server; what is left out, the environment may say.

    Attributes
    ----------
    token_file, tls, root_certificates, certificate, key, server_name
        As the client takes them.
    """

    token_file: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="File with the token for the server; or set SKETCHMATCH_TOKEN.",
            parser=to_path,
        ),
    ] = None
    tls: Annotated[
        bool | None,
        typer.Option(
            "--tls/--no-tls",
            help="Encrypt; implied by certificates.",
            show_default=False,
        ),
    ] = None
    root_certificates: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Certificate authorities to trust for the server's certificate (PEM).",
            parser=to_path,
        ),
    ] = None
    certificate: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Client certificate for the server (PEM).", parser=to_path
        ),
    ] = None
    key: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Private key of the client certificate (PEM).", parser=to_path
        ),
    ] = None
    server_name: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Name in the server's certificate, if it is not in the address.",
        ),
    ] = None


@dataclass(frozen=True)
class Search:
    """How maps are compared, searched and judged; what is left out, profile or default say.

    Attributes
    ----------
    searcher, judge, histogram, similarity, seed, time_budget, weights, allow_unmatched, \
unmatched_price
        As a match takes them; the weights as they are typed.
    """

    searcher: Annotated[str | None, typer.Option(help="Searcher.")] = None
    judge: Annotated[str | None, typer.Option(help="Judge of the object maps found.")] = None
    histogram: Annotated[str | None, typer.Option(help="Histogram.")] = None
    similarity: Annotated[str | None, typer.Option(help="Similarity measure.")] = None
    seed: Annotated[int, typer.Option(help="Random seed: same seed, same answer.")] = 0
    time_budget: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="Stop after this time with the best answer so far."),
    ] = None
    weights: Annotated[
        str | None,
        typer.Option(
            metavar="W1,W2,W3[,W4,W5[,β]]",
            help="Weights in ζ: of ζσ, ζR and ζL; of the objects' shapes and sizes; and β, where "
            "the rotation of a pair at distance d counts d^β. 1,1,1 by default.",
        ),
    ] = None
    allow_unmatched: Annotated[
        bool | None,
        typer.Option(
            "--allow-unmatched/--no-allow-unmatched",
            help="Let objects of either side stay without partner where that is more likely.",
            show_default=False,
        ),
    ] = None
    unmatched_price: Annotated[
        float | None,
        typer.Option(metavar="PRICE", help="Price of leaving out all objects, in units of ζ."),
    ] = None

    def chosen(self) -> MatchOptions:
        """Return the options of a request.

        Raises
        ------
        InvalidInputError
            If the weights have another form.
        """
        return {
            "searcher": self.searcher,
            "judge": self.judge,
            "histogram": self.histogram,
            "similarity": self.similarity,
            "seed": self.seed,
            "time_budget": self.time_budget,
            "weights": None if self.weights is None else parse_weights(self.weights),
            "allow_unmatched": self.allow_unmatched,
            "unmatched_price": self.unmatched_price,
        }


_GROUPS: Mapping[str, type[Any]] = {"access": Access, "search": Search}
"""Options that several commands share, by the name of the parameter that takes them."""


def asking(command: Callable[..., _Value]) -> Callable[..., _Value]:
    """Give a command the options that it takes in groups, as ``access`` and as ``search``."""
    own = inspect.signature(command, eval_str=True)
    groups = {
        name: inspect.signature(group, eval_str=True).parameters
        for name, group in _GROUPS.items()
        if name in own.parameters
    }

    @functools.wraps(command)
    def run(*arguments: Any, **options: Any) -> _Value:
        for name, fields in groups.items():
            given = {each.name: options.pop(each.name, each.default) for each in fields.values()}
            options[name] = _GROUPS[name](**given)
        return command(*arguments, **options)

    parameters = []
    for parameter in own.parameters.values():
        added = groups[parameter.name].values() if parameter.name in groups else (parameter,)
        parameters += [each.replace(kind=inspect.Parameter.KEYWORD_ONLY) for each in added]
    run.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {each.name: each.annotation for each in parameters}
    return run


def parse_settings(
    settings: Iterable[str] | None, allowed: Sequence[str] = ()
) -> dict[str, dict[str, Any]]:
    """Read ``stage.parameter=value`` settings; a value is JSON, or else a string.

    Parameters
    ----------
    settings
        As typed.
    allowed
        The stages that the command has; all if left out.

    Raises
    ------
    InvalidInputError
        If one has another form, or is for another stage.

    Examples
    --------
    >>> parse_settings(["searcher.population=400", "searcher.consistency=pairwise"])
    {'searcher': {'population': 400, 'consistency': 'pairwise'}}
    """
    from sketchmatch.config import value_of

    stages: dict[str, dict[str, Any]] = {}
    for setting in settings or ():
        name, equals, text = setting.partition("=")
        stage, dot, parameter = name.partition(".")
        if not (equals and dot and stage and parameter):
            raise InvalidInputError(
                Reason.INVALID_PARAMETER,
                "--set",
                f"{setting!r} is not of the form STAGE.PARAMETER=VALUE, "
                "as in searcher.population=400",
            )
        if allowed and stage not in allowed:
            known = " or ".join(f"{name}.…" for name in allowed)
            raise InvalidInputError(
                Reason.INVALID_PARAMETER, "--set", f"{stage!r} is not a stage here; use {known}"
            )
        stages.setdefault(stage, {})[parameter] = value_of(text)
    return stages


def refuse_config(config: Path | None, server: str | None) -> None:
    """Refuse a configuration for an answer that is another's.

    Raises
    ------
    InvalidInputError
        If there is one, and a server.
    """
    if config is not None and server is not None:
        problem = "is not used with --server, as the server has its own; leave out one of the two"
        raise InvalidInputError(Reason.INVALID_FIELD, "--config", problem)


def parse_pairs(texts: Iterable[str] | None, option: str) -> list[tuple[int, int]]:
    """Read pairs of objects, numbered from 1 as tables and pictures do, and count them from 0.

    Raises
    ------
    InvalidInputError
        If one has another form or names one object twice.

    Examples
    --------
    >>> parse_pairs(["3,1"], "--pair")
    [(2, 0)]
    """
    pairs = []
    for text in texts or ():
        try:
            a, b = (int(part) for part in text.split(","))
        except ValueError:
            raise InvalidInputError(
                Reason.INVALID_FIELD, option, f"{text!r} is not of the form A,B, as in 3,1"
            ) from None
        if a == b:
            raise InvalidInputError(
                Reason.INVALID_FIELD, option, f"{text!r} names one object twice; give two objects"
            )
        pairs.append((a - 1, b - 1))
    return pairs


_PIN = re.compile(r'\s*("[^"]*"|[^="]+?)\s*=\s*("[^"]*"|[^="]+?)\s*', re.DOTALL)
_PIN_FIELD = re.compile(r"pins\[(\d+)\](?:\.\w+)?")


def parse_pins(pins: Iterable[str] | None, exclusions: Iterable[str] | None) -> Mapping[str, Pin]:
    """Read what is known of single objects, by option as typed; objects count from 0 then.

    Raises
    ------
    InvalidInputError
        If one has another form.

    Examples
    --------
    >>> parse_pins(["old desk=3", '"3"=none'], ["2=5"]).values()
    dict_values([Pin(sketch='old desk', map=2, excluded=False), \
Pin(sketch='3', map=None, excluded=False), Pin(sketch=1, map=4, excluded=True)])
    """
    from sketchmatch_client import Pin

    known = {}
    for option, texts in (("--pin", pins), ("--no-pin", exclusions)):
        excluded = option == "--no-pin"
        for text in texts or ():
            found = _PIN.fullmatch(text)
            if found is None:
                raise InvalidInputError(
                    Reason.INVALID_FIELD,
                    option,
                    f"{text!r} is not of the form SKETCHED=MAPPED, as in desk=3, 2=5 or "
                    "desk=none; put labels that contain = or quotes in double quotes",
                )
            sketched, mapped = (part.strip() for part in found.groups())
            nothing = mapped.lower() == "none"
            if excluded and nothing:
                raise InvalidInputError(
                    Reason.INVALID_FIELD, option, f"{text!r} excludes nothing; name a mapped object"
                )
            known[f"{option} {text}"] = Pin(
                _object_named(sketched, option, text),
                None if nothing else _object_named(mapped, option, text),
                excluded,
            )
    return known


def _object_named(typed: str, option: str, text: str) -> int | str:
    """Return a label, or a number counted from 0."""
    if typed.startswith('"'):
        typed = typed[1:-1].strip()
    elif re.fullmatch(r"[+-]?\d+", typed):
        if 0 < int(typed) < 2**32:
            return int(typed) - 1
        raise InvalidInputError(
            Reason.INVALID_FIELD, option, f"{text!r} names object {typed}; numbers begin at 1"
        )
    if not typed:
        raise InvalidInputError(
            Reason.INVALID_FIELD, option, f"{text!r} names no object; give a label or a number"
        )
    return typed


@contextmanager
def pins_as_typed(options: Sequence[str]) -> Iterator[None]:
    """Give errors about pins the options that these were typed as."""
    from sketchmatch_client import InvalidRequestError

    def typed(found: re.Match[str]) -> str:
        return options[int(found[1])]

    try:
        yield
    except (InvalidInputError, InvalidRequestError) as error:
        place = _PIN_FIELD.match(error.field)
        if place is None:
            raise
        problem = _PIN_FIELD.sub(typed, str(error).removeprefix(f"{error.field} "))
        raise InvalidInputError(Reason.INVALID_FIELD, typed(place), problem) from None


def parse_synonyms(groups: Iterable[str] | None) -> list[tuple[str, ...]]:
    """Read groups of labels that mean the same.

    Raises
    ------
    InvalidInputError
        If one is of fewer than two labels.

    Examples
    --------
    >>> parse_synonyms(["couch, sofa"])
    [('couch', 'sofa')]
    """
    read = []
    for text in groups or ():
        labels = tuple(label.strip() for label in text.split(","))
        if len(labels) < 2 or not all(labels):
            raise InvalidInputError(
                Reason.INVALID_FIELD,
                "--synonyms",
                f"{text!r} is not a list of two or more labels, as in couch,sofa",
            )
        read.append(labels)
    return read


def parse_weights(text: str) -> RequestWeights:
    """Read the weights of ζ.

    Raises
    ------
    InvalidInputError
        If they are not three, five or six numbers.

    Examples
    --------
    >>> parse_weights("1,2,0.5")
    (1.0, 2.0, 0.5)
    """
    from sketchmatch.model.maps import WEIGHT_COUNTS

    try:
        weights = tuple(float(part) for part in text.split(","))
    except ValueError:
        weights = ()
    if len(weights) not in WEIGHT_COUNTS:
        raise InvalidInputError(
            Reason.INVALID_FIELD,
            "--weights",
            f"{text!r} is not three, five or six numbers, as in 1,1,1 or 1,1,1,0.5,0.5 or "
            "1,2,0.1,2,0.3,1",
        )
    return cast("RequestWeights", weights)


def say_renamed(sketch_segmenter: str, map_segmenter: str) -> None:
    """Tell that a segmenter was chosen by an option's former name, after what was asked for."""
    for side, given in (("sketch", sketch_segmenter), ("map", map_segmenter)):
        if given:
            say(f"--segmenter-{side} is deprecated; use --{side}-segmenter")


def say(sentence: str) -> None:
    """Tell the person at the terminal something that is not part of the answer."""
    tell(f"sketchmatch: {clean(sentence)}")
