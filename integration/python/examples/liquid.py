# SPDX-License-Identifier: Apache-2.0
"""A liquid body above a tank, seeded into one level set, with marker particles; saved for Houdini or Blender."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from common import arguments, save

import bilayer

mesh, given = arguments(__doc__, "liquid.png")
tank = bilayer.build(bilayer.box((2, 0.5, 1.2)), voxel_size=0.02)
seeded = bilayer.seed(tank, mesh, pose=bilayer.Pose((0, 0.95, 0)))
liquid = seeded.liquid
volumes = [bilayer.mass_properties(one).volume for one in (tank, mesh, liquid)]
print("volumes: tank {:.4f}, body {:.4f}, liquid {:.4f}".format(*volumes))

output = Path(given.output).with_suffix(".vdb")
liquid.save(output)
particles = bilayer.particles(liquid, per_voxel=8)
print(f"wrote {output}; {len(particles):,} particles")

values, origin, spacing = liquid.to_numpy()
middle = round(-origin[2] / spacing)
x, y = (origin[axis] + spacing * np.arange(values.shape[axis]) for axis in (0, 1))
figure, axes = plt.subplots(figsize=(9, 7))
shown = axes.pcolormesh(x, y, values[:, :, middle].T, cmap="coolwarm", shading="nearest")
axes.contour(x, y, values[:, :, middle].T, levels=[0], colors="black")
slab = particles[np.abs(particles[:, 2]) < spacing / 4]
axes.scatter(*slab[:, :2].T, s=0.3, color="black")
axes.set(aspect="equal", title="the liquid's level set and particles at z = 0")
figure.colorbar(shown, ax=axes, label="distance, clipped to the band")
save(figure, given.output)
