# SPDX-License-Identifier: Apache-2.0
"""Mesh, files, inspect, meshes of other packages."""

import base64
import copy
import json
import pickle
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
import pytest

import bilayer

TRIANGLE = ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64, np.longdouble, np.int8, np.int64, np.uint16])
def test_any_dtype_of_vertices(dtype):
    mesh = bilayer.Mesh(np.array(TRIANGLE[0], dtype=dtype), TRIANGLE[1])
    assert mesh.vertices.dtype == np.float32
    assert np.array_equal(mesh.vertices, TRIANGLE[0])


@pytest.mark.parametrize("dtype", [np.int8, np.uint8, np.int32, np.uint32, np.int64, np.uint64])
def test_any_dtype_of_faces(dtype):
    mesh = bilayer.Mesh(TRIANGLE[0], np.array(TRIANGLE[1], dtype=dtype))
    assert mesh.faces.dtype == np.uint32
    assert np.array_equal(mesh.faces, TRIANGLE[1])


def test_arrays_of_any_layout():
    vertices = np.asfortranarray(np.array(TRIANGLE[0], dtype=np.float32))
    reversed_twice = np.array(TRIANGLE[0], dtype=np.float32)[::-1][::-1]
    assert np.array_equal(bilayer.Mesh(vertices, TRIANGLE[1]).vertices, TRIANGLE[0])
    assert np.array_equal(bilayer.Mesh(reversed_twice, TRIANGLE[1]).vertices, TRIANGLE[0])


@pytest.mark.parametrize(
    "vertices, faces, message",
    [
        (np.zeros((4, 2)), TRIANGLE[1], r"vertices: .* shape \(N, 3\), got shape \(4, 2\) and dtype float64"),
        (np.zeros(3), TRIANGLE[1], r"vertices: expected .* \(N, 3\)"),
        ("mesh.obj", TRIANGLE[1], "vertices: expected an array of real numbers"),
        (np.zeros((3, 3), dtype=complex), TRIANGLE[1], "vertices: .* dtype complex128"),
        (np.zeros((3, 3), dtype=bool), TRIANGLE[1], "vertices: .* dtype bool"),
        ([[0, 0, 0], [1, 0]], TRIANGLE[1], "vertices: expected an array"),
        ([[0, 0, 0], [1, np.nan, 0], [0, 1, 0]], TRIANGLE[1], r"vertices\[1, 1\] is nan, and must be finite"),
        ([[0, 0, 0], [1, 0, np.inf], [0, 1, 0]], TRIANGLE[1], r"vertices\[1, 2\] is inf"),
        (TRIANGLE[0], [[0, 1, 3]], r"faces\[0, 2\] is 3, and must be a vertex of 0 to 2; its shape is \(1, 3\)"),
        (np.empty((0, 3)), [[0, 1, 2]], r"faces\[0, 0\] is 0, and must be a vertex, but there is none"),
        (TRIANGLE[0], [[0, 1, -1]], r"faces\[0, 2\] is -1"),
        (TRIANGLE[0], [[0, 1]], r"faces: expected .* shape \(N, 3\), got shape \(1, 2\)"),
        (TRIANGLE[0], np.zeros((0, 7)), r"faces: expected .* shape \(N, 3\), got shape \(0, 7\)"),
        (TRIANGLE[0], np.array([[0, 1, 2**64 - 1]], dtype=np.uint64), r"faces\[0, 2\] is 18446744073709551615"),
        (np.array([[1e300, 0, 0]]), [[0, 0, 0]], r"vertices\[0, 0\] is 1e[+]300, and must be in the range of float32"),
        (TRIANGLE[0], [[0.0, 1.0, 2.0]], "faces: expected an array of integers .* dtype float64"),
        (TRIANGLE[0], None, "faces: expected an array of integers"),
        (np.array(TRIANGLE[0]) + 1e7, TRIANGLE[1], "vertices: the mesh is 1 long and 1e[+]07 from zero"),
        (np.array(TRIANGLE[0]) + 10**9, TRIANGLE[1], "vertices: the mesh is 1 long and 1e[+]09 from zero"),
        (np.int32(TRIANGLE[0]) - 10**9, TRIANGLE[1], "vertices: the mesh is 1 long and 1e[+]09 from zero"),
        (np.uint32(TRIANGLE[0]) + np.uint32(4e9), TRIANGLE[1], "vertices: the mesh is 1 long and 4e[+]09 from zero"),
        (np.uint64(TRIANGLE[0]) + np.uint64(2**63), TRIANGLE[1], "vertices: the mesh is"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_bad_meshes(vertices, faces, message):
    with pytest.raises(ValueError, match=message):
        bilayer.Mesh(vertices, faces)


def test_origin():
    mesh = bilayer.Mesh(*TRIANGLE, origin=(1e7, 0, 0))
    assert mesh.origin.tolist() == [1e7, 0, 0]
    with pytest.raises(ValueError, match="origin"):
        bilayer.Mesh(*TRIANGLE, origin=(0, 0))


def test_views_are_read_only_and_keep_the_mesh_alive():
    mesh = bilayer.sphere(1, subdivisions=5)
    expected = mesh.vertices.copy()
    view, faces = mesh.vertices, mesh.faces
    assert view.base is mesh
    del mesh
    others = [bilayer.sphere(2, subdivisions=5) for _ in range(4)]
    assert np.array_equal(view, expected) and faces.max() == len(view) - 1
    with pytest.raises(ValueError, match="read-only"):
        view[0] = 0
    del others


def test_values(sphere):
    assert pickle.loads(pickle.dumps(sphere)) == sphere
    assert copy.copy(sphere) == sphere and copy.deepcopy(sphere) == sphere
    assert hash(sphere) == hash(bilayer.sphere(1.0, subdivisions=4))
    assert sphere != bilayer.sphere(1.0, subdivisions=3) and sphere != 3
    far = bilayer.Mesh(*TRIANGLE, origin=(1e7, 0, 0))
    assert pickle.loads(pickle.dumps(far)).origin.tolist() == [1e7, 0, 0]


@pytest.mark.parametrize("extension", ["obj", "ply", "stl"])
def test_files(tmp_path, box, extension):
    path = tmp_path / f"box.{extension}"
    box.save(path)
    again = bilayer.read_mesh(str(path))
    assert again.faces.shape == (12, 3)
    assert np.array_equal(again.bounds, [[-1, -1, -1], [1, 1, 1]])


def test_bad_files(tmp_path, box):
    with pytest.raises(FileNotFoundError):
        bilayer.read_mesh(tmp_path / "none.obj")
    (tmp_path / "bad.obj").write_text("v 0 0 0\nf 1 2 3\n")
    with pytest.raises(RuntimeError, match="bad.obj"):
        bilayer.read_mesh(tmp_path / "bad.obj")
    with pytest.raises(ValueError, match="xyz"):
        box.save(tmp_path / "box.xyz")
    with pytest.raises(RuntimeError, match="none"):
        box.save(tmp_path / "none" / "box.ply")
    with pytest.raises(ValueError, match="path: expected a str, bytes or os.PathLike, got a 'int'"):
        bilayer.read_mesh(3)
    with pytest.raises(FileNotFoundError, match="none.obj"):
        bilayer.read_mesh(bytes(tmp_path / "none.obj"))


def test_gltf(tmp_path, box):
    data = box.vertices.tobytes() + box.faces.tobytes()
    size = box.vertices.nbytes
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    document = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "translation": [5, 0, 0]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": len(data), "uri": uri}],
        "bufferViews": [
            {"buffer": 0, "byteLength": size},
            {"buffer": 0, "byteOffset": size, "byteLength": len(data) - size},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3", "min": [-1] * 3, "max": [1] * 3},
            {"bufferView": 1, "componentType": 5125, "count": 36, "type": "SCALAR"},
        ],
    }
    (tmp_path / "box.gltf").write_text(json.dumps(document))
    with ThreadPoolExecutor(8) as pool:  # each file is read in a child process
        meshes = list(pool.map(bilayer.read_mesh, [tmp_path / "box.gltf"] * 16))
    assert all(np.array_equal(mesh.bounds, [[4, -1, -1], [6, 1, 1]]) for mesh in meshes)


def test_inspect(box):
    report = bilayer.inspect(box)
    assert report.closed and report.oriented and report.faces == 12
    assert report.volume == pytest.approx(8) and report.area == pytest.approx(24)
    assert report == bilayer.inspect(box) and copy.deepcopy(report) == report
    assert pickle.loads(pickle.dumps(report)) == report
    opened = bilayer.inspect(bilayer.Mesh(box.vertices, box.faces[:-2]))
    assert not opened.closed and opened.boundary_edges == 4 and opened.boundary_loops == 1
    assert report != opened
    assert bilayer.inspect(box, wall=3).thin_walls == 12
    with pytest.raises(ValueError, match="wall"):
        bilayer.inspect(box, wall=-1)
    with pytest.raises(ValueError):
        bilayer.inspect(bilayer.Mesh(np.zeros((0, 3)), []))


def test_transformed(box):
    moved = box.transformed([[2, 0, 0, 5], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    assert moved.bounds.tolist() == [[3, -1, -1], [7, 1, 1]]
    with pytest.raises(ValueError, match="matrix"):
        box.transformed(np.eye(3))
    with pytest.raises(ValueError, match="affine"):
        box.transformed(np.ones((4, 4)))


def test_welded(box):
    soup = bilayer.Mesh(box.vertices[box.faces].reshape(-1, 3), np.arange(36).reshape(-1, 3))
    assert soup.welded().vertices.shape == (8, 3)


class Tensor:
    def __init__(self, array):
        self.array = array

    def cpu(self):
        return self

    def numpy(self):
        return self.array


def test_meshes_of_other_packages(box):
    vertices, faces = box.vertices, box.faces
    quad = SimpleNamespace(type="quad", data=np.array([[0, 1, 3, 2]]))
    blocks = [SimpleNamespace(type="line", data=np.array([[0, 1]])), SimpleNamespace(type="triangle", data=faces)]
    likes = {
        "trimesh": SimpleNamespace(vertices=vertices, faces=faces),
        "legacy Open3D": SimpleNamespace(vertices=list(vertices), triangles=list(faces)),
        "tensor Open3D": SimpleNamespace(vertex={"positions": Tensor(vertices)}, triangle={"indices": Tensor(faces)}),
        "meshio": SimpleNamespace(points=vertices, cells=blocks),
        "older meshio": SimpleNamespace(points=vertices, cells={"triangle": faces}),
        "PyVista": SimpleNamespace(points=vertices, faces=np.insert(faces.astype(int), 0, 3, axis=1).ravel()),
        "pair": (vertices, faces),
    }
    for like in likes.values():
        assert bilayer.as_mesh(like) == box
    assert bilayer.as_mesh(SimpleNamespace(points=vertices, cells=[quad])).faces.tolist() == [[0, 1, 3], [0, 3, 2]]
    assert bilayer.build(likes["trimesh"], resolution=16) == bilayer.build(box, resolution=16)
    with pytest.raises(ValueError, match="mesh: expected a bilayer.Mesh.*'int'"):
        bilayer.build(3, resolution=16)
    mixed = SimpleNamespace(points=vertices, faces=[4, 0, 1, 3, 2, 3, 4, 5, 6])
    assert sorted(bilayer.as_mesh(mixed).faces.tolist()) == [[0, 1, 3], [0, 3, 2], [4, 5, 6]]


@pytest.mark.parametrize(
    "like, message",
    [
        (SimpleNamespace(points=[[0, 0, 0]], cells={"tetra": [[0, 1, 2, 3]]}), "got 'tetra'"),
        (SimpleNamespace(points=[[0, 0, 0]], cells=None), "got a 'SimpleNamespace' whose data are others"),
        (SimpleNamespace(points=[[0, 0, 0]], cells=[3]), "got a 'SimpleNamespace' whose data are others"),
        (SimpleNamespace(points=[[0, 0, 0]], faces=[5, 0, 0, 0, 0, 0]), "3 or 4 corners, got one of 5"),
        (SimpleNamespace(points=[[0, 0, 0]], faces=[3, 0, 0]), r"expected 3 corners after .faces\[0\], got 2"),
        (SimpleNamespace(points=[[0, 0, 0]], faces=[[0, 0, 0]]), r"expected .faces as flat integers"),
        (SimpleNamespace(points=[[0, 0, 0]], faces=None), r"expected .faces as flat integers"),
        (SimpleNamespace(vertex={}, triangle={}), "got a 'SimpleNamespace' whose data are others"),
        (3, "expected a bilayer.Mesh.*got a 'int'"),
    ],
)
def test_other_objects_are_refused(like, message):
    with pytest.raises(ValueError, match=f"source: .*{message}"):
        bilayer.as_mesh(like)
    calls = {"mesh": bilayer.Shape.triangles, "solid": bilayer.mass_properties}
    for name, call in calls.items():
        with pytest.raises(ValueError, match=f"{name}: .*{message}"):
            call(like)


@pytest.mark.parametrize("size", [(1, 1), (1, 1, 0), (1, np.nan, 1), "big"])
def test_bad_boxes(size):
    with pytest.raises(ValueError, match="size: expected three lengths above 0, got"):
        bilayer.box(size)


def test_spheres():
    mesh = bilayer.sphere(2, subdivisions=4)
    assert np.allclose(np.linalg.norm(mesh.vertices, axis=1), 2)
    assert bilayer.inspect(mesh).verdict == "closed and oriented"
    for radius, subdivisions in ((0, 1), (np.inf, 1), (1, 10), (1, -1), ("x", 1), (1, 2.5)):
        with pytest.raises(ValueError, match="radius is|subdivisions is"):
            bilayer.sphere(radius, subdivisions)


def test_transformed_beyond_float(sphere):
    large = sphere.transformed(np.diag([3e38, 1, 1, 1]))
    with pytest.raises(ValueError, match="vertex 0 would be beyond the range of float"):
        large.transformed(np.diag([9, 1, 1, 1]))


def test_polydata_cut_short():
    class PolyData:
        points, faces = np.zeros((3, 3)), np.array([3, 0, 1])

    with pytest.raises(ValueError, match=r"expected 3 corners after \.faces\[0\], got 2"):
        bilayer.as_mesh(PolyData())
