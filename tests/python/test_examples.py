# SPDX-License-Identifier: Apache-2.0
"""Each example runs on a small mesh and writes a picture."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

import bilayer

EXAMPLES = Path(__file__).resolve().parents[2] / "integration" / "python" / "examples"
NAMES = sorted(path.stem for path in EXAMPLES.glob("*.py") if path.stem != "common")


def test_there_are_examples():
    assert {"slice", "distance_on_mesh", "neural_samples", "drop", "pairwise", "liquid"} == set(NAMES)


@pytest.mark.skipif(importlib.util.find_spec("matplotlib") is None, reason="matplotlib is not installed")
@pytest.mark.parametrize("name", NAMES)
def test_examples(tmp_path, name):
    mesh, picture = tmp_path / "mesh.ply", tmp_path / f"{name}.png"
    bilayer.sphere(1).transformed([[1, 0, 0, 3], [0, 0.7, 0, 0], [0, 0, 0.5, 0], [0, 0, 0, 1]]).save(mesh)
    environment = dict(os.environ, PYTHONPATH=str(Path(bilayer.__file__).parents[1]), MPLCONFIGDIR=str(tmp_path))
    command = [sys.executable, str(EXAMPLES / f"{name}.py"), str(mesh), "-o", str(picture)]
    result = subprocess.run(command, capture_output=True, text=True, env=environment, cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert picture.read_bytes().startswith(b"\x89PNG") and picture.stat().st_size > 10_000
