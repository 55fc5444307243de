# SPDX-License-Identifier: Apache-2.0
"""The exact distance to one mesh, coloured on a second mesh: where two parts come close."""

import matplotlib.pyplot as plt
import numpy as np
from common import arguments, save
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

import bilayer

mesh, given = arguments(__doc__, "distance_on_mesh.png")
level_set = bilayer.build(mesh, resolution=128)
field = bilayer.Field(level_set, mesh)

sphere = bilayer.sphere(0.36, subdivisions=5)
distance = field.closest(sphere.vertices).distance[sphere.faces].mean(axis=1)
limit = np.abs(distance).max()
colours = plt.cm.RdBu_r(0.5 + 0.5 * distance / limit)


def shaded(mesh):
    """Grey, lighter where faces point up."""
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    up = normals[:, 2] / np.maximum(np.linalg.norm(normals, axis=1), 1e-30)
    return plt.cm.gray(0.5 + 0.3 * up)


figure = plt.figure(figsize=(11, 5.5))
coarse = level_set.surface(adaptivity=0.1)  # enough for a picture
both = np.concatenate([sphere.vertices[sphere.faces], coarse.vertices[coarse.faces]])
for place, corners, paint, title in (
    (1, both, np.concatenate([colours, shaded(coarse)]), "both meshes"),
    (2, sphere.vertices[sphere.faces], colours, "the second mesh alone"),
):
    axes = figure.add_subplot(1, 2, place, projection="3d")
    turned = corners[..., [2, 0, 1]]  # y is up
    axes.add_collection3d(Poly3DCollection(turned, facecolors=paint, edgecolors=paint, linewidths=0.3))
    axes.set(xlim=(-0.37, 0.37), ylim=(-0.37, 0.37), zlim=(-0.37, 0.37), box_aspect=(1, 1, 1))
    axes.set_title(title, y=0)
    axes.view_init(15, 15)
    axes.set_axis_off()
figure.subplots_adjust(left=0, right=0.88, wspace=0)
scale = plt.cm.ScalarMappable(plt.Normalize(-limit, limit), "RdBu_r")
bar = figure.add_axes((0.9, 0.2, 0.02, 0.6))
figure.colorbar(scale, cax=bar, label="distance to the other mesh, negative inside it")
print(f"from {distance.min():.3f} to {distance.max():.3f} on the second mesh")
save(figure, given.output)
