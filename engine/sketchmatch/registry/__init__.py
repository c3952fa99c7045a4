"""Finding plugins and picking algorithms from them by name."""

from sketchmatch.registry.discovery import discover
from sketchmatch.registry.registry import Kind, PluginStatus, Registered, Registry

__all__ = ["Kind", "PluginStatus", "Registered", "Registry", "default_registry", "discover"]

_default: Registry | None = None


def default_registry() -> Registry:
    """Return the registry of all installed plugins, discovered once a process."""
    global _default  # noqa: PLW0603
    if _default is None:
        _default = discover()
    return _default
