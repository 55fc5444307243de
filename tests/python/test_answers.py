# SPDX-License-Identifier: Apache-2.0
"""The answers are those of the C++ library, to the bit."""

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

import bilayer

SOURCE = Path(__file__).resolve().parents[2]
PROGRAM = os.environ.get("BILAYER_ANSWERS", str(SOURCE / "build" / "release" / "test_python_answers"))
VOXEL_SIZE = 0.0625


def answers_here(mesh, points):
    level_set = bilayer.build(mesh, voxel_size=VOXEL_SIZE)
    field = bilayer.Field(level_set, mesh)
    samples = field.sample(points)
    closest = field.closest(points)
    collider = bilayer.Collider(mesh, level_set)
    contacts = bilayer.collide(collider, bilayer.Pose((VOXEL_SIZE, 0, 0)), collider, None, margin=VOXEL_SIZE)
    there = bilayer.Pose((3, 0, 0))
    apart = bilayer.distance(collider, there, collider, None)
    thrown = (collider, there, [[-3, 0, 0], [0, 0, 1]], collider, None, None)
    times = [bilayer.time_of_impact(*thrown, penetration=deeper).fraction for deeper in (False, True)]
    hits, spheres = field.raycast(points, -points), field.sphere_cast(points, -points, 0.1)
    return np.concatenate(
        [
            np.column_stack([samples.distance, samples.gradient]).ravel(),
            np.column_stack([closest.distance, closest.position, closest.normal]).ravel(),
            np.column_stack([hits.distance, spheres.distance, hits.triangle, field.inside(points)]).ravel(),
            np.column_stack([contacts.position, contacts.normal, contacts.distance]).ravel(),
            np.float32([apart.distance, *times, bilayer.mass_properties(level_set).volume]),
            bilayer.particles(level_set).ravel(),
        ]
    )


@pytest.mark.skipif(not Path(PROGRAM).exists(), reason=f"{PROGRAM} is not built")
@pytest.mark.parametrize("shape", ["box", "sphere"])
def test_to_the_bit(tmp_path, random, shape):
    mesh = bilayer.box((2, 1, 1.5)) if shape == "box" else bilayer.sphere(1)
    path, points_path, answers_path = (str(tmp_path / name) for name in ("mesh.ply", "points", "answers"))
    mesh.save(path)
    points = random.uniform(-1.5, 1.5, size=(20000, 3)).astype(np.float32)
    points.tofile(points_path)
    subprocess.run([PROGRAM, path, str(VOXEL_SIZE), points_path, answers_path], check=True)
    here, there = answers_here(bilayer.read_mesh(path), points), np.fromfile(answers_path, dtype=np.float32)
    assert here.size > 11 * len(points)
    assert here.astype(np.float32).tobytes() == there.tobytes()
