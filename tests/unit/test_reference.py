"""The reference page and the texts of the built-in algorithms that it is made from."""

import re
from enum import StrEnum

import pytest
from pydantic import Field

from sketchmatch.api import Params, Similarity
from sketchmatch.app import responses
from sketchmatch.cli.reference import page
from sketchmatch.errors import InvalidInputError
from sketchmatch.registry import OWN_DISTRIBUTION, Kind, Registered, Registry, discover
from tests.tools import ROOT

BUILT_IN = [item for item in discover().algorithms if item.distribution == OWN_DISTRIBUTION]
FIELDS = [
    pytest.param(item, name, id=f"{item.name}.{name}")
    for item in BUILT_IN
    for name in item.schema.get("properties", {})
]
UNITS = {
    r"\bmet(re|er)s?\b": "m",
    r"\bm²": "m²",
    r"\bseconds?\b(?! (parent|histogram|best))": "s",
    r"\bdegrees?\b": "°",
    r"\bradians?\b": "rad",
    r"\bpixels?\b": "px",
    r"\bpercent\b": "%",
}
"""The unit of a parameter whose text speaks of it."""


class Shape(StrEnum):
    ROUND = "round"
    SQUARE = "square"


class Stranger(Similarity):
    """Compares as a stranger would, after :class:`~acme.Plain` and [1]_.

    The second ``paragraph``.

    Notes
    -----
    Not on the page.

    References
    ----------
    .. [1] A. Author, "One | two", 1999.
    .. [2] B. Author, 2001.
    """

    name = "strange"
    summary = "Of another distribution."

    class Params(Params):
        """All kinds of parameters."""

        width: float = Field(
            0.25, gt=0, le=0.5, description="A | B", json_schema_extra={"unit": "m"}
        )
        count: int | None = Field(None, ge=2, description="How many.")
        shape: Shape = Field(Shape.ROUND, description="Which.")

    def compare(self, aligned, argument):
        raise NotImplementedError


STRANGE_PAGE = r"""# Algorithms of acme

<!-- Written by `sketchmatch plugins reference --distribution acme`. -->

A request, a configuration file, `--set STAGE.PARAMETER=VALUE` and `params` in Python set the \
parameters; `null` leaves one to the algorithm.

## Similarity measures

### `strange`

Of another distribution.

Compares as a stranger would, after `Plain` and [1].

The second `paragraph`.

Source:

- [1] A. Author, "One | two", 1999.
- [2] B. Author, 2001.

| parameter | type | default | bounds | unit | what it does |
| --- | --- | --- | --- | --- | --- |
| `count` | `integer` or `null` | `null` | ≥ 2 |  | How many. |
| `shape` | `round` or `square` | `round` |  |  | Which. |
| `width` | `number` | `0.25` | > 0, ≤ 0.5 | m | A \| B |
""".replace("\\\n", "")


def catalogue():
    stranger = Registered(Kind.SIMILARITY, Stranger, "acme", "1.2")
    return responses.catalogue(Registry([stranger, *BUILT_IN]))


def test_the_reference_page_is_fresh():
    written = (ROOT / "plugins/REFERENCE.md").read_text(encoding="utf-8")
    assert written == page(catalogue(), "sketchmatch"), "run `make reference`"


def test_a_page_holds_what_the_classes_of_its_distribution_say():
    assert page(catalogue(), "acme") == STRANGE_PAGE


def test_a_distribution_that_offers_nothing_is_refused():
    with pytest.raises(InvalidInputError, match=r"'nobody'.*choose one of: acme, sketchmatch"):
        page(catalogue(), "nobody")


def test_all_algorithms_but_the_choice_among_others_name_their_source():
    assert [item.name for item in BUILT_IN if not item.source] == ["auto"]
    for item in BUILT_IN:
        assert not re.search(r"\bSources?:", item.description), item.name
        cited = re.findall(r"\[\d+\](?=_)", item.description)
        assert set(cited) == set(re.findall(r"\[\d+\]", item.source)), item.name


@pytest.mark.parametrize(("item", "name"), FIELDS)
def test_a_parameter_has_a_text_a_default_and_bounds(item, name):
    said = item.schema["properties"][name]
    assert said["description"]
    assert "default" in said
    for form in said.get("anyOf", [said]):
        if form["type"] in ("integer", "number"):
            assert {"minimum", "exclusiveMinimum"} & form.keys()


@pytest.mark.parametrize(("item", "name"), FIELDS)
def test_a_parameter_whose_text_speaks_of_a_unit_declares_it(item, name):
    said = item.schema["properties"][name]
    for pattern, unit in UNITS.items():
        if re.search(pattern, said["description"], re.IGNORECASE):
            assert said.get("unit") == unit


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("occupancy-grid.min_size", "m"),
        ("rooms.min_area", "m²"),
        ("rooms.tolerance", "m"),
        ("image.blur", "px"),
        ("raster.pixels", "px"),
        ("exact.cell_angle", "°"),
    ],
)
def test_units_reach_the_schema(name, unit):
    algorithm, _, parameter = name.partition(".")
    (item,) = [item for item in BUILT_IN if item.name == algorithm]
    assert item.schema["properties"][parameter]["unit"] == unit
