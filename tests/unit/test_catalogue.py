"""What the command line makes of a catalogue, whoever sent it."""

import pytest
from google.protobuf.struct_pb2 import Struct

from sketchmatch.app.application import Application
from sketchmatch.cli.app import main
from sketchmatch.cli.catalogue import Parameter, parameters
from sketchmatch.cli.listing import show_catalogue
from sketchmatch_proto.v1 import catalog_service_pb2 as catalog


def algorithm(distribution, **fields):
    message = catalog.Algorithm(
        kind=catalog.ALGORITHM_KIND_SEARCHER,
        name="hill-climb",
        distribution=distribution,
        distribution_version="1.2",
    )
    message.MergeFrom(catalog.Algorithm(**fields))
    return message


def schema(**properties):
    message = Struct()
    definitions = {"Mode": {"enum": ["fast", "slow"], "type": "string"}}
    message.update({"type": "object", "properties": properties, "$defs": definitions})
    return message


@pytest.mark.parametrize(
    ("said", "parameter"),
    [
        (
            {"type": "integer", "default": 4, "minimum": 2, "multipleOf": 2, "description": "Of."},
            Parameter("x", "integer", "4", "≥ 2, a multiple of 2", "", "Of."),
        ),
        (
            {"type": "number", "default": 1e-6, "exclusiveMinimum": 0, "unit": "m"},
            Parameter("x", "number", "1e-06", "> 0", "m", ""),
        ),
        (
            {"anyOf": [{"type": "integer", "maximum": 9}, {"type": "null"}], "default": None},
            Parameter("x", "integer | null", "null", "≤ 9", "", ""),
        ),
        (
            {"$ref": "#/$defs/Mode", "default": "fast", "description": "Two\n lines."},
            Parameter("x", "fast | slow", "fast", "", "", "Two lines."),
        ),
        ({"const": "only", "default": "only"}, Parameter("x", "only", "only", "", "", "")),
        ({"type": "boolean", "default": True}, Parameter("x", "boolean", "true", "", "", "")),
        ({"type": "array"}, Parameter("x", "array", "", "", "", "")),
        ({}, Parameter("x", "any", "", "", "", "")),
    ],
    ids=lambda value: value.type if isinstance(value, Parameter) else "",
)
def test_parameters_are_read_from_their_json_schema(said, parameter):
    assert parameters(algorithm("acme", parameters_schema=schema(x=said))) == [parameter]


def test_a_default_is_shown_with_its_unit():
    assert Parameter("x", "number", "2", "", "m", "").value == "2 m"
    assert Parameter("x", "number | null", "null", "", "m", "").value == "null"


def test_lines_stay_whole_whatever_a_plugin_says(capsys):
    show_catalogue(
        catalog.ListAlgorithmsResponse(
            algorithms=[algorithm("acme", summary="Climbs\nhills\tfast.", source="A. Author.")],
            profiles=[catalog.Profile(name="fast", summary="Soon.", is_default=True)],
            plugins=[
                catalog.Plugin(
                    distribution="acme",
                    version="1.2",
                    state=catalog.PLUGIN_STATE_DISABLED,
                    reason="the configuration\ndenies it",
                )
            ],
        )
    )
    assert capsys.readouterr().out.splitlines() == [
        "kind\tname\tdefault\tdistribution\tversion\tsummary\tsource",
        "searcher\thill-climb\tfalse\tacme\t1.2\tClimbs hills fast.\tA. Author.",
        "",
        "profile\tdefault\tsummary",
        "fast\ttrue\tSoon.",
        "",
        "plugin\tversion\tstate\treason",
        "acme\t1.2\tdisabled\tthe configuration denies it",
    ]


@pytest.fixture
def show(monkeypatch, capsys):
    """Return what `plugins show hill-climb` says if some distributions offer it."""

    def said(*distributions):
        found = catalog.ListAlgorithmsResponse(algorithms=map(algorithm, distributions))
        monkeypatch.setattr(Application, "algorithms", lambda _: found)
        monkeypatch.setattr("sys.argv", ["sketchmatch", "plugins", "show", "hill-climb"])
        with pytest.raises(SystemExit) as left:
            main()
        return left.value.code, "".join(capsys.readouterr())

    return said


def test_a_name_that_two_distributions_offer_is_refused_with_both(show):
    code, said = show("acme", "zeta")
    assert code == 2
    assert said == (
        "sketchmatch: 'hill-climb' is offered by acme 1.2 and zeta 1.2, so it cannot be selected; "
        "uninstall one of them\n"
    )


def test_the_engines_own_algorithm_is_the_one_that_its_name_selects(show):
    code, said = show("acme", "sketchmatch")
    assert code == 0
    assert "distribution\tsketchmatch\n" in said
    assert "acme" not in said
