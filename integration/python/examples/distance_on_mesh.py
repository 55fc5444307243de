# SPDX-License-Identifier: Apache-2.0
"""The exact distance to one mesh, coloured on a second mesh: where two parts come close.

The picture is drawn by rays through its pixels, by Field.raycast().
"""

import matplotlib.pyplot as plt
import numpy as np
from common import arguments, save

import bilayer

PIXELS, HALF_WIDTH = 900, 0.64

mesh, given = arguments(__doc__.splitlines()[0], "distance_on_mesh.png")
sphere = bilayer.sphere(0.36, subdivisions=5)
field, ball = (bilayer.Field(bilayer.build(one, resolution=128), one) for one in (mesh, sphere))
distance = field.closest(sphere.vertices).distance
print(f"from {distance.min():.3f} to {distance.max():.3f} on the second mesh")

# parallel rays from the camera, through a grid of points around zero
back = np.array([0.5, 0.3, 1.0]) / np.linalg.norm([0.5, 0.3, 1.0])  # y is up
right = np.cross([0, 1, 0], back) / np.linalg.norm(np.cross([0, 1, 0], back))
up = np.cross(back, right)
along = np.linspace(-HALF_WIDTH, HALF_WIDTH, PIXELS)
x, y = np.meshgrid(along, along[::-1])
origins = x[..., None] * right + y[..., None] * up + 2 * back
light = np.array([0.3, 0.8, 0.5]) / np.linalg.norm([0.3, 0.8, 0.5])
limit = np.abs(distance).max()


def picture(bodies):
    """The colours of the nearest hits: the ball by its distance to the mesh, the mesh in grey."""
    image, nearest = np.ones((PIXELS, PIXELS, 3)), np.full((PIXELS, PIXELS), np.inf)
    for body in bodies:
        hits = body.raycast(origins, -back)
        seen = hits.distance < nearest
        nearest[seen] = hits.distance[seen]
        shade = 0.65 + 0.35 * np.clip(hits.normal[seen] @ light, -0.5, 1)
        if body is ball:
            there = field.closest(hits.position[seen]).distance
            image[seen] = shade[:, None] * plt.cm.RdBu_r(0.5 + 0.5 * there / limit)[:, :3]
        else:
            image[seen] = 0.75 * shade[:, None]
    return image


figure, panels = plt.subplots(1, 2, figsize=(11, 5.2))
for axes, bodies, title in zip(panels, ((field, ball), (ball,)), ("both meshes", "the second mesh alone")):
    axes.imshow(picture(bodies), interpolation="lanczos")
    axes.set_title(title, y=-0.05)
    axes.set_axis_off()
figure.subplots_adjust(left=0, right=0.88, wspace=0)
scale = plt.cm.ScalarMappable(plt.Normalize(-limit, limit), "RdBu_r")
bar = figure.add_axes((0.9, 0.2, 0.02, 0.6))
figure.colorbar(scale, cax=bar, label="distance to the other mesh, negative inside it")
save(figure, given.output)
