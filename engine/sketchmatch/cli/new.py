"""``sketchmatch plugins new``."""

from __future__ import annotations

import re
import shlex
from importlib import metadata, resources
from importlib.util import find_spec
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, Annotated

import typer

import sketchmatch
from sketchmatch.cli.options import say, to_path
from sketchmatch.cli.output import answering, write_line
from sketchmatch.errors import InvalidInputError, Reason, quoted

if TYPE_CHECKING:
    from sketchmatch.registry import Kind

__all__ = ["new"]

_NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")
_LONGEST_NAME = 40
_TESTS = {"segmenter": "test_segmenter.py"}
_USUAL_LIBRARIES = ("numpy>=1.26", "pydantic>=2.7")
_LIBRARIES = {"segmenter": ("pydantic>=2.7",)}


@answering
def new(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="Name by which the algorithm is selected.")
    ],
    kind: Annotated[
        str,
        typer.Option(
            "--kind", metavar="KIND", help="segmenter, histogram, similarity, searcher or judge."
        ),
    ],
    into: Annotated[
        Path,
        typer.Option(
            "--into",
            metavar="DIR",
            help="Folder to write it into.",
            parser=to_path,
        ),
    ] = Path(),
) -> None:
    """Create a working plugin: a package with a small algorithm of a kind, and its tests.

    The distribution and its folder are called sketchmatch-NAME. Prints the commands that install,
    test and use it.
    """
    chosen = _kind(kind)
    _check_name(name, chosen)
    folder = into / f"sketchmatch-{name}"
    if folder.exists():
        raise InvalidInputError(
            Reason.INVALID_FIELD,
            str(folder),
            "exists already; choose another NAME, or another folder with --into",
        )
    _write(folder, _files(name, chosen))
    say(f"wrote the {chosen} {name} into {folder}; these commands install, test and use it")
    for command in _next_steps(folder, name, chosen):
        write_line(command)


def _kind(text: str) -> Kind:
    from sketchmatch.registry import Kind

    try:
        return Kind(text)
    except ValueError:
        known = ", ".join(Kind)
        raise InvalidInputError(
            Reason.INVALID_FIELD, "--kind", f"is {quoted(text)}; choose one of: {known}"
        ) from None


def _check_name(name: str, kind: Kind) -> None:
    """Refuse a name that nothing can be called by, or that something is called by already."""
    from sketchmatch.registry import default_registry

    if not _NAME.fullmatch(name) or len(name) > _LONGEST_NAME:
        raise _about_name(
            name,
            f"cannot be the name of an algorithm; use up to {_LONGEST_NAME} small letters, digits "
            "and single hyphens, and begin with a letter, as in hill-climber",
        )
    for item in default_registry().of_kind(kind):
        if item.name == name:
            raise _about_name(
                name,
                f"is already a {kind} of {item.distribution} {item.version}; choose another name",
            )
    if find_spec(_module(name)) or f"sketchmatch-{name}" in _installed():
        raise _about_name(
            name,
            f"would make the package {_module(name)}, which is installed already; "
            "choose another name",
        )


def _about_name(name: str, problem: str) -> InvalidInputError:
    return InvalidInputError(Reason.INVALID_FIELD, "NAME", f"{quoted(name)} {problem}")


def _installed() -> set[str]:
    return {item.name.replace("_", "-").lower() for item in metadata.distributions()}


def _module(name: str) -> str:
    return f"sketchmatch_{name.replace('-', '_')}"


def _files(name: str, kind: Kind) -> dict[str, str]:
    """Return the text of each file by its path in the folder."""
    package = f"src/{_module(name)}"
    templates = {
        "pyproject.toml": "pyproject.toml",
        "README.md": "README.md",
        ".gitignore": "gitignore",
        f"{package}/__init__.py": "__init__.py",
        f"{package}/{kind}.py": f"{kind}.py",
        f"{package}/py.typed": "py.typed",
        f"tests/test_{kind}.py": _TESTS.get(kind, "test_matching.py"),
    }
    values = _values(name, kind)
    return {
        path: Template(_template(template)).substitute(values)
        for path, template in templates.items()
    }


def _template(name: str) -> str:
    folder = resources.files("sketchmatch") / "templates" / "plugin"
    return (folder / f"{name}.tmpl").read_text(encoding="utf-8")


def _values(name: str, kind: Kind) -> dict[str, str]:
    """Return what the templates leave open."""
    major, minor = (int(part) for part in sketchmatch.__version__.split(".")[:2])
    return {
        "name": name,
        "kind": kind,
        "distribution": f"sketchmatch-{name}",
        "module": _module(name),
        # With its kind at the end it hides nothing that is imported beside it.
        "class_name": "".join(part.capitalize() for part in (*name.split("-"), kind)),
        "interface": kind.interface.__name__,
        "hook": kind.hook,
        "dependencies": ", ".join(f'"{item}"' for item in _LIBRARIES.get(kind, _USUAL_LIBRARIES)),
        "version": f"{major}.{minor}",
        "next_version": f"{major}.{minor + 1}",
    }


def _write(folder: Path, files: dict[str, str]) -> None:
    try:
        for path, text in files.items():
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            (folder / path).write_text(text, encoding="utf-8")
    except OSError as error:
        raise InvalidInputError(
            Reason.INVALID_FILE,
            str(folder),
            f"cannot be written ({error.strerror}); choose another folder with --into",
        ) from None


def _next_steps(folder: Path, name: str, kind: Kind) -> list[str]:
    use = {
        "segmenter": f"sketchmatch segment map.geojson --segmenter {name}",
        "histogram": f"sketchmatch match sketch.svg map.yaml --histogram {name}",
        "similarity": f"sketchmatch match sketch.svg map.yaml --similarity {name}",
        "searcher": f"sketchmatch match sketch.svg map.yaml --searcher {name}",
        "judge": f"sketchmatch match sketch.svg map.yaml --judge {name}",
    }
    return [
        f"cd {shlex.quote(str(folder))}",
        "python -m pip install --editable '.[test]'",
        "python -m pytest",
        f"sketchmatch plugins show {name}",
        use[kind],
    ]
