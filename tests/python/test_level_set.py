# SPDX-License-Identifier: Apache-2.0
"""LevelSet: files, conversions, values."""

import copy
import pickle

import numpy as np
import pytest

import bilayer
from conftest import box_distance


def test_metadata(box_set):
    assert box_set.method == "exact" and box_set.sign == "normals" and box_set.sign_reason
    assert box_set.voxel_size == 0.0625 and box_set.exterior_width == 0.1875
    assert box_set.error_bound == pytest.approx(1e-4 * 0.0625)
    data = box_set.metadata
    assert data["active_voxels"] == box_set.active_voxels and data["mesh_hash"] == box_set.mesh_hash
    assert data["build_seconds"] > 0 and data["leaves"] > 0 and box_set.memory_bytes > 0
    assert "active voxels" in repr(box_set)


def test_dense(box_set):
    values, origin, spacing = box_set.to_numpy()
    assert values.dtype == np.float32 and values.flags.c_contiguous
    index = np.stack(np.meshgrid(*map(np.arange, values.shape), indexing="ij"), axis=-1)
    truth = box_distance(origin + spacing * index)
    expected = np.clip(truth, -box_set.interior_width, box_set.exterior_width)
    assert np.abs(values - expected).max() < 1e-5
    padded, shifted, _ = box_set.to_numpy(padding=4)
    assert np.array_equal(padded[3:-3, 3:-3, 3:-3], values) and np.allclose(shifted, origin - 3 * spacing)
    with pytest.raises(ValueError, match="padding"):
        box_set.to_numpy(padding=-1)
    with pytest.raises(ValueError, match="8 GiB"):
        box_set.to_numpy(padding=100000)


def test_sparse(box):
    level_set = bilayer.build(box, resolution=32, triangles=True)
    sparse = level_set.sparse()
    dense = level_set.to_numpy()
    assert len(sparse.values) == level_set.active_voxels
    assert len(np.unique(sparse.coordinates, axis=0)) == len(sparse.coordinates)
    first = np.round((dense.origin - sparse.origin) / dense.spacing).astype(int)
    assert np.array_equal(dense.values[tuple((sparse.coordinates - first).T)], sparse.values)
    # the nearest face's plane is as far as the value where it is not beyond an edge
    centres = sparse.origin + sparse.spacing * sparse.coordinates
    inside = sparse.values < 0
    corner = box.vertices[box.faces[sparse.triangles[inside], 0]]
    axis = np.argmax(np.abs(centres[inside]), axis=1)
    gaps = np.abs(np.take_along_axis(centres[inside] - corner, axis[:, None], axis=1)[:, 0])
    assert np.mean(np.abs(gaps + sparse.values[inside]) < 1e-5) > 0.95
    assert bilayer.build(box, resolution=32).sparse().triangles is None


def test_files(tmp_path, box):
    level_set = bilayer.build(box, resolution=16, triangles=True)
    level_set.save(tmp_path / "box.vdb")
    again = bilayer.LevelSet.load(tmp_path / "box.vdb")
    assert again == level_set and again.has_triangles and again.mesh_hash == level_set.mesh_hash
    level_set.save(tmp_path / "half.vdb", half_float=True)
    half = bilayer.LevelSet.load(tmp_path / "half.vdb")
    assert half != level_set and np.allclose(half.sparse().values, level_set.sparse().values, atol=1e-3)
    level_set.save(str(tmp_path / "box.nvdb"))
    assert (tmp_path / "box.nvdb").stat().st_size > 0


def test_bad_files(tmp_path, box_set):
    with pytest.raises(FileNotFoundError):
        bilayer.LevelSet.load(tmp_path / "none.vdb")
    (tmp_path / "bad.vdb").write_bytes(b"no field")
    with pytest.raises(RuntimeError, match="bad.vdb"):
        bilayer.LevelSet.load(tmp_path / "bad.vdb")
    with pytest.raises(ValueError, match=".vdb or .nvdb"):
        box_set.save(tmp_path / "box.txt")
    with pytest.raises(ValueError, match="half_float"):
        box_set.save(tmp_path / "box.nvdb", half_float=True)
    with pytest.raises(RuntimeError):
        box_set.save(tmp_path / "none" / "box.vdb")


def test_values(box_set, sphere_set, box):
    again = pickle.loads(pickle.dumps(box_set))
    assert again == box_set and again.metadata["mesh_hash"] == box_set.mesh_hash and again.sign == "normals"
    assert copy.copy(box_set) == box_set and copy.deepcopy(box_set) == box_set and hash(again) == hash(box_set)
    assert box_set != sphere_set and box_set != 1
    far = bilayer.build(bilayer.Mesh(box.vertices, box.faces, origin=(1e6, 0, 0)), resolution=16)
    assert pickle.loads(pickle.dumps(far)) == far and far.origin.tolist() == [1e6, 0, 0]
    assert far.to_numpy().origin[0] > 1e6 - 2
    stored = bilayer.with_body(box_set, box)
    assert bilayer.Collider.from_level_set(pickle.loads(pickle.dumps(stored))).mass.volume == pytest.approx(8)


def test_surface(sphere_set):
    mesh = sphere_set.surface()
    assert np.abs(np.linalg.norm(mesh.vertices, axis=1) - 1).max() < 0.01
    outer = sphere_set.surface(isovalue=0.05, adaptivity=0.5)
    assert np.linalg.norm(outer.vertices, axis=1).mean() == pytest.approx(1.05, abs=0.01)
    with pytest.raises(ValueError, match="isovalue"):
        sphere_set.surface(isovalue=1)
    with pytest.raises(ValueError, match="adaptivity"):
        sphere_set.surface(adaptivity=2)


def test_extended(box_set):
    wide = box_set.extended(0.5)
    assert wide.exterior_width == 0.5 and wide.active_voxels > box_set.active_voxels
    assert np.isnan(wide.error_bound)
    assert box_set.extended().active_voxels > box_set.active_voxels
    with pytest.raises(ValueError):
        box_set.extended(-1)


def test_no_level_set_without_a_build():
    with pytest.raises(TypeError):
        bilayer.LevelSet()
