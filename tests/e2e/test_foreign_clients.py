"""grpcurl and ghz, which know nothing of us: people ask and load gRPC servers with them."""

import json
import os
import shutil
import subprocess

import pytest

from tests.tools import ROOT, require

pytestmark = pytest.mark.slow

GRPCURL = "github.com/fullstorydev/grpcurl/cmd/grpcurl@v1.9.3"
MATCH = "sketchmatch.v1.MatchService/Match"
GHZ = "github.com/bojand/ghz/cmd/ghz@v0.120.0"
SQUARES = [
    [[x, y], [x + 1, y], [x + 1, y + 2 + k / 4], [x, y + 2 + k / 4]]
    for k, (x, y) in enumerate([(0, 0), (4, 1), (1, 7), (8, 5)])
]
SCENE = {
    "polygonSet": {
        "polygons": [
            {
                "rings": [{"points": [{"x": x, "y": y} for x, y in square]}],
                "label": f"thing {k}",
            }
            for k, square in enumerate(SQUARES)
        ]
    }
}
REQUEST = {"sketch": SCENE, "map": SCENE, "seed": 7}


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Return what builds a program of Go's, as its authors say."""
    require(shutil.which("go"), "Go")
    folder = tmp_path_factory.mktemp("go")

    def build(module):
        done = subprocess.run(
            ["go", "install", module],
            env={**os.environ, "GOBIN": str(folder)},
            capture_output=True,
            text=True,
            timeout=550,
            check=False,
        )
        require("dial tcp" not in done.stderr, "Go's module proxy")
        assert done.returncode == 0, done.stderr
        return folder / module.partition("@")[0].rpartition("/")[2]

    return build


def run(program, *arguments, given=""):
    return subprocess.run(
        [program, *arguments],
        input=given,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


@pytest.fixture(scope="module")
def grpcurl(built, address):
    program = built(GRPCURL)

    def call(*asked, options=(), given=""):
        return run(program, "-plaintext", *options, address, *asked, given=given)

    return call


def documents(text):
    """Return the JSON objects that stand one after the other."""
    decoder, found = json.JSONDecoder(), []
    while text := text.lstrip():
        value, end = decoder.raw_decode(text)
        found.append(value)
        text = text[end:]
    return found


def test_grpcurl_finds_by_reflection_what_there_is(grpcurl):
    listed = grpcurl("list").stdout.split()
    assert {"sketchmatch.v1.MatchService", "grpc.health.v1.Health"} <= set(listed)
    done = grpcurl("describe", "sketchmatch.v1.MatchService.CancelMatch")
    assert done.returncode == 0, done.stderr
    assert "rpc CancelMatch ( .sketchmatch.v1.CancelMatchRequest )" in done.stdout


def test_grpcurl_is_told_that_the_server_serves(grpcurl):
    done = grpcurl("grpc.health.v1.Health/Check")
    assert (done.returncode, documents(done.stdout)) == (0, [{"status": "SERVING"}])


def test_grpcurl_gets_the_map_of_a_scene_onto_itself(grpcurl):
    done = grpcurl(MATCH, options=("-d", "@"), given=json.dumps(REQUEST))
    assert (done.returncode, done.stderr) == (0, "")
    events = documents(done.stdout)
    assert "accepted" in events[0]
    (scenes,) = (event["scenes"] for event in events if "scenes" in event)
    assert [each["label"] for each in scenes["map"]["objects"]] == [f"thing {k}" for k in range(4)]
    pairs = events[-1]["result"]["object_matches"]
    # What is 0 is left out of JSON.
    assert [(each.get("sketch_object", 0), each.get("map_object", 0)) for each in pairs] == [
        (k, k) for k in range(4)
    ]
    assert events[-1]["result"]["outcome"] == "OUTCOME_CONVERGED"


def test_grpcurl_shows_a_refusal_with_its_details(grpcurl):
    wrong = {**REQUEST, "pipeline": {"searcher": {"name": "unheard-of"}}}
    done = grpcurl(MATCH, options=("-d", "@"), given=json.dumps(wrong))
    assert done.returncode == 64 + 3
    assert "Code: InvalidArgument" in done.stderr
    assert "pipeline.searcher.name" in done.stderr
    assert "UNKNOWN_ALGORITHM" in done.stderr


@pytest.mark.parametrize("described_by", ["reflection", "files"])
def test_every_call_of_ghz_is_answered(built, address, described_by):
    proto = ROOT / "proto"
    files = (f"--proto={proto}/sketchmatch/v1/match_service.proto", f"--import-paths={proto}")
    done = run(
        built(GHZ),
        "--insecure",
        *(files if described_by == "files" else ()),
        "--call=sketchmatch.v1.MatchService.Match",
        "--total=24",
        "--concurrency=8",
        "--connections=4",
        "--timeout=100s",
        "--format=json",
        f"--data={json.dumps(REQUEST)}",
        address,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["count"] == 24
    assert found["statusCodeDistribution"] == {"OK": 24}
