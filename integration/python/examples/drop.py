# SPDX-License-Identifier: Apache-2.0
"""A body thrown on a tilted slab by a solver of thirty lines of numpy on bilayer.collide()."""

import matplotlib.pyplot as plt
import numpy as np
from common import arguments, save

import bilayer

STEP, STEPS, GRAVITY, FRICTION, PASSES, MARGIN = 1 / 120, 600, (0, -9.81, 0), 0.6, 15, 0.01
SPIN_KEPT = 1 - 12 * STEP  # of a body in contact, since rolling has no friction here


class Body:
    def __init__(self, collider, mass, position, rotation=(1, 0, 0, 0)):
        self.collider, self.mass, self.centre = collider, mass, np.array(collider.mass.centre, float)
        self.inverse_inertia = np.linalg.inv(collider.mass.inertia * (mass / collider.mass.volume))
        self.place, self.spin = np.array(position, float), np.zeros(3)  # of the centre of mass
        self.rotation, self.velocity = np.array(rotation, float), np.zeros(3)

    def pose(self):
        turned = bilayer.Pose(rotation=self.rotation).to_world(self.centre)
        return bilayer.Pose(self.place - turned, self.rotation)

    def move(self):
        self.place += STEP * self.velocity
        w, v = self.rotation[0], self.rotation[1:]
        change = np.concatenate([[-self.spin @ v], w * self.spin + np.cross(self.spin, v)])
        self.rotation += 0.5 * STEP * change
        self.rotation /= np.linalg.norm(self.rotation)


def solve(body, found):
    """Sequential impulses with friction: the contacts' normal speeds become 0 or more."""
    axes = body.pose().matrix[:3, :3]
    inverse_inertia = axes @ body.inverse_inertia @ axes.T
    arms, normals, gaps = found.position - body.place, found.normal, found.distance
    # levers[i] @ impulse is its torque, and spin @ levers[i] the speed that the spin gives the point
    levers = np.stack([np.cross(arms, axis) for axis in np.eye(3)], axis=2)
    turning = np.einsum("nij,jk,nkl->nil", levers.transpose(0, 2, 1), inverse_inertia, levers)
    pushed = 1 / (1 / body.mass + np.einsum("ni,nij,nj->n", normals, turning, normals))
    rubbed = 1 / (1 / body.mass + np.trace(turning, axis1=1, axis2=2))
    allowed = np.where(gaps > 0, gaps, 0.1 * np.minimum(gaps + 0.001, 0)) / STEP
    pushes, rubs = np.zeros(len(arms)), np.zeros((len(arms), 3))

    def push(lever, impulse):
        body.velocity += impulse / body.mass
        body.spin += inverse_inertia @ (lever @ impulse)

    for _ in range(PASSES):
        for i, (lever, normal) in enumerate(zip(levers, normals)):
            speed = (body.velocity + body.spin @ lever) @ normal
            total = max(pushes[i] - (speed + allowed[i]) * pushed[i], 0)
            push(lever, (total - pushes[i]) * normal)
            pushes[i] = total
            slip = body.velocity + body.spin @ lever
            wanted = rubs[i] - (slip - (slip @ normal) * normal) * rubbed[i]
            wanted *= min(FRICTION * total / max(np.sqrt(wanted @ wanted), 1e-12), 1)
            push(lever, wanted - rubs[i])
            rubs[i] = wanted


mesh, given = arguments(__doc__, "drop.png")
# The margin of each step is wider than a band of 3 voxels can surely answer by samples; one of 5 is faster.
shape = bilayer.Collider(mesh, bilayer.build(mesh, resolution=64, half_width_voxels=5))
body = Body(shape, 1, (-1.3, 1.2, 0), (np.cos(0.1), 0, 0, np.sin(0.1)))
body.velocity[:] = 2.2, 0, 0
slab = bilayer.box((3.2, 0.4, 3.2))
ground = bilayer.Collider(slab, bilayer.build(slab, voxel_size=0.03, half_width_voxels=5))
tilt = bilayer.Pose((0, -0.2, 0), (np.cos(0.02), 0, 0, -np.sin(0.02)))
cache, track, drawn, depths = bilayer.ContactCache(), [], [], []
for step in range(STEPS):
    body.velocity += STEP * np.array(GRAVITY)
    reach = MARGIN + STEP * 4
    contacts = bilayer.collide(body.collider, body.pose(), ground, tilt, margin=reach, reduced=True, cache=cache)
    solve(body, contacts)
    body.spin *= SPIN_KEPT if (contacts.distance < MARGIN).any() else 1
    body.move()
    track.append(body.place.copy())
    depths.append(max(-contacts.distance.min(initial=0.0), 0.0))
    if step in (0, 24, 42, STEPS - 1):
        drawn.append((STEP * step, body.pose()))
speed = np.linalg.norm(track[-1] - track[-25]) / (24 * STEP)
print(f"ends at {np.round(track[-1], 3)}, at {speed:.4f} units/s; deepest penetration {max(depths):.4f} units")

figure = plt.figure(figsize=(12, 5))
axes, heights, penetration = (figure.add_subplot(place) for place in (121, 222, 224))
corners = tilt.to_world(slab.vertices)
axes.fill(*corners[corners[:, 2] > 0][[0, 1, 3, 2], :2].T, color="0.8")
for time, pose in drawn:
    outline = pose.to_world(mesh.vertices[mesh.faces])[:, :, :2]
    colours = np.full(len(outline), np.sqrt(time / (STEP * STEPS)))
    axes.tripcolor(*outline.reshape(-1, 2).T, np.arange(3 * len(outline)).reshape(-1, 3), facecolors=colours,
                   vmin=0, vmax=1, cmap="viridis")
axes.plot(*np.array(track)[:, :2].T, "k-", linewidth=1)
axes.set(aspect="equal", xlim=(-2.1, 1.8), title="the body at " + ", ".join(f"{time:.2f}" for time, _ in drawn) + " s")
heights.plot(STEP * np.arange(STEPS), np.array(track)[:, 1])
heights.set(ylabel="height of the centre", ylim=(0, None))
penetration.plot(STEP * np.arange(STEPS), depths, linewidth=0.8)
penetration.set(xlabel="time [s]", ylabel="penetration", ylim=(0, None))
figure.subplots_adjust(wspace=0.25)
figure.align_ylabels((heights, penetration))
save(figure, given.output)
