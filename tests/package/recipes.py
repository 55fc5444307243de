# SPDX-License-Identifier: Apache-2.0
"""usage: recipes.py SOURCE: checks packaging/ as far as it can be without vcpkg's and Conan's servers: syntax, the version, and
that the options and components that recipes set are those of CMake."""

import ast
import json
import re
import sys
from pathlib import Path


def faults(root):
    cmake = (root / "CMakeLists.txt").read_text() + (root / "integration" / "python" / "CMakeLists.txt").read_text()
    version = re.search(r"project\(bilayer VERSION ([0-9.]+)", cmake).group(1)
    components = set(re.search(r'BILAYER_COMPONENTS "([^"]+)"', cmake).group(1).split(";"))
    minor = ".".join(version.split(".")[:2])
    for path in [root / "README.md", *sorted((root / "docs").rglob("*.md")), *sorted((root / "tests" / "package").rglob("*.*"))]:
        for asked in re.findall(r"find_package\(bilayer ([0-9.]+)", path.read_text()):
            if asked != minor:
                yield f"{path.relative_to(root)} asks for bilayer {asked}, and the version is {version}"
    newest = re.search(r"^## (\S+)", (root / "CHANGELOG.md").read_text(), re.M).group(1)
    if newest != version:
        yield f"CHANGELOG.md begins with {newest}, and the version is {version}"
    port = root / "packaging" / "vcpkg" / "bilayer"
    manifest = json.loads((port / "vcpkg.json").read_text())
    if manifest["version-semver"] != version:
        yield f"vcpkg.json has version {manifest['version-semver']}, and CMakeLists.txt {version}"
    if not set(manifest["features"]) | {"sdf", "collider"} == components:
        yield f"the features of vcpkg.json are {sorted(manifest['features'])}, and the components are {sorted(components)}"
    recipe = (root / "packaging" / "conan" / "conanfile.py").read_text()
    ast.parse(recipe)
    for name, text in (("portfile.cmake", (port / "portfile.cmake").read_text()), ("conanfile.py", recipe)):
        for option in set(re.findall(r"BILAYER_\w+", text)):
            if not re.search(rf"(option|set)\({option}\b", cmake):
                yield f"{name} sets {option}, which CMake does not know"
        for component in components:
            if not re.search(rf"\b{component}\b", text):
                yield f"{name} does not know the component {component}"
    if not {"build", "out"} <= set((root / ".dockerignore").read_text().split()):
        yield ".dockerignore lets build folders into the image: their caches name another folder"
    if "RUN ./run package" not in (root / "packaging" / "Dockerfile").read_text():
        yield "the Dockerfile does not make packages by ./run package"


if __name__ == "__main__":
    found = list(faults(Path(sys.argv[1])))
    sys.exit("\n".join(found) if found else 0)
