# SPDX-License-Identifier: Apache-2.0
"""A slice of a signed distance field, everywhere exact: inside blue, outside red, the surface black."""

import matplotlib.pyplot as plt
import numpy as np
from common import arguments, save
from matplotlib.colors import TwoSlopeNorm
from matplotlib.ticker import MultipleLocator

import bilayer

mesh, given = arguments(__doc__, "slice.png")
field = bilayer.Field(bilayer.build(mesh, resolution=128), mesh)

x = np.linspace(-0.75, 0.75, 600)
points = np.stack(np.meshgrid(x, x, [0.0], indexing="ij"), axis=-1)[:, :, 0]
distance = field.closest(points).distance

figure, axes = plt.subplots(figsize=(7, 6))
step = 0.025
levels = step * np.arange(np.floor(distance.min() / step), np.ceil(distance.max() / step) + 1)
centred = TwoSlopeNorm(0, min(levels[0], -step), max(levels[-1], step))  # both sides use all of their colours
shown = axes.contourf(x, x, distance.T, levels=levels, norm=centred, cmap="RdBu_r")
axes.contour(x, x, distance.T, levels=levels[::2], colors="grey", linewidths=0.4, linestyles="solid")
axes.contour(x, x, distance.T, levels=[0], colors="black", linewidths=1.5)
axes.set_aspect("equal")
axes.set_title(f"signed distance at z = 0, {len(mesh.faces):,} faces")
figure.colorbar(shown, ax=axes, label="distance", ticks=MultipleLocator(0.1), spacing="proportional")
save(figure, given.output)
