"""What is in force: file, environment and flags together, as the engine's values."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from sketchmatch.config.layers import (
    Layer,
    Origin,
    builtin_layer,
    environment_layer,
    file_layer,
    flag_layer,
    found_file,
    says,
    variable_of,
    variables_in,
    without,
    without_overruled,
)
from sketchmatch.config.settings import Settings, keys_of, static_paths
from sketchmatch.errors import InvalidInputError, Reason, quoted
from sketchmatch.model.limits import SourceLimits
from sketchmatch.pipeline.selection import (
    STAGES,
    Choice,
    Defaults,
    Profile,
    Selection,
    fault_of,
    kind_of,
    profile_faults,
    set_up_faults,
)
from sketchmatch.registry import OWN_DISTRIBUTION, Kind, PluginRules, Registry, default_registry
from sketchmatch.registry.distributions import canonical

if TYPE_CHECKING:
    from sketchmatch.pipeline.engine import Engine

__all__ = [
    "Configuration",
    "builtin",
    "check",
    "idle_faults",
    "load",
    "open_engine",
    "open_registry",
    "refuse_faults",
]

_NO_FLAGS: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True)
class Configuration:
    """What is in force.

    Attributes
    ----------
    defaults
        What is taken where a request chooses nothing, and the profiles that it can name.
    rules
        Which plugins may be used.
    strict
        Whether a server must not start while a plugin has failed, a name is taken twice, or what
        is said of algorithms and distributions is of no use.
    trusted
        Canonical names of the distributions whose algorithms run in the server's own process;
        ``"*"`` stands for all.
    patience
        Seconds that an algorithm in a process of its own may go without a sign of life.
    limits
        How large a sketch or a map may be.
    settings
        All of it as the file spells it, with the settings of the server.
    layers
        What each place said, the strongest first.
    """

    defaults: Defaults
    rules: PluginRules
    strict: bool
    trusted: frozenset[str]
    patience: float
    limits: SourceLimits
    settings: Settings
    layers: tuple[Layer, ...] = field(compare=False, repr=False)

    @property
    def file(self) -> str:
        """The file that was read, empty if none was."""
        return next((layer.name for layer in self.layers if layer.origin is Origin.FILE), "")

    def origin(self, path: tuple[str, ...]) -> tuple[Origin, str]:
        """Return where the value at a path comes from, and what it is called there."""
        for layer in self.layers:
            for leaf, label in layer.labels.items():
                if leaf == path[: len(leaf)] and says(layer, path):
                    return layer.origin, _called(layer, label, path, len(leaf))
        return Origin.DEFAULT, ""


def load(
    path: str | Path | None = None, flags: Mapping[str, Any] = _NO_FLAGS, *, search: bool = True
) -> Configuration:
    """Read file, environment and flags, each stronger than the one before.

    Parameters
    ----------
    path
        The file. Left out: the one that ``SKETCHMATCH_CONFIG`` names, ``sketchmatch.toml`` here, or
        the one of that name in the user's configuration folder, if there is any.
    flags
        Values by dotted path, e.g. ``{"server.address": "127.0.0.1:0"}``; None is not given.
    search
        Whether to look for a file where ``path`` is left out.

    Raises
    ------
    InvalidInputError
        If a file is missing or no TOML, or a key or value is of no use; the first fault.

    Examples
    --------
    >>> load(flags={"limits.max_objects": 50}, search=False).limits.max_objects
    50
    """
    if not (path or flags or search):
        return _of_environment(variables_in(os.environ))
    return _merged(_layers(path, flags, search))


@lru_cache(maxsize=4)
def _of_environment(variables: tuple[tuple[str, str], ...]) -> Configuration:
    """Return what is in force where there are only environment variables.

    Every match in Python needs it, and merging takes a millisecond or two.
    """
    return _merged((environment_layer(dict(variables)), builtin_layer()))


def builtin() -> Configuration:
    """Return what is in force where nobody configured anything."""
    return _merged((builtin_layer(),))


def _merged(layers: tuple[Layer, ...]) -> Configuration:
    try:
        settings = Settings.of(without_overruled(layers))
    except ValidationError as error:
        raise next(_faults(error, layers)) from None
    for path, fault in _segmenter_faults(settings):
        raise _placed(layers, (path, fault))
    return _configuration(settings, layers)


def _configuration(settings: Settings, layers: tuple[Layer, ...]) -> Configuration:
    plugins = settings.plugins
    return Configuration(
        defaults=_defaults(settings),
        rules=PluginRules.of(plugins.allow, plugins.deny),
        strict=plugins.strict,
        trusted=frozenset(map(canonical, plugins.trusted)),
        patience=plugins.patience_seconds,
        limits=SourceLimits(**settings.limits.model_dump()),
        settings=settings,
        layers=layers,
    )


def open_registry(configuration: Configuration) -> Registry:
    """Return the algorithms that a configuration lets in, once what it says of them is sound.

    Profiles are checked when they are used, but for the default one.

    Raises
    ------
    InvalidInputError
        If a setting in force names an algorithm or a parameter of no use; the first fault.
    """
    registry = default_registry(configuration.rules)
    refuse_faults(configuration, registry)
    return registry


def open_engine(configuration: Configuration) -> Engine:
    """Return the engine as a configuration sets it up.

    Raises
    ------
    InvalidInputError
        As :func:`open_registry` does.
    """
    from sketchmatch.pipeline.engine import Engine  # numba comes with it

    registry = open_registry(configuration)
    return Engine(registry, configuration.defaults, configuration.limits)


def refuse_faults(configuration: Configuration, registry: Registry) -> None:
    """Refuse a configuration that says something of no use about the algorithms at hand.

    Raises
    ------
    InvalidInputError
        As :func:`open_registry` does.
    """
    for fault in _faults_in_force(configuration, registry):
        raise _placed(configuration.layers, fault)


def idle_faults(configuration: Configuration, registry: Registry) -> tuple[InvalidInputError, ...]:
    """Return what :func:`check` finds though :func:`refuse_faults` does not mind.

    It does no harm until a request asks for it, such as a profile of an algorithm that is not
    there, or none at all, as a distribution that is not installed.
    """
    return tuple(
        _placed(configuration.layers, fault) for fault in _all_faults(configuration, registry)
    )


def check(path: str | Path | None = None) -> tuple[Path | None, list[InvalidInputError]]:
    """Find the faults of a file and the environment, in every profile too.

    Parameters
    ----------
    path
        The file; left out, as for :func:`load`.

    Returns
    -------
    path, list of InvalidInputError
        The file that was read, if there is one, and the faults of all kinds. What has no use is
        left out of what is checked after it.

    Raises
    ------
    InvalidInputError
        If a file is named and does not exist.
    """
    file = found_file(path)
    found: list[InvalidInputError] = []
    layers = [environment_layer(os.environ, found.append), builtin_layer()]
    if file is not None:
        try:
            layers.insert(1, file_layer(file))
        except InvalidInputError as error:
            found.append(error)
    settings, sound, faults = _sound(tuple(layers))
    found += faults
    configuration = _configuration(settings, sound)
    registry = default_registry(configuration.rules)
    found += [_placed(sound, fault) for fault in _all_faults(configuration, registry)]
    return file, found


def _sound(
    layers: tuple[Layer, ...],
) -> tuple[Settings, tuple[Layer, ...], list[InvalidInputError]]:
    """Return what layers set, without what has no use; the layers without it; and the faults."""
    found: list[InvalidInputError] = []
    sound = layers
    while True:
        try:
            settings = Settings.of(without_overruled(sound))
        except ValidationError as error:
            found += _faults(error, sound)
            wrong = [tuple(map(str, fault["loc"])) for fault in error.errors(include_url=False)]
        else:
            faults = list(_segmenter_faults(settings))
            if not faults:
                return settings, sound, found
            found += [_placed(sound, fault) for fault in faults]
            wrong = [path[:-1] for path, _ in faults]
        left = without(sound, wrong)
        assert left != sound, "a fault is at no value, and would be found for ever"
        sound = left


def _layers(path: str | Path | None, flags: Mapping[str, Any], search: bool) -> tuple[Layer, ...]:
    """Return the layers, the strongest first."""
    file = found_file(path) if path or search else None
    return (
        flag_layer(flags),
        environment_layer(os.environ),
        *([file_layer(file)] if file else []),
        builtin_layer(),
    )


def _defaults(settings: Settings) -> Defaults:
    return Defaults(
        pipeline=_selection(settings.pipeline),
        parameters={kind: getattr(settings.algorithms, kind) for kind in Kind},
        profiles=tuple(
            Profile(
                name,
                profile.summary,
                _selection(profile),
                profile.weights,  # type: ignore[arg-type]  # three, five or six
                profile.allow_unmatched,
            )
            for name, profile in settings.profiles.items()
        ),
        profile=settings.profile,
    )


def _selection(stages: Any) -> Selection:
    chosen = {stage: getattr(stages, stage) for stage in STAGES}
    return {
        stage: Choice(choice.name, choice.parameters)
        for stage, choice in chosen.items()
        if choice.name or choice.parameters
    }


_NO_TABLE = ("dict_type", "model_attributes_type", "model_type")


def _faults(error: ValidationError, layers: Sequence[Layer]) -> Iterator[InvalidInputError]:
    """Yield what a validation found wrong, each in one sentence."""
    for fault in error.errors(include_url=False):
        path = tuple(str(part) for part in fault["loc"])
        place = _place(layers, path)
        if fault["type"] == "extra_forbidden":
            problem = f"is not a setting; {_known(path, place)}"
        elif path[-1] == "[key]":
            problem = "cannot be the name of a profile; use small letters, digits and hyphens"
        elif fault["type"] in _NO_TABLE:
            naming = (
                f"; set {'.'.join(path)}.name to choose an algorithm"
                if "name" in keys_of(path)
                else ""
            )
            problem = f"is {quoted(fault['input'])}; it should be a table{naming}"
        else:
            problem = fault_of(fault["input"], fault["msg"])
        yield InvalidInputError(Reason.INVALID_PARAMETER, place, problem)


def _known(path: tuple[str, ...], place: str) -> str:
    """Say which setting may have been meant."""
    *above, last = path
    keys = keys_of(tuple(above))
    near = [(*above, key) for key in get_close_matches(last, keys, 1)]
    if not near:
        dotted = {".".join(known): known for known in static_paths()}
        near = [dotted[found] for found in get_close_matches(".".join(path), dotted, 1, 0.75)]
    if not near:
        return f"{'.'.join(above) or 'a configuration'} has: {', '.join(keys)}"
    variable = place.startswith("SKETCHMATCH_")
    return f"did you mean {variable_of(near[0]) if variable else '.'.join(near[0])}?"


_Fault = tuple[tuple[str, ...], InvalidInputError]
"""What is wrong, and the path where it is said."""


def _segmenter_faults(settings: Settings) -> Iterator[_Fault]:
    """Yield parameters of a segmenter without its name: each kind of source has another one."""
    tables: list[tuple[tuple[str, ...], Selection]]
    tables = [(("pipeline",), _selection(settings.pipeline))]
    tables += [(("profiles", name), _selection(p)) for name, p in settings.profiles.items()]
    for path, selection in tables:
        for stage, choice in selection.items():
            if kind_of(stage) is Kind.SEGMENTER and not choice.name:
                problem = (
                    "is set without the name of a segmenter; give the name beside it, or set the "
                    "parameter in algorithms.segmenter.NAME"
                )
                whole = (*path, stage, "parameters", next(iter(choice.parameters)))
                yield whole, InvalidInputError(Reason.INVALID_PARAMETER, stage, problem)


def _all_faults(configuration: Configuration, registry: Registry) -> list[_Fault]:
    """Return what is wrong with every stage, algorithm and profile, each once."""
    found = [*_stage_faults(configuration, registry), *_algorithm_faults(configuration, registry)]
    inherited = {(path[-1], fault.problem) for path, fault in found}
    for profile in configuration.defaults.profiles:
        found += [
            (path, fault)
            for path, fault in _profile_faults(configuration, registry, profile.name)
            if (path[-1], fault.problem) not in inherited
        ]
    return [
        *found,
        *_default_profile_faults(configuration),
        *_distribution_faults(configuration, registry),
    ]


def _faults_in_force(configuration: Configuration, registry: Registry) -> Iterator[_Fault]:
    """Yield what is wrong with what is used where a request chooses nothing, and with algorithms.

    Settings of algorithms that are not there do no harm.
    """
    yield from _stage_faults(configuration, registry)
    for path, fault in _algorithm_faults(configuration, registry):
        if fault.reason is not Reason.UNKNOWN_ALGORITHM:
            yield path, fault
    yield from _default_profile_faults(configuration)
    yield from _profile_faults(configuration, registry, configuration.defaults.profile)


def _stage_faults(configuration: Configuration, registry: Registry) -> Iterator[_Fault]:
    for stage, choice in configuration.defaults.pipeline.items():
        name = choice.name or registry.default(kind_of(stage))
        whole = Choice(name, choice.parameters)
        for error in set_up_faults(registry, kind_of(stage), whole, stage):
            yield ("pipeline", *error.field.split(".")), error


def _algorithm_faults(configuration: Configuration, registry: Registry) -> Iterator[_Fault]:
    for kind, algorithms in configuration.defaults.parameters.items():
        for name, parameters in algorithms.items():
            for error in set_up_faults(registry, kind, Choice(name, parameters), kind):
                # There the parameters stand below the name itself.
                yield ("algorithms", str(kind), name, *error.field.split(".")[2:]), error


def _distribution_faults(configuration: Configuration, registry: Registry) -> Iterator[_Fault]:
    """Yield distributions that are named in vain: what is denied by a wrong name is let in."""
    installed = {canonical(status.distribution) for status in registry.statuses}
    others = sorted(installed - {OWN_DISTRIBUTION})
    plugins = configuration.settings.plugins
    for key in ("allow", "deny", "trusted"):
        for name in getattr(plugins, key) or ():
            if key == "deny" and canonical(name) == OWN_DISTRIBUTION:
                problem = f"is {quoted(name)}, the engine itself, which cannot be denied; drop it"
            elif canonical(name) in installed or (key, name) == ("trusted", "*"):
                continue
            else:
                near = get_close_matches(canonical(name), others, 1)
                remedy = (
                    f"did you mean {near[0]}?"
                    if near
                    else f"those with plugins are: {', '.join(others) or 'none'}"
                )
                problem = f"is {quoted(name)}, which is not installed or has no plugin; {remedy}"
            fault = InvalidInputError(Reason.INVALID_PARAMETER, f"plugins.{key}", problem)
            yield ("plugins", key), fault


def _default_profile_faults(configuration: Configuration) -> Iterator[_Fault]:
    try:
        configuration.defaults.named("")
    except InvalidInputError as error:
        yield ("profile",), error


def _profile_faults(
    configuration: Configuration, registry: Registry, profile: str
) -> Iterator[_Fault]:
    for error in profile_faults(registry, configuration.defaults, profile):
        yield ("profiles", profile, *error.field.split(".")), error


def _placed(layers: Sequence[Layer], fault: _Fault) -> InvalidInputError:
    """Return an error with the place of its value as its path."""
    path, error = fault
    return InvalidInputError(error.reason, _place(layers, path), error.problem)


def _place(layers: Sequence[Layer], path: Sequence[str]) -> str:
    """Return what something wrong at a path is called where it is said: at, below or beside it."""
    wanted = tuple(path)
    for length in range(len(wanted), 0, -1):
        for layer in layers:
            for leaf, label in layer.labels.items():
                if leaf[:length] == wanted[:length]:
                    return _called(layer, label, wanted, len(leaf))
    return ".".join(wanted)


def _called(layer: Layer, label: str, path: Sequence[str], known: int) -> str:
    """Return what a value is called where it is set; ``label`` stands for the path's beginning."""
    if layer.origin is Origin.FILE:
        return f"{layer.name}: {'.'.join(part for part in path if part != '[key]')}"
    rest = ".".join(part for part in path[known:] if part != "[key]")
    return f"{label}: {rest}" if rest else label
