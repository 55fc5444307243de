# SPDX-License-Identifier: Apache-2.0
"""Training samples for a neural SDF of a dirty mesh: near the surface and uniform, with exact signed distances.

The mesh has holes, flipped faces, and a second solid that overlaps it; signs come from winding numbers. Writes
`neural_samples.npz` next to the picture.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from common import arguments, save

import bilayer

NEAR, UNIFORM = 200_000, 50_000
DEVIATIONS = (0.005, 0.03)  # of near samples from the surface

mesh, given = arguments(__doc__.splitlines()[0], "neural_samples.png")
random = np.random.default_rng(7)


def dirty(mesh):
    """Drops and flips faces, and adds a ball that overlaps the mesh."""
    ball = bilayer.sphere(0.2)
    kept = mesh.faces[random.random(len(mesh.faces)) > 0.02]
    flipped = random.random(len(kept)) < 0.01
    kept[flipped] = kept[flipped][:, ::-1]
    vertices = np.concatenate([mesh.vertices, ball.vertices + [0.3, 0.1, 0]])
    return bilayer.Mesh(vertices, np.concatenate([kept, ball.faces + len(mesh.vertices)]))


def on_surface(mesh, count):
    """Points that are uniform on the area of the faces."""
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    chosen = random.choice(len(areas), size=count, p=areas / areas.sum())
    u, v = np.sqrt(random.random((count, 1))), random.random((count, 1))
    return (1 - u) * a[chosen] + u * (1 - v) * b[chosen] + u * v * c[chosen]


mesh = dirty(mesh)
print(bilayer.inspect(mesh).verdict)
level_set = bilayer.build(mesh, resolution=128, unite=True)
print(f"signs by {level_set.sign}: {level_set.sign_reason}")
# the surface of the union, without walls inside it and with holes closed
solid = bilayer.Collider(mesh, level_set)
field = solid.exact_field

surface = on_surface(level_set.surface(), NEAR)
near = surface + random.normal(size=surface.shape) * random.choice(DEVIATIONS, size=(NEAR, 1))
uniform = random.uniform(-0.75, 0.75, size=(UNIFORM, 3))
points = np.concatenate([near, uniform]).astype(np.float32)
distance = field.closest(points).distance

output = Path(given.output).with_suffix(".npz")
np.savez_compressed(output, points=points, distance=distance)
print(f"wrote {output}: {len(points):,} samples, {np.mean(distance < 0):.0%} inside")

figure, panels = plt.subplots(1, 2, figsize=(12, 5.5))
for axes, chosen, title in ((panels[0], slice(0, NEAR), "near the surface"), (panels[1], slice(NEAR, None), "uniform")):
    here = points[chosen]
    slab = np.abs(here[:, 2]) < 0.04
    shown = axes.scatter(*here[slab][:, :2].T, c=distance[chosen][slab], s=3, cmap="coolwarm", vmin=-0.1, vmax=0.1)
    axes.set(aspect="equal", xlim=(-0.75, 0.75), ylim=(-0.75, 0.75), title=f"{title}, |z| < 0.04")
figure.colorbar(shown, ax=panels, label="signed distance", shrink=0.8)
save(figure, given.output)
