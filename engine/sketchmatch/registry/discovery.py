"""Loading plugins, each alone, so that a broken one never stops the host."""

from __future__ import annotations

import inspect
import re
import threading
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import replace
from importlib.metadata import Distribution, EntryPoint, distributions
from pathlib import PurePath
from typing import Any, NamedTuple

import pluggy

from sketchmatch.api import API_VERSION, Algorithm, Params, Reader, Segmenter
from sketchmatch.model import Image, OccupancyGrid, PolygonSet, StrokeSet
from sketchmatch.registry import hookspecs
from sketchmatch.registry.distributions import (
    EVERY_PLUGIN,
    PluginRules,
    PluginState,
    PluginStatus,
    canonical,
)
from sketchmatch.registry.raised import words_of
from sketchmatch.registry.readers import RegisteredReader
from sketchmatch.registry.registry import Kind, Registered, Registry

__all__ = ["ENTRY_POINT_GROUP", "discover"]

ENTRY_POINT_GROUP = "sketchmatch"
_LOADING_SECONDS = 30.0
_LONGEST_REASON = 1000
_NAME = re.compile(r"[a-z0-9]+(-[a-z0-9]+)*")
_SOURCES = (StrokeSet, PolygonSet, OccupancyGrid, Image)
_SUFFIX = re.compile(r"(\.[a-z0-9_+-]+)+")


class _Offered(NamedTuple):
    """What one plugin offers."""

    algorithms: list[tuple[Kind, type[Algorithm]]]
    readers: list[type[Reader]]


def discover(
    points: Iterable[EntryPoint] | None = None,
    rules: PluginRules = EVERY_PLUGIN,
    loading_seconds: float = _LOADING_SECONDS,
) -> Registry:
    """Load plugins and return what they offer.

    Parameters
    ----------
    points
        The plugins; all installed ones when left out.
    rules
        Which distributions may offer something. Nothing of the others is imported.
    loading_seconds
        How long one plugin may take to load.

    Returns
    -------
    Registry
        A plugin that cannot be loaded offers nothing and is named in its statuses, and so is a
        distribution that seems to have plugins and cannot be read.
    """
    algorithms: list[Registered] = []
    readers: list[RegisteredReader] = []
    statuses: list[PluginStatus] = []
    for point, status in _installed() if points is None else map(_presumed, points):
        if objection := rules.objection(status.distribution):
            statuses.append(replace(status, state=PluginState.DISABLED, reason=objection))
            continue
        if point is None:
            statuses.append(status)
            continue
        offered = _loaded_in_time(point, loading_seconds)
        if isinstance(offered, BaseException):
            reason = words_of(offered, _LONGEST_REASON)
            statuses.append(replace(status, state=PluginState.FAILED, reason=reason))
        else:
            statuses.append(status)
            origin = (status.distribution, status.version)
            algorithms += [
                Registered(kind, algorithm, *origin) for kind, algorithm in offered.algorithms
            ]
            readers += [RegisteredReader(reader, *origin) for reader in offered.readers]
    return Registry(algorithms, statuses, readers)


def _installed() -> Iterator[tuple[EntryPoint | None, PluginStatus]]:
    """Yield what is installed: each plugin, or none for a distribution that cannot be read.

    Python's own function reads all distributions, and fails for one that is broken, whosever it is.
    """
    seen = set()
    for distribution in distributions():
        name, version = _named_by_folder(distribution)
        if name in seen:  # Python imports the first on its path
            continue
        seen.add(name)
        broken = PluginStatus("", name, version, PluginState.FAILED)
        try:
            points = distribution.entry_points.select(group=ENTRY_POINT_GROUP)
        except Exception as error:  # a parser that expects no damage may raise anything
            if _may_have_plugins(distribution):
                yield None, replace(broken, reason=_unreadable("entry_points.txt", error))
            continue
        for point in points:
            try:
                yield _presumed(point)
            except Exception as error:
                reason = _unreadable("METADATA", error)
                yield None, replace(broken, entry_point=point.name, reason=reason)


def _presumed(point: EntryPoint) -> tuple[EntryPoint, PluginStatus]:
    """Return a plugin and what becomes of it if it loads.

    Raises
    ------
    Exception
        Anything, if its distribution is broken.
    """
    if point.dist is None:
        return point, PluginStatus(point.name, "unknown distribution", "")
    metadata: Any = point.dist.metadata
    name, version = metadata.get("Name"), metadata.get("Version")
    if not name:
        raise ValueError("its metadata has no Name")
    return point, PluginStatus(point.name, name, version or "")


def _unreadable(file: str, error: Exception) -> str:
    return f"its {file} cannot be read ({type(error).__name__}: {error}); install it again"


def _named_by_folder(distribution: Distribution) -> tuple[str, str]:
    """Return the name and the version of a distribution without reading what is in its folder."""
    folder = getattr(distribution, "_path", None)
    if folder is None:  # of someone's own finder
        return distribution.name, distribution.version
    name, _, version = PurePath(str(folder)).stem.partition("-")
    return canonical(name), version


def _may_have_plugins(distribution: Distribution) -> bool:
    """Whether entry points that cannot be read name our group; if unsure, yes."""
    try:
        raw: bytes = distribution._path.joinpath("entry_points.txt").read_bytes()  # type: ignore[attr-defined]
    except (AttributeError, OSError):
        return True
    # Without the zeros of UTF-16.
    return f"[{ENTRY_POINT_GROUP}]".encode() in raw.replace(b"\0", b"")


def _loaded_in_time(point: EntryPoint, seconds: float) -> _Offered | BaseException:
    """Load a plugin in a thread of its own, which is left behind if it takes too long.

    Returns
    -------
    list or BaseException
        What it offers, or what it raised: in that thread nothing of this is Ctrl-C.
    """
    outcome: list[_Offered | BaseException] = []

    def load() -> None:
        try:
            outcome.append(_load(point))
        except BaseException as error:
            outcome.append(error)

    loading = threading.Thread(target=load, name=f"sketchmatch-load-{point.name}", daemon=True)
    loading.start()
    loading.join(seconds)
    if not outcome:
        return TimeoutError(f"it was not loaded after {seconds:g} s; do less at import")
    return outcome[0]


def _load(point: EntryPoint) -> _Offered:
    module = point.load()
    _check_version(getattr(module, "sketchmatch_api_version", 1))
    manager = pluggy.PluginManager("sketchmatch")
    manager.add_hookspecs(hookspecs)
    manager.register(module, name=point.name)
    _check_hooks(manager)
    found = [
        (kind, _checked(kind, offered))
        for kind in Kind
        for classes in getattr(manager.hook, kind.hook)()
        for offered in classes
    ]
    readers = [
        _checked_reader(offered)
        for classes in manager.hook.sketchmatch_register_readers()
        for offered in classes
    ]
    if not (found or readers):
        raise ValueError("it offers no algorithm and no reader")
    for (kind, name), times in Counter((kind, item.name) for kind, item in found).items():
        if times > 1:
            raise ValueError(f"it offers {times} {kind.plural} named {name!r}")
    return _Offered(found, readers)


def _check_hooks(manager: pluggy.PluginManager) -> None:
    """Refuse what is marked as a hook and is none."""
    hooks = {name: hook for name, hook in vars(manager.hook).items() if not name.startswith("_")}
    known = sorted(name for name, hook in hooks.items() if hook.has_spec())
    for name, hook in hooks.items():
        if name not in known and not all(each.optionalhook for each in hook.get_hookimpls()):
            raise ValueError(f"it has {name}, which is not a hook; hooks are: {', '.join(known)}")


def _check_version(version: Any) -> None:
    if not isinstance(version, int) or isinstance(version, bool):
        raise TypeError(f"sketchmatch_api_version is {version!r}, which is not a whole number")
    if version > API_VERSION:
        raise ValueError(
            f"it is written for version {version} of the plugin API, but this engine has "
            f"{API_VERSION}; upgrade sketchmatch"
        )
    if version < API_VERSION:
        raise ValueError(
            f"it is written for version {version} of the plugin API, but this engine has "
            f"{API_VERSION}; upgrade the plugin"
        )


def _checked(kind: Kind, offered: Any) -> type[Algorithm]:
    """Return what a plugin offered if it is an algorithm of the kind."""
    if not (isinstance(offered, type) and issubclass(offered, kind.interface)):
        raise TypeError(f"{kind.hook} offers {offered!r}, which is not a {kind.interface.__name__}")
    if inspect.isabstract(offered):
        missing = ", ".join(sorted(getattr(offered, "__abstractmethods__", ())))
        raise TypeError(f"{offered.__name__} does not define {missing}")
    _check_texts(offered)
    _check_params(offered)
    if issubclass(offered, Segmenter):
        _check_sources(offered)
    return offered


def _checked_reader(offered: Any) -> type[Reader]:
    """Return what a plugin offered if it is a reader."""
    if not (isinstance(offered, type) and issubclass(offered, Reader)):
        raise TypeError(f"sketchmatch_register_readers offers {offered!r}, which is not a Reader")
    if inspect.isabstract(offered):
        raise TypeError(f"{offered.__name__} does not define read")
    _check_texts(offered)
    for attribute in ("suffixes", "keys"):
        texts = getattr(offered, attribute)
        if not (isinstance(texts, tuple) and all(isinstance(text, str) for text in texts)):
            raise TypeError(f"{offered.__name__}.{attribute} is not a tuple of strings")
    for suffix in offered.suffixes:
        if not _SUFFIX.fullmatch(suffix) or suffix == ".json":
            raise ValueError(
                f"{offered.__name__} reads {suffix!r}; use small letters, as in '.plan', and keys "
                "for .json"
            )
    if not (offered.suffixes or offered.keys):
        raise ValueError(
            f"{offered.__name__} has neither suffixes nor keys to recognise its files by"
        )
    if not _is_source(getattr(offered, "source", None)):
        raise TypeError(f"{offered.__name__}.source is not one of {_KNOWN_SOURCES}")
    return offered


def _check_texts(offered: type[Any]) -> None:
    for attribute in ("name", "summary"):
        if not isinstance(getattr(offered, attribute, None), str):
            raise TypeError(f"{offered.__name__}.{attribute} is not a string")
    if not _NAME.fullmatch(offered.name):
        raise ValueError(
            f"{offered.__name__}.name is {offered.name!r}; use small letters, digits and hyphens"
        )


def _check_params(offered: type[Algorithm]) -> None:
    params = offered.Params
    if not (isinstance(params, type) and issubclass(params, Params)):
        raise TypeError(f"{offered.__name__}.Params does not derive from sketchmatch.api.Params")
    for name, field in params.model_fields.items():
        if field.is_required():
            raise ValueError(f"{offered.__name__}.Params.{name} has no default")
    params.model_json_schema()


def _check_sources(offered: type[Segmenter]) -> None:
    sources = getattr(offered, "sources", None)
    if not (isinstance(sources, tuple) and sources and all(map(_is_source, sources))):
        raise TypeError(f"{offered.__name__}.sources is not a tuple of some of {_KNOWN_SOURCES}")


def _is_source(kind: Any) -> bool:
    """Whether it is a type of source, or a plugin's own with more in it."""
    return isinstance(kind, type) and issubclass(kind, _SOURCES)


_KNOWN_SOURCES = ", ".join(source.__name__ for source in _SOURCES)
