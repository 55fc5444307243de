# SPDX-License-Identifier: Apache-2.0
"""Other packages, where they are installed: nothing of bilayer imports them."""

import subprocess
import sys

import numpy as np
import pytest

import bilayer


def test_nothing_else_is_imported():
    others = ("open3d", "pyopenvdb", "scipy", "trimesh", "meshio")
    code = f"import sys, bilayer; print(*(name for name in {others} if name in sys.modules))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "\n"


def test_open3d(box):
    open3d = pytest.importorskip("open3d")
    vertices = open3d.utility.Vector3dVector(box.vertices.astype(float))
    faces = open3d.utility.Vector3iVector(box.faces.astype(np.int32))
    legacy = open3d.geometry.TriangleMesh(vertices, faces)
    assert bilayer.as_mesh(legacy) == box
    assert bilayer.as_mesh(open3d.t.geometry.TriangleMesh.from_legacy(legacy)) == box


def test_trimesh(box):
    trimesh = pytest.importorskip("trimesh")
    assert bilayer.as_mesh(trimesh.Trimesh(box.vertices, box.faces, process=False)) == box


def test_meshio(box):
    meshio = pytest.importorskip("meshio")
    assert bilayer.as_mesh(meshio.Mesh(box.vertices, [("triangle", box.faces)])) == box


def test_openvdb(tmp_path, box_set):
    openvdb = pytest.importorskip("pyopenvdb")
    ours, theirs = str(tmp_path / "ours.vdb"), str(tmp_path / "theirs.vdb")
    box_set.save(ours)
    grid = openvdb.read(ours, "distance")
    assert grid.activeVoxelCount() == box_set.active_voxels and grid.gridClass == "level set"
    openvdb.write(theirs, grids=[grid])
    assert bilayer.LevelSet.load(theirs) == box_set
    sphere = openvdb.createLevelSetSphere(radius=1.0, voxelSize=0.1, halfWidth=3.0)
    openvdb.write(theirs, grids=[sphere])
    loaded = bilayer.LevelSet.load(theirs)
    assert loaded.method == "" and np.isnan(loaded.error_bound)
    assert bilayer.mass_properties(loaded).volume == pytest.approx(4 / 3 * np.pi, rel=0.001)


def test_openvdb_dense(tmp_path):
    openvdb = pytest.importorskip("pyopenvdb")
    path = str(tmp_path / "dense.vdb")
    places = np.stack(np.meshgrid(*3 * [np.arange(-40, 41)], indexing="ij"), axis=-1)
    distances = 0.1 * np.linalg.norm(places, axis=-1) - 2.5
    grid = openvdb.FloatGrid(0.3)
    values = np.clip(distances.astype(np.float32), np.float32(-0.3), np.float32(0.3))
    grid.copyFromArray(values, ijk=(-40, -40, -40))
    grid.transform, grid.gridClass = openvdb.createLinearTransform(0.1), openvdb.GridClass.LEVEL_SET
    openvdb.write(path, grids=[grid])
    loaded = bilayer.LevelSet.load(path)
    assert loaded.active_voxels == (np.abs(values) < np.float32(0.3)).sum()
    assert bilayer.Field(loaded).sample([2.6, 0, 0]).distance == pytest.approx(0.1)
    assert not bilayer.Field(loaded).sample([0, 0, 0]).in_band
    transform = openvdb.createLinearTransform(0.1)
    transform.translate((0.03, 0, 0))
    grid.transform = transform
    openvdb.write(path, grids=[grid])
    with pytest.raises(RuntimeError, match="shifted by 0.3 voxels along x.*from_numpy.. takes its values"):
        bilayer.LevelSet.load(path)


def test_scikit_image(sphere_set):
    measure = pytest.importorskip("skimage.measure")
    values, origin, spacing = sphere_set.to_numpy()
    vertices, faces, _, _ = measure.marching_cubes(values, 0.0, spacing=(spacing,) * 3)
    assert np.abs(np.linalg.norm(vertices + origin, axis=1) - 1).max() < 0.01


def test_scipy(sphere_set):
    ndimage = pytest.importorskip("scipy.ndimage")
    values, origin, spacing = sphere_set.to_numpy()
    points = np.array([[1.01, 0, 0], [0, 0.99, 0]])
    sampled = ndimage.map_coordinates(values, ((points - origin) / spacing).T, order=1)
    assert np.allclose(sampled, bilayer.Field(sphere_set).sample(points).distance, atol=1e-5)
