# SPDX-License-Identifier: Apache-2.0
"""The exact distance to one mesh, coloured on a second mesh: where two parts come close."""

import matplotlib.pyplot as plt
import numpy as np
from common import arguments, save
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

import bilayer

mesh, given = arguments(__doc__, "distance_on_mesh.png")
field = bilayer.Field(bilayer.build(mesh, resolution=128), mesh)

sphere = bilayer.sphere(0.45, subdivisions=5)
distance = field.closest(sphere.vertices).distance
faces = distance[sphere.faces].mean(axis=1)

figure = plt.figure(figsize=(11, 5))
limit = np.abs(faces).max()
colours = plt.cm.RdBu_r(0.5 + 0.5 * faces / limit)
for place, azimuth in ((1, -60), (2, 120)):
    axes = figure.add_subplot(1, 2, place, projection="3d")
    axes.add_collection3d(Poly3DCollection(sphere.vertices[sphere.faces], facecolors=colours, linewidths=0))
    axes.set(xlim=(-0.32, 0.32), ylim=(-0.32, 0.32), zlim=(-0.32, 0.32), box_aspect=(1, 1, 1))
    axes.view_init(20, azimuth)
    axes.set_axis_off()
scale = plt.cm.ScalarMappable(plt.Normalize(-limit, limit), "RdBu_r")
figure.colorbar(scale, ax=figure.axes, label="distance to the other mesh, negative inside it", shrink=0.7)
figure.suptitle(f"a sphere through a mesh of {len(mesh.faces):,} faces: {faces.min():.3f} to {faces.max():.3f}")
save(figure, given.output)
