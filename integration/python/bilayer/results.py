# SPDX-License-Identifier: Apache-2.0
"""What functions return: named tuples of arrays, and the report of a mesh."""

from __future__ import annotations

import inspect
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Optional, Type, TypeVar

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from bilayer._bilayer import LevelSet, Pose

Floats = NDArray[np.float32]
Doubles = NDArray[np.float64]
Ints = NDArray[np.int32]
Bools = NDArray[np.bool_]
Result = TypeVar("Result")
_NAMES = r"\w+(?:, \w+)*: "
_FIELDS = re.compile(rf"^({_NAMES})(.*(?:\n(?!{_NAMES}).+)*)", re.M)  # of the docstring of a class: names, and the text about them


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return np.array_equal(a, b, equal_nan=a.dtype.kind == b.dtype.kind == "f")
    return bool(a == b)


def _result(result: Type[Result]) -> Type[Result]:
    """Lets named tuples compare field by field, where tuples would ask arrays for a truth value. Each field gets what the
    docstring of the class says about it as a docstring of its own."""

    def equal(self: Any, other: Any) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return all(map(_same, self, other))

    for name, value in (("__eq__", equal), ("__ne__", object.__ne__), ("__hash__", None)):
        setattr(result, name, value)
    for names, text in _FIELDS.findall(inspect.cleandoc(result.__doc__ or "")):
        for name in set(re.findall(r"\w+", names)) & set(getattr(result, "_fields")):
            getattr(result, name).__doc__ = " ".join(text.split())
    return result


@_result
class Samples(NamedTuple):
    """Field.sample(): arrays of the points' leading shape (...). A tuple, so that it can be unpacked.

    distance: float32 (...), signed; outside the band a bound with the right sign.
    gradient: float32 (..., 3), of length near 1; zero outside the band.
    in_band: bool (...), whether all eight voxels around the point are in the band.

    >>> import bilayer
    >>> field = bilayer.Field(bilayer.build(bilayer.sphere(1), resolution=32))
    >>> distance, gradient, in_band = field.sample([[1, 0, 0], [0, 0, 1.05]])
    >>> in_band
    array([ True,  True])
    """

    distance: Floats
    gradient: Floats
    in_band: Bools


@_result
class ClosestPoints(NamedTuple):
    """Field.closest(): arrays of the points' leading shape (...). A tuple, so that it can be unpacked.

    distance: float32 (...), negative inside; inf where nothing was found.
    position: float32 (..., 3), on the surface, relative to Field.origin; nan where nothing was found.
    normal: float32 (..., 3), outward, of length 1; nan where nothing was found.
    triangle: int32 (...), index of the face; -1 without a mesh and where nothing was found.
    feature: uint8 (...): 0 face, 1 edge, 2 vertex.
    feature_index: uint8 (...), which edge of the face, from that corner to the next, or which corner.
    found: bool (...), False where the surface is farther than max_distance.

    >>> import bilayer
    >>> box = bilayer.box()
    >>> closest = bilayer.Field(bilayer.build(box, resolution=32), box).closest([2, 0, 0])
    >>> float(closest.distance), closest.position.tolist()
    (1.5, [0.5, 0.0, 0.0])
    """

    distance: Floats
    position: Floats
    normal: Floats
    triangle: Ints
    feature: NDArray[np.uint8]
    feature_index: NDArray[np.uint8]
    found: Bools


@_result
class Hits(NamedTuple):
    """Field.raycast(), sphere_cast() and segment(): arrays of the rays' leading shape (...). A tuple, so that it can be
    unpacked: its length is that of the tuple, not the number of rays.

    hit: bool (...), whether the ray or sphere meets the solid.
    distance: float32 (...), a length in the mesh's unit; 0 for a start inside, inf without a hit.
    position: float32 (..., 3), on the surface, relative to Field.origin; the start itself for a start inside;
    nan without a hit.
    normal: float32 (..., 3), outward, of length 1; the reversed direction for a start inside; nan without a hit.
    triangle: int32 (...), index of the face; -1 without a mesh or a hit, and for a start inside.

    >>> import bilayer
    >>> box = bilayer.box()
    >>> hits = bilayer.Field(bilayer.build(box, resolution=32), box).raycast([2, 0, 0], [-1, 0, 0])
    >>> bool(hits.hit), float(hits.distance)
    (True, 1.5)
    """

    hit: Bools
    distance: Floats
    position: Floats
    normal: Floats
    triangle: Ints


class _Fields:
    """Values that compare field by field, arrays included."""

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return all(_same(value, getattr(other, name)) for name, value in vars(self).items())

    __hash__ = None  # type: ignore[assignment]


@dataclass(frozen=True, eq=False)
class Contacts(_Fields):
    """collide(): one entry of each array for each of N contacts. Its length is N, so that it is true if there are any.

    position: float32 (N, 3), on the surface of b, in the world of the poses.
    normal: float32 (N, 3), of length 1, from b to a.
    distance: float32 (N,), the separation in the meshes' unit; negative where the bodies penetrate.
    feature: uint32 (N,), which surface point, or the number of points plus which sharp edge; the top bit is set for
    those of b.
    approach: float32 (N,), by how much the motions reduce the distance, in the meshes' unit; 0 for motions within the
    margin.
    rounding_radius: float32 (N,), rounding radius of the vertex or edge that the contact stays on while its body
    rotates, in the meshes' unit; negative where the contact moves along as the surfaces roll.
    points_tested: int, surface points that were sampled in the other body's field.
    beyond_band: int, those of them that are too deep inside for the band, and make no contact.

    >>> import bilayer
    >>> box = bilayer.box()
    >>> ball, body = bilayer.Shape.sphere(0.5), bilayer.Collider(box, bilayer.build(box, resolution=32))
    >>> contacts = bilayer.collide(ball, bilayer.Pose((0, 0, 0.99)), body, None)
    >>> bool(contacts), round(float(contacts.distance.min()), 3)
    (True, -0.01)
    """

    position: Floats
    normal: Floats
    distance: Floats
    feature: NDArray[np.uint32]
    approach: Floats
    rounding_radius: Floats
    points_tested: int
    beyond_band: int

    def __len__(self) -> int:
        return len(self.distance)


@_result
class BodyDistance(NamedTuple):
    """distance(): the closest points of two bodies, in the world of the poses.

    found: bool, False if the bodies are farther apart than max_distance; the other fields are then invalid.
    overlap: str: "none", "surfaces", "a inside b" or "b inside a".
    distance: float, the separation, or minus the penetration depth, in the meshes' unit.
    position_a, position_b: float32 (3,), the closest points.
    normal: float32 (3,), of length 1, from b to a.
    triangle_a, triangle_b: int, faces of the closest points; -1 where not known.

    >>> import bilayer
    >>> box = bilayer.box()
    >>> body = bilayer.Collider(box, bilayer.build(box, resolution=32))
    >>> apart = bilayer.distance(bilayer.Shape.sphere(0.5), bilayer.Pose((3, 0, 0)), body, None)
    >>> apart.overlap, round(apart.distance, 3)
    ('none', 2.0)
    """

    found: bool
    overlap: str
    distance: float
    position_a: Floats
    position_b: Floats
    normal: Floats
    triangle_a: int
    triangle_b: int


@_result
class Impact(NamedTuple):
    """time_of_impact(): when two moving bodies touch.

    found: bool, False if they do not touch in the whole motion; the other fields are then invalid.
    fraction: float, of the motion until they touch, 0 to 1.
    pose_a, pose_b: Pose, at that time.
    distance: BodyDistance, at that time; of a penetration only its place and normal count.

    >>> import bilayer
    >>> box = bilayer.box()
    >>> body, motion = bilayer.Collider(box, bilayer.build(box, resolution=32)), [[-4, 0, 0], [0, 0, 0]]
    >>> impact = bilayer.time_of_impact(bilayer.Shape.sphere(0.5), bilayer.Pose((3, 0, 0)), motion, body, None, None)
    >>> impact.found, round(impact.fraction, 2)
    (True, 0.5)
    """

    found: bool
    fraction: float
    pose_a: Pose
    pose_b: Pose
    distance: BodyDistance


@_result
class MassProperties(NamedTuple):
    """mass_properties() and Collider.mass, for density 1.

    volume: float, in the mesh's unit cubed.
    centre: float32 (3,), the centre of mass, in the coordinates of Mesh.vertices.
    inertia: float32 (3, 3), the inertia tensor about the centre of mass.
    principal_inertia: float32 (3,), ascending.
    principal_axes: float32 (4,), the quaternion w, x, y, z that rotates the principal axes to those of the mesh.

    >>> import bilayer
    >>> round(bilayer.mass_properties(bilayer.box((1, 2, 3))).volume, 3)
    6.0
    """

    volume: float
    centre: Floats
    inertia: Floats
    principal_inertia: Floats
    principal_axes: Floats


@_result
class Dense(NamedTuple):
    """LevelSet.to_numpy(): values[i, j, k] is the distance at origin + spacing * (i, j, k).

    values: float32 (nx, ny, nz), negative inside.
    origin: float64 (3,), the centre of values[0, 0, 0]; relative to LevelSet.origin, as the points of queries.
    spacing: float, the voxel size.

    >>> import bilayer
    >>> values, origin, spacing = bilayer.build(bilayer.sphere(1), voxel_size=0.125).to_numpy()
    >>> values.ndim, spacing
    (3, 0.125)
    """

    values: Floats
    origin: Doubles
    spacing: float


@_result
class Sparse(NamedTuple):
    """LevelSet.sparse(): values[n] is the distance at origin + spacing * coordinates[n].

    coordinates: int32 (N, 3), indices of the active voxels.
    values: float32 (N,), negative inside.
    triangles: int32 (N,), the nearest faces; None without them.
    origin: float64 (3,), zero; relative to LevelSet.origin, as the points of queries.
    spacing: float, the voxel size.

    >>> import bilayer
    >>> sparse = bilayer.build(bilayer.sphere(1), voxel_size=0.125).sparse()
    >>> len(sparse.coordinates) == len(sparse.values), sparse.triangles is None
    (True, True)
    """

    coordinates: Ints
    values: Floats
    triangles: Optional[Ints]
    origin: Doubles
    spacing: float


@_result
class Seeded(NamedTuple):
    """seed(): the new liquid, and how far distances were changed to make it a level set.

    liquid: LevelSet, with the body added or taken away.
    max_change_voxels: float, the largest change of a distance, near creases, in voxels.
    where: float64 (3,), the centre of that voxel, relative to LevelSet.origin.
    changed_voxels: int, voxels that changed by more than 0.1 voxels.

    >>> import bilayer
    >>> tank = bilayer.build(bilayer.box((2, 2, 1)), voxel_size=0.1)
    >>> bilayer.seed(tank, bilayer.sphere(0.4), mode="subtract").liquid.voxel_size == tank.voxel_size
    True
    """

    liquid: LevelSet
    max_change_voxels: float
    where: Doubles
    changed_voxels: int


@dataclass(frozen=True, eq=False)
class MeshReport(_Fields):
    """inspect(): a mesh is closed, oriented and clean if every count of defects is zero.

    Lengths are in the mesh's unit.

    vertices, faces: int. Vertices with equal coordinates count as one.
    components: int, sets of faces that are connected by vertices.
    bounds: float32 (2, 3), lower and upper corner, in the coordinates of Mesh.vertices.
    origin: float64 (3,): Mesh.origin.
    boundary_edges: int, edges with one face; boundary_loops: int, the holes that they surround.
    non_manifold_edges: int, edges with three or more faces.
    misoriented_edges: int, edges that faces do not use equally often in both directions.
    degenerate_triangles: int, faces with zero area.
    duplicate_triangles: int, faces with the same three vertices as an earlier one.
    non_manifold_vertices: int, vertices whose faces form several fans.
    self_intersections: int, pairs of faces that intersect and share no edge.
    flipped_triangles: int, faces that build() would flip, to orient the mesh.
    inside_out_components: int, closed components with reversed orientation; cavities do not count.
    thinnest_wall: float, minimum thickness of the solid behind a face; 0: none found.
    common_wall: float, the same without the thinnest hundredth of the area: without creases and convex vertices.
    thin_walls: int, faces with less than `wall` of solid behind them.
    area: float. volume: float, signed; it has a meaning only for a closed mesh.
    closed: bool, no boundary and no non-manifold edges. oriented: bool, no misoriented edges or components inside out.
    verdict: str, all of that in words.

    >>> import bilayer
    >>> bilayer.inspect(bilayer.box()).verdict
    'closed and oriented'
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
