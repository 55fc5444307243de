# SPDX-License-Identifier: Apache-2.0
"""Field: queries against analytic answers, shapes, bad arguments."""

import copy
import pickle
import signal
import subprocess
import sys

import numpy as np
import pytest

import bilayer
from conftest import box_distance

INFINITY = float("inf")


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64, np.int32])
def test_samples_of_any_dtype(box_field, dtype):
    points = np.array([[0, 0, 1], [1, 1, 0]], dtype=dtype)
    samples = box_field.sample(points)
    assert samples.distance.dtype == np.float32 and samples.gradient.shape == (2, 3)
    assert np.allclose(samples.distance, 0, atol=1e-5) and samples.in_band.all()


def test_samples_are_distances(sphere_field, random):
    directions = random.normal(size=(1000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    radii = random.uniform(0.97, 1.03, size=(1000, 1))
    distance, gradient, in_band = sphere_field.sample(directions * radii)
    assert in_band.all()
    assert np.abs(distance - (radii[:, 0] - 1)).max() < 0.01
    assert (gradient * directions).sum(axis=1).min() > 0.95
    far = sphere_field.sample([[3, 0, 0], [0, 0, 0]])
    assert not far.in_band.any() and far.distance[0] > 0 > far.distance[1] and not far.gradient.any()


def test_leading_shapes(box_field, random):
    points = random.uniform(-2, 2, size=(4, 5, 3))
    flat = box_field.sample(points.reshape(-1, 3))
    grid = box_field.sample(points)
    assert grid.distance.shape == (4, 5) and grid.gradient.shape == (4, 5, 3)
    assert np.array_equal(grid.distance.ravel(), flat.distance)
    single = box_field.sample(points[0, 0])
    assert single.distance.shape == () and single.gradient.shape == (3,)
    assert single.distance == flat.distance[0] and isinstance(single.distance, np.float32)
    empty = box_field.sample(np.zeros((0, 3)))
    assert empty.distance.shape == (0,) and empty.gradient.shape == (0, 3)
    assert box_field.closest(np.zeros((0, 3))).position.shape == (0, 3)
    assert box_field.inside(np.zeros((0, 3))).shape == (0,)
    transposed = points.transpose(1, 0, 2)
    assert np.array_equal(box_field.sample(transposed).distance, grid.distance.T)


def test_lists_and_broadcast_arrays(box_field):
    assert np.array_equal(box_field.sample([[0.9, 0, 0]]).distance, box_field.sample(np.array([[0.9, 0, 0]])).distance)
    repeated = np.broadcast_to(np.float32([0.9, 0, 0]), (7, 3))
    assert len(set(box_field.sample(repeated).distance.tolist())) == 1


@pytest.mark.parametrize(
    "points, message",
    [
        (np.zeros((5, 2)), r"points: expected an array of real numbers of shape \(\.\.\., 3\), got shape \(5, 2\)"),
        (1.0, r"points: expected .* got shape \(\)"),
        ([], r"points: .* got shape \(0,\)"),
        (None, "points: expected"),
        ("abc", "points: expected"),
        ([[1, 2], [3]], "points: expected"),
        (np.array([[1, 2, 3]], dtype=object), "dtype object"),
        ([[0, 0, 0], [0, np.nan, 0]], r"points\[1, 1\] is nan, and must be finite; its shape is \(2, 3\)"),
        (np.full((2, 2, 3), np.inf), r"points\[0, 0, 0\] is inf"),
        (np.array([[1e300, 0, 0]]), r"points\[0, 0\] is 1e[+]300, and must be in the range of float32"),
    ],
)
@pytest.mark.parametrize("query", ["sample", "closest", "inside"])
@pytest.mark.filterwarnings("error")
def test_bad_points(box_field, query, points, message):
    with pytest.raises(ValueError, match=message):
        getattr(box_field, query)(points)


def test_closest(box_field, random):
    points = random.uniform(-3, 3, size=(2000, 3)).astype(np.float32)
    answer = box_field.closest(points)
    assert answer.found.all()
    assert np.abs(answer.distance - box_distance(points)).max() < 1e-5
    assert np.allclose(np.linalg.norm(points - answer.position, axis=1), np.abs(answer.distance), atol=1e-5)
    assert answer.triangle.dtype == np.int32 and answer.triangle.min() >= 0 and answer.triangle.max() < 12
    assert set(answer.feature) <= {0, 1, 2} and answer.feature_index.max() <= 2
    near = box_field.closest(points, max_distance=0.5)
    assert np.array_equal(near.found, np.abs(box_distance(points)) <= 0.5)
    for bad in (-1, float("nan")):
        with pytest.raises(ValueError, match="max_distance"):
            box_field.closest(points, bad)


def test_closest_without_a_mesh(box_set):
    answer = bilayer.Field(box_set).closest([2, 0.1, 0.2])
    assert answer.triangle == -1 and answer.distance == pytest.approx(1, abs=1e-3)


def test_inside(box_field, random):
    points = random.uniform(-1.5, 1.5, size=(5000, 3)).astype(np.float32)
    inside = box_field.inside(points)
    assert inside.dtype == bool and np.array_equal(inside, box_distance(points) < 0)
    assert box_field.inside([0, 0, 0]) and not box_field.inside([0, 0, 2])


def test_raycast(box_field):
    origins = [[5, 0.1, 0.2], [0, 5, 0], [0, 0, 0], [5, 3, 0]]
    directions = [[-2, 0, 0], [0, -1, 0], [1, 0, 0], [-1, 0, 0]]
    hits = box_field.raycast(origins, directions)
    assert hits.hit.tolist() == [True, True, True, False]
    assert hits.distance.tolist() == [4, 4, 0, INFINITY]
    assert np.allclose(hits.position[0], [1, 0.1, 0.2]) and np.allclose(hits.normal[0], [1, 0, 0])
    assert np.isnan(hits.position[3]).all() and hits.triangle[3] == -1 and hits.triangle[0] >= 0
    short = box_field.raycast(origins, directions, [4.1, 3.9, 1, 1])
    assert short.hit.tolist() == [True, False, True, False]


def test_rays_are_broadcast(box_field):
    hits = box_field.raycast([[[5, 0, 0]], [[6, 0, 0]]], [[-1, 0, 0], [1, 0, 0], [0, 1, 0]])
    assert hits.hit.shape == (2, 3) and hits.position.shape == (2, 3, 3)
    assert hits.distance.tolist() == [[4, INFINITY, INFINITY], [5, INFINITY, INFINITY]]
    with pytest.raises(ValueError, match=r"directions: leading shape \(2,\) does not fit origins of .* \(3,\)"):
        box_field.raycast(np.ones((3, 3)), np.ones((2, 3)))


@pytest.mark.parametrize(
    "arguments, message",
    [
        (([0, 0, 0], [0, 0, 0]), "directions is zero, and must be a direction"),
        (([0, 0, 0], [0, 0]), "directions: expected"),
        (([0, 0], [0, 0, 1]), "origins: expected"),
        (([0, 0, 0], [0, 0, 1], -1), "max_distance is -1, and must be 0 or above"),
        (([0, 0, 0], [0, 0, 1], float("nan")), "max_distance is nan"),
        (([0, 0, 0], [0, 0, 1], "far"), "max_distance: expected real numbers"),
    ],
)
def test_bad_rays(box_field, arguments, message):
    with pytest.raises(ValueError, match=message):
        box_field.raycast(*arguments)


def test_sphere_cast(box_field):
    hits = box_field.sphere_cast([5, 0, 0], [-1, 0, 0], [0, 0.5, 4.5])
    assert np.allclose(hits.distance, [4, 3.5, 0], atol=1e-4)
    with pytest.raises(ValueError, match=r"radii\[1\] is -1"):
        box_field.sphere_cast([5, 0, 0], [-1, 0, 0], [1, -1])
    with pytest.raises(ValueError, match="radii is inf"):
        box_field.sphere_cast([5, 0, 0], [-1, 0, 0], INFINITY)


def test_segment(box_field):
    hits = box_field.segment([3, 0, 0], [[0, 0, 0], [2, 0, 0]])
    assert hits.hit.tolist() == [True, False] and hits.distance[0] == 2
    with pytest.raises(ValueError, match="end: expected"):
        box_field.segment([0, 0, 0], [0, 0])


def test_overlaps(box_field):
    assert box_field.overlaps_sphere([[2, 0, 0], [2, 0, 0], [0, 0, 0]], [0.9, 1.1, 0]).tolist() == [False, True, True]
    assert box_field.overlaps_box([[2, 0, 0], [2, 0, 0]], [[0.9, 1, 1], [1.1, 1, 1]]).tolist() == [False, True]
    turned = [np.cos(np.pi / 8), 0, 0, np.sin(np.pi / 8)]
    assert not box_field.overlaps_box([2.2, 0, 0], [1, 1, 1]) and box_field.overlaps_box([2.2, 0, 0], [1, 1, 1], turned)
    with pytest.raises(ValueError, match="rotations is a quaternion of length 1.41421, and must be one of length 1"):
        box_field.overlaps_box([0, 0, 0], [1, 1, 1], [1, 1, 0, 0])
    with pytest.raises(ValueError, match=r"half_sizes\[0\] is -1"):
        box_field.overlaps_box([0, 0, 0], [-1, 1, 1])
    with pytest.raises(ValueError, match="radii"):
        box_field.overlaps_sphere([0, 0, 0], -1)


@pytest.mark.parametrize("storage", ["float32", "fixed16"])
def test_pickles(box, box_set, random, storage):
    points = random.uniform(-2, 2, size=(3000, 3)).astype(np.float32)
    for mesh in (None, (box.vertices, box.faces)):
        field = bilayer.Field(box_set, mesh, storage)
        again = pickle.loads(pickle.dumps(field))
        assert (again.mesh is None) == (mesh is None) and again.memory_bytes == field.memory_bytes
        for query, some in (("closest", points[:300]), ("sample", points)):
            answers = zip(getattr(again, query)(some), getattr(field, query)(some))
            assert all(np.array_equal(one, other) for one, other in answers)


def test_long_batches_equal_single_queries(sphere_field, random):
    points = random.uniform(-1.2, 1.2, size=(40_001, 3)).astype(np.float32)
    few = slice(39_900, None)
    for query in (sphere_field.sample, sphere_field.closest):
        many, last = query(points), query(points[few])
        assert np.array_equal(many.distance[few], last.distance)
    assert np.array_equal(sphere_field.inside(points)[few], sphere_field.inside(points[few]))
    rays = sphere_field.raycast(points, -points)
    assert np.array_equal(rays.triangle[few], sphere_field.raycast(points[few], -points[few]).triangle)
    directions = points.copy()
    directions[30_000] = 0
    with pytest.raises(ValueError, match=r"directions\[30000\] is zero, and must be a direction; its leading shape is \(\d+,\)"):
        sphere_field.raycast(points, directions)


def test_attributes(box, box_set, box_field, sphere):
    assert box_field.voxel_size == 0.0625 and box_field.exterior_width == box_field.interior_width == 0.1875
    assert (box_field.bounds[0] < -1).all() and (box_field.bounds[1] > 1).all()
    assert box_field.mesh == box and bilayer.Field(box_set).mesh is None
    small = bilayer.Field(box_set, storage="fixed16")
    assert small.memory_bytes < bilayer.Field(box_set).memory_bytes < box_field.memory_bytes
    alone = bilayer.Field(box_set, storage="fixed16", keep_level_set=False)
    assert small.memory_bytes == alone.memory_bytes + box_set.memory_bytes
    with pytest.raises(TypeError, match="keep_level_set=False cannot be pickled"):
        pickle.dumps(alone)
    assert small.sample([1.1, 0, 0]).distance == pytest.approx(0.1, abs=1e-5)
    assert np.array_equal(copy.deepcopy(box_field).sample([1, 2, 3]).distance, box_field.sample([1, 2, 3]).distance)
    with pytest.raises(ValueError, match="storage: expected one of 'float32', 'fixed16'"):
        bilayer.Field(box_set, storage="float64")
    with pytest.raises(ValueError, match="level_set: the level set is of another mesh"):
        bilayer.Field(box_set, sphere)
    with pytest.raises(ValueError, match="level_set: the level set has another origin than the mesh"):
        bilayer.Field(box_set, bilayer.Mesh(box.vertices, box.faces, (1, 0, 0)))
    with pytest.raises(ValueError, match="level_set: expected a LevelSet, got a 'Mesh'"):
        bilayer.Field(box)
    with pytest.raises(TypeError, match=r"sample\(\) missing 1 required positional argument: 'points'"):
        box_field.sample()


def test_results_compare_field_by_field(box_field, box_set):
    rays = [[-3, 0, 0], [-3, 5, 0]]
    ball = bilayer.Shape.sphere(0.5), bilayer.Pose((2, 0, 0))
    body = bilayer.Collider(box_field.mesh, box_set)
    for ask in (
        lambda: box_field.sample(rays),
        lambda: box_field.closest(rays, max_distance=2),  # nan where nothing is found
        lambda: box_field.raycast(rays, [1, 0, 0]),
        lambda: bilayer.distance(*ball, body, None),
        lambda: bilayer.time_of_impact(*ball, [[-2, 0, 0], [0, 0, 0]], body, None, None),
        lambda: bilayer.mass_properties(box_set),
        box_set.to_numpy,
        box_set.sparse,
        lambda: bilayer.seed(box_set, bilayer.sphere(0.5), mode="subtract"),
        lambda: bilayer.collide(*ball, body, bilayer.Pose((0.6, 0, 0))),
        lambda: bilayer.inspect(box_field.mesh),
    ):
        answer = ask()
        assert answer == ask() and answer == pickle.loads(pickle.dumps(answer)) and not answer != copy.deepcopy(answer)
        assert answer != "something else"
        with pytest.raises(TypeError, match="unhashable"):
            hash(answer)
    assert box_field.sample(rays) != box_field.sample(rays[::-1])
    assert box_field.sample(rays) != box_field.sample(rays[:1])


FREED = """
import bilayer

def resident():
    with open("/proc/self/statm") as stream:
        return 4096 * int(stream.read().split()[1])

box = bilayer.box((2, 2, 2))
growth, fields = [], []
for keep in (False, True):
    before = resident()
    for _ in range(6):
        level_set = bilayer.build(box, resolution=300)
        kept = level_set.memory_bytes
        fields.append(bilayer.Field(level_set, storage="fixed16", keep_level_set=keep))
        del level_set
    growth.append(resident() - before)
assert growth[1] - growth[0] > 3 * kept, (growth, kept)
assert all(field.sample([1.001, 0, 0]).in_band for field in fields)
"""


def test_a_field_without_its_level_set_frees_it():
    """By the memory of a process of its own, which also counts what memory_bytes would leave out."""
    subprocess.run([sys.executable, "-c", FREED], check=True)


def test_what_is_not_found_is_nan(box_field):
    points = [[5, 0, 0], [1.5, 0, 0], [3, 0.1, 0]]
    found = box_field.closest(points, [1, 1, INFINITY])
    assert found.found.tolist() == [False, True, True] and found.distance.tolist() == [INFINITY, 0.5, 2]
    assert np.isnan(found.position[0]).all() and np.isnan(found.normal[0]).all() and found.triangle[0] == -1
    for limit, one in zip((1, 1, INFINITY), zip(points, *found)):
        alone = box_field.closest(one[0], limit)
        assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(alone, one[1:]))
    many = box_field.closest([5, 0, 0], [[1], [10]])
    assert many.found.tolist() == [[False], [True]] and many.position.shape == (2, 1, 3)
    assert not box_field.closest([5, 0, 0], 1).found
    for bad, message in ((-1, " is -1"), ("far", ": expected"), ([1, 2], ": leading shape")):
        with pytest.raises(ValueError, match="max_distance" + message):
            box_field.closest(points, bad)


def test_rays_from_inside_and_lengths(box_field):
    hit = box_field.raycast([0.2, 0, 0], [0, 3, 0])
    assert hit.hit and hit.distance == 0 and hit.triangle == -1
    assert hit.normal.tolist() == [0, -1, 0] and np.allclose(hit.position, [0.2, 0, 0])
    assert box_field.raycast([5, 0, 0], [-2, 0, 0]).distance == 4
    assert box_field.raycast([5, 0, 0], [-2, 0, 0], 3.9).hit == False  # noqa: E712


def test_points_of_the_world(tmp_path):
    there = np.array([5e5, 4e6, 100])
    path = tmp_path / "far.obj"
    box = bilayer.box((2, 2, 2))
    corners = box.vertices.astype(float) + there
    path.write_text(
        "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in corners.tolist())
        + "".join("f {} {} {}\n".format(*(face + 1)) for face in box.faces.astype(int))
    )
    mesh = bilayer.read_mesh(path)
    level_set = bilayer.build(mesh, resolution=32)
    field = bilayer.Field(level_set, mesh)
    assert mesh.origin.any() and np.array_equal(field.origin, mesh.origin)
    assert np.array_equal(level_set.origin, mesh.origin)
    points = there + [[1.25, 0, 0], [0, 0.875, 0]]
    answer = field.closest(points - field.origin)
    assert np.allclose(answer.distance, [0.25, -0.125], atol=1e-6)
    assert np.allclose(answer.position + field.origin, there + [[1, 0, 0], [0, 1, 0]], atol=1e-6)
    values, origin, spacing = level_set.to_numpy()
    index = np.argwhere(np.abs(values) < 0.1)
    assert np.allclose(field.closest(origin + spacing * index).distance, values[tuple(index.T)], atol=1e-5)
    sparse = level_set.sparse()
    centres = sparse.origin + sparse.spacing * sparse.coordinates
    assert np.allclose(field.closest(centres).distance, sparse.values, atol=1e-5)
    collider = bilayer.Collider(mesh, level_set)
    assert np.array_equal(collider.field.origin, mesh.origin) and np.array_equal(field.mesh.origin, mesh.origin)
    assert np.allclose(collider.mass.centre + collider.field.origin, there, atol=1e-5)


def test_signals_without_a_mesh():
    field = bilayer.Field(bilayer.build(bilayer.sphere(1, 5), resolution=100))
    points = np.random.default_rng(0).uniform(-1.5, 1.5, (16 * 1024, 3))
    seen = []
    previous = signal.signal(signal.SIGALRM, lambda *_: seen.append(True))
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.02, 0.02)
        field.closest(points)  # takes half a second or more
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, previous)
    assert len(seen) > 3


class Tensor:
    """As Open3D's, which numpy takes for an array of objects."""

    def __len__(self):
        return 1

    def __getitem__(self, index):
        if index > 0:
            raise IndexError
        return [object(), object(), object()]

    def numpy(self):
        return np.zeros((1, 3))


@pytest.mark.parametrize(
    "points, message",
    [
        (None, "got None"),
        ({}, "got a 'dict'"),
        ({1, 2, 3}, "got a 'set'"),
        (Tensor(), r"got a 'Tensor': pass its \.numpy\(\)"),
        ([np.longdouble("1e4000"), 0, 0], r"\[0\] is inf"),
        (np.ma.masked_less([[0.0, 0, 1]], 1), r"without masked items, got one with some: pass \.compressed\(\)"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_what_is_no_array_of_numbers(box_field, points, message):
    with pytest.raises(ValueError, match=f"points.*{message}"):
        box_field.sample(points)


def test_masked_arrays_without_masked_items(box_field):
    assert box_field.sample(np.ma.array([[0.0, 0, 1]])).distance.shape == (1,)
