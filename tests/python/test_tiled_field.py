# SPDX-License-Identifier: Apache-2.0
"""TiledField: the answers of a Field of the merged tiles, budgets, damaged folders."""

import pickle
import shutil
import threading

import numpy as np
import pytest

import bilayer
from conftest import run_program


@pytest.fixture(scope="module")
def knot(tmp_path_factory):
    """A torus in tiles, and its field in one piece."""
    folder = tmp_path_factory.mktemp("tiled")
    angles = np.linspace(0, 2 * np.pi, 61)[:-1]
    around, across = np.meshgrid(angles, angles, indexing="ij")
    radius = 1 + 0.3 * np.cos(across)
    vertices = np.stack([radius * np.cos(around), radius * np.sin(around), 0.3 * np.sin(across)], axis=-1).reshape(-1, 3)
    i, j = [index.ravel() for index in np.meshgrid(np.arange(60), np.arange(60), indexing="ij")]
    at = lambda a, b: (a % 60) * 60 + b % 60
    faces = np.concatenate([np.stack([at(i, j), at(i + 1, j), at(i + 1, j + 1)], axis=-1),
                            np.stack([at(i, j), at(i + 1, j + 1), at(i, j + 1)], axis=-1)])
    mesh = bilayer.Mesh(vertices, faces)
    mesh.save(folder / "torus.ply")
    run_program("build", folder / "torus.ply", "-o", folder / "tiles", "--resolution", "120", "--tiles", "3x2x1")
    run_program("merge", folder / "tiles", "-o", folder / "torus.vdb")
    return folder / "tiles", bilayer.Field(bilayer.LevelSet.load(folder / "torus.vdb"))


def points_around(field, random, count=4000):
    low, high = field.bounds
    return random.uniform(low - 0.2, high + 0.2, size=(count, 3))


@pytest.mark.parametrize("storage", ["float32", "fixed16"])
def test_samples_have_the_bytes_of_the_merged_field(knot, random, storage):
    folder, whole = knot
    tiled = bilayer.TiledField(folder, storage=storage)
    points = points_around(whole, random)
    samples, expected = tiled.sample(points), whole.sample(points)
    assert np.array_equal(samples.in_band, expected.in_band) and samples.in_band.any()
    if storage == "float32":
        assert np.array_equal(samples.distance, expected.distance)
        assert np.array_equal(samples.gradient, expected.gradient)
        assert np.array_equal(tiled.inside(points), expected.distance < 0)
    assert np.abs(samples.distance - expected.distance).max() < 1e-4 * whole.voxel_size
    single = tiled.sample(points[0])
    assert single.distance.shape == () and single.distance == samples.distance[0]
    assert tiled.sample(points.reshape(40, 100, 3)).gradient.shape == (40, 100, 3)
    assert tiled.inside(points[0]).shape == () and tiled.sample(np.zeros((0, 3))).distance.shape == (0,)


def test_rays_and_closest_points(knot, random):
    folder, whole = knot
    tiled = bilayer.TiledField(folder)
    points = points_around(whole, random, 300)
    near, expected = tiled.closest(points), whole.closest(points)
    assert near.found.all() and np.abs(near.distance - expected.distance).max() < 1e-5
    limited = tiled.closest(points, 0.05)
    assert np.array_equal(limited.found, np.abs(near.distance) <= 0.05) and np.isnan(limited.position[~limited.found]).all()
    rays = (points, random.normal(size=(300, 3)))
    hits, wanted = tiled.raycast(*rays), whole.raycast(*rays)
    assert np.array_equal(hits.hit, wanted.hit) and 0 < hits.hit.sum() < 300
    assert np.abs(hits.distance[hits.hit] - wanted.distance[hits.hit]).max() < 1e-5
    assert tiled.raycast([5, 0, 0], [-1, 0, 0], 0.1).hit == False  # noqa: E712


def test_a_small_budget_reads_tiles_again(knot, random):
    folder, whole = knot
    points = points_around(whole, random)
    large, small = bilayer.TiledField(folder), bilayer.TiledField(folder, budget_bytes=1)
    for field in (large, small):
        assert np.array_equal(field.sample(points).distance, whole.sample(points).distance)
        field.sample(points)
    assert large.tiles_read <= large.tile_count == 6 < small.tiles_read
    assert small.memory_bytes < large.memory_bytes


def test_threads_share_the_tiles(knot, random):
    folder, whole = knot
    tiled = bilayer.TiledField(folder, budget_bytes=1)
    points = points_around(whole, random)
    answers = [None] * 4

    def work(number):
        answers[number] = tiled.sample(points[number::4]).distance

    threads = [threading.Thread(target=work, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for number, answer in enumerate(answers):
        assert np.array_equal(answer, whole.sample(points[number::4]).distance)


def test_properties(knot):
    folder, whole = knot
    tiled = bilayer.TiledField(str(folder))
    for name in ("voxel_size", "exterior_width", "interior_width"):
        assert getattr(tiled, name) == getattr(whole, name)
    assert np.array_equal(tiled.bounds, whole.bounds) and np.array_equal(tiled.origin, whole.origin)
    assert repr(tiled).startswith("TiledField(6 tiles with voxels of ")
    with pytest.raises(TypeError, match="pickle"):
        pickle.dumps(tiled)


def test_errors_name_the_file_or_the_argument(knot, tmp_path):
    folder, _ = knot
    with pytest.raises(RuntimeError, match="manifest.json"):
        bilayer.TiledField(tmp_path)
    tiled = bilayer.TiledField(folder)
    with pytest.raises(ValueError, match=r"points: expected .* got shape \(5, 2\)"):
        tiled.sample(np.zeros((5, 2)))
    with pytest.raises(ValueError, match="directions is zero, and must be a direction"):
        tiled.raycast([0, 0, 0], [0, 0, 0])
    with pytest.raises(ValueError, match="storage"):
        bilayer.TiledField(folder, storage="float64")
    with pytest.raises(ValueError, match="budget_bytes"):
        bilayer.TiledField(folder, budget_bytes=-1)
    damaged = tmp_path / "damaged"
    shutil.copytree(folder, damaged)
    tiled = bilayer.TiledField(damaged, budget_bytes=1)
    for path in damaged.glob("*.vdb"):
        path.write_bytes(b"damaged")
    with pytest.raises(RuntimeError, match=r"tile_\d_\d_\d.vdb"):
        tiled.sample(np.random.default_rng(1).uniform(-1, 1, size=(1000, 3)))
