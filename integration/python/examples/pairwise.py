# SPDX-License-Identifier: Apache-2.0
"""The pairwise distances of 200 bodies, all 19,900 exact."""

import time

import matplotlib.pyplot as plt
import numpy as np
from common import arguments, save

import bilayer

COUNT = 200

mesh, given = arguments(__doc__, "pairwise.png")
body = bilayer.Collider(mesh, bilayer.build(mesh, resolution=64))
random = np.random.default_rng(5)
places = random.uniform(-4, 4, size=(COUNT, 3))
rotations = random.normal(size=(COUNT, 4))
rotations /= np.linalg.norm(rotations, axis=1, keepdims=True)
poses = [bilayer.Pose(place, rotation) for place, rotation in zip(places, rotations)]

pairs = np.stack(np.triu_indices(COUNT, 1), axis=1)
begin = time.perf_counter()
distances = bilayer.distances(body, poses, pairs)
seconds = time.perf_counter() - begin
print(f"{len(pairs):,} distances of bodies with {len(mesh.faces):,} faces in {seconds:.3f} s, "
      f"{np.count_nonzero(distances < 0)} pairs overlap")

matrix = np.zeros((COUNT, COUNT))
matrix[pairs[:, 0], pairs[:, 1]] = matrix[pairs[:, 1], pairs[:, 0]] = distances
order = np.argsort(places[:, 0])

figure, (left, right) = plt.subplots(1, 2, figsize=(12, 5))
shown = left.imshow(matrix[np.ix_(order, order)], cmap="magma")
left.set(title=f"distances of {COUNT} bodies, sorted by x", xlabel="body", ylabel="body")
figure.colorbar(shown, ax=left, label="distance")
apart = np.linalg.norm(places[pairs[:, 0]] - places[pairs[:, 1]], axis=1)
right.scatter(apart, distances, s=2, c=distances, cmap="magma", vmin=0)
right.axhline(0, color="black", linewidth=0.5)
right.set(xlabel="distance of the positions", ylabel="exact distance of the bodies")
save(figure, given.output)
