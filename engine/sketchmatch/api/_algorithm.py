"""What every algorithm of every kind has: a name, a summary, typed parameters."""

from __future__ import annotations

from typing import Any, ClassVar

from sketchmatch.api._numbers import Plain

__all__ = ["API_VERSION", "Algorithm", "Params"]

API_VERSION = 1
"""Version of the plugin API. It rises when a plugin written before would no longer work."""


class Params(Plain):
    """Parameters of one algorithm: frozen, nothing extra; default, bounds and text on every field.

    It is a model of pydantic, in which a number is neither True nor text. One definition serves
    validation, configuration, command line, catalogue and documentation.

    Examples
    --------
    >>> from pydantic import Field
    >>> class Tracing(Params):
    ...     tolerance: float = Field(
    ...         default=0.1, gt=0, description="Simplification.", json_schema_extra={"unit": "m"}
    ...     )
    >>> Tracing(tolerance=0.5)
    Tracing(tolerance=0.5)
    """


class Algorithm:
    """Base of the five kinds of plugin.

    Parameters
    ----------
    params
        An instance of the class's own ``Params``; its defaults when left out.

    Attributes
    ----------
    name
        The name by which a request, a configuration file or a command line selects the algorithm.
    summary
        One line for lists.
    default
        Whether it is the default of its kind, or, for a segmenter, of the sources that it reads.
        Only counts for a class of the engine's own distribution that sets it itself: it is not
        inherited.
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    default: ClassVar[bool] = False

    class Params(Params):
        """No parameters, unless the algorithm defines its own."""

    @classmethod
    def warm_up(cls) -> None:
        """Compile what the first use would otherwise wait for; nothing unless overridden."""

    def __init__(self, params: Any = None) -> None:
        self.params = self.Params() if params is None else params

    @property
    def identity(self) -> str:
        """Identifies the algorithm and its parameters: equal for two that do the same."""
        return f"{self.name} {self.params.model_dump_json()}"
