"""The marker with which a plugin marks its hooks."""

import pluggy

__all__ = ["hookimpl"]

hookimpl = pluggy.HookimplMarker("sketchmatch")
"""Marks a function as one of the ``sketchmatch_register_…`` hooks."""
