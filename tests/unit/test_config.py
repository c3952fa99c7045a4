"""Configuration: file, environment and flags, what each says, and every way to say it wrongly."""

import errno
import json
import re
import subprocess
import sys
import tomllib

import pytest

from sketchmatch import Scene, match, read_scene
from sketchmatch.cli.serve import _setup
from sketchmatch.config import Origin, builtin, check, entries, load, open_registry, template
from sketchmatch.config.layers import found_file
from sketchmatch.config.settings import static_paths
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.pipeline.match import run_match
from sketchmatch.pipeline.request import MatchRequest
from sketchmatch.pipeline.selection import Choice, resolve
from sketchmatch.registry import Kind, PluginStatus, Registry, default_registry
from sketchmatch_client import AccessOptions
from tests.pages import Page

SHOWN = Page("engine/GUIDE.md", __name__).take_one("toml")

SCENE = Scene.from_polygons(
    [[[0, 0], [2, 0], [2, 1]], [[5, 1], [6, 1], [6, 4]], [[1, 5], [2, 5], [2, 7]]]
)


@pytest.fixture(autouse=True)
def _nothing_around(monkeypatch, tmp_path):
    """Keep the files and variables of whoever runs the tests out of them."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "home"))


@pytest.fixture
def file(tmp_path):
    def write(text, name="sketchmatch.toml"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return path

    return write


def refused(call, *arguments, **options):
    with pytest.raises(InvalidInputError) as caught:
        call(*arguments, **options)
    assert "\n" not in str(caught.value)
    return caught.value


def searcher_of(configuration, **selection):
    return resolve(
        open_registry(configuration), selection, defaults=configuration.defaults
    ).searcher


# Where it comes from ----------------------------------------------------------------------------


def test_without_file_and_variables_the_built_in_values_hold():
    configuration = load()
    assert configuration == builtin()
    assert configuration.file == ""
    assert searcher_of(configuration).name == "align"
    assert configuration.limits.max_objects == 1000
    assert configuration.rules.objection("acme") == ""


def test_flags_are_stronger_than_variables_and_these_than_the_file(file, monkeypatch):
    path = file("[limits]\nmax_objects = 10\nmax_side = 20\nmax_bytes = 30\n")
    monkeypatch.setenv("SKETCHMATCH_LIMITS__MAX_SIDE", "21")
    monkeypatch.setenv("SKETCHMATCH_LIMITS__MAX_BYTES", "31")
    found = load(path, {"limits.max_bytes": 32, "limits.max_pixels": None})
    limits = found.limits
    assert (limits.max_objects, limits.max_side, limits.max_bytes) == (10, 21, 32)
    assert limits.max_pixels == 64_000_000
    assert found.origin(("limits", "max_objects")) == (
        Origin.FILE,
        f"{path}: limits.max_objects",
    )
    assert found.origin(("limits", "max_side")) == (
        Origin.ENVIRONMENT,
        "SKETCHMATCH_LIMITS__MAX_SIDE",
    )
    assert found.origin(("limits", "max_bytes")) == (Origin.FLAG, "--max-bytes")
    assert found.origin(("limits", "max_pixels")) == (Origin.DEFAULT, "")


def test_the_file_is_looked_for_here_and_then_in_the_users_folder(file, monkeypatch):
    file('profile = "proof"', "home/sketchmatch/sketchmatch.toml")
    if sys.platform == "linux":
        assert load().defaults.profile == "proof"
    file('profile = "proof"')
    assert load().defaults.profile == "proof"
    monkeypatch.setenv("SKETCHMATCH_CONFIG", str(file('profile = "thesis-easm"', "named.toml")))
    assert load().defaults.profile == "thesis-easm"
    assert load(file("", "empty.toml")).defaults.profile == ""
    assert load(search=False).defaults.profile == ""


def test_a_named_file_that_is_missing_is_refused(monkeypatch):
    error = refused(load, "away.toml")
    assert str(error) == (
        "away.toml does not exist; write one with `sketchmatch config init away.toml`"
    )
    monkeypatch.setenv("SKETCHMATCH_CONFIG", "gone.toml")
    assert str(refused(load)).startswith("SKETCHMATCH_CONFIG names gone.toml, which does not exist")


def test_what_the_client_reads_is_no_setting_of_ours(monkeypatch):
    for name in AccessOptions.__annotations__:
        monkeypatch.setenv(f"SKETCHMATCH_{name.upper()}", "text")
    assert load() == builtin()


@pytest.mark.parametrize(
    "variable",
    ["SKETCHMATCH_DEBUG", "SKETCHMATCH_PORT", "SKETCHMATCH_SERVICE_HOST", "SKETCHMATCH_PORT_1_TCP"],
)
def test_variables_of_others_are_left_alone(monkeypatch, variable):
    monkeypatch.setenv(variable, "tcp://10.0.0.1:50051")
    assert load() == builtin()


def test_an_empty_variable_is_not_set(monkeypatch):
    monkeypatch.setenv("SKETCHMATCH_LIMITS__MAX_OBJECTS", " ")
    assert load() == builtin()


def test_variables_say_whatever_a_file_can(monkeypatch):
    monkeypatch.setenv("SKETCHMATCH_PROFILE", "12")
    monkeypatch.setenv("SKETCHMATCH_PROFILES__12__SEARCHER__NAME", "fsnn-pso")
    monkeypatch.setenv("SKETCHMATCH_ALGORITHMS__SEARCHER__FSNN_PSO__PARTICLES", "7")
    monkeypatch.setenv("SKETCHMATCH_PIPELINE__HISTOGRAM", '{"name": "hybrid"}')
    monkeypatch.setenv("SKETCHMATCH_PLUGINS__DENY", "Acme_Search, other")
    monkeypatch.setenv("SKETCHMATCH_PLUGINS__TRUSTED", '["Mine"]')
    configuration = load()
    searcher = searcher_of(configuration)
    assert (searcher.name, searcher.params.particles) == ("fsnn-pso", 7)
    assert configuration.defaults.pipeline["histogram"] == Choice("hybrid")
    assert configuration.rules.objection("acme-search")
    assert configuration.trusted == {"mine"}


def test_a_stronger_place_that_names_another_algorithm_drops_the_parameters(file, monkeypatch):
    path = file("[pipeline.searcher]\nname = 'easm'\nparameters = {population = 9}\n")
    assert searcher_of(load(path)).params.population == 9
    monkeypatch.setenv("SKETCHMATCH_PIPELINE__SEARCHER__NAME", "easm")
    assert searcher_of(load(path)).params.population == 9
    monkeypatch.setenv("SKETCHMATCH_PIPELINE__SEARCHER__NAME", "direct")
    assert searcher_of(load(path)).params.population is None


def test_a_profile_of_ones_own_changes_the_built_in_one(file):
    path = file("profile = 'thesis-easm'\n[profiles.thesis-easm.searcher]\nname = 'exact'\n")
    configuration = load(path)
    pipeline = resolve(open_registry(configuration), {}, defaults=configuration.defaults)
    assert pipeline.searcher.name == "exact"
    assert pipeline.histogram.params.directions == 180, "the other stages stay"


# What is wrong with it --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("[server\naddress = 1", "{file} is not TOML at line 1, column 8 (expected ']' at the end"),
        ("a = 'b", "{file} is not TOML at its end ("),
        (
            "[server]\nadress = 'x'",
            "{file}: server.adress is not a setting; did you mean server.addr",
        ),
        ("sever = 1", "{file}: sever is not a setting; did you mean server?"),
        (
            "[server]\nx = 1",
            "{file}: server.x is not a setting; server has: address, grace_seconds",
        ),
        ("[limits]\nmax_objects = 'few'", "{file}: limits.max_objects is 'few'; it should be a"),
        (
            "[limits]\nmax_objects = '50'",
            "{file}: limits.max_objects is '50'; it should be a",
        ),
        (
            "[server]\nmax_matches = true",
            "{file}: server.max_matches is True; it should be",
        ),
        (
            "[server]\ngrace_seconds = true",
            "{file}: server.grace_seconds is True; it should",
        ),
        (
            "[algorithms.searcher.easm]\npatience = true",
            "{file}: algorithms.searcher.easm.patience is True; it should be a valid integer",
        ),
        ("[limits]\nmax_objects = 1", "{file}: limits.max_objects is 1; it should be greater"),
        ("[server]\ngrace_seconds = inf", "{file}: server.grace_seconds is inf; it should be a f"),
        (
            "profile = 'best'",
            "{file}: profile is 'best', which is not a profile; choose one of: proof",
        ),
        (
            "[pipeline.searcher]\nname = 'best'",
            "{file}: pipeline.searcher.name is 'best', which is not a searcher; choose one of: al",
        ),
        (
            "[pipeline]\nsearcher = 'easm'",
            "{file}: pipeline.searcher is 'easm'; it should be a table; set pipeline.searcher.name",
        ),
        ("server = 3", "{file}: server is 3; it should be a table"),
        ("[algorithms]\nsearcher = 3", "{file}: algorithms.searcher is 3; it should be a table"),
        (
            "[algorithms.searcher.easm]\ncolour = 1",
            "{file}: algorithms.searcher.easm.colour is not a parameter of easm; it has: con",
        ),
        (
            "[algorithms.judge.confidence]\nodds = 3",
            "{file}: algorithms.judge.confidence.odds is not a parameter of confidence; it has",
        ),
        (
            "[pipeline.map_segmenter.parameters]\nmin_size = 1",
            "{file}: pipeline.map_segmenter.parameters.min_size is set without the name of a seg",
        ),
        ("[profiles.'My Own']", "{file}: profiles.My Own cannot be the name of a profile; use"),
    ],
)
def test_a_fault_is_one_sentence_with_its_place(file, text, sentence):
    path = file(text)
    error = refused(lambda: open_registry(load(path)))
    assert str(error).startswith(sentence.format(file=path))
    _, faults = check(path)
    assert str(error) in map(str, faults), "and `config check` says the same"


@pytest.mark.parametrize(
    ("variable", "value", "sentence"),
    [
        ("SERVER__ADRESS", "x", "is not a setting; did you mean SKETCHMATCH_SERVER__ADDRESS?"),
        ("FOO__BAR", "x", "is not a setting; a configuration has: profile, pipeline,"),
        ("MAX_BYTES", "1", "is not a setting; did you mean SKETCHMATCH_LIMITS__MAX_BYTES?"),
        ("LIMITS_MAX_BYTES", "1", "is not a setting; did you mean SKETCHMATCH_LIMITS__MAX_BYTES?"),
        ("LIMITS__MAX_BYTES", "0", "is 0; it should be greater than or equal to 1"),
        ("LIMITS__MAX_BYTES", "[" * 99_999, "is '[[[[[[[[[["),
        ("LIMITS__MAX_BYTES", "1" * 5000, "is '1111111111111111111111111111111111111111111111"),
        ("PROFILE", "best", "is 'best', which is not a profile; choose one of: proof, thesis"),
        (
            "PIPELINE__SEARCHER",
            '{"nmae": 1}',
            ": nmae is not a setting; did you mean SKETCHMATCH_PIP",
        ),
    ],
)
def test_a_bad_variable_is_named(monkeypatch, variable, value, sentence):
    monkeypatch.setenv(f"SKETCHMATCH_{variable}", value)
    error = refused(lambda: open_registry(load()))
    joint = "" if sentence.startswith(":") else " "
    assert str(error).startswith(f"SKETCHMATCH_{variable}{joint}{sentence}")


DEEP = "has tables or lists nested more than 50 deep"


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda path: path.write_bytes(b"\xff"), "is not UTF-8 text; save it as UTF-8"),
        (lambda path: path.mkdir(), "is a directory; give a file in it"),
        (
            lambda path: path.symlink_to("/dev/zero"),
            "has more than 1024 KiB; give a configuration file",
        ),
        (lambda path: path.write_text(f"a = {'[' * 9999}"), f"{DEEP}; give a configuration file"),
        (lambda path: path.write_text(f"[{'a.' * 60}a]"), f"{DEEP}; give a configuration file"),
    ],
)
def test_a_file_that_cannot_be_read_is_refused(tmp_path, make, sentence):
    path = tmp_path / "odd.toml"
    make(path)
    assert str(refused(load, path)) == f"{path} {sentence}"


BAD = ("population", 1, "is 1; it should be greater than or equal to 2")


def test_one_bad_parameter_is_told_in_the_same_words_wherever_it_is_set(file, monkeypatch):
    name, value, words = BAD
    path = file(f"[pipeline.searcher]\nname = 'easm'\nparameters = {{{name} = {value}}}\n")
    said = [refused(lambda: open_registry(load(path)))]
    monkeypatch.setenv("SKETCHMATCH_PIPELINE__SEARCHER__NAME", "easm")
    monkeypatch.setenv("SKETCHMATCH_PIPELINE__SEARCHER__PARAMETERS__POPULATION", str(value))
    said.append(refused(lambda: open_registry(load())))
    monkeypatch.undo()
    flag = {"pipeline.searcher.name": "easm", f"pipeline.searcher.parameters.{name}": value}
    said.append(refused(lambda: open_registry(load(flags=flag, search=False))))
    said.append(refused(match, SCENE, SCENE, searcher="easm", params={"searcher": {name: value}}))
    request = MatchRequest(SCENE, SCENE, {"searcher": Choice("easm", {name: value})})
    said.append(refused(run_match, request, default_registry()))
    assert {(error.reason, error.problem) for error in said} == {(Reason.INVALID_PARAMETER, words)}
    assert [error.field for error in said] == [
        f"{path}: pipeline.searcher.parameters.population",
        "SKETCHMATCH_PIPELINE__SEARCHER__PARAMETERS__POPULATION",
        "--population",
        "pipeline.searcher.parameters.population",
        "pipeline.searcher.parameters.population",
    ]


def test_a_profile_of_no_use_harms_only_those_who_name_it(file):
    path = file(
        "[profiles.mine.searcher]\nname = 'annealing'\n[algorithms.searcher.annealing]\nt = 1"
    )
    configuration = load(path)
    registry = open_registry(configuration)
    request = MatchRequest(SCENE, SCENE, profile="mine")
    error = refused(run_match, request, registry, configuration.defaults)
    assert error.field == "pipeline.profile"
    assert error.problem.startswith(
        "is 'mine', whose searcher.name is 'annealing', which is not a s"
    )
    _, faults = check(path)
    assert [fault.field for fault in faults] == [
        f"{path}: algorithms.searcher.annealing",
        f"{path}: profiles.mine.searcher.name",
    ]
    named = load(path, {"profile": "mine"})
    assert refused(open_registry, named).field == f"{path}: profiles.mine.searcher.name"


def test_a_server_says_what_check_says_and_is_not_started_for_it_if_strict(file, capsys):
    path = file(
        "[plugins]\nallow = ['acme-missing']\n[profiles.mine.searcher]\nname = 'annealing'\n"
    )
    _setup(load(path))
    said = capsys.readouterr().err.splitlines()
    assert said == [f"sketchmatch: {fault}" for fault in check(path)[1]]
    assert [sentence.split(" is ")[0].rpartition(" ")[2] for sentence in said] == [
        "profiles.mine.searcher.name",
        "plugins.allow",
    ]
    error = refused(_setup, load(path, {"plugins.strict": True}))
    assert error.field == f"{path}: profiles.mine.searcher.name"
    assert str(error).endswith("; correct it, or set plugins.strict to false")


def test_numbers_that_people_write_are_numbers(monkeypatch):
    monkeypatch.setenv("SKETCHMATCH_SERVER__GRACE_SECONDS", ".5")
    monkeypatch.setenv("SKETCHMATCH_LIMITS__MAX_OBJECTS", "+50")
    found = load(search=False)
    assert (found.settings.server.grace_seconds, found.limits.max_objects) == (0.5, 50)


def test_check_finds_every_fault(file):
    path = file(
        "[pipeline.histogram]\nparameters = {directions = 3}\n"
        "[algorithms.searcher.nn]\nseed_points = 0\n"
        "[profiles.a.similarity]\nname = 'x'\n[profiles.b.searcher.parameters]\ny = 1\n"
    )
    found, faults = check(path)
    assert found == path
    assert [str(fault).removeprefix(f"{path}: ").split(" is ")[0] for fault in faults] == [
        "pipeline.histogram.parameters.directions",
        "algorithms.searcher.nn.seed_points",
        "profiles.a.similarity.name",
        "profiles.b.searcher.parameters.y",
    ]
    assert check(file("[server]\na = 1\nb = 2\n"))[1][1].field.endswith("server.b")


EVERYTHING_WRONG = """
profile = "best"
colour = 3
[pipeline.searcher]
name = "easm"
parameters = { population = 1, generations = 0, foo = 1 }
[pipeline.map_segmenter.parameters]
min_size = 1
[pipeline.histogram]
name = "nope"
[algorithms.searcher.nn]
seed_points = 0
[profiles.'My Own']
[profiles.mine]
weights = [1, 2]
[profiles.mine.similarity]
name = "x"
[plugins]
deny = ["acme-serach"]
[server]
address = "127.0.0.1"
adress = "x"
[limits]
max_objects = "few"
"""


def test_check_finds_faults_of_every_kind_at_once(file, monkeypatch):
    path = file(EVERYTHING_WRONG)
    monkeypatch.setenv("SKETCHMATCH_MAX_BYTES", "1")
    monkeypatch.setenv("SKETCHMATCH_SERVER__ADRESS", "x")
    monkeypatch.setenv("SKETCHMATCH_SERVER__ADDRESS", "y")
    _, faults = check(path)
    places = [fault.field.removeprefix(f"{path}: ") for fault in faults]
    assert sorted(places) == sorted(
        [
            *("SKETCHMATCH_MAX_BYTES", "SKETCHMATCH_SERVER__ADRESS", "SKETCHMATCH_SERVER__ADDRESS"),
            *("profile", "colour", "server.address", "server.adress", "limits.max_objects"),
            *(f"pipeline.searcher.parameters.{name}" for name in ("population", "foo")),
            *("pipeline.searcher.parameters.generations", "pipeline.histogram.name"),
            "pipeline.map_segmenter.parameters.min_size",
            *("algorithms.searcher.nn.seed_points", "profiles.My Own"),
            *("profiles.mine.weights", "profiles.mine.similarity.name", "plugins.deny"),
        ]
    )


def test_check_goes_on_with_the_environment_where_the_file_is_no_toml(file, monkeypatch):
    path = file("a = [")
    monkeypatch.setenv("SKETCHMATCH_LIMITS__MAX_BYTES", "0")
    _, faults = check(path)
    assert [fault.field for fault in faults] == [str(path), "SKETCHMATCH_LIMITS__MAX_BYTES"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("deny = ['acme-serach']", "which is not installed or has no plugin; did you mean acme-se"),
        ("deny = ['zzz']", "is 'zzz', which is not installed or has no plugin; those with plugins"),
        ("allow = ['Acme_Search', 'zzz']", "those with plugins are: acme-search"),
        ("trusted = ['*', 'zzz']", "is 'zzz', which is not installed"),
        ("deny = ['sketchmatch']", "the engine itself, which cannot be denied; drop it"),
    ],
)
def test_check_finds_distributions_that_are_named_in_vain(file, monkeypatch, text, words):
    own = default_registry()
    strangers = [*own.statuses, PluginStatus("search", "acme.search", "1.0")]
    both = Registry(own.algorithms, strangers)
    monkeypatch.setattr("sketchmatch.config.configuration.default_registry", lambda _: both)
    _, faults = check(file(f"[plugins]\n{text}\n"))
    (fault,) = faults
    assert words in str(fault)
    assert fault.field.endswith(f": plugins.{text.split()[0]}")
    assert check(file("[plugins]\ndeny = ['Acme_Search']\ntrusted = ['*', 'sketchmatch']"))[1] == []


@pytest.mark.parametrize(
    ("address", "fault"),
    [
        ("127.0.0.1:0", ""),
        ("localhost:65535", ""),
        ("[::1]:50051", ""),
        ("unix:s.sock", ""),
        ("unix:///run/s.sock", ""),
        ("unix-abstract:sketchmatch", ""),
        ("localhost", "have a port, as in localhost:50051"),
        ("::1", "have brackets around an IPv6 address"),
        (f"127.0.0.1:{'9' * 5000}", "end with a port from 0 to 65535"),
        ("a\0b:80", "begin with a host"),
        ("fe80::1:50051", "have brackets around an IPv6 address"),
        ("[]:50051", "begin with a host"),
        ("a b:50051", "begin with a host"),
        ("localhost:", "end with a port from 0 to 65535, as in localhost:50051"),
        ("localhost:65536", "end with a port from 0 to 65535"),
        ("localhost:-1", "end with a port from 0 to 65535"),
        ("localhost:²", "end with a port from 0 to 65535"),
        ("dns:///localhost:1", "be HOST:PORT and not a URL"),
        (f"unix:/{'x' * 107}", "name a file by a path of at most 107 bytes"),
        ("unix:", "name a file"),
    ],
)
def test_an_address_to_listen_at_is_whole(file, address, fault):
    path = file(f"[server]\naddress = {json.dumps(address)}\n")
    if not fault:
        assert load(path).settings.server.address == address
        return
    error = refused(load, path)
    assert error.field == f"{path}: server.address"
    assert f"; it should {fault}" in error.problem


# Profiles ---------------------------------------------------------------------------------------


def test_the_built_in_profiles_are_sound_and_as_the_thesis_has_it():
    path, faults = check()
    assert (path, faults) == (None, [])
    profiles = {profile.name: profile for profile in builtin().defaults.profiles}
    assert list(profiles) == ["proof", "thesis", "thesis-easm", "thesis-fsnn"]
    assert all(profile.summary for profile in profiles.values())
    for name in ("proof", "thesis", "thesis-easm", "thesis-fsnn"):
        assert profiles[name].stages["judge"].name == "confidence"
        assert profiles[name].allow_unmatched is False
    easm = profiles["thesis-easm"].stages["searcher"].parameters
    assert (easm["crossover_rate"], easm["exchange_rate"]) == (0.7, 0.5)
    assert (easm["mutation_rate"], easm["patience"]) == (0.3, 400)
    fsnn = profiles["thesis-fsnn"].stages["searcher"].parameters
    assert fsnn == {
        "rotation": "folded",
        "alpha": 10.0,
        "k": 1.0,
        "velocity_limit": 0.2,
        "patience": 30,
    }


def test_a_profile_says_whether_objects_may_stay_unmatched_or_leaves_it_open(file):
    path = file(
        "[profiles.open.judge]\nname = 'confidence'\n[profiles.strict]\nallow_unmatched = false\n"
        "[profiles.loose]\nallow_unmatched = true\n[pipeline.judge]\nname = 'confidence'\n"
    )
    configuration = load(path)
    profiles = {each.name: each.allow_unmatched for each in configuration.defaults.profiles}
    assert [profiles[name] for name in ("open", "strict", "loose")] == [None, False, True]
    found = {entry.path: entry for entry in entries(configuration, default_registry())}
    assert found["pipeline", "judge", "name"].origin is Origin.FILE
    assert found["profiles", "strict", "allow_unmatched"].value is False
    assert found["profiles", "loose", "allow_unmatched"].value is True
    assert ("profiles", "open", "allow_unmatched") not in found


def test_python_takes_profiles_and_files_but_reads_none_that_lies_around(file, monkeypatch):
    assert match(SCENE, SCENE, profile="proof").outcome == "OPTIMAL"
    path = file("[pipeline.searcher]\nname = 'nn'\nparameters = {seed_points = 3}\n")
    assert match(SCENE, SCENE).statistics.iterations != 3
    assert match(SCENE, SCENE, config=path).statistics.iterations == 3
    assert match(SCENE, SCENE, config=path, searcher="auto").outcome == "OPTIMAL"
    assert refused(match, SCENE, SCENE, profile="best").reason is Reason.UNKNOWN_PROFILE
    monkeypatch.setenv("SKETCHMATCH_PIPELINE__SEARCHER__NAME", "nn")
    monkeypatch.setenv("SKETCHMATCH_ALGORITHMS__SEARCHER__NN__SEED_POINTS", "4")
    assert match(SCENE, SCENE).statistics.iterations == 4


def test_python_keeps_to_the_limits_of_the_environment(monkeypatch, tmp_path):
    ring = [[0, 0], [1, 0], [0, 1], [0, 0]]
    shapes = [
        {"type": "Polygon", "coordinates": [[[x + 3 * k, y] for x, y in ring]]} for k in (0, 1, 2)
    ]
    path = tmp_path / "map.geojson"
    path.write_text(json.dumps({"type": "GeometryCollection", "geometries": shapes}))
    assert len(read_scene(path)) == 3
    monkeypatch.setenv("SKETCHMATCH_LIMITS__MAX_OBJECTS", "2")
    for call in (read_scene, lambda path: match(path, SCENE)):
        error = refused(call, path)
        assert "or raise limits.max_objects (SKETCHMATCH_LIMITS__MAX_OBJECTS)" in error.problem


# Files to begin with ----------------------------------------------------------------------------


@pytest.mark.parametrize("uncommented", [False, True])
def test_the_file_to_begin_with_is_sound_and_changes_nothing(file, uncommented):
    text = template(default_registry())
    if uncommented:
        text = re.sub(r"^# ", "", text, flags=re.M)
    path = file(text)
    assert check(path) == (path, [])
    found, expected = load(path), builtin()
    assert found.limits == expected.limits
    assert found.settings.server == expected.settings.server
    for kind in (Kind.HISTOGRAM, Kind.SIMILARITY, Kind.SEARCHER, Kind.JUDGE):
        for item in default_registry().of_kind(kind):
            one, other = (
                getattr(resolve(default_registry(), {kind: Choice(item.name)}, defaults=d), kind)
                for d in (found.defaults, expected.defaults)
            )
            assert one.params == other.params


def test_the_file_to_begin_with_has_every_setting():
    text = template(default_registry())
    set_ = {path[-1] for path in static_paths()} - {"summary"}
    set_ |= {
        name
        for item in default_registry().algorithms
        for name in item.algorithm.Params.model_fields
    }
    for name in set_:
        assert re.search(rf"^#+ {name} (= |is not set)", text, re.M), name
    uncommented = tomllib.loads(re.sub(r"^# ", "", text, flags=re.M))
    assert uncommented["algorithms"]["searcher"]["easm"]["patience"] == 400


def test_the_file_in_the_readme_is_sound(file):
    path = file(SHOWN.text)
    assert check(path) == (path, [])
    assert searcher_of(load(path)).name == "exact"


def test_every_entry_tells_where_it_comes_from(file, monkeypatch):
    path = file("[algorithms.searcher.easm]\npatience = 9\n[server]\nmax_matches = 3\n")
    monkeypatch.setenv("SKETCHMATCH_PIPELINE__SEARCHER__NAME", "easm")
    configuration = load(path, {"server.address": "127.0.0.1:0"})
    found = {entry.path: entry for entry in entries(configuration, default_registry())}
    for dotted, value, origin in [
        ("algorithms.searcher.easm.patience", 9, Origin.FILE),
        ("algorithms.searcher.easm.mutation_rate", 0.3, Origin.DEFAULT),
        ("server.max_matches", 3, Origin.FILE),
        ("server.grace_seconds", 5.0, Origin.DEFAULT),
        ("server.address", "127.0.0.1:0", Origin.FLAG),
        ("pipeline.searcher.name", "easm", Origin.ENVIRONMENT),
        ("pipeline.histogram.name", "constant", Origin.DEFAULT),
    ]:
        entry = found[tuple(dotted.split("."))]
        assert (entry.value, entry.origin) == (value, origin), dotted


def test_no_entry_comes_from_a_place_that_does_not_say_it(file, monkeypatch):
    path = file(
        "[limits]\n[profiles.proof]\n[pipeline.searcher]\nparameters = {}\n"
        "[pipeline.histogram]\nparameters = {directions = 90}\n"
    )
    monkeypatch.setenv("SKETCHMATCH_PIPELINE__HISTOGRAM", '{"name": "constant"}')
    found = {entry.path: entry for entry in entries(load(path), default_registry())}
    origins = {path: entry.origin for path, entry in found.items() if entry.origin != "default"}
    assert origins == {
        ("pipeline", "histogram", "name"): Origin.ENVIRONMENT,
        ("pipeline", "histogram", "parameters", "directions"): Origin.FILE,
    }


def test_help_starts_without_what_reads_the_configuration():
    code = (
        "import sys, sketchmatch, sketchmatch.cli.app; "
        "print([name for name in ('pydantic_settings', 'numba') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_without_a_home_or_with_one_that_is_closed_the_defaults_are_in_force(monkeypatch):
    def homeless(*_):
        raise RuntimeError("could not determine the home directory")

    def closed(path, **_):
        raise PermissionError(errno.EACCES, "Permission denied", path)

    monkeypatch.delenv("SKETCHMATCH_CONFIG", raising=False)
    with monkeypatch.context() as patch:
        patch.setattr("platformdirs.user_config_path", homeless)
        assert found_file(None) is None
    with monkeypatch.context() as patch:
        patch.setattr("os.stat", closed)
        assert found_file(None) is None
