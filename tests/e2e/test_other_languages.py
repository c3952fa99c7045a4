"""Languages for which there is no client of ours: their pages' commands, and one answer for all."""

import os
import re
import shutil
import subprocess

import pytest

from sketchmatch.examples import LIVING_ROOM_MAP, LIVING_ROOM_SKETCH
from sketchmatch_client import Client, SketchmatchError
from sketchmatch_proto.v1.match_service_pb2 import MatchRequest
from tests.client.fake_server import running
from tests.client.test_golden import MATCHES
from tests.contract.golden import FOLDER, NAMES, golden
from tests.pages import Page
from tests.processes import free_port
from tests.shell import steps
from tests.tools import ROOT, TOOLS, require, tool

pytestmark = pytest.mark.slow

SAID = {file.stem: file.read_text("utf-8").splitlines() for file in (FOLDER / "said").iterdir()}
"""What a program in any language prints about a golden request or status."""
STATUSES = [name for name in NAMES if name.startswith("Status.")]
_OFFLINE = re.compile("dial tcp|Could ?n.t resolve|failed to download|EAI_AGAIN|ENOTFOUND", re.I)

PLACE = {
    "sketch.svg": LIVING_ROOM_SKETCH,
    "room.yaml": LIVING_ROOM_MAP,
    "room.pgm": LIVING_ROOM_MAP.with_suffix(".pgm"),
}
FIRST = {
    "clients/go": ("hello/main.go", "go", "func main() {"),
    "clients/rust": ("examples/hello.rs", "rust", "async fn main()"),
    "proto/examples": ("hello.mjs", "js", "const options"),
}
"""The first program of each page, its language, and how it begins after its imports."""
PAGES = {page: Page(f"{page}/README.md", __name__) for page in (*FIRST, "proto")}
SHOWN = {page: PAGES[page].take(language) for page, (_, language, _) in FIRST.items()}
COMMANDS = {page: PAGES[page].take("console") for page in FIRST}
BY_PROTOC = PAGES["clients/go"].take_one("sh", "protoc")
REFUSED = [PAGES[page].take_one("") for page in ("clients/go", "clients/rust")]
CMAKE = PAGES["proto"].take_one("cmake")
PROTOC = PAGES["proto"].take_one("sh", "--cpp_out")

_BUILT = shutil.ignore_patterns("Cargo.lock", "target", "node_modules", "package-lock.json")


class Program:
    """The program of a page, in a copy of the checkout, built as the page says."""

    def __init__(self, folder, page, files=(), **environment):
        self.page = page
        self.folder = folder / page
        for name in ("proto", page):
            shutil.copytree(ROOT / name, folder / name, dirs_exist_ok=True, ignore=_BUILT)
        for name, text in dict(files).items():
            (self.folder / name).write_text(text, "utf-8")
        self._environment = {**os.environ, "PATH": f"{TOOLS}:{os.environ['PATH']}", **environment}
        self._build, self._hello, self._run = (steps(block.text) for block in COMMANDS[page])
        for step in self._build:
            done = self._bash(step.command)
            require(not _OFFLINE.search(done.stderr), f"a registry that `{step.command}` reaches")
            assert done.returncode == 0, done.stderr

    def hello(self, file, address):
        """Run the page's first program, and return what it prints and what the page shows."""
        for name, original in PLACE.items():
            shutil.copy(original, self.folder / name)
        program = self.folder / file
        program.write_text(program.read_text("utf-8").replace("localhost:50051", address), "utf-8")
        (step,) = self._hello
        done = self._bash(step.command)
        assert (done.returncode, done.stderr) == (0, "")
        return step, done.stdout.splitlines()

    def example(self, address):
        """Run what the page shows, and see that it shows the same."""
        (step,) = self._run
        done = self._bash(step.command.replace("localhost:50051", address))
        assert (done.returncode, done.stderr) == (0, "")
        lines = done.stdout.splitlines()
        assert len(lines) == len(step.shown)
        assert step.missing_in(lines) is None, lines

    def says(self, address, request):
        """Return code and lines of the program about a request."""
        file = self.folder / "request.binpb"
        file.write_bytes(request.SerializeToString())
        (step,) = self._run
        done = self._bash(f"{step.command.replace('localhost:50051', address)} {file}")
        return done.returncode, done.stdout.splitlines()

    def alone(self):
        """Run the program without arguments."""
        (step,) = self._run
        return self._bash(step.command.replace("localhost:50051", ""))

    def generated_otherwise(self):
        """Generate by the page's other commands, compile it, and return the files of both ways."""
        folder = self.folder / "sketchmatch" / "v1"
        first = {file.name for file in folder.iterdir()}
        shutil.rmtree(folder)
        for command in (BY_PROTOC.text, self._build[-1].command):
            done = self._bash(f"set -eu\n{command}")
            assert done.returncode == 0, done.stderr
        return first, {file.name for file in folder.iterdir()}

    def _bash(self, command):
        return subprocess.run(
            ["bash", "-c", command],
            cwd=self.folder,
            env=self._environment,
            capture_output=True,
            text=True,
            timeout=550,
            check=False,
        )


# What stands around the blocks of a page, so that they are compiled with its program.
_IN_GO = """\
package main

import (
	"context"
	"fmt"

	"google.golang.org/grpc"
	"google.golang.org/grpc/credentials"
	"google.golang.org/grpc/credentials/insecure"
	"google.golang.org/grpc/metadata"

	pb "example.com/sketch/sketchmatch/v1"
)
"""
_GO_BLOCK = """
func block{}(
	call context.Context, request *pb.MatchRequest, token string,
) (context.Context, error) {{
{}	connection.Close()
	return call, err
}}
"""
_RUST_BLOCK = """
#[allow(dead_code, unused)]
async fn block{}(request: MatchRequest, token: &str) -> Result<(), Box<dyn Error>> {{
{}Ok(()) }}
"""


def go(folder):
    require(shutil.which("go"), "go")
    tool("buf")
    _, *found = SHOWN["clients/go"]
    code = _IN_GO + "".join(_GO_BLOCK.format(k, block.text) for k, block in enumerate(found))
    return Program(folder, "clients/go", {"blocks.go": code}, GOFLAGS="-p=1")


def rust(folder):
    require(shutil.which("cargo"), "cargo")
    protoc = folder / "protoc"
    protoc.write_text(f'#!/bin/sh\nexec {tool("python")} -m grpc_tools.protoc "$@"\n')
    protoc.chmod(0o755)
    _, *found = SHOWN["clients/rust"]
    code = (ROOT / "clients" / "rust" / "src" / "main.rs").read_text("utf-8")
    code += "".join(_RUST_BLOCK.format(k, block.text) for k, block in enumerate(found))
    cargo = (ROOT / "clients" / "rust" / "Cargo.toml").read_text("utf-8")
    feature = re.search(r"With the feature `([\w-]+)` of tonic", PAGES["clients/rust"].text)
    files = {
        "src/main.rs": code,
        "Cargo.toml": cargo.replace(
            '"channel", "codegen"', f'"channel", "codegen", "{feature[1]}"'
        ),
    }
    return Program(folder, "clients/rust", files, PROTOC=str(protoc), CARGO_BUILD_JOBS="1")


def node(folder):
    require(shutil.which("npm"), "npm")
    return Program(folder, "proto/examples")


@pytest.fixture(scope="module", params=[go, rust, node], ids=["go", "rust", "node"])
def program(request, tmp_path_factory):
    return request.param(tmp_path_factory.mktemp(request.param.__name__))


def test_the_pages_example_has_the_answer_that_it_shows(program, address):
    program.example(address)


@pytest.mark.parametrize("program", [go], indirect=True, ids=["go"])
def test_protoc_makes_of_the_contract_what_buf_makes(program):
    require(shutil.which("protoc"), "protoc")
    by_buf, by_protoc = program.generated_otherwise()
    assert by_buf == by_protoc > {"match_service.pb.go", "match_service_grpc.pb.go"}


def test_the_pages_first_program_finds_all_that_is_sketched(program, address):
    step, lines = program.hello(FIRST[program.page][0], address)
    assert len(lines) == 8
    assert step.missing_in(lines) is None, lines


@pytest.mark.parametrize("page", FIRST)
def test_the_page_shows_its_first_program_which_has_about_twenty_lines(page):
    file, _, begin = FIRST[page]
    program = (ROOT / page / file).read_text("utf-8")
    assert program == SHOWN[page][0].text
    assert len(program[program.index(begin) :].splitlines()) <= 23


def test_the_golden_request_has_the_golden_answer(program, address):
    name = "MatchRequest.turned"
    assert program.says(address, golden(name)) == (0, SAID[name])


def test_a_request_arrives_as_it_was_written(program):
    with running() as fake:
        program.says(fake.address, golden("MatchRequest"))
    assert fake.requests == [golden("MatchRequest")]


@pytest.mark.parametrize("name", STATUSES)
def test_an_error_is_told_with_its_details(program, name):
    with running() as fake:
        fake.error = golden(name)
        assert program.says(fake.address, MatchRequest()) == (1, SAID[name])


def test_a_program_without_an_address_says_how_it_is_called(program):
    done = program.alone()
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    assert re.fullmatch(r"usage: .+ ADDRESS \[REQUEST\]", line)


def test_nobody_at_the_address_is_told(program):
    code, lines = program.says(f"127.0.0.1:{free_port()}", MatchRequest())
    assert code == 1
    assert "refused" in lines[0].lower()


def test_what_the_server_refuses_names_its_field(program, address):
    request = golden("MatchRequest.turned")
    request.pipeline.histogram.parameters["directions"] = 3
    for shown in REFUSED:
        assert program.says(address, request) == (1, shown.text.splitlines())


def test_the_python_client_has_the_golden_answer_too(address):
    sketch, map_, options = MATCHES["MatchRequest.turned"]
    with Client(address) as client:
        lines = client.match(sketch, map_, **options).result.object_matches
    assert [
        f"{line.sketch_object} {line.sketch_label} is {line.map_object} {line.map_label}, "
        f"confidence {line.confidence:.3f}"
        for line in lines
    ] == SAID["MatchRequest.turned"]


@pytest.mark.parametrize("name", STATUSES)
def test_the_python_client_tells_the_same_of_an_error(name):
    sketch, map_, options = MATCHES["MatchRequest.turned"]
    with running() as fake, Client(fake.address, retries=0) as client:
        fake.error = golden(name)
        with pytest.raises(SketchmatchError) as no:
            client.match(sketch, map_, **options)
    error = no.value
    field, pause = getattr(error, "field", ""), getattr(error, "retry_after", None)
    assert [
        f"error {golden(name).code}: {error}",
        f"reason {error.reason}",
        *([f"field {field}"] if field else []),
        *([f"retry after {pause:g}s"] if pause is not None else []),
    ] == SAID[name]


def test_cmake_lines_generate_and_compile(tmp_path):
    require(shutil.which("cmake") and shutil.which("grpc_cpp_plugin"), "gRPC for C++ and cmake")
    head = "cmake_minimum_required(VERSION 3.16)\nproject(robot CXX)\n"
    (tmp_path / "CMakeLists.txt").write_text(head + CMAKE.text, "utf-8")
    shutil.copytree(ROOT / "proto", tmp_path / "proto", ignore=_BUILT)
    for command in (
        ["cmake", "-S", ".", "-B", "build", "-G", "Unix Makefiles"],
        # One of each is enough: all of them take minutes.
        ["make", "-C", "build", "gen/google/rpc/status.pb.o"],
        ["make", "-C", "build", "gen/sketchmatch/v1/match_service.grpc.pb.o"],
    ):
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr


def test_protoc_lines_generate(tmp_path):
    require(shutil.which("protoc") and shutil.which("grpc_cpp_plugin"), "protoc and its plugin")
    shutil.copytree(ROOT / "proto", tmp_path / "proto", ignore=_BUILT)
    (tmp_path / "gen").mkdir()
    subprocess.run(["bash", "-ec", PROTOC.text], cwd=tmp_path, check=True)
    for name in ("match_service.grpc.pb.h", "match_service.pb.h"):
        assert (tmp_path / "gen" / "sketchmatch" / "v1" / name).exists()
    assert (tmp_path / "gen" / "com" / "google" / "rpc" / "Status.java").exists()


def test_every_golden_status_is_told():
    assert set(SAID) == {"MatchRequest.turned", *STATUSES}
