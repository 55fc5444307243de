# SPDX-License-Identifier: Apache-2.0
"""What functions return: named tuples of arrays, and the report of a mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Optional

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from bilayer._bilayer import LevelSet, Pose

Floats = NDArray[np.float32]
Doubles = NDArray[np.float64]
Ints = NDArray[np.int32]
Bools = NDArray[np.bool_]


class Samples(NamedTuple):
    """Field.sample(): arrays of the points' shape."""

    distance: Floats
    gradient: Floats
    in_band: Bools


class ClosestPoints(NamedTuple):
    """Field.closest(): arrays of the points' shape."""

    distance: Floats
    position: Floats
    normal: Floats
    triangle: Ints
    feature: NDArray[np.uint8]
    feature_index: NDArray[np.uint8]
    found: Bools


class Hits(NamedTuple):
    """Field.raycast(), sphere_cast() and segment(): arrays of the rays' shape."""

    hit: Bools
    distance: Floats
    position: Floats
    normal: Floats
    triangle: Ints


class Contacts(NamedTuple):
    """collide(): arrays of one entry per contact, and two counts."""

    position: Floats
    normal: Floats
    distance: Floats
    feature: NDArray[np.uint32]
    approach: Floats
    turning_radius: Floats
    points_tested: int
    beyond_band: int


class BodyDistance(NamedTuple):
    """distance(): of two bodies."""

    found: bool
    overlap: str
    distance: float
    position_a: Floats
    position_b: Floats
    normal: Floats
    triangle_a: int
    triangle_b: int


class Impact(NamedTuple):
    """time_of_impact(): of two moving bodies, their poses and distance when they touch."""

    found: bool
    fraction: float
    pose_a: Pose
    pose_b: Pose
    distance: BodyDistance


class MassProperties(NamedTuple):
    """mass_properties(): for density 1."""

    volume: float
    centre: Floats
    inertia: Floats
    principal_inertia: Floats
    principal_axes: Floats


class Dense(NamedTuple):
    """LevelSet.to_numpy(): values[i, j, k] is the distance at origin + spacing * (i, j, k)."""

    values: Floats
    origin: Doubles
    spacing: float


class Sparse(NamedTuple):
    """LevelSet.sparse(): values[n] is the distance at origin + spacing * coordinates[n]."""

    coordinates: Ints
    values: Floats
    triangles: Optional[Ints]
    origin: Doubles
    spacing: float


class Seeded(NamedTuple):
    """seed(): the new liquid, and how far distances were changed to make it a level set."""

    liquid: LevelSet
    max_change_voxels: float
    where: Doubles
    changed_voxels: int


@dataclass(frozen=True)
class MeshReport:
    """inspect(): a mesh is closed, oriented and clean if every count of defects is zero.

    Lengths are in the mesh's unit; `bounds` has shape (2, 3), relative to `origin`.
    """

    vertices: int
    faces: int
    components: int
    bounds: Floats
    origin: Doubles
    boundary_edges: int
    non_manifold_edges: int
    misoriented_edges: int
    degenerate_triangles: int
    duplicate_triangles: int
    boundary_loops: int
    non_manifold_vertices: int
    self_intersections: int
    flipped_triangles: int
    inside_out_components: int
    thinnest_wall: float
    common_wall: float
    thin_walls: int
    area: float
    volume: float
    closed: bool
    oriented: bool
    verdict: str

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, MeshReport):
            return NotImplemented
        return all(_same(value, getattr(other, name)) for name, value in vars(self).items())

    __hash__ = None  # type: ignore[assignment]


def _same(a: Any, b: Any) -> bool:
    return bool(np.array_equal(a, b))
