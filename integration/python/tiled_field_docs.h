// SPDX-License-Identifier: Apache-2.0
// Docstrings of TiledField and its methods; their first lines declare the parameters. The tests run the examples where
// `box_tiles` holds the tiles of bilayer.box((2, 2, 2)).
#pragma once

namespace bilayer::python {

inline constexpr const char* tiledFieldDoc = R"(TiledField(folder, budget_bytes=1073741824, storage="float32")

The tiles that `bilayer build --tiles` wrote, for queries of fields that do not fit into memory. A tile is read when a
query falls into it. The tiles that were used last stay in memory. Answers are those of Field without a mesh.

folder: with manifest.json.
budget_bytes: maximum memory of the tiles that are kept. A single tile is kept even if it is larger.
storage: as for Field.

Arguments, results and coordinates of queries are as for Field. Queries from several threads share the tiles. Sort points
by place where you can: a batch of up to 2^20 samples reads each tile once, rays and closest points read tiles as they
need them. Ctrl-C cancels large batches.

Raises RuntimeError that names a file that is missing or damaged, here and from queries; queries raise ValueError as
those of Field do. A TiledField cannot be pickled: open the folder again.

>>> import bilayer
>>> field = bilayer.TiledField("box_tiles", budget_bytes=100_000_000)
>>> field.sample([[1.1, 0, 0], [0.9, 0, 0]]).distance.round(3).tolist()
[0.10000000149011612, -0.10000000149011612]
)";

inline constexpr const char* tiledSampleDoc = R"(sample(points) -> Samples(distance, gradient, in_band)

As Field.sample(), with the same bytes. points: (..., 3), relative to TiledField.origin.

Raises ValueError as Field.sample() does, and RuntimeError for a tile that is missing or damaged.

>>> import bilayer
>>> bilayer.TiledField("box_tiles").sample([1.1, 0, 0]).gradient.round(3).tolist()
[1.0, 0.0, 0.0]
)";

inline constexpr const char* tiledClosestDoc = R"(closest(points, max_distance=inf) -> ClosestPoints

As Field.closest() without a mesh. Reads the tiles that are nearer than the closest point, the nearest first.

Raises ValueError as Field.closest() does, and RuntimeError for a tile that is missing or damaged.

>>> import bilayer
>>> round(float(bilayer.TiledField("box_tiles").closest([5, 0.1, 0.2]).distance), 4)
4.0
)";

inline constexpr const char* tiledInsideDoc = R"(inside(points) -> bool (...)

Whether points (..., 3) are inside, by the sign of the sample. They are relative to TiledField.origin.

Raises ValueError as Field.inside() does, and RuntimeError for a tile that is missing or damaged.

>>> import bilayer
>>> bilayer.TiledField("box_tiles").inside([[0, 0, 0.9], [0, 0, 1.1]]).tolist()
[True, False]
)";

inline constexpr const char* tiledRaycastDoc = R"(raycast(origins, directions, max_distance=inf) -> Hits

As Field.raycast() without a mesh. Reads the tiles with surface along a ray, up to the hit.

Raises ValueError as Field.raycast() does, and RuntimeError for a tile that is missing or damaged.

>>> import bilayer
>>> bilayer.TiledField("box_tiles").raycast([5, 0, 0], [[-2, 0, 0], [1, 0, 0]]).distance.round(4).tolist()
[4.0, inf]
)";

}  // namespace bilayer::python
