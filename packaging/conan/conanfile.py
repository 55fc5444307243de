# SPDX-License-Identifier: Apache-2.0
"""A recipe for Conan 2 that builds the checkout it stands in: conan create packaging/conan"""

import os
import re

from conan import ConanFile
from conan.tools.cmake import CMake, CMakeDeps, CMakeToolchain, cmake_layout
from conan.tools.files import copy, load

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")


class Bilayer(ConanFile):
    name = "bilayer"
    license = "Apache-2.0"
    description = "Narrow-band signed distance fields from triangle meshes, with queries, contacts, Bullet and liquids"
    package_type = "library"
    settings = "os", "arch", "compiler", "build_type"
    options = {"shared": [True, False], "bullet": [True, False], "cl": [True, False], "fluid": [True, False]}
    default_options = {"shared": False, "bullet": True, "cl": True, "fluid": True}

    def set_version(self):
        self.version = re.search(r"project\(bilayer VERSION ([0-9.]+)", load(self, os.path.join(ROOT, "CMakeLists.txt"))).group(1)

    def export_sources(self):
        for folder in ("sdf", "collider", "cl", "integration", "cmake"):
            copy(self, f"{folder}/*", src=ROOT, dst=self.export_sources_folder)
        for file in ("CMakeLists.txt", "LICENSE"):
            copy(self, file, src=ROOT, dst=self.export_sources_folder)

    def requirements(self):
        self.requires("glm/[>=0.9.9]", transitive_headers=True)
        for package in ("openvdb/[>=10 <11]", "onetbb/[>=2021.8]"):
            self.requires(package, transitive_headers=bool(self.options.fluid))
        for package in ("assimp/[>=5.2 <6]", "highway/[>=1.0.3]", "qhull/[>=8.0]", "zlib/[>=1.2.11]", "fmt/[>=9]"):
            self.requires(package)
        if self.options.bullet:
            self.requires("bullet3/[>=3.24]", transitive_headers=True)
        if self.options.cl:
            self.requires("opencl-icd-loader/[>=2022]")
            self.requires("opencl-clhpp-headers/[>=2022]")

    def build_requirements(self):
        for package in ("tinygltf/[>=2.8]", "nlohmann_json/[>=3.11]", "fast_float/[>=3.5]"):
            self.test_requires(package)  # headers alone, which users do not need

    def layout(self):
        cmake_layout(self)

    def generate(self):
        toolchain = CMakeToolchain(self)
        chosen = [name for name in ("bullet", "cl", "fluid") if self.options.get_safe(name)]
        toolchain.cache_variables.update({
            "BILAYER_COMPONENTS": ";".join(["sdf", "collider", *chosen]), "BILAYER_TOOLS": "OFF", "BILAYER_PYTHON": "OFF",
            "BILAYER_WERROR": "OFF", "BILAYER_INSTALL": "ON"})
        toolchain.generate()
        CMakeDeps(self).generate()

    def build(self):
        cmake = CMake(self)
        cmake.configure()
        cmake.build()

    def package(self):
        copy(self, "LICENSE", src=self.source_folder, dst=os.path.join(self.package_folder, "licenses"))
        CMake(self).install()

    def package_info(self):
        # the package's own configuration, rather than one that Conan writes
        self.cpp_info.set_property("cmake_find_mode", "none")
        self.cpp_info.builddirs.append(os.path.join("lib", "cmake", "bilayer"))
