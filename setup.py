# SPDX-License-Identifier: Apache-2.0
"""Builds the Python package with setuptools: the native module comes from CMake."""

import os
import re
import subprocess
import sys
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

ROOT = Path(__file__).resolve().parent


def version():
    return re.search(r"project\(bilayer VERSION ([0-9.]+)", (ROOT / "CMakeLists.txt").read_text()).group(1)


class CMakeBuild(build_ext):
    """Configures and builds the target bilayer_python alone, and copies the module to where setuptools wants it."""

    def build_extension(self, extension):
        target = Path(self.get_ext_fullpath(extension.name)).resolve()
        folder = Path(os.environ.get("BILAYER_BUILD_DIR", ROOT / "build" / "wheel")).resolve()
        subprocess.run(
            ["cmake", "-S", str(ROOT), "-B", str(folder), "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release",
             "-DBILAYER_PYTHON=ON", "-DBILAYER_TOOLS=OFF", "-DBILAYER_INSTALL=OFF", "-DBILAYER_COMPONENTS=cl;fluid",
             f"-DPython3_EXECUTABLE={sys.executable}"],
            check=True,
        )
        subprocess.run(["cmake", "--build", str(folder), "--target", "bilayer_python"], check=True)
        target.parent.mkdir(parents=True, exist_ok=True)
        self.copy_file(str(folder / "python" / "bilayer" / target.name), str(target))


setup(version=version(), ext_modules=[Extension("bilayer._bilayer", sources=[])], cmdclass={"build_ext": CMakeBuild})
