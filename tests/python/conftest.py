# SPDX-License-Identifier: Apache-2.0
"""What the tests share: a sphere and a box with their fields, and the command line."""

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

import bilayer

SOURCE = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def sphere():
    return bilayer.sphere(1.0, subdivisions=4)


@pytest.fixture(scope="session")
def sphere_set(sphere):
    return bilayer.build(sphere, resolution=48)


@pytest.fixture(scope="session")
def sphere_field(sphere, sphere_set):
    return bilayer.Field(sphere_set, sphere)


@pytest.fixture(scope="session")
def box():
    return bilayer.box((2, 2, 2))


@pytest.fixture(scope="session")
def box_set(box):
    return bilayer.build(box, resolution=32)


@pytest.fixture(scope="session")
def box_field(box, box_set):
    return bilayer.Field(box_set, box)


@pytest.fixture(scope="session")
def collider(box, box_set):
    return bilayer.Collider(box, box_set)


def run_program(*words):
    """Runs `bilayer`, and skips the test where it is not built."""
    program = os.environ.get("BILAYER_PROGRAM") or str(SOURCE / "build" / "release" / "bilayer")
    if not os.path.exists(program):
        pytest.skip(f"{program} is not built")
    subprocess.run([program, *map(str, words)], check=True, stdout=subprocess.DEVNULL)


@pytest.fixture(scope="session")
def folder_with_tiles(box, tmp_path_factory):
    """A folder that holds `box_tiles`, for docstrings."""
    folder = tmp_path_factory.mktemp("docs")
    box.save(folder / "box.ply")
    run_program("build", folder / "box.ply", "-o", folder / "box_tiles", "--resolution", "32", "--tiles", "2x1x1")
    return folder


@pytest.fixture
def random():
    return np.random.default_rng(38)


def box_distance(points, half=1.0):
    """The signed distance of points to a cube."""
    q = np.abs(points) - half
    return np.linalg.norm(np.maximum(q, 0), axis=-1) + np.minimum(q.max(axis=-1), 0)
