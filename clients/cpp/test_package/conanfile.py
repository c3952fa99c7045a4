"""Uses the package that Conan made, as strangers do."""

from conan import ConanFile
from conan.tools.build import can_run
from conan.tools.cmake import CMake, cmake_layout


class SketchmatchTest(ConanFile):
    """A program that makes a client and a source."""

    settings = "os", "compiler", "build_type", "arch"
    generators = "CMakeDeps", "CMakeToolchain"

    def requirements(self) -> None:
        """Name the package."""
        self.requires(self.tested_reference_str)

    def layout(self) -> None:
        """Build where CMake's presets say."""
        cmake_layout(self)

    def build(self) -> None:
        """Build the program."""
        cmake = CMake(self)
        cmake.configure()
        cmake.build()

    def test(self) -> None:
        """Run it."""
        if can_run(self):
            self.run(f"{self.cpp.build.bindir}/hello", env="conanrun")
