# SPDX-License-Identifier: Apache-2.0
"""LevelSet: files, conversions, values."""

import copy
import os
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
    with pytest.raises(ValueError, match="padding is -1"):
        box_set.to_numpy(padding=-1)
    with pytest.raises(ValueError, match="padding: expected an integer, got a 'float'"):
        box_set.to_numpy(1.5)
    with pytest.raises(ValueError, match="8 GiB"):
        box_set.to_numpy(padding=100000)


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"half_width_voxels": 12},
        {"exterior_width_voxels": 2, "interior_width_voxels": 5},
        {"exterior_width_voxels": 5, "interior_width_voxels": 2},
        {"method": "double-layer"},
        {"sign": "flood"},
    ],
)
def test_dense_there_and_back(sphere, options):
    level_set = bilayer.build(sphere, resolution=40, **options)
    dense = level_set.to_numpy()
    again = bilayer.LevelSet.from_numpy(*dense)
    assert again == level_set and again.method == "" and np.isnan(again.error_bound)
    assert np.array_equal(again.to_numpy().values, dense.values)
    assert bilayer.LevelSet.from_numpy(dense.values.astype(float).tolist(), dense.origin, dense.spacing) == level_set
    far = bilayer.Mesh(sphere.vertices, sphere.faces, origin=(1e6, 2, -3))
    moved = bilayer.build(far, resolution=40, **options)
    assert bilayer.LevelSet.from_numpy(*moved.to_numpy(), field_origin=moved.origin) == moved


def test_thin_solids_and_dirty_meshes_there_and_back(sphere):
    plate = bilayer.build(bilayer.box((2, 2, 0.1)), voxel_size=0.06, half_width_voxels=4)
    film = bilayer.build(bilayer.box((2, 2, 0.02)).transformed(bilayer.Pose((0, 0, 0.001)).matrix), voxel_size=0.06)
    cut = bilayer.Mesh(sphere.vertices, sphere.faces[: -len(sphere.faces) // 20])
    for level_set in (plate, film, bilayer.build(cut, resolution=40)):
        widths = (level_set.exterior_width, level_set.interior_width)
        assert bilayer.LevelSet.from_numpy(*level_set.to_numpy(), half_width=widths) == level_set


def unclamped(count=40, radius=0.6):
    axis = np.linspace(-1, 1, count)
    points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
    return np.linalg.norm(points, axis=-1) - radius, axis[1] - axis[0]


def test_from_numpy():
    values, spacing = unclamped()
    level_set = bilayer.LevelSet.from_numpy(values, spacing=spacing, field_origin=(-1, -1, -1))
    assert level_set.origin.tolist() == [-1, -1, -1] and level_set.voxel_size == pytest.approx(spacing)
    assert level_set.exterior_width == pytest.approx(0.4, abs=1e-3)  # at the middle of each side
    field = bilayer.Field(level_set)
    assert field.sample([1, 1, 1 + 0.65]).distance == pytest.approx(0.05, abs=0.003)
    assert bilayer.mass_properties(level_set).volume == pytest.approx(4 / 3 * np.pi * 0.6**3, rel=0.01)
    narrow = bilayer.LevelSet.from_numpy(values, spacing=spacing, half_width=3 * spacing)
    assert narrow.exterior_width == narrow.interior_width == pytest.approx(3 * spacing)
    assert narrow.active_voxels < level_set.active_voxels
    uneven = bilayer.LevelSet.from_numpy(values, spacing=spacing, half_width=(0.2, 0.1))
    assert (uneven.exterior_width, uneven.interior_width) == pytest.approx((0.2, 0.1))


@pytest.mark.parametrize(
    "change, options, message",
    [
        (lambda v: v[0], {}, r"values: expected real numbers of shape \(nx, ny, nz\), got shape \(40, 40\)"),
        (lambda v: v[:0], {}, "values: expected real numbers"),
        (lambda v: v > 0, {}, "values: expected real numbers, got .* dtype bool"),
        (lambda v: np.where(v < -0.5, np.nan, v), {}, r"values\[\d+, \d+, \d+\] is nan, and must be finite"),
        (lambda v: v + 1, {}, "values: expected negative distances inside"),
        (lambda v: v - 0.5, {}, "values: a voxel at the border of the array is at -"),
        (lambda v: 10 * v, {}, r"values: values\[0, 0, 0\] is .* differ by at most"),
        (lambda v: v / 10, {}, "values: across the surface they change by 0[.]"),
        (lambda v: np.sign(v), {"spacing": 1}, "values: across the surface they change by 2 spacings"),
        (np.sign, {}, "values: across the surface they change by"),
        (lambda v: v, {"spacing": 0}, "spacing is 0"),
        (lambda v: v, {"spacing": float("nan")}, "spacing is nan"),
        (lambda v: v, {"spacing": (1, 1, 1)}, "spacing: expected a number, got a 'tuple'"),
        (lambda v: v, {"origin": (0, 0)}, "origin: expected"),
        (lambda v: v, {"origin": (0.01, 0, 0)}, r"origin\[0\] is 0.01, .* pass field_origin=origin"),
        (lambda v: v, {"origin": (1e30, 0, 0)}, r"origin\[0\] is"),
        (lambda v: v, {"half_width": 0}, "half_width is 0"),
        (lambda v: v, {"half_width": (1, 2, 3)}, "half_width: expected a number"),
        (lambda v: v, {"half_width": 2}, "half_width is 2 outside, but a voxel at the border"),
    ],
)
def test_bad_arrays(change, options, message):
    values, spacing = unclamped()
    with pytest.raises(ValueError, match=message):
        bilayer.LevelSet.from_numpy(change(values), **{"spacing": spacing, **options})


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
    near = bilayer.build(box, resolution=16)
    assert np.array_equal(far.to_numpy().origin, near.to_numpy().origin)  # relative to LevelSet.origin
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
    with pytest.raises(ValueError, match="distance: the distance to extend to must be positive"):
        box_set.extended(-1)
    with pytest.raises(ValueError, match="distance: expected a number, got a 'str'"):
        box_set.extended("far")


def test_no_level_set_without_a_build():
    with pytest.raises(TypeError):
        bilayer.LevelSet()


def test_distance_transforms_of_scipy():
    ndimage = pytest.importorskip("scipy.ndimage")
    axis = np.arange(40) - 19.5
    inside = sum(np.square(np.meshgrid(axis, axis, axis))) < 12**2
    outer, inner = ndimage.distance_transform_edt(~inside), ndimage.distance_transform_edt(inside)
    with pytest.raises(ValueError, match="subtract half a spacing from each, and then one from the other"):
        bilayer.LevelSet.from_numpy(outer - inner)
    corrected = np.where(inside, 0.5 - inner, outer - 0.5)
    level_set = bilayer.LevelSet.from_numpy(corrected, half_width=3)
    assert bilayer.mass_properties(level_set).volume == pytest.approx(4 / 3 * np.pi * 12**3, rel=0.02)


@pytest.mark.parametrize("kind", ["FloatGrid", "Vec3SGrid", "BoolGrid"])
def test_files_with_other_grids(tmp_path, box_set, kind):
    openvdb = pytest.importorskip("pyopenvdb")
    ours, both = str(tmp_path / "ours.vdb"), str(tmp_path / "both.vdb")
    box_set.save(ours)
    empty = getattr(openvdb, kind)()
    empty.name = "empty"
    openvdb.write(both, grids=[empty, openvdb.read(ours, "distance")])
    assert bilayer.LevelSet.load(both) == box_set
    openvdb.write(both, grids=[empty])
    with pytest.raises(RuntimeError, match="holds no level set"):
        bilayer.LevelSet.load(both)


@pytest.mark.parametrize("padding", [10**5, 2**30, 2**31 - 1])
def test_too_much_padding(box_set, padding):
    with pytest.raises(ValueError, match="padding: a dense array of .* is larger than 8 GiB"):
        box_set.to_numpy(padding)


@pytest.mark.parametrize("name", ["ü €.vdb", b"\xff.vdb", "CAPITALS.VDB"])
def test_names_of_files(tmp_path, box, box_set, name):
    path = os.path.join(os.fsencode(tmp_path), os.fsencode(name))
    box_set.save(path)
    assert os.path.exists(path) and bilayer.LevelSet.load(path) == box_set
    mesh = path[:-4] + b".ply"
    box.save(mesh)
    assert os.path.exists(mesh) and bilayer.read_mesh(mesh) == box


def test_a_null_byte_in_a_path(tmp_path, box_set):
    for name in ("a\0b.vdb", b"a\0.vdb"):
        with pytest.raises(ValueError, match="path: expected a path without null bytes"):
            box_set.save(name)


@pytest.mark.parametrize("spacing", [1e-30, 1e30])
def test_voxels_beyond_the_limits_are_named(spacing):
    with pytest.raises(ValueError, match="spacing 1e"):
        bilayer.LevelSet.from_numpy([[[1.0]]], spacing=spacing)
    for call in (bilayer.build, bilayer.obstacle):
        with pytest.raises(ValueError, match="voxel_size 1e"):
            call(bilayer.box(), voxel_size=spacing)
