"""Write the reference page of all that a plugin may import, ``API.md``, from the docstrings.

``make api`` runs it.
"""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path

from griffe2md import ConfigDict, render_package_docs

from sketchmatch.cli.reference import markdown
from sketchmatch.model.caching import cached_property

__all__ = ["page"]

_ENGINE = Path(__file__).parents[1] / "engine"
_MODULES = (
    "sketchmatch.api",
    "sketchmatch.api.kernels",
    "sketchmatch.api.forces",
    "sketchmatch.api.pixels",
    "sketchmatch.api.documents",
    "sketchmatch.model",
    "sketchmatch.testing",
)
_OPTIONS = ConfigDict(
    docstring_style="numpy",
    inherited_members=False,
    search_paths=[str(_ENGINE)],
    show_if_no_docstring=False,
    show_object_full_path=False,
    show_root_members_full_path=False,
    show_signature_annotations=True,
    show_submodules=False,
    summary=False,
)
_PREAMBLE = """# The plugin API

<!-- Written by `make api`. -->

All that a plugin may import. [CONTRIBUTING](../CONTRIBUTING.md#adding-an-algorithm) tells how to
write one, and [REFERENCE](REFERENCE.md) describes the algorithms that there are.
"""


def page() -> str:
    """Return the page, in Markdown."""
    anchors = ((module, module.replace(".", "")) for module in _MODULES)
    contents = "\n".join(f"- [`{module}`](#{anchor})" for module, anchor in anchors)
    return "\n".join([_PREAMBLE, contents, "", *map(_module, _MODULES)])


def _module(name: str) -> str:
    """Return what there is to say of a module, without links to what has no anchor, and roles."""
    text = render_package_docs(name, _OPTIONS)
    text = re.sub(r"\[([^][]+)\]\(#[^()]*\)", r"\1", text)
    for value in sorted(_values(name)):  # which griffe takes for methods
        text = re.sub(rf"^{value}\(\) -> ", f"{value}: ", text, flags=re.MULTILINE)
    return re.sub(r"::$", ":", markdown(text), flags=re.MULTILINE).rstrip() + "\n"


def _values(name: str) -> set[str]:
    """Return the names of what classes of a module compute once."""
    members = [
        each
        for cls in vars(import_module(name)).values()
        if isinstance(cls, type)
        for each in vars(cls).values()
    ]
    return {
        each.attrname for each in members if isinstance(each, cached_property) and each.attrname
    }


if __name__ == "__main__":
    print(page(), end="")
