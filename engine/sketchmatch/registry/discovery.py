"""Loading plugins, each alone, so that a broken one never stops the host."""

from __future__ import annotations

import inspect
from collections.abc import Iterable
from importlib.metadata import EntryPoint, entry_points
from typing import Any

import pluggy

from sketchmatch.api import Algorithm, Params
from sketchmatch.registry import hookspecs
from sketchmatch.registry.registry import Kind, PluginStatus, Registered, Registry

__all__ = ["ENTRY_POINT_GROUP", "discover"]

ENTRY_POINT_GROUP = "sketchmatch"


def discover(points: Iterable[EntryPoint] | None = None) -> Registry:
    """Load plugins and return what they offer.

    Parameters
    ----------
    points
        The plugins; all installed ones when left out.

    Returns
    -------
    Registry
        A plugin that cannot be loaded offers nothing and is named in its statuses.
    """
    algorithms: list[Registered] = []
    statuses: list[PluginStatus] = []
    for point in entry_points(group=ENTRY_POINT_GROUP) if points is None else points:
        origin = (
            point.dist.name if point.dist else "unknown distribution",
            point.dist.version if point.dist else "",
        )
        try:
            algorithms += [Registered(kind, algorithm, *origin) for kind, algorithm in _load(point)]
            failure = ""
        except Exception as error:  # a plugin may raise anything
            failure = f"{type(error).__name__}: {error}"
        statuses.append(PluginStatus(point.name, *origin, failure))
    return Registry(algorithms, statuses)


def _load(point: EntryPoint) -> list[tuple[Kind, type[Algorithm]]]:
    manager = pluggy.PluginManager("sketchmatch")
    manager.add_hookspecs(hookspecs)
    manager.register(point.load(), name=point.name)
    manager.check_pending()
    return [
        (kind, _checked(kind, offered))
        for kind in Kind
        for classes in getattr(manager.hook, kind.hook)()
        for offered in classes
    ]


def _checked(kind: Kind, offered: Any) -> type[Algorithm]:
    """Return what a plugin offered if it is an algorithm of the kind."""
    if not (isinstance(offered, type) and issubclass(offered, kind.interface)):
        raise TypeError(f"{kind.hook} offers {offered!r}, which is not a {kind.interface.__name__}")
    if inspect.isabstract(offered):
        missing = ", ".join(sorted(getattr(offered, "__abstractmethods__", ())))
        raise TypeError(f"{offered.__name__} does not define {missing}")
    for attribute in ("name", "summary"):
        if not isinstance(getattr(offered, attribute, None), str):
            raise TypeError(f"{offered.__name__}.{attribute} is not a string")
    if not issubclass(offered.Params, Params):
        raise TypeError(f"{offered.__name__}.Params does not derive from sketchmatch.api.Params")
    return offered
