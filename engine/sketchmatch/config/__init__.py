"""Configuration: one TOML file, environment variables, then flags, each stronger than the last.

``[pipeline.…]`` chooses the algorithms, ``[algorithms.…]`` sets their parameters, ``[profiles.…]``
names whole pipelines; ``[plugins]``, ``[server]`` and ``[limits]`` are for whoever runs a server.
Variables spell the same paths: ``SKETCHMATCH_SERVER__ADDRESS``.
"""

import sketchmatch.api  # noqa: F401  (before pydantic_settings, for what it does for pydantic)

# isort: split
from sketchmatch.config.configuration import (
    Configuration,
    builtin,
    check,
    idle_faults,
    load,
    open_engine,
    open_registry,
    refuse_faults,
)
from sketchmatch.config.layers import Origin, value_of
from sketchmatch.config.listing import Entry, entries, shown_file, template

__all__ = [
    "Configuration",
    "Entry",
    "Origin",
    "builtin",
    "check",
    "entries",
    "idle_faults",
    "load",
    "open_engine",
    "open_registry",
    "refuse_faults",
    "shown_file",
    "template",
    "value_of",
]
