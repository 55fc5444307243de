# SPDX-License-Identifier: Apache-2.0
"""Pose, Collider, collide(), distance(), mass properties."""

import copy
import pickle

import numpy as np
import pytest

import bilayer

HALF_TURN = (0, 0, 0, 1)
QUARTER = (np.sqrt(0.5), 0, 0, np.sqrt(0.5))


def test_pose(random):
    pose = bilayer.Pose((1, 2, 3), QUARTER)
    assert np.allclose(pose.to_world([1, 0, 0]), [1, 3, 3])
    assert np.allclose(pose.to_body([1, 3, 3]), [1, 0, 0], atol=1e-6)
    points = random.normal(size=(4, 5, 3))
    assert np.allclose(pose.to_body(pose.to_world(points)), points, atol=1e-5)
    assert np.allclose((pose.matrix @ [1, 0, 0, 1])[:3], [1, 3, 3])
    again = bilayer.Pose.from_matrix(pose.matrix)
    assert np.allclose(again.rotation, pose.rotation) and np.array_equal(again.position, pose.position)
    assert pickle.loads(pickle.dumps(pose)) == pose and copy.deepcopy(pose) == pose and pose != bilayer.Pose()
    assert eval(repr(bilayer.Pose()), {"Pose": bilayer.Pose}) == bilayer.Pose()


@pytest.mark.parametrize(
    "arguments, message",
    [
        (((0, 0),), r"position: expected an array of real numbers of shape \(3,\), got shape \(2,\)"),
        ((np.zeros((2, 3)),), r"position: expected an array of real numbers of shape \(3,\), got shape \(2, 3\)"),
        (((0, 0, float("nan")),), r"position\[2\] is nan"),
        (((0, 0, 0), (1, 0, 0)), "rotation: expected"),
        (((0, 0, 0), (1, 1, 0, 0)), "rotation: expected a quaternion w, x, y, z of length 1, got one of length 1.41"),
    ],
)
def test_bad_poses(arguments, message):
    with pytest.raises(ValueError, match=message):
        bilayer.Pose(*arguments)


def test_products_of_poses(random):
    axes = random.normal(size=(2, 4))
    a, b = (bilayer.Pose(random.normal(size=3), axis / np.linalg.norm(axis)) for axis in axes)
    points = random.normal(size=(7, 3))
    assert np.allclose((a @ b).to_world(points), a.to_world(b.to_world(points)), atol=1e-5)
    assert np.allclose((a @ b).matrix, a.matrix @ b.matrix, atol=1e-6)
    assert np.allclose(a.inverse().matrix, np.linalg.inv(a.matrix), atol=1e-5)
    assert hash(copy.copy(a)) == hash(a) and len({a, copy.copy(a), b}) == 2
    assert hash(bilayer.Pose((0.0, 0, 0))) == hash(bilayer.Pose((-0.0, 0, 0)))
    with pytest.raises(TypeError):
        a @ 3


@pytest.mark.parametrize(
    "matrix", [2 * np.eye(4), np.diag([1, 1, -1, 1]), np.ones((4, 4)), np.eye(3), np.zeros((2, 4, 4))]
)
def test_bad_matrices(collider, matrix):
    with pytest.raises(ValueError, match="matrix"):
        bilayer.Pose.from_matrix(matrix)
    with pytest.raises(ValueError, match="pose_b"):
        bilayer.distance(collider, None, collider, matrix)


@pytest.mark.parametrize("accuracy", ["samples", "exact-near-features", "exact"])
@pytest.mark.parametrize("height", [2.05, 2.07, 2.09])
def test_margins_wider_than_the_band(accuracy, height):
    ball = bilayer.sphere(1)
    narrow, wide = (
        bilayer.Collider(ball, bilayer.build(ball, resolution=64, half_width_voxels=width), accuracy=accuracy)
        for width in (3, 8)
    )
    pose = bilayer.Pose((0, 0, height))
    found, expected = (bilayer.collide(body, pose, body, None, margin=0.1) for body in (narrow, wide))
    assert len(found) == len(expected) > 0
    assert np.allclose(found.distance, expected.distance, atol=2e-3)


def test_collider(box, box_set, collider, sphere):
    assert collider.margin == pytest.approx(0.0625) and collider.mesh == box
    assert collider.mass.volume == pytest.approx(8) and collider.field.voxel_size == 0.0625
    assert collider.exact_field.closest([2, 0, 0]).distance == 1
    assert bilayer.Collider(box, box_set, margin=0.5, accuracy="exact").margin == 0.5
    stored = bilayer.Collider.from_level_set(bilayer.with_body(box_set, box, margin=0.25))
    assert stored.margin == 0.25
    for options, message in (
        ({"margin": -1}, "margin"),
        ({"margin": float("nan")}, "margin"),
        ({"accuracy": "best"}, "accuracy: expected one of 'samples'"),
        ({"point_spacing_voxels": 0}, "point_spacing_voxels"),
    ):
        with pytest.raises(ValueError, match=message):
            bilayer.Collider(box, box_set, **options)
    with pytest.raises(ValueError, match="level_set: the level set is of another mesh"):
        bilayer.Collider(sphere, box_set)
    with pytest.raises(ValueError, match="level_set: the level set has another origin than the mesh"):
        bilayer.Collider(bilayer.Mesh(box.vertices, box.faces, (1, 0, 0)), box_set)
    for swapped, call in (
        (lambda: bilayer.Collider(box_set, box), r"Collider\(mesh, level_set\)"),
        (lambda: bilayer.Field(box, box_set), r"Field\(level_set, mesh\)"),
        (lambda: bilayer.with_body(box, box_set), r"with_body\(level_set, mesh\)"),
    ):
        with pytest.raises(ValueError, match=f"swapped, call {call}"):
            swapped()
    with pytest.raises(ValueError, match="level_set: expected a LevelSet, got a 'int'"):
        bilayer.Collider(box, 3)
    with pytest.raises(ValueError, match="margin: expected a number, got a 'str'"):
        bilayer.Collider(box, box_set, margin="1")
    with pytest.raises(ValueError):
        bilayer.Collider.from_level_set(box_set)


def test_colliders_pickle(box, box_set, sphere):
    cut = bilayer.Mesh(sphere.vertices, sphere.faces[: -len(sphere.faces) // 50])
    holed = bilayer.build(cut, resolution=24)
    bodies = [
        bilayer.Collider(box, box_set, point_spacing_voxels=1.7, margin=0.2, accuracy="exact"),
        bilayer.Collider(box, box_set, accuracy="samples"),
        bilayer.Collider(cut, holed),
        bilayer.Collider.from_level_set(bilayer.with_body(box_set, box, margin=0.3, keep_mesh=False)),
    ]
    points = np.random.default_rng(1).uniform(-1.5, 1.5, size=(500, 3))
    for body in bodies:
        again = pickle.loads(pickle.dumps(body))
        assert again.margin == body.margin and again.mesh == body.mesh
        above = bilayer.Pose((0.1, 0, 1.97))
        here, there = (bilayer.collide(one, above, one, None, margin=0.1) for one in (body, again))
        assert len(here) > 0 and here == there
        for name in ("field", "exact_field"):
            field, pickled = getattr(body, name), pickle.loads(pickle.dumps(getattr(body, name)))
            assert np.array_equal(field.closest(points).position, pickled.closest(points).position)
        assert copy.copy(body).margin == copy.deepcopy(body).margin == body.margin


def test_mass(sphere, box, sphere_set):
    mass = bilayer.mass_properties(bilayer.box((1, 2, 3)))
    assert mass.volume == pytest.approx(6) and not mass.centre.any()
    assert np.allclose(np.diag(mass.inertia), [6 * 13 / 12, 6 * 10 / 12, 6 * 5 / 12])
    assert np.allclose(mass.principal_inertia, sorted(np.diag(mass.inertia))) and mass.principal_axes.shape == (4,)
    volume = bilayer.mass_properties(sphere).volume
    assert bilayer.mass_properties(sphere_set).volume == pytest.approx(volume, rel=0.005)
    with pytest.raises(ValueError):
        bilayer.mass_properties(bilayer.Mesh(box.vertices, box.faces[:1]))


def test_contacts_of_a_box_on_a_box(collider):
    contacts = bilayer.collide(collider, bilayer.Pose((0, 0, 1.99)), collider, None, margin=0.05)
    assert len(contacts) == len(contacts.distance) > 4 and contacts
    assert contacts.points_tested > 0 and contacts.beyond_band == 0
    assert pickle.loads(pickle.dumps(contacts)) == contacts
    assert np.allclose(contacts.distance, -0.01, atol=1e-4)
    assert np.allclose(contacts.normal, [0, 0, 1], atol=1e-4)
    assert contacts.feature.dtype == np.uint32 and contacts.feature.max() >= 1 << 31
    matrix = bilayer.Pose((0, 0, 1.99)).matrix
    assert np.array_equal(bilayer.collide(collider, matrix, collider, None, margin=0.05).position, contacts.position)
    apart = bilayer.collide(collider, bilayer.Pose((0, 0, 2.2)), collider, None, margin=0.05)
    assert apart.position.shape == (0, 3) and apart.distance.shape == (0,) and len(apart) == 0 and not apart
    assert apart != contacts


def test_contact_options(collider):
    pose = bilayer.Pose((0, 0, 2.5))
    moving = bilayer.collide(collider, pose, collider, None, margin=0.05, motion_a=[[0, 0, -1], [0, 0, 0]])
    assert len(moving.approach) > 0 and (moving.approach > 0).any()
    large = bilayer.collide(collider, bilayer.Pose((0, 0, 2.99)), collider, None, margin=0.05, scale_b=2)
    assert np.allclose(large.distance.min(), -0.01, atol=1e-4)
    for options, message in (
        ({"margin": -1}, "margin"),
        ({"scale_a": 0}, "scale_a"),
        ({"scale_b": float("nan")}, "scale_b"),
        ({"motion_a": [0, 0, 0]}, "motion_a: expected"),
        ({"min_normal_cosine": np.nan}, "min_normal_cosine is nan"),
        ({"min_normal_cosine": 2}, "min_normal_cosine is 2, and must be a cosine, at most 1"),
        ({"exact": 1.5}, "exact: expected True or False, got a 'float'"),
        ({"cache": collider}, "cache: expected a ContactCache, got a"),
        ({"min_normal_cosine_apart": np.nan}, "min_normal_cosine_apart is nan"),
        ({"motion_b": np.zeros((3, 2, 3))}, "motion_b: expected"),
    ):
        with pytest.raises(ValueError, match=message):
            bilayer.collide(collider, pose, collider, None, **options)


def test_cache_changes_no_contact(collider):
    cache = bilayer.ContactCache()
    for step in range(5):
        pose = bilayer.Pose((0.01 * step, 0, 1.99))
        fresh = bilayer.collide(collider, pose, collider, None, margin=0.05)
        cached = bilayer.collide(collider, pose, collider, None, margin=0.05, cache=cache)
        assert np.array_equal(fresh.position, cached.position) and np.array_equal(fresh.feature, cached.feature)


def test_distance(collider):
    apart = bilayer.distance(collider, bilayer.Pose((5, 0.5, 0), HALF_TURN), collider, None)
    assert apart.found and apart.overlap == "none" and apart.distance == pytest.approx(3, abs=1e-5)
    assert apart.normal.tolist() == pytest.approx([1, 0, 0], abs=1e-6) and apart.triangle_a >= 0
    assert apart.position_a[0] == pytest.approx(4) and apart.position_b[0] == pytest.approx(1)
    assert not bilayer.distance(collider, bilayer.Pose((5, 0, 0)), collider, None, max_distance=1).found
    deep = bilayer.distance(collider, bilayer.Pose((1.9, 0.1, 0.2)), collider, None)
    assert deep.overlap == "surfaces" and deep.distance == pytest.approx(-0.1, abs=1e-4)
    inner = bilayer.distance(collider, None, collider, None, scale_a=0.25)
    assert inner.overlap == "a inside b" and inner.distance < 0
    with pytest.raises(ValueError, match="max_distance"):
        bilayer.distance(collider, None, collider, None, max_distance=-1)


def test_time_of_impact(collider):
    there = bilayer.Pose((5, 0.5, 0))
    impact = bilayer.time_of_impact(collider, there, [[-8, 0, 0], [0, 0, 0]], collider, None, None)
    assert impact.found and impact.fraction == pytest.approx(3 / 8, abs=1e-3)
    assert impact.pose_a.position == pytest.approx([2, 0.5, 0], abs=0.01) and impact.pose_b == bilayer.Pose()
    assert 0 <= impact.distance.distance < 0.01 and impact.distance.normal == pytest.approx([1, 0, 0], abs=1e-4)
    both = bilayer.time_of_impact(
        collider, there.matrix, [[-4, 0, 0], [0, 0, 0]], collider, None, [[4, 0, 0], [0, 0, 0]], tolerance=1e-4
    )
    assert both.fraction == pytest.approx(3 / 8, abs=1e-4)
    small = bilayer.time_of_impact(collider, there, [[-8, 0, 0], [0, 0, 0]], collider, None, None, scale_a=0.5)
    assert small.fraction == pytest.approx(3.5 / 8, abs=1e-3)
    turning = bilayer.time_of_impact(collider, bilayer.Pose((2.2, 0, 0)), [[0, 0, 0], [0, 0, 1]], collider, None, None)
    assert turning.found and 0 < turning.fraction < 0.5
    assert not bilayer.time_of_impact(collider, there, [[1, 0, 0], [0, 0, 0]], collider, None, None).found
    inside = bilayer.time_of_impact(collider, None, [[1, 0, 0], [0, 0, 0]], collider, None, None)
    assert inside.found and inside.fraction == 0 and inside.distance.overlap != "none"
    for arguments, options, message in (
        ((collider, there, [1, 0, 0], collider, None, None), {}, "motion_a: expected"),
        ((collider, there, None, collider, None, [[np.nan, 0, 0], [0, 0, 0]]), {}, r"motion_b\[0, 0\] is nan"),
        ((collider, np.eye(3), None, collider, None, None), {}, "pose_a: expected"),
        ((collider, there, None, collider, None, [[0, 0, 0], [0, 0, 2000]]), {}, "rad"),
        ((collider, there, None, collider, None, None), {"tolerance": -1}, "tolerance is -1"),
        ((collider, there, None, collider, None, None), {"scale_b": 0}, "scale_b"),
        (
            (collider, there, None, collider, None, None),
            {"tolerance": 0.5, "penetration": True},
            "tolerance is 0.5, and must be 0 with penetration=True",
        ),
    ):
        with pytest.raises(ValueError, match=message):
            bilayer.time_of_impact(*arguments, **options)


def test_time_of_penetration(collider):
    voxel = collider.field.voxel_size
    resting = bilayer.Pose((2, 0, 0))

    def found(motion, pose=resting, penetration=True):
        motion_a = [motion, [0, 0, 0]]
        return bilayer.time_of_impact(collider, pose, motion_a, collider, None, None, penetration=penetration)

    for motion in ((0, 1.5, 0), (0, 0, -1.5), (1, 0, 0), (0, 0, 0)):  # slides, parts, rests
        assert found(motion, penetration=False).fraction == 0  # a touch
        assert not found(motion).found
    into = found((-1, 0.2, 0))
    assert into.found and into.pose_a.position[0] == pytest.approx(2, abs=voxel / 2)
    assert abs(into.distance.normal[0]) == pytest.approx(1, abs=1e-3)
    fast = found((-100, 0, 0), bilayer.Pose((50, 0.1, 0.2)))
    assert fast.found and 2 - 1e-4 <= fast.pose_a.position[0] <= 2 + voxel / 2


SHAPES = [
    bilayer.Shape.sphere(0.5),
    bilayer.Shape.box((0.5, 0.5, 0.5)),
    bilayer.Shape.capsule(0.5, 0.25),
    bilayer.Shape.cylinder(0.5, 0.25),
    bilayer.Shape.cone(0.5, 0.5),
    bilayer.Shape.hull(0.5 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])),
    bilayer.Shape.spheres([(0, 0, 0), (0, 0.2, 0)], 0.5),
    bilayer.Shape.plane((1, 0, 0), 0.5),
    bilayer.Shape.triangles(bilayer.Mesh([(0.5, -9, -9), (0.5, 9, -9), (0.5, 0, 9)], [(0, 1, 2)])),
]


@pytest.mark.parametrize("shape", SHAPES, ids=repr)
def test_shapes(collider, shape):
    # a shape from x = -0.5 to 0.5 on the left of a box of half side 1, turned by 90 degrees about x
    at = bilayer.Pose((-2, 0, 0.3 if "cone" in repr(shape) else 0), (np.sqrt(0.5), np.sqrt(0.5), 0, 0))
    apart = bilayer.distance(shape, at, collider, None)
    assert apart.found and apart.overlap == "none" and apart.distance == pytest.approx(0.5, abs=0.01)
    assert apart.normal.tolist() == pytest.approx([-1, 0, 0], abs=0.05)
    assert bilayer.distance(collider, None, shape, at).distance == apart.distance
    near = bilayer.Pose(at.position + (0.51, 0, 0), at.rotation)
    contacts = bilayer.collide(shape, near, collider, None, margin=0.1)
    assert len(contacts.distance) and contacts.distance.min() == pytest.approx(-0.01, abs=0.01)
    assert contacts.normal[contacts.distance.argmin()].tolist() == pytest.approx([-1, 0, 0], abs=0.1)
    few = bilayer.collide(collider, None, shape, near, margin=0.1, reduced=True, cache=bilayer.ContactCache())
    assert 0 < len(few.distance) <= 12 * 8
    impact = bilayer.time_of_impact(shape, at, [[1, 0, 0], [0, 0, 0]], collider, None, None)
    assert impact.found and impact.fraction == pytest.approx(0.5, abs=0.02)
    again = pickle.loads(pickle.dumps(shape))
    assert bilayer.distance(again, at, collider, None).distance == apart.distance
    assert copy.copy(shape) is not None and bilayer.distance(copy.deepcopy(shape), at, collider, None).found


CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.5]])


@pytest.mark.parametrize(
    "make, arguments",
    [
        (bilayer.Shape.box, (np.array([0.5, 0.75, 0.25]),)),
        (bilayer.Shape.box, ([0.5, 0.75, 0.25],)),
        (bilayer.Shape.plane, (np.float32([0.5, 0.75, 0.25]),)),
        (bilayer.Shape.hull, (CORNERS.copy(),)),
        (bilayer.Shape.hull, (CORNERS.astype(np.float32),)),
        (bilayer.Shape.spheres, (CORNERS.copy(), np.array([0.5, 0.75, 0.25, 0.1]))),
        (bilayer.Shape.triangles, ((CORNERS.copy(), np.array([[0, 1, 2], [0, 1, 3]])),)),
    ],
)
def test_shapes_keep_their_numbers(collider, make, arguments):
    shape = make(*arguments)
    there = bilayer.Pose((4, 0, 0))
    before = bilayer.distance(shape, there, collider, None).distance, repr(shape), pickle.dumps(shape)
    for array in arguments[0] if isinstance(arguments[0], tuple) else arguments:
        array[:] = [0, 0, 0] if isinstance(array, list) else 0
    assert before == (bilayer.distance(shape, there, collider, None).distance, repr(shape), pickle.dumps(shape))
    again = pickle.loads(before[2])
    assert bilayer.distance(again, there, collider, None).distance == before[0]
    kept = shape.__reduce__()[1][0]
    if isinstance(kept, np.ndarray):
        with pytest.raises(ValueError, match="read-only"):
            kept[:] = 0


def test_long_shapes_have_a_short_repr(random):
    assert repr(bilayer.Shape.hull(random.normal(size=(1000, 3)))) == "Shape.hull(<array of shape (1000, 3)>, 0.0)"


def test_bad_shapes(collider):
    for make, message in (
        (lambda: bilayer.Shape.sphere(0), "radius: the radius is 0"),
        (lambda: bilayer.Shape.cone(1, -1), "half_height: the half height is -1"),
        (lambda: bilayer.Shape.spheres([(0, 0, 0)], 0), "radii: the radii are all 0"),
        (lambda: bilayer.Shape.spheres([(0, 0, 0)], [1, 2]), r"radii: expected one number, or shape \(1,\) .* \(2,\)"),
        (lambda: bilayer.Shape.spheres([(0, 0, 0), (1, 0, 0)], [[1], [2]]), r"radii: expected .* got shape \(2, 1\)"),
        (lambda: bilayer.Shape.spheres((0, 0, 0), [1, 2]), r"centres: expected .* got shape \(3,\)"),
        (lambda: bilayer.Shape.spheres(np.zeros((2, 2, 3)), 1), r"centres: expected .* got shape \(2, 2, 3\)"),
        (lambda: bilayer.Shape.spheres([(0, 0, 0)], -1), "radii is -1"),
        (lambda: bilayer.Shape.plane((0, 0, 1), np.inf), "offset: the offset of the plane is not finite"),
        (lambda: bilayer.Shape.triangles(bilayer.Mesh(np.zeros((0, 3)), [])), "mesh: the mesh has no triangle"),
        (lambda: bilayer.Shape.box((1, -1, 1)), "half_extents: the half extent is -1"),
        (lambda: bilayer.Shape.box((1, 1)), "half_extents: expected"),
        (lambda: bilayer.Shape.hull([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)]), "points: the points of a hull"),
        (lambda: bilayer.Shape.hull([[np.nan, 0, 0]]), r"points\[0, 0\] is nan"),
        (lambda: bilayer.Shape.plane((0, 0, 0)), "normal: the length of the normal is 0"),
        (lambda: bilayer.distance(SHAPES[0], None, SHAPES[1], None), "a: at least one of the two shapes must"),
        (lambda: bilayer.time_of_impact(SHAPES[7], None, [[0, 0, 0], [0, 1, 0]], collider, None, None), "rotate"),
    ):
        with pytest.raises(ValueError, match=message):
            make()
    with pytest.raises(ValueError, match="a: expected a Collider or a Shape, got a 'int'"):
        bilayer.distance(1, None, collider, None)


def test_distances(collider, random):
    poses = [bilayer.Pose(random.uniform(-8, 8, size=3)) for _ in range(12)]
    pairs = [(i, j) for i in range(12) for j in range(i)]
    many = bilayer.distances(collider, poses, pairs)
    single = [bilayer.distance(collider, poses[i], collider, poses[j]).distance for i, j in pairs]
    assert many.dtype == np.float32 and np.array_equal(many, np.float32(single))
    assert np.array_equal(bilayer.distances([collider] * 12, poses, pairs), many)
    assert np.array_equal(bilayer.distances(collider, poses, pairs, max_distance=0.5) == np.inf, many > 0.5)
    assert bilayer.distances(collider, poses, []).shape == (0,)
    matrices = np.stack([pose.matrix for pose in poses])
    assert np.array_equal(bilayer.distances(collider, matrices, pairs), many)
    for colliders, bad, message in (
        ([collider], pairs, "colliders: expected one for each of 12 poses, got 1"),
        ([1] * 12, pairs, "colliders: expected a Collider"),
        (collider, [[0, 12]], r"pairs\[0, 1\] is 12"),
        (collider, [0, 1], "pairs: expected"),
    ):
        with pytest.raises(ValueError, match=message):
            bilayer.distances(colliders, poses, bad)
    with pytest.raises(ValueError, match="poses: expected a sequence of poses, got a 'int'"):
        bilayer.distances(collider, 3, pairs)
    with pytest.raises(ValueError, match="colliders: expected a Collider or a sequence of them, got a 'int'"):
        bilayer.distances(3, poses, pairs)
