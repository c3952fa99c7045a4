"""The C++ client: built, installed, used by strangers, and asked of real servers.

All of it takes minutes, most of which the compiler needs, and only what changed is built anew.
"""

import json
import os
import re
import shutil
import subprocess
import threading
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from sketchmatch.examples import LIVING_ROOM_MAP, LIVING_ROOM_SKETCH
from tests.certificates import Authority
from tests.environment import environment
from tests.pace import slowness
from tests.pages import Page
from tests.processes import Server, server, sketchmatch
from tests.tools import ROOT, require

# The compiler alone needs minutes.
pytestmark = [pytest.mark.slow, pytest.mark.timeout(3600)]

FOLDER = ROOT / "clients" / "cpp"
BUILD = ROOT / "build" / "cpp"
PAGE = Page("clients/cpp/README.md", __name__)
PROGRAMS = PAGE.take("cpp")
INSTALL = PAGE.take_one("sh", "--install")
PROJECT = PAGE.take_one("cmake")
BUILD_BY_CMAKE = PAGE.take_one("sh", "-S . ")
BUILD_BY_PKG_CONFIG = PAGE.take_one("sh", "pkg-config --cflags")
GENERATE = PAGE.take_one("sh", "protoc --proto_path")
CONFIGURE, COMPILE, CTEST, *SANITIZE, TIDY, CONAN = PAGE.take_one("sh", "ctest").commands
OBJECT_MAP = {0: 6, 1: 4, 2: 7, 3: 5, 4: 1, 5: 0, 6: 2, 7: 3}
PACKAGES = (
    *("cmake", "g++", "libgrpc++-dev", "libprotobuf-dev", "libyaml-cpp-dev", "pkg-config"),
    "protobuf-compiler-grpc",
)


def run(*command, cwd=ROOT, timeout=1800, **environment):
    """Run a command to its end, which is to be a good one, and return what it said."""
    done = subprocess.run(
        list(map(str, command)),
        cwd=cwd,
        env={**os.environ, **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        encoding="utf-8",
        timeout=timeout,
        check=False,
    )
    assert done.returncode == 0, f"{' '.join(map(str, command))}\n{done.stdout[-8000:]}"
    return done.stdout


def shell(commands, cwd, **environment):
    return run("bash", "-euo", "pipefail", "-c", commands, cwd=cwd, **environment)


@pytest.fixture(scope="session")
def built():
    """Build library, examples and tests, with every warning an error."""
    for program in ("cmake", "ninja", "c++", "protoc", "grpc_cpp_plugin", "pkg-config"):
        require(shutil.which(program), f"the program {program}")
    for header in ("grpcpp/grpcpp.h", "yaml-cpp/yaml.h", "gtest/gtest.h"):
        require(Path("/usr/include", header).exists(), f"the C++ header {header}")
    # The compiler's own time is what the tests take most of.
    options = "-DCMAKE_BUILD_TYPE=None -DCMAKE_CXX_FLAGS=-O1"
    shell(f"{CONFIGURE} {options}", ROOT)
    shell(f"{COMPILE} --parallel 2", ROOT)
    return BUILD


@pytest.fixture(scope="module")
def home(built, tmp_path_factory):
    """Install as the README says, into a home folder."""
    assert built.is_relative_to(ROOT)  # where the README's commands find it
    folder = tmp_path_factory.mktemp("home")
    shell(INSTALL.text, ROOT, HOME=str(folder))
    return folder


@pytest.fixture
def here(tmp_path):
    """Return a folder with the files that the README names."""
    shutil.copy(LIVING_ROOM_SKETCH, tmp_path / "sketch.svg")
    shutil.copy(LIVING_ROOM_MAP, tmp_path / "room.yaml")
    shutil.copy(LIVING_ROOM_MAP.with_suffix(".pgm"), tmp_path)
    (tmp_path / "ca.pem").write_text("-----BEGIN CERTIFICATE-----\n", encoding="utf-8")
    (tmp_path / "robot-7.token").write_text("robot-7.secret\n", encoding="utf-8")
    return tmp_path


@contextmanager
def phoenix_server(store):
    """Run a server that, once it was killed, is started anew at the same place."""
    first = Server("--store", str(store), "--workers", "0")
    first.wait_for("serving$")
    over = threading.Event()

    def rise():
        first.end(3600.0)
        if not over.is_set():
            with server("--store", str(store), "--workers", "0", "--address", first.address):
                over.wait()

    thread = threading.Thread(target=rise)
    thread.start()
    try:
        yield first
    finally:
        over.set()
        first.process.kill()
        thread.join()


@contextmanager
def servers_in(folder):
    """Run servers of each kind, two of which the tests in C++ kill, and yield where they are."""
    authority = Authority(folder, "authority")
    own, robot = authority.issue("localhost"), authority.issue("robot-7")
    token = sketchmatch("tokens", "add", "robot-7", "--file", folder / "tokens").stdout
    (folder / "token").write_text(token, encoding="utf-8")
    tls = ("--tls-certificate", str(own.certificate), "--tls-key", str(own.key), "--workers", "0")
    client_ca = ("--tls-client-ca", str(authority.certificate))
    with ExitStack() as stack:
        plain = stack.enter_context(server("--store", str(folder / "kept")))
        by_token = stack.enter_context(
            server(*tls, "--no-store", "--tokens", str(folder / "tokens"))
        )
        mutual = stack.enter_context(server(*tls, *client_ca))
        doomed = Server()
        stack.callback(doomed.end)
        stack.callback(doomed.process.kill)
        doomed.wait_for("serving$")
        phoenix = stack.enter_context(phoenix_server(folder / "store"))
        yield {
            "ADDRESS": plain.address,
            "TLS_ADDRESS": by_token.address.replace("127.0.0.1", "localhost"),
            "MUTUAL_ADDRESS": mutual.address.replace("127.0.0.1", "localhost"),
            "DOOMED_ADDRESS": doomed.address,
            "DOOMED_PID": str(doomed.process.pid),
            "PHOENIX_ADDRESS": phoenix.address,
            "PHOENIX_PID": str(phoenix.process.pid),
            "CA": str(authority.certificate),
            "CERTIFICATE": str(robot.certificate),
            "KEY": str(robot.key),
            "TOKEN_FILE": str(folder / "token"),
            "EXAMPLES": str(LIVING_ROOM_MAP.parent),
        }


def told(servers):
    """Return the variables in which the tests in C++ are told of servers."""
    return {f"SKETCHMATCH_TEST_{name}": value for name, value in servers.items()}


@pytest.fixture(scope="module")
def servers(tmp_path_factory):
    with servers_in(tmp_path_factory.mktemp("servers")) as running:
        yield running


@pytest.mark.usefixtures("built")
def test_every_test_in_cpp_passes_and_none_is_skipped(servers):
    said = shell(CTEST, ROOT, **told(servers))
    assert "100% tests passed" in said
    assert "Skipped" not in said


def test_the_examples_run(built, servers):
    address = servers["ADDRESS"]
    files = (LIVING_ROOM_SKETCH, LIVING_ROOM_MAP)
    examples = built / "examples"
    assert "\n6 sofa          2 " in run(examples / "first_answer", address, *files)
    said = run(examples / "beside", address, *files)
    assert {f"{drawn} is {mapped}" for drawn, mapped in OBJECT_MAP.items()} < set(said.splitlines())
    said = run(examples / "ask_or_act", address).splitlines()
    assert {"sofa is at 2.5, 6", "table is at 7, 5.25"} < set(said)
    assert 'api_version: "sketchmatch.v1"' in run(examples / "raw", address)


def test_an_example_without_its_files_says_what_is_missing(built):
    done = subprocess.run(
        [built / "examples" / "first_answer", "localhost:1", "none.svg", "none.yaml"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (1, "")
    (line,) = done.stderr.splitlines()
    assert line.startswith("first_answer: file (none.svg) cannot be read: ")


class TestReadme:
    def test_five_lines_give_a_first_answer_through_cmake(self, home, servers, here):
        program = PROGRAMS[0].text
        lines = program.partition("main() {\n")[2].rstrip("}\n").splitlines()
        assert len(lines) == 5
        (here / "hello.cpp").write_text(
            program.replace("localhost:50051", servers["ADDRESS"]), encoding="utf-8"
        )
        (here / "CMakeLists.txt").write_text(PROJECT.text, encoding="utf-8")
        shell(BUILD_BY_CMAKE.text, here, HOME=str(home))
        assert "8 of 8 sketched objects matched" in run(here / "build" / "hello", cwd=here)

    @pytest.mark.parametrize("number", range(len(PROGRAMS)))
    def test_every_program_runs_through_pkg_config(self, home, servers, here, number):
        program = PROGRAMS[number].text
        (here / "hello.cpp").write_text(
            program.replace("localhost:50051", servers["ADDRESS"]), encoding="utf-8"
        )
        shell(BUILD_BY_PKG_CONFIG.text, here, HOME=str(home))
        said = run(here / "hello", cwd=here)
        assert SAID[number] in said

    @pytest.mark.usefixtures("built")
    def test_protoc_makes_code_of_the_contract(self, here):
        (here / "proto").symlink_to(ROOT / "proto")
        shell(GENERATE.text, here)
        made = {str(file.relative_to(here)) for file in here.glob("generated/**/*.h")}
        assert "generated/sketchmatch/v1/match_service.grpc.pb.h" in made
        assert "generated/google/rpc/error_details.pb.h" in made

    def test_what_it_installs_is_what_ci_installs(self):
        (commands,) = re.findall(r"^(sudo apt-get(?:.*\\\n)*.*)", PAGE.text, re.M)
        named = commands.replace("\\\n", " ").split()[4:]
        assert sorted(named) == sorted(PACKAGES)
        ci = re.findall(r"[\w.+-]+", (ROOT / ".ci" / "run").read_text(encoding="utf-8"))
        assert {name for name in PACKAGES if name not in ci} == set()

    def test_every_way_into_a_server_is_listed(self):
        table = PAGE.text.partition("| member of `ClientOptions` |")[2].partition("\n\n")[0]
        header = (FOLDER / "include/sketchmatch/options.hpp").read_text(encoding="utf-8")
        ways = header.partition("int retries")[2].partition("std::shared_ptr<grpc")[0]
        members = re.findall(r"> (\w+);$", ways, re.M)
        assert len(members) == 7
        for name in members:
            assert f"`{name}`" in table
            assert f"`SKETCHMATCH_{name.upper()}`" in table

    def test_every_error_is_listed(self):
        header = (FOLDER / "include/sketchmatch/errors.hpp").read_text(encoding="utf-8")
        errors = set(re.findall(r"^class (\w+)", header, re.M))
        listed = set(re.findall(r"^\| `(\w+Error)`", PAGE.text, re.M))
        assert listed == errors - {"SketchmatchError", "RetryableError"}


SAID = (
    "8 of 8 sketched objects matched",
    "desk is object",
    "8 of 8 sketched objects matched",
    " events\n",
    "patrol has 3 points, within ",
    "TOO_FEW_OBJECTS in ",
    "",
    "sketchmatch.v1\n",
)
"""What each program of the README prints."""


class TestInstallation:
    def test_headers_stand_alone_and_need_none_that_is_generated(self, home, tmp_path):
        include = home / ".local" / "include"
        for header in sorted((FOLDER / "include" / "sketchmatch").glob("*.hpp")):
            if header.name == "raw.hpp":
                continue
            unit = tmp_path / f"{header.stem}.cpp"
            unit.write_text(f"#include <sketchmatch/{header.name}>\n", encoding="utf-8")
            said = run("c++", "-std=c++17", "-Wall", "-Wextra", "-M", f"-I{include}", unit)
            assert "sketchmatch/" in said
            assert ".pb.h" not in said
            assert "grpcpp" not in said

    def test_the_contract_is_beside_the_library(self, home):
        proto = home / ".local" / "share" / "sketchmatch" / "proto"
        ours = sorted(file.name for file in (ROOT / "proto/sketchmatch/v1").glob("*.proto"))
        assert sorted(file.name for file in proto.glob("sketchmatch/v1/*.proto")) == ours
        assert (proto / "google" / "rpc" / "error_details.proto").exists()

    def test_ament_finds_the_package(self, home):
        share = home / ".local" / "share"
        assert (share / "ament_index/resource_index/packages/sketchmatch").exists()
        assert "<name>sketchmatch</name>" in (share / "sketchmatch/package.xml").read_text()


PORT = """
cmake_minimum_required(VERSION 3.22)
function(exists path)
  if(NOT EXISTS "${path}")
    message(FATAL_ERROR "${path} does not exist")
  endif()
endfunction()
function(vcpkg_cmake_configure)
  cmake_parse_arguments(PARSE_ARGV 0 given "" "SOURCE_PATH" "OPTIONS")
  exists("${given_SOURCE_PATH}/CMakeLists.txt")
  exists("${given_SOURCE_PATH}/../../proto/sketchmatch/v1")
endfunction()
function(vcpkg_cmake_install)
  execute_process(COMMAND "${CMAKE_COMMAND}" --install "${BUILD}" --prefix "${CURRENT_PACKAGES_DIR}"
                  COMMAND_ERROR_IS_FATAL ANY OUTPUT_QUIET)
endfunction()
function(vcpkg_cmake_config_fixup)
  cmake_parse_arguments(PARSE_ARGV 0 given "" "CONFIG_PATH" "")
  exists("${CURRENT_PACKAGES_DIR}/${given_CONFIG_PATH}/sketchmatchConfig.cmake")
endfunction()
function(vcpkg_fixup_pkgconfig)
  exists("${CURRENT_PACKAGES_DIR}/lib/pkgconfig/sketchmatch.pc")
endfunction()
function(vcpkg_install_copyright)
  cmake_parse_arguments(PARSE_ARGV 0 given "" "" "FILE_LIST")
  exists("${given_FILE_LIST}")
endfunction()
include("${PORT}/portfile.cmake")
"""
"""Stands in for vcpkg: each of its functions looks at what it is given."""


class TestVcpkg:
    FOLDER = FOLDER / "vcpkg" / "sketchmatch"

    def test_the_port_finds_and_installs_what_it_names(self, built, tmp_path):
        (tmp_path / "port.cmake").write_text(PORT, encoding="utf-8")
        told = {"BUILD": built, "PORT": self.FOLDER, "CURRENT_PACKAGES_DIR": tmp_path / "packages"}
        given = [f"-D{name}={value}" for name, value in told.items()]
        run("cmake", *given, "-P", tmp_path / "port.cmake")

    def test_the_port_depends_on_what_the_library_looks_for(self):
        port = json.loads((self.FOLDER / "vcpkg.json").read_text(encoding="utf-8"))
        named = {each if isinstance(each, str) else each["name"] for each in port["dependencies"]}
        project = (FOLDER / "CMakeLists.txt").read_text(encoding="utf-8")
        wanted = {name.lower() for name in re.findall(r"find_package\((\S+)", project)}
        assert wanted - {"threads"} <= named


def test_a_match_of_eight_objects_costs_less_than_a_millisecond_more_than_the_stub(built):
    figures = json.loads(run(built / "tests" / "overhead"))
    assert figures["objects"] == 8
    assert figures["client"] - figures["raw"] < 1000 * slowness(), figures


def test_ten_thousand_calls_leave_nothing_behind(built):
    figures = json.loads(run(built / "tests" / "memory", 10_000))
    assert figures["calls"] == 10_000
    # A leak of one small object a call would be 300 KiB or more; buffers of threads come and go.
    assert figures["grown"] < 4 * 2**20, figures


@pytest.mark.usefixtures("built")
@pytest.mark.parametrize("command", SANITIZE)
def test_sanitizers_find_nothing(command, tmp_path):
    with servers_in(tmp_path) as running:
        said = shell(command, ROOT, **told(running))
    assert "SKIPPED" not in said
    assert re.search(r"^\[  PASSED  \] \d{2,} tests", said, re.M), said[-4000:]
    assert "ERROR: " not in said
    assert "WARNING: ThreadSanitizer" not in said


@pytest.mark.usefixtures("built")
def test_clang_format_and_clang_tidy_find_nothing():
    for program in ("clang-format", "clang-tidy"):
        require(shutil.which(program), f"the program {program}")
    shell(TIDY, ROOT)


@pytest.mark.usefixtures("built")
def test_conan_makes_a_package_that_a_program_uses(tmp_path):
    programs = environment(tmp_path / "environment", "conan>=2.5,<3")
    for name in ("clients/cpp", "proto"):  # it builds its program beside the recipe
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("build*"))
    path = f"{programs}{os.pathsep}{os.environ['PATH']}"
    said = shell(CONAN, tmp_path, PATH=path, CONAN_HOME=str(tmp_path / "conan"))
    assert "Running test()" in said
    assert "the sketchmatch server at localhost:1 " in said


def test_doxygen_finds_everything_documented():
    require(shutil.which("doxygen"), "the program doxygen")
    BUILD.parent.mkdir(exist_ok=True)
    run("doxygen", FOLDER / "Doxyfile")
    assert (ROOT / "build" / "cpp-docs" / "html" / "index.html").exists()


def test_every_recipe_is_of_the_same_version():
    texts = {
        name: (FOLDER / name).read_text(encoding="utf-8")
        for name in (
            *("CMakeLists.txt", "conanfile.py", "Doxyfile", "include/sketchmatch/version.hpp"),
            *("package.xml", "vcpkg/sketchmatch/vcpkg.json"),
        )
    }
    (version,) = re.findall(r'^version = "(.+)"', (ROOT / "pyproject.toml").read_text(), re.M)
    assert {name for name, text in texts.items() if version not in text} == set()
    recipe = json.loads(texts["vcpkg/sketchmatch/vcpkg.json"])
    assert recipe["version"] == version
