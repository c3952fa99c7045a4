"""The contract is well formed, keeps its promises and says the same as the engine."""

import re
import subprocess
from dataclasses import fields
from pathlib import Path

import grpc
import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorSet

import sketchmatch
import sketchmatch_client
from sketchmatch.api import Outcome
from sketchmatch.errors import Reason
from sketchmatch_proto.v1 import catalog_service_pb2, errors_pb2, match_pb2, source_pb2
from tests.tools import ROOT, tool

PROTO = ROOT / "proto"
CLIENT = ROOT / "clients" / "python"
GENERATED = "sketchmatch_proto/v1"
SERVICE, METHOD = 6, 2  # field numbers in the paths of SourceCodeInfo


def run(*command: object) -> None:
    words = [str(part) for part in command]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def names(enum, prefix: str) -> set[str]:
    assert enum.Name(0) == f"{prefix}UNSPECIFIED"
    return {name.removeprefix(prefix) for name in enum.keys()[1:]}


def test_buf_finds_nothing_to_complain_about():
    run(tool("buf"), "lint", PROTO)


def test_files_are_formatted():
    run(tool("buf"), "format", "--diff", "--exit-code", PROTO)


def test_nothing_that_was_released_is_broken():
    run(tool("buf"), "breaking", PROTO, "--against", PROTO / "released.binpb")


def test_generated_code_is_what_the_contract_gives(tmp_path):
    run(tool("python"), PROTO / "generate.py", "--output", tmp_path)
    assert contents(tmp_path / GENERATED) == contents(CLIENT / GENERATED)


def contents(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.glob("*_pb2*.py*")}


def test_googles_own_files_are_those_of_the_pinned_version():
    (site,) = (tool("python").parents[1] / "lib").glob("python*/site-packages")
    for file in (PROTO / "google" / "rpc").iterdir():
        assert file.read_bytes() == (site / "google" / "rpc" / file.name).read_bytes()


def test_all_that_is_shipped_compiles_together(tmp_path):
    files = sorted(PROTO.rglob("*.proto"))
    assert {file.name for file in files} >= {"status.proto", "error_details.proto", "errors.proto"}
    run(tool("python"), "-m", "grpc_tools.protoc", "-I", PROTO, f"--python_out={tmp_path}", *files)
    assert (tmp_path / "google" / "rpc" / "error_details_pb2.py").exists()


def test_error_reasons_are_the_engines():
    assert names(errors_pb2.ErrorReason, "ERROR_REASON_") == {reason.name for reason in Reason}


def test_outcomes_are_the_engines():
    assert names(match_pb2.Outcome, "OUTCOME_") == {outcome.name for outcome in Outcome}


def test_what_the_client_says_of_an_object_is_what_the_engine_takes():
    ours, theirs = (
        [(field.name, field.type, field.default) for field in fields(pin)]
        for pin in (sketchmatch.Pin, sketchmatch_client.Pin)
    )
    assert ours == theirs


def test_source_kinds_are_the_fields_of_a_source():
    fields = source_pb2.Source.DESCRIPTOR.oneofs_by_name["kind"].fields
    kinds = names(catalog_service_pb2.SourceKind, "SOURCE_KIND_")
    assert kinds == {field.name.upper() for field in fields} - {"STORED_SCENE"}


@pytest.fixture(scope="module")
def method_comments(tmp_path_factory) -> dict[str, str]:
    image = tmp_path_factory.mktemp("image") / "contract.binpb"
    run(tool("buf"), "build", PROTO, "--output", image)
    return {
        file.service[where.path[1]].method[where.path[3]].name: where.leading_comments
        for file in FileDescriptorSet.FromString(image.read_bytes()).file
        for where in file.source_code_info.location
        if len(where.path) == 4 and (where.path[0], where.path[2]) == (SERVICE, METHOD)
    }


def test_every_method_lists_its_error_codes(method_comments):
    ours = {"Match", "GetMatch", "WatchMatch", "CancelMatch", "ListMatches"}
    assert {*ours, "Segment", "Transfer", "ListAlgorithms", "GetServerInfo"} <= set(method_comments)
    for method, comment in method_comments.items():
        codes = re.findall(r"^ \* `([A-Z_]+)`: ", comment, re.MULTILINE)
        assert {"UNAVAILABLE", "DEADLINE_EXCEEDED", "UNAUTHENTICATED"} <= set(codes), method
        assert set(codes) <= {code.name for code in grpc.StatusCode}, method


def test_methods_that_read_sources_may_refuse_them(method_comments):
    for method in ("Match", "Segment", "PutScene", "CreateSketch"):
        assert "`INVALID_ARGUMENT`" in method_comments[method]
        assert "`RESOURCE_EXHAUSTED`" in method_comments[method]
