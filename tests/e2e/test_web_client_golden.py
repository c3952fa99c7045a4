"""The TypeScript client writes the golden requests, and reads the golden answers and errors."""

import base64
import json
import struct
import threading
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
from google.protobuf import json_format

from sketchmatch_proto.v1.catalog_service_pb2 import GetServerInfoRequest, ListAlgorithmsRequest
from sketchmatch_proto.v1.match_service_pb2 import MatchRequest
from sketchmatch_proto.v1.scene_service_pb2 import SegmentRequest
from tests.contract.golden import FOLDER, KINDS, NAMES, golden
from tests.e2e.test_web_client import node
from tests.web import built, serving_pad

pytestmark = pytest.mark.slow

REQUESTS = {
    "Match": MatchRequest,
    "Segment": SegmentRequest,
    "ListAlgorithms": ListAlgorithmsRequest,
    "GetServerInfo": GetServerInfoRequest,
}
STREAM = [f"MatchResponse.{kind}" for kind in ("accepted", "scenes", "progress", "result")]
ANSWERS = {
    "Segment": "SegmentResponse",
    "ListAlgorithms": "ListAlgorithmsResponse",
    "GetServerInfo": "GetServerInfoResponse",
}
CODES = {int(number): code.lower().replace("cancelled", "canceled") for number, code, *_ in KINDS}
"""Connect's names."""

SOURCES = """
import { SketchmatchClient, sources } from "@sketchmatch/client";

const bar = [[[2, 12], [8, 12], [8, 20], [2, 20]], [[3, 17], [5, 17], [5, 13], [3, 13]]];
const triangle = [[1.5, 2.5], [4.5, 3.5], [0.5, 6.5]];
const strokes = sources.strokes([
  { points: [[1.5, 2.5, 0.25], [3.5, 4.75, 0.5], [5.25, 0.125, 0.875]], label: "sofa" },
  { points: [[7.5, -8.5], [9.25, 6.5]], label: "route" },
]);
const cells = [0, 100, -1, 0, 100, 30];
const grid = sources.occupancyGrid(cells, 3, 0.05, { x: -1.5, y: 2.25, yaw: 0.75 });
const picture = new TextEncoder().encode("P2\\n3 2\\n255\\n0 64 128 192 224 255\\n");
const shapes = (...outlines) => sources.polygons(outlines.map((outline) => ({ rings: [outline] })));
const [one, two] = [[[1, 2], [4, 2], [4, 8]], [[5, 3], [9, 3], [9, 6]]];
const turned = [
  sources.polygons([
    { label: "bed", rings: [[[1, -1], [5, -1], [5, -3], [1, -3]]] },
    { label: "desk", rings: [[[7, -2], [9, -2], [9, -5], [7, -5]]] },
    { label: "shelf", rings: [[[2, -6], [3, -6], [3, -11], [2, -11]]] },
  ], "down"),
  sources.polygons([
    { label: "table", rings: [[[22, 14], [28, 14], [28, 18], [22, 18]]] },
    { label: "bar", rings: bar },
    { label: "bunk", rings: [[[26, 2], [30, 2], [30, 10], [26, 10]]] },
    { label: "rack", rings: [[[10, 4], [20, 4], [20, 6], [10, 6]]] },
  ]),
  {
    pipeline: {
      histogram: { parameters: { directions: 36 } },
      searcher: { name: "exact" },
      judge: { name: "confidence" },
    },
    seed: 7n,
    weights: { similarity: 1, rotation: 2, dilation: 3, shape: 0.5, size: 0.25, distance: 1.5 },
    alternatives: 2,
  },
];
"""
MATCHES = """
const label = (value) => ({ kind: { case: "label", value } });
const index = (value) => ({ kind: { case: "index", value } });
const matches = {
  "MatchRequest": [strokes, grid, {
    pipeline: {
      sketchSegmenter: { name: "tracing", parameters: { closing: 0.125, mode: "neat" } },
      mapSegmenter: { name: "tiling", parameters: { least: null, walls: true } },
      histogram: { name: "compass", parameters: { directions: 36 } },
      similarity: { name: "alikeness", parameters: { shares: [0.5, "rest", false] } },
      searcher: { name: "guessing", parameters: { limits: { rounds: 9, quiet: true } } },
      judge: { name: "weighing", parameters: { scales: ["gold", 2.5] } },
      profile: "careful",
    },
    seed: 2n ** 53n + 1n,
    timeBudget: { seconds: 3n, nanos: 250_000_000 },
    weights: {
      similarity: 1.5, rotation: 2.5, dilation: 0.75, shape: 0.5, size: 0.25, distance: 1.25,
    },
    alternatives: 5,
    allowUnmatched: true,
    unmatchedPrice: 0.4375,
    pins: [
      { sketchObject: label("sofa"), mapObject: index(3) },
      { sketchObject: index(0), mapObject: label("couch"), excluded: true },
      { sketchObject: index(2) },
    ],
    synonyms: [{ labels: ["couch", "sofa", "settee"] }, { labels: ["desk", "bureau"] }],
  }],
  "MatchRequest.sparse": [sources.image(picture), shapes(one, two), {
    pipeline: { searcher: { parameters: { rounds: 4 } } },
    weights: { similarity: 0.5, rotation: 0, dilation: 2 },
    allowUnmatched: false,
  }],
  "MatchRequest.named": [shapes(one), shapes(two), {
    pipeline: {}, requestId: "3f0e-17", keepRunning: true, priority: 3,
  }],
  "MatchRequest.stored": [
    ...["5f2b", "c07d"].map((four) => sources.storedScene(four.repeat(16))), { pipeline: {} },
  ],
  "MatchRequest.turned": turned,
};
"""
SEGMENTATIONS = """
const yaml = "image: room.pgm\\nresolution: 0.25\\norigin: [-1.5, 2.25, 0.75]\\nnegate: 0\\n" +
  "occupied_thresh: 0.65\\nfree_thresh: 0.196\\n";
const pgm = new TextEncoder().encode("P2\\n3 2\\n255\\n0 254 128\\n254 0 254\\n");
const sheet = new TextEncoder().encode("1.5 2.5 4.5 3.5 0.5 6.5");
const lamp = { points: [[1.5, 2.5], [3.5, 4.75], [5.25, 0.125]], label: "lamp" };
const segmentations = {
  "SegmentRequest": sources.polygons(
    [{ rings: bar, label: "bar" }, { rings: [triangle], certainty: 0.375 }], "down"),
  "SegmentRequest.stroke_set": sources.strokes([lamp], "up"),
  "SegmentRequest.occupancy_grid": sources.occupancyGrid(cells, 2, 0.125),
  "SegmentRequest.map_server_map": sources.mapServerMap(yaml, pgm),
  "SegmentRequest.image": sources.image(picture),
  "SegmentRequest.file": sources.file("room.sheet", sheet, "cellar"),
};
"""


class FakeServer:
    """Speaks Connect: it keeps the requests, and has a golden answer or error for each."""

    def __init__(self, address):
        self.address = address
        self.requests = []
        self.errors = []

    def answer(self, method, body):
        """Return status, content type and content of the answer to a method."""
        streams = method == "Match"
        self.requests.append(REQUESTS[method].FromString(body[5:] if streams else body))
        error = self._told(self.errors.pop(0)) if self.errors else None
        if not streams:
            return 200, "application/proto", golden(ANSWERS[method]).SerializeToString()
        messages = [] if error else [golden(name).SerializeToString() for name in STREAM]
        ends = json.dumps({"error": error} if error else {}).encode()
        parts = [*((0, message) for message in messages), (2, ends)]
        content = b"".join(struct.pack(">BI", flag, len(part)) + part for flag, part in parts)
        return 200, "application/connect+proto", content

    def _told(self, status):
        details = [
            {
                "type": detail.type_url.rpartition("/")[2],
                "value": base64.b64encode(detail.value).decode(),
            }
            for detail in status.details
        ]
        return {"code": CODES[status.code], "message": status.message, "details": details}


@contextmanager
def running():
    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_POST(self):
            body = self.rfile.read(int(self.headers["Content-Length"]))
            code, kind, content = fake.answer(self.path.rpartition("/")[2], body)
            self.send_response(code)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(content)))
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, *arguments):
            pass

    built()
    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        fake = FakeServer(f"http://127.0.0.1:{server.server_port}")
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield fake
        finally:
            server.shutdown()


def lines(code):
    done = node(code)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.splitlines()


def test_each_match_is_asked_for():
    with running() as fake:
        names = lines(
            f"""{SOURCES}{MATCHES}
            const client = new SketchmatchClient("{fake.address}");
            for (const [name, asked] of Object.entries(matches)) {{
              await client.match(...asked);
              console.log(name);
            }}"""
        )
    assert {*names} == {name for name in NAMES if name.startswith("MatchRequest")}
    assert fake.requests == [golden(name) for name in names]


def test_each_form_of_source_is_sent():
    mended = golden("SegmentRequest.mended_map").source.map_server_map.objects
    with running() as fake:
        names = lines(
            f"""{SOURCES}{SEGMENTATIONS}
            const client = new SketchmatchClient("{fake.address}");
            const segmenter = {{ name: "tracing", parameters: {{ closing: 0.125, mode: "neat" }} }};
            for (const [name, source] of Object.entries(segmentations)) {{
              const whole = name === "SegmentRequest";
              const asked = {{ segmenter, profile: "careful", includeMap: true }};
              await client.segment(source, whole ? asked : {{}});
              console.log(name);
            }}
            const mended = sources.mapServerMap(yaml, pgm, {json.dumps(mended)});
            await client.segment(mended);
            console.log("SegmentRequest.mended_map");"""
        )
    assert {*names} == {name for name in NAMES if name.startswith("SegmentRequest")}
    wanted = [golden(name) for name in names]
    # Who hands objects in with this client has just mended them.
    wanted[-1].source.map_server_map.own_objects = True
    assert fake.requests == wanted


def test_nothing_is_lost_of_an_answer():
    with running() as fake:
        said = lines(
            f"""{SOURCES}
            import {{ toJsonString }} from "@bufbuild/protobuf";
            import * as events from "@sketchmatch/client/v1/match";
            import {{ SegmentResponseSchema }} from "@sketchmatch/client/v1/scene_service";
            import * as catalog from "@sketchmatch/client/v1/catalog_service";
            const client = new SketchmatchClient("{fake.address}");
            const tell = (schema, message) => console.log(toJsonString(schema, message));
            const {{ scenes, result }} = await client.match(strokes, grid, {{}}, {{
              accepted: (accepted) => tell(events.MatchAcceptedSchema, accepted),
              progress: (progress) => tell(events.MatchProgressSchema, progress),
            }});
            tell(events.MatchScenesSchema, scenes);
            tell(events.MatchResultSchema, result);
            tell(SegmentResponseSchema, await client.segment(strokes));
            tell(catalog.ListAlgorithmsResponseSchema, await client.algorithms());
            tell(catalog.GetServerInfoResponseSchema, await client.info());"""
        )
    accepted, scenes, progress, result = map(golden, STREAM)
    wanted = [
        *(accepted.accepted, progress.progress, scenes.scenes, result.result),
        *map(golden, ANSWERS.values()),
    ]
    assert [
        json_format.Parse(text, type(each)()) for text, each in zip(said, wanted, strict=True)
    ] == wanted


def told_of(statuses):
    """Return what the client says of each status."""
    with running() as fake:
        fake.errors = list(statuses)
        said = lines(
            f"""{SOURCES}
            const client = new SketchmatchClient("{fake.address}");
            for (let k = 0; k < {len(statuses)}; k++) {{
              const error = await client.match(strokes, grid).catch((error) => error);
              const {{ message, failure, reason, field, retrySeconds }} = error;
              console.log(JSON.stringify([message, failure, reason, field, retrySeconds]));
            }}"""
        )
    return list(map(json.loads, said))


def test_each_code_is_a_failure_of_the_kind_that_every_client_has():
    statuses = [golden("Status.not_found") for _ in KINDS]
    for status, (number, *_) in zip(statuses, KINDS, strict=True):
        status.code = int(number)
    assert [told[1] for told in told_of(statuses)] == [failure for *_, failure in KINDS]


def test_an_error_is_told_with_its_details():
    names = [name for name in NAMES if name.startswith("Status.")]
    told = told_of([golden(name) for name in names])
    for name, (message, _, reason, field, pause) in zip(names, told, strict=True):
        said = (FOLDER / "said" / f"{name}.txt").read_text("utf-8").splitlines()
        assert said == [
            f"error {golden(name).code}: {message}",
            f"reason {reason}",
            *([f"field {field}"] if field else []),
            *([f"retry after {pause:g}s"] if pause is not None else []),
        ]


def test_the_golden_request_has_the_golden_answer():
    with serving_pad() as (_, url):
        said = lines(
            f"""{SOURCES}
            const client = new SketchmatchClient("{url.rstrip("/")}");
            const {{ result }} = await client.match(...turned);
            for (const line of result.objectMatches)
              console.log(`${{line.sketchObject}} ${{line.sketchLabel}} is ${{line.mapObject}} ` +
                `${{line.mapLabel}}, confidence ${{line.confidence.toFixed(3)}}`);"""
        )
    assert said == (FOLDER / "said" / "MatchRequest.turned.txt").read_text("utf-8").splitlines()
