// SPDX-License-Identifier: Apache-2.0
// Docstrings of Field and its methods; their first lines declare the parameters.
#pragma once

namespace bilayer::python {

inline constexpr const char* fieldDoc = R"(Field(level_set, mesh=None, storage="float32", keep_level_set=True)

A level set laid out for queries, from any number of threads. With its mesh, closest points, rays and inside tests are
exact; without it they follow the trilinear interpolant. Large batches run on all cores, and Ctrl-C cancels them.

mesh: the Mesh that the level set was built from, or None.
storage: "float32", or "fixed16" for samples of half the size, with an error below 5e-5 voxels.
keep_level_set: pickles hold the level set and the mesh. False frees the level set; the field then cannot be pickled.

Arguments are arrays of any real dtype, or nested lists. Points may have any leading shape: (3,), (N, 3), (H, W, 3), and
results have the same. Results are arrays that share one buffer: use numpy.ascontiguousarray() where a contiguous one is
needed.

Coordinates are those of Mesh.vertices. For points of the world, ask with points - field.origin, in float64; the origin
is zero unless the mesh has one, as a mesh file far from zero.

Raises ValueError if the level set belongs to another mesh; one without a mesh_hash, as of other programs, is not
checked. Queries raise ValueError that names the argument for a wrong shape or dtype, and for a value that is not
finite.

>>> import bilayer
>>> box = bilayer.box((2, 2, 2))
>>> field = bilayer.Field(bilayer.build(box, resolution=32), box)
>>> field.sample([[1.1, 0, 0], [0.9, 0, 0]]).distance.round(3).tolist()
[0.10000000149011612, -0.10000000149011612]
)";

inline constexpr const char* sampleDoc = R"(sample(points) -> Samples(distance, gradient, in_band)

Trilinear samples. points: (..., 3), relative to Field.origin.

distance: float32 (...); outside the band a bound with the right sign.
gradient: float32 (..., 3), of length near 1; zero outside the band.
in_band: bool (...), whether all eight voxels around the point are in the band.

Raises ValueError for another shape or dtype, and for a value that is not finite.

>>> import bilayer
>>> field = bilayer.Field(bilayer.build(bilayer.box((2, 2, 2)), resolution=32))
>>> field.sample([1.1, 0, 0]).gradient.round(3).tolist()
[1.0, 0.0, 0.0]
)";

inline constexpr const char* closestDoc = R"(closest(points, max_distance=inf) -> ClosestPoints

The closest point of the surface, from any distance. Arguments are broadcast against each other.

points: (..., 3), relative to Field.origin, as the positions of the answer.
max_distance: (...), 0 or above. Where the surface is farther away, `found` is False, the distance is inf, position and
normal are nan, and the triangle is -1.

Raises ValueError for another shape or dtype, and for a value out of range.

>>> import bilayer
>>> box = bilayer.box((2, 2, 2))
>>> field = bilayer.Field(bilayer.build(box, resolution=32), box)
>>> float(field.closest([5, 0.1, 0.2]).distance)
4.0
)";

inline constexpr const char* raycastDoc = R"(raycast(origins, directions, max_distance=inf) -> Hits

The first point of each ray inside the solid. Arguments are broadcast against each other.

origins: (..., 3), relative to Field.origin, as the positions of the answer.
directions: (..., 3), of any length above 0.
max_distance: (...), 0 or above.

The distance is a length in the mesh's unit, also for directions that are not of unit length. Without a hit, `hit` is
False, the distance is inf, position and normal are nan, and the triangle is -1. A ray that starts inside the solid hits
at once: at distance 0, with triangle -1, and with its reversed unit direction as the normal.

Raises ValueError for shapes that do not fit, a direction of length 0, and a value out of range.

>>> import bilayer
>>> box = bilayer.box((2, 2, 2))
>>> field = bilayer.Field(bilayer.build(box, resolution=32), box)
>>> field.raycast([5, 0, 0], [[-2, 0, 0], [1, 0, 0]]).distance.tolist()
[4.0, inf]
)";

inline constexpr const char* sphereCastDoc = R"(sphere_cast(origins, directions, radii, max_distance=inf) -> Hits

The first contact of a sphere that moves along each ray; as raycast(). The distance is the path length of its centre,
0 for a sphere that overlaps the solid at the start.

radii: (...), 0 or above.

Raises ValueError as raycast() does, and for a radius out of range.

>>> import bilayer
>>> box = bilayer.box((2, 2, 2))
>>> field = bilayer.Field(bilayer.build(box, resolution=32), box)
>>> round(float(field.sphere_cast([5, 0, 0], [-1, 0, 0], 0.5).distance), 4)
3.5
)";

inline constexpr const char* insideDoc = R"(inside(points) -> bool (...)

Whether points (..., 3) are inside; exact with the mesh. They are relative to Field.origin.

Raises ValueError for another shape or dtype, and for a value that is not finite.

>>> import bilayer
>>> box = bilayer.box((2, 2, 2))
>>> field = bilayer.Field(bilayer.build(box, resolution=32), box)
>>> field.inside([[0, 0, 0.99], [0, 0, 1.01]]).tolist()
[True, False]
)";

inline constexpr const char* segmentDoc = R"(segment(start, end) -> Hits

As raycast(), along segments between points (..., 3), which are relative to Field.origin. The distance is the length
from the start.

Raises ValueError for shapes that do not fit, and for a value that is not finite.

>>> import bilayer
>>> box = bilayer.box((2, 2, 2))
>>> field = bilayer.Field(bilayer.build(box, resolution=32), box)
>>> field.segment([5, 0, 0], [[0, 0, 0], [2, 0, 0]]).hit.tolist()
[True, False]
)";

inline constexpr const char* overlapsSphereDoc = R"(overlaps_sphere(centres, radii) -> bool (...)

Whether spheres and the solid overlap. centres: (..., 3), relative to Field.origin; radii: (...), 0 or above.

Raises ValueError for shapes that do not fit, and for a value out of range.

>>> import bilayer
>>> box = bilayer.box((2, 2, 2))
>>> field = bilayer.Field(bilayer.build(box, resolution=32), box)
>>> field.overlaps_sphere([2, 0, 0], [0.9, 1.1]).tolist()
[False, True]
)";

inline constexpr const char* overlapsBoxDoc = R"(overlaps_box(centres, half_sizes, rotations=None) -> bool (...)

Whether boxes and the solid overlap. centres, half_sizes: (..., 3), centres relative to Field.origin, half sizes 0 or
above; rotations: unit quaternions w, x, y, z (..., 4), or None.

Raises ValueError for shapes that do not fit, a value out of range, and a quaternion that is not of length 1.

>>> import bilayer
>>> box = bilayer.box((2, 2, 2))
>>> field = bilayer.Field(bilayer.build(box, resolution=32), box)
>>> field.overlaps_box([2, 0, 0], [[0.9, 1, 1], [1.1, 1, 1]]).tolist()
[False, True]
)";

}  // namespace bilayer::python
