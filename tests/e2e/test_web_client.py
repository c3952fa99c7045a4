"""The TypeScript client, as its README shows it, in Node.js against a real server."""

import re
import shutil
import subprocess

import pytest

from sketchmatch.examples import LIVING_ROOM_MAP, LIVING_ROOM_SKETCH
from tests.pages import Page
from tests.tools import ROOT, require
from tests.web import CLIENTS, serving_pad

PAGE = Page("clients/typescript/README.md", __name__)
INSTALL = PAGE.take_one("sh", "npm install")
PROGRAMS = PAGE.take("js")
PRINTED = PAGE.take("")


@pytest.fixture(scope="module")
def url():
    with serving_pad() as (_, address):
        yield address


def node(code, folder=CLIENTS / "web"):
    require(shutil.which("node"), "node")
    return subprocess.run(
        ["node", "--input-type=module", "--eval", code],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )


def test_the_readme_shows_a_first_answer_in_five_lines():
    assert len(PROGRAMS[0].text.partition("\n\n")[2].splitlines()) == 5


@pytest.mark.slow
def test_every_program_of_the_readme_prints_what_it_says(url, tmp_path):
    shutil.copy(LIVING_ROOM_SKETCH, tmp_path / "sketch.svg")
    shutil.copy(LIVING_ROOM_MAP, tmp_path / "room.yaml")
    shutil.copy(LIVING_ROOM_MAP.with_suffix(".pgm"), tmp_path / "room.pgm")
    (tmp_path / "node_modules").symlink_to(CLIENTS / "node_modules")
    for program, printed in zip(PROGRAMS, PRINTED, strict=True):
        done = node(program.text.replace("http://127.0.0.1:8080", url.rstrip("/")), tmp_path)
        assert (done.stdout, done.stderr) == (printed.text, "")


@pytest.mark.slow
def test_the_package_is_installed_as_the_readme_says(url, tmp_path):
    ci, build, *rest = INSTALL.commands
    # `built` has done these two.
    assert (ci.rpartition("clients ")[2], build.rpartition("clients ")[2]) == ("ci", "run build")
    (tmp_path / "package.json").write_text('{"type": "module"}', encoding="utf-8")
    for command in rest:
        told = command.replace("path/to/sketchmatch", str(ROOT))
        done = subprocess.run(
            ["bash", "-c", told], cwd=tmp_path, capture_output=True, text=True, check=False
        )
        require(not re.search("EAI_AGAIN|ENOTFOUND", done.stderr), "a registry that npm reaches")
        assert done.returncode == 0, done.stderr
    done = node(
        f"""
        import {{ SketchmatchClient }} from "@sketchmatch/client";
        const {{ apiVersion }} = await new SketchmatchClient("{url.rstrip("/")}").info();
        console.log(apiVersion);
        """,
        tmp_path,
    )
    assert (done.stdout, done.stderr) == ("sketchmatch.v1\n", "")


@pytest.mark.slow
def test_errors_say_what_to_do_and_where(url):
    done = node(f"""
        import {{ SketchmatchClient, sources }} from "@sketchmatch/client";
        const client = new SketchmatchClient("{url.rstrip("/")}");
        const there = sources.strokes([{{ points: [[0, 0], [1, 1]] }}]);
        const told = await client.match(there, there).catch((error) => error);
        console.log(told.name, told.failure, told.reason, told.field);
        const nobody = new SketchmatchClient("http://127.0.0.1:9");
        const away = await nobody.info().catch((error) => error);
        console.log(away.failure, away.message);
        const stop = new AbortController();
        const call = client.match(there, there, {{}}, {{}}, stop.signal).catch((error) => error);
        stop.abort();
        console.log((await call).failure);
        for (const address of ["", "127.0.0.1:8080", "ftp://127.0.0.1"]) {{
          try {{ new SketchmatchClient(address); }} catch (error) {{ console.log(error.message); }}
        }}
        for (const options of [{{ colour: 3 }}, {{ seed: -1n }}]) {{
          const {{ failure, message }} = await client.match(there, there, options).catch((e) => e);
          console.log(failure, message);
        }}
    """)
    assert done.stderr == ""
    first, away, cancelled, *addresses, unknown, negative = done.stdout.splitlines()
    assert re.match(r"RequestFailed invalid [A-Z_]+ sketch", first)
    assert re.fullmatch(
        r"away the sketchmatch server at http://127\.0\.0\.1:9 is not available; "
        r"start it with --web, or check the address \(.+\)",
        away,
    )
    assert cancelled == "cancelled"
    assert addresses == [
        f"address is '{none}'; give a URL, as in 'http://127.0.0.1:8080'"
        for none in ("", "127.0.0.1:8080", "ftp://127.0.0.1")
    ]
    assert unknown == "invalid MatchRequest has no 'colour'; correct the name"
    assert re.fullmatch(r"invalid the request cannot be sent \(.*seed.*-1\); correct it", negative)


@pytest.mark.slow
def test_a_request_that_the_transport_refuses_is_too_large_and_not_for_later():
    with serving_pad("--max-request-mib", "1") as (_, address):
        there = address.rstrip("/")
        done = node(f"""
            import {{ SketchmatchClient, sources }} from "@sketchmatch/client";
            const client = new SketchmatchClient("{there}");
            const grid = sources.occupancyGrid(new Int8Array(20e6), 4000, 0.05);
            for (const call of [() => client.segment(grid), () => client.match(grid, grid)]) {{
              const {{ failure, reason, message }} = await call().catch((error) => error);
              console.log(failure, reason, message);
            }}
        """)
    assert done.stderr == ""
    told = f"the request is larger than the server at {there} accepts; make it smaller"
    assert done.stdout.splitlines() == [f"invalid MESSAGE_TOO_LARGE {told}"] * 2


PLACE = "{ kind: { case: 'index', value: 0 } }"
MISTAKES = {
    "{ time_budget: { seconds: 1n } }": (
        "time_budget",
        "MatchRequest has no 'time_budget'; did you mean 'timeBudget'?",
    ),
    "{ timeBudget: { milliseconds: 5 } }": (
        "timeBudget.milliseconds",
        "timeBudget has no 'milliseconds'; correct the name",
    ),
    "{ timeBudget: 5 }": ("timeBudget", "timeBudget is 5; give { seconds, nanos }"),
    "{ weights: { simularity: 0 } }": (
        "weights.simularity",
        "weights has no 'simularity'; did you mean 'similarity'?",
    ),
    "{ pipeline: { search: { name: 'exact' } } }": (
        "pipeline.search",
        "pipeline has no 'search'; did you mean 'searcher'?",
    ),
    "{ pipeline: { searcher: 'exact' } }": (
        "pipeline.searcher",
        "pipeline.searcher is 'exact'; give { name, parameters }",
    ),
    f"{{ pins: [{{ sketchObject: {PLACE}, mapObject: {PLACE}, exclude: true }}] }}": (
        "pins[0].exclude",
        "pins[0] has no 'exclude'; did you mean 'excluded'?",
    ),
    f"{{ pins: {{ sketchObject: {PLACE} }} }}": ("pins", "pins is not a list; give [ … ]"),
    "{ pins: [{ sketchObject: { index: 0 } }] }": (
        "pins[0].sketchObject.index",
        "pins[0].sketchObject has no 'index'; write kind: { case: 'index', value: … }",
    ),
    **{
        f"{{ pins: [{{ mapObject: {{ kind: {kind} }} }}] }}": (
            "pins[0].mapObject.kind",
            "pins[0].mapObject.kind is not a choice; "
            "give { case, value } with the case 'index' or 'label'",
        )
        for kind in ("'index'", "{ case: 'indx', value: 0 }", "{ value: 0 }", "{ case: 'index' }")
    },
    "{ allowUnmatched: 'false' }": (
        "allowUnmatched",
        "allowUnmatched is 'false'; give true or false",
    ),
}
"""Options as somebody may write them who has no compiler, with the field and the sentence."""


@pytest.mark.slow
@pytest.mark.usefixtures("url")  # it sees that the client is built
def test_options_that_would_be_left_out_in_silence_are_refused_at_every_depth():
    done = node(f"""
        import {{ SketchmatchClient, sources }} from "@sketchmatch/client";
        const client = new SketchmatchClient("http://127.0.0.1:9");
        const there = sources.strokes([]);
        for (const options of [{", ".join(MISTAKES)}]) {{
          const told = await client.match(there, there, options).catch((error) => error);
          console.log(told.failure, told.field, told.message);
        }}
    """)
    assert done.stderr == ""
    told = [f"invalid {field} {message}" for field, message in MISTAKES.values()]
    assert done.stdout.splitlines() == told


@pytest.mark.slow
@pytest.mark.usefixtures("url")
def test_every_service_and_source_refuses_names_that_it_does_not_know():
    done = node("""
        import { RequestFailed, SketchmatchClient, sources } from "@sketchmatch/client";
        const client = new SketchmatchClient("http://127.0.0.1:9");
        const there = sources.polygons([]);
        const watch = async (request) => {
          for await (const event of client.sketches.watchSketch(request)) console.log(event);
        };
        const value = { points: [], speedsMetersPerSecond: new Float64Array(2) };
        for (const call of [
          () => client.transfers.transfer({ features: [{ kind: { case: "route", value } }] }),
          () => client.segment(there, { segmenter: { nmae: "rooms" } }),
          () => client.transfers.transfer({ sketch: there, map: there, radious: 0.3 }),
          () => client.sketches.createSketch({ match: { map: there, wieghts: {} } }),
          () => watch({ sketch: "7" }),
          () => client.match({ kind: { case: "strokeSet", value: { yaxis: 2 } } }, there),
          async () => sources.strokes([], "UP"),
          async () => sources.polygons([], 2),
        ]) console.log(RequestFailed.from(await call().catch((error) => error)).message);
    """)
    assert done.stderr == ""
    sent, *refused = done.stdout.splitlines()
    assert sent.startswith("the sketchmatch server is not available")
    assert refused == [
        "segmenter has no 'nmae'; did you mean 'name'?",
        "TransferRequest has no 'radious'; did you mean 'radius'?",
        "match has no 'wieghts'; did you mean 'weights'?",
        "WatchSketchRequest has no 'sketch'; did you mean 'sketchId'?",
        "sketch.kind.value has no 'yaxis'; did you mean 'yAxis'?",
        "y is 'UP'; give 'up', or 'down' for points from a screen",
        "y is '2'; give 'up', or 'down' for points from a screen",
    ]


@pytest.mark.slow
def test_faults_of_the_callers_own_functions_are_not_the_servers(url):
    done = node(f"""
        import {{ SketchmatchClient, sources }} from "@sketchmatch/client";
        const there = sources.polygons([0, 3, 7, 12].map((x) => (
          {{ rings: [[[x, 0], [x + 1, 0], [x + 1, x + 2]]] }})));
        const client = new SketchmatchClient("{url.rstrip("/")}");
        const scenes = () => undefined.objects;
        const mine = await client.match(there, there, {{}}, {{ scenes }}).catch((error) => error);
        console.log(mine.name, mine.message);
        const tokens = [() => undefined.token, "robot-7.secret", () => "robot-7.\\nsecret"];
        for (const token of tokens) {{
          const {{ failure, field, message }} =
            await new SketchmatchClient("{url.rstrip("/")}", {{ token }}).info().catch((e) => e);
          console.log(failure, field, message);
        }}
        const trimmed = new SketchmatchClient("{url.rstrip("/")}", {{ token: () => "secret\\n" }});
        console.log((await trimmed.info()).apiVersion);
    """)
    assert done.stderr == ""
    mine, *tokens, version = done.stdout.splitlines()
    assert mine.startswith("TypeError Cannot read properties of undefined")
    assert re.fullmatch(
        r"invalid token token cannot be had \(Cannot read .*\); give a function that returns it",
        tokens.pop(0),
    )
    assert tokens == [
        "invalid token token cannot be had (token is not a function); "
        "give a function that returns it",
        "invalid token token is not a token; give what `sketchmatch tokens add` printed",
    ]
    assert version == "sketchmatch.v1"


@pytest.mark.slow
@pytest.mark.usefixtures("url")
def test_a_server_that_breaks_off_is_away():
    done = node("""
        import { createServer } from "node:http";
        import { SketchmatchClient, sources } from "@sketchmatch/client";
        const server = createServer((request, response) => {
          response.writeHead(200, { "content-type": "application/connect+proto" });
          response.write(Buffer.from([0, 0, 0]), () => response.destroy());
        });
        await new Promise((begun) => server.listen(0, "127.0.0.1", begun));
        const client = new SketchmatchClient(`http://127.0.0.1:${server.address().port}`);
        const there = sources.strokes([]);
        const { failure, message } = await client.match(there, there).catch((error) => error);
        console.log(failure, message);
        process.exit();
    """)
    assert done.stderr == ""
    assert re.match(
        r"away the sketchmatch server at http://127\.0\.0\.1:\d+ is not available; ", done.stdout
    )
