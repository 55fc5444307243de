# SPDX-License-Identifier: Apache-2.0
"""seed(), particles(), obstacle()."""

import copy
import pickle

import numpy as np
import pytest

import bilayer


@pytest.fixture(scope="module")
def tank():
    return bilayer.build(bilayer.box((2, 2, 1)), voxel_size=0.05)


def volume(level_set):
    return bilayer.mass_properties(level_set).volume


def test_seed(tank):
    ball = bilayer.sphere(0.3)
    added = bilayer.mass_properties(ball).volume
    above = bilayer.Pose((0, 0, 1))
    both = bilayer.seed(tank, ball, pose=above)
    assert volume(both.liquid) == pytest.approx(volume(tank) + added, rel=0.003)
    assert both.changed_voxels >= 0 and both.max_change_voxels >= 0 and both.where.shape == (3,)
    assert both.liquid.voxel_size == tank.voxel_size and both.liquid.mesh_hash == 0
    holed = bilayer.seed(tank, ball, mode="subtract")
    assert volume(holed.liquid) == pytest.approx(volume(tank) - added, rel=0.003)
    twice = bilayer.seed(tank, bilayer.build(ball, voxel_size=0.03), above, scale=(1, 1, 0.5))
    assert volume(twice.liquid) == pytest.approx(volume(tank) + added / 2, rel=0.005)
    assert volume(tank) == pytest.approx(4, rel=0.001)


def far(mesh, origin):
    return bilayer.Mesh(mesh.vertices, mesh.faces, origin)


ORIGIN = (500000, 4000000, -800)
TURNED = bilayer.Pose((0.5, -0.25, 0.5), (0.8, 0, 0.6, 0))


@pytest.mark.parametrize("is_field", [False, True])
@pytest.mark.parametrize("mode", ["unite", "intersect", "subtract"])
def test_seeds_far_from_zero_are_those_near_it(tank, mode, is_field):
    there = bilayer.build(far(bilayer.box((2, 2, 1)), ORIGIN), voxel_size=0.05)
    body, moved = bilayer.box((0.5, 0.7, 0.9)), far(bilayer.box((0.5, 0.7, 0.9)), ORIGIN)
    if is_field:
        body, moved = bilayer.build(body, voxel_size=0.04), bilayer.build(moved, voxel_size=0.04)
    here, result = (bilayer.seed(a, b, TURNED, (1, 2, 0.5), mode) for a, b in ((tank, body), (there, moved)))
    assert np.array_equal(result.liquid.origin, ORIGIN) and np.array_equal(here.liquid.origin, (0, 0, 0))
    for one, other in zip(here.liquid.to_numpy(), result.liquid.to_numpy()):
        assert np.array_equal(one, other)
    assert here.changed_voxels == result.changed_voxels and np.allclose(here.where, result.where, atol=1e-6)


def test_bodies_of_a_seed_are_where_their_origins_put_them(tank):
    there = bilayer.build(far(bilayer.box((2, 2, 1)), ORIGIN), voxel_size=0.05)
    ball, up = bilayer.sphere(0.3), np.float64([0.25, 0, 0.5])
    for form in (lambda mesh: mesh, lambda mesh: bilayer.build(mesh, resolution=24)):
        apart = bilayer.seed(there, form(far(ball, ORIGIN + up))).liquid
        again = bilayer.seed(tank, form(ball), pose=bilayer.Pose(up)).liquid
        for one, other in zip(apart.to_numpy(), again.to_numpy()):
            assert np.allclose(one, other, atol=1e-6)
    same = bilayer.seed(there, there).liquid
    assert np.array_equal(same.to_numpy().values, bilayer.seed(tank, tank).liquid.to_numpy().values)


@pytest.mark.parametrize("is_field", [False, True])
def test_obstacles_far_from_zero_are_those_near_it(is_field):
    origin, solid = (5000, -40000, 25), bilayer.box((0.5, 0.7, 0.9))  # whole cells
    moved = far(solid, origin)
    if is_field:
        solid, moved = bilayer.build(solid, voxel_size=0.05), bilayer.build(moved, voxel_size=0.05)
    options = {"velocity": (1, 2, 3), "angular_velocity": (0, 1, 2)}
    here, there = (bilayer.obstacle(body, 0.125, TURNED, 1.5, **options) for body in (solid, moved))
    assert np.array_equal(here.origin + origin, there.origin)
    for name in ("distance", "velocity", "face_fluid_fraction", "cell_fluid_fraction"):
        assert np.allclose(getattr(here, name), getattr(there, name), atol=1e-6)


def test_bad_seeds(tank):
    ball = bilayer.sphere(0.3)
    for options, message in (
        ({"mode": "add"}, "mode: expected one of 'unite', 'intersect', 'subtract'"),
        ({"scale": 0}, "scale"),
        ({"scale": (1, 2)}, r"scale: expected one number or three, got shape \(2,\)"),
        ({"scale": -1}, "scale is -1, and must be above 0"),
        ({"pose": np.eye(3)}, "pose: expected"),
    ):
        with pytest.raises(ValueError, match=message):
            bilayer.seed(tank, ball, **options)
    with pytest.raises(ValueError, match="body: the mesh is open"):
        bilayer.seed(tank, bilayer.Mesh(ball.vertices, ball.faces[: len(ball.faces) // 2]))
    with pytest.raises(ValueError, match="body: expected a bilayer.Mesh"):
        bilayer.seed(tank, 3)
    with pytest.raises(ValueError, match="liquid: expected a LevelSet, got a 'Mesh'"):
        bilayer.seed(ball, tank)
    narrow = bilayer.build(ball, voxel_size=0.05, half_width_voxels=2)
    with pytest.raises(ValueError, match="liquid: the liquid's band is narrower"):
        bilayer.seed(narrow, ball)


def test_nothing_left(tank):
    with pytest.raises(ValueError, match="body: it leaves nothing of the liquid"):
        bilayer.seed(tank, bilayer.box((99, 99, 99)), mode="subtract")


def test_particles_of_a_level_set_take_no_place(tank):
    for options in ({"scale": 2}, {"pose": bilayer.Pose((1, 0, 0))}, {"voxel_size": 1}):
        with pytest.raises(ValueError, match="pose, scale, voxel_size: expected no values with a LevelSet"):
            bilayer.particles(tank, **options)


def test_particles(tank):
    points = bilayer.particles(tank, per_voxel=4)
    assert points.dtype == np.float32 and points.shape[1] == 3
    assert len(points) == pytest.approx(4 * 4 / 0.05**3, rel=0.02)
    assert (np.abs(points) <= np.float32([1, 1, 0.5]) + 1e-5).all()
    assert np.array_equal(bilayer.particles(tank, per_voxel=4), points)
    assert not np.array_equal(bilayer.particles(tank, per_voxel=4, seed=1)[:10], points[:10])
    ball = bilayer.sphere(0.3)
    field = bilayer.Field(bilayer.build(ball, resolution=32), ball)
    moved = bilayer.particles(field, bilayer.Pose((5, 0, 0)), scale=2, voxel_size=0.05)
    assert np.linalg.norm(moved - [5, 0, 0], axis=1).max() <= 0.6 + 1e-5
    for arguments, message in (
        ({"per_voxel": 0}, "per_voxel must be in 1..1000"),
        ({"pose": bilayer.Pose()}, "pose, scale, voxel_size: expected no values"),
        ({"seed": -1}, "seed is -1, and must be an integer from 0 to 18446744073709551615"),
        ({"seed": 1.5}, "seed: expected an integer, got a 'float'"),
    ):
        with pytest.raises(ValueError, match=message):
            bilayer.particles(tank, **arguments)
    with pytest.raises(ValueError, match="liquid: expected a LevelSet or a Field"):
        bilayer.particles(ball)
    with pytest.raises(ValueError, match="voxel_size"):
        bilayer.particles(field, voxel_size=-1)


def test_obstacle(tmp_path):
    ball = bilayer.sphere(0.5, subdivisions=4)
    obstacle = bilayer.obstacle(ball, 0.05, bilayer.Pose((1, 0, 0)), velocity=(0, 0, 3))
    shape = obstacle.distance.shape
    assert obstacle.cell_fluid_fraction.shape == shape
    assert obstacle.face_fluid_fraction.shape == obstacle.velocity.shape == shape + (3,)
    closed = (1 - obstacle.cell_fluid_fraction).sum() * 0.05**3
    assert closed == pytest.approx(bilayer.mass_properties(ball).volume, rel=0.01)
    index = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1)
    truth = np.linalg.norm(obstacle.origin + obstacle.voxel_size * index - [1, 0, 0], axis=-1) - 0.5
    near = np.abs(truth) < 0.1
    assert np.abs(obstacle.distance - truth)[near].max() < 0.005
    assert np.allclose(obstacle.velocity[near][:, 2], 3)
    for again in (pickle.loads(pickle.dumps(obstacle)), copy.copy(obstacle), copy.deepcopy(obstacle)):
        assert np.array_equal(again.distance, obstacle.distance) and np.array_equal(again.origin, obstacle.origin)
        assert np.array_equal(again.face_fluid_fraction, obstacle.face_fluid_fraction)
        assert np.array_equal(again.velocity, obstacle.velocity)
        assert again == obstacle
    assert obstacle != bilayer.obstacle(ball, 0.05, velocity=(0, 0, 3)) and obstacle != 1
    assert repr(obstacle) == "Obstacle({} x {} x {} cells of 0.05)".format(*shape)
    obstacle.save(tmp_path / "solid.vdb")
    assert bilayer.LevelSet.load(tmp_path / "solid.vdb").voxel_size == pytest.approx(0.05)
    for arguments, message in (
        ({"voxel_size": 0}, "voxel_size"),
        ({"voxel_size": 0.05, "velocity": (1, 2)}, "velocity: expected"),
        ({"voxel_size": 0.05, "half_width_voxels": 1}, "half_width_voxels must be in 3..1000, not 1"),
    ):
        with pytest.raises(ValueError, match=message):
            bilayer.obstacle(ball, **arguments)
