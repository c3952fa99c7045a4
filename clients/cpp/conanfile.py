"""The recipe for Conan 2: ``conan create clients/cpp`` in a checkout."""

from pathlib import Path

from conan import ConanFile
from conan.tools.cmake import CMake, CMakeDeps, CMakeToolchain, cmake_layout
from conan.tools.files import copy


class SketchmatchConan(ConanFile):
    """The C++ client, and the contract beside it."""

    name = "sketchmatch"
    version = "0.1.0"
    license = "Apache-2.0"
    description = "Ask a sketchmatch server which sketched object is which object on a robot's map"
    topics = ("robotics", "sketch", "map", "grpc")
    settings = "os", "compiler", "build_type", "arch"
    options = {"shared": [True, False], "fPIC": [True, False]}  # noqa: RUF012 (as Conan wants it)
    default_options = {"shared": False, "fPIC": True}  # noqa: RUF012
    exports_sources = "CMakeLists.txt", "cmake/*", "include/*", "src/*", "package.xml"

    def export_sources(self) -> None:
        """Take the contract along, which lies elsewhere in the checkout."""
        proto = Path(self.recipe_folder).parents[1] / "proto"
        copy(self, "*.proto", str(proto), str(Path(self.export_sources_folder) / "proto"))

    def requirements(self) -> None:
        """Name what the headers and the library need."""
        self.requires("grpc/[>=1.50 <2]", transitive_headers=True, transitive_libs=True)
        self.requires("protobuf/[>=3.21 <7]", transitive_headers=True, transitive_libs=True)
        self.requires("yaml-cpp/[>=0.7 <1]")

    def build_requirements(self) -> None:
        """Name what generates the code of the contract."""
        self.tool_requires("grpc/<host_version>")
        self.tool_requires("protobuf/<host_version>")

    def layout(self) -> None:
        """Build where CMake's presets say."""
        cmake_layout(self)

    def generate(self) -> None:
        """Write what CMake reads."""
        CMakeDeps(self).generate()
        toolchain = CMakeToolchain(self)
        toolchain.cache_variables["SKETCHMATCH_BUILD_EXAMPLES"] = False
        toolchain.generate()

    def build(self) -> None:
        """Build the library."""
        cmake = CMake(self)
        cmake.configure()
        cmake.build()

    def package(self) -> None:
        """Install it."""
        CMake(self).install()

    def package_info(self) -> None:
        """Say what to link."""
        self.cpp_info.libs = ["sketchmatch"]
        # CMake finds the package by its own files, as everywhere.
        self.cpp_info.set_property("cmake_find_mode", "none")
        self.cpp_info.builddirs = ["lib/cmake/sketchmatch"]
        self.cpp_info.requires = ["grpc::grpc++", "protobuf::libprotobuf", "yaml-cpp::yaml-cpp"]
