# SPDX-License-Identifier: Apache-2.0
"""A slice of a signed distance field, everywhere exact: inside blue, outside red, the surface black."""

import matplotlib.pyplot as plt
import numpy as np
from common import arguments, save

import bilayer

mesh, given = arguments(__doc__, "slice.png")
field = bilayer.Field(bilayer.build(mesh, resolution=128), mesh)

x = np.linspace(-0.75, 0.75, 600)
points = np.stack(np.meshgrid(x, x, [0.0], indexing="ij"), axis=-1)[:, :, 0]
distance = field.closest(points).distance

figure, axes = plt.subplots(figsize=(7, 6))
limit = np.abs(distance).max()
shown = axes.contourf(x, x, distance.T, levels=np.linspace(-limit, limit, 41), cmap="RdBu_r")
axes.contour(x, x, distance.T, levels=np.arange(-0.5, 0.5, 0.05), colors="grey", linewidths=0.4)
axes.contour(x, x, distance.T, levels=[0], colors="black", linewidths=1.5)
axes.set_aspect("equal")
axes.set_title(f"signed distance at z = 0, {len(mesh.faces):,} faces")
figure.colorbar(shown, ax=axes, label="distance")
save(figure, given.output)
