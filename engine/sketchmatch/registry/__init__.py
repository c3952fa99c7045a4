"""Finding plugins and picking algorithms from them by name."""

from functools import cache

from sketchmatch.registry.discovery import discover
from sketchmatch.registry.distributions import (
    EVERY_PLUGIN,
    OWN_DISTRIBUTION,
    PluginRules,
    PluginState,
    PluginStatus,
)
from sketchmatch.registry.readers import RegisteredReader, reader_by_keys, reader_by_name
from sketchmatch.registry.registry import Conflict, Kind, Registered, Registry

__all__ = [
    "EVERY_PLUGIN",
    "OWN_DISTRIBUTION",
    "Conflict",
    "Kind",
    "PluginRules",
    "PluginState",
    "PluginStatus",
    "Registered",
    "RegisteredReader",
    "Registry",
    "default_registry",
    "discover",
    "reader_by_keys",
    "reader_by_name",
]


@cache
def default_registry(rules: PluginRules = EVERY_PLUGIN) -> Registry:
    """Return the registry of the installed plugins that rules let in, discovered once a process."""
    return discover(rules=rules)
