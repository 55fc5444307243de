"""A body dropped on a tilted slab by a solver of thirty lines of numpy on bilayer.collide()."""

import matplotlib.pyplot as plt
import numpy as np
from common import arguments, save

import bilayer

STEP, STEPS, GRAVITY, FRICTION, PASSES, MARGIN = 1 / 240, 480, (0, -9.81, 0), 0.6, 12, 0.01


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
    deepest = np.argsort(found.distance)[:24]
    arms, normals, gaps = found.position[deepest] - body.place, found.normal[deepest], found.distance[deepest]
    pushes, rubs = np.zeros(len(arms)), np.zeros((len(arms), 3))

    def push(arm, impulse):
        body.velocity += impulse / body.mass
        body.spin += inverse_inertia @ np.cross(arm, impulse)

    for _ in range(PASSES):
        for i, (arm, normal, gap) in enumerate(zip(arms, normals, gaps)):
            speed = body.velocity + np.cross(body.spin, arm)
            lever = np.cross(arm, normal)
            allowed = gap / STEP if gap > 0 else 0.1 * min(gap + 0.001, 0) / STEP
            total = max(pushes[i] - (speed @ normal + allowed) / (1 / body.mass + lever @ inverse_inertia @ lever), 0)
            push(arm, (total - pushes[i]) * normal)
            pushes[i] = total
            slip = body.velocity + np.cross(body.spin, arm)
            slip -= (slip @ normal) * normal
            wanted = rubs[i] - slip / (1 / body.mass + np.trace(inverse_inertia) * (arm @ arm) / 2)
            limit = FRICTION * total / max(np.linalg.norm(wanted), 1e-12)
            wanted *= min(limit, 1)
            push(arm, wanted - rubs[i])
            rubs[i] = wanted


mesh, given = arguments(__doc__, "drop.png")
body = Body(bilayer.Collider(mesh, bilayer.build(mesh, resolution=64, half_width_voxels=5)), 1, (-0.4, 1.6, 0))
slab = bilayer.box((3.2, 0.4, 2))
ground = bilayer.Collider(slab, bilayer.build(slab, voxel_size=0.03, half_width_voxels=5))
tilt = bilayer.Pose((0, -0.2, 0), (np.cos(-0.1), 0, 0, np.sin(-0.1)))
cache, track, poses, depths = bilayer.ContactCache(), [], [], []
for step in range(STEPS):
    body.velocity += STEP * np.array(GRAVITY)
    contacts = bilayer.collide(body.collider, body.pose(), ground, tilt, margin=MARGIN + STEP * 4, cache=cache)
    solve(body, contacts)
    body.move()
    track.append(body.place.copy())
    depths.append(min(contacts.distance.min(initial=0.0), 0.0))
    if step % 40 == 0:
        poses.append(body.pose())
poses.append(body.pose())
speed = np.linalg.norm(track[-1] - track[-25]) / (24 * STEP)
print(f"ends at {np.round(track[-1], 3)}, at {speed:.4f} units/s; deepest penetration {-min(depths):.4f} units")

figure, (axes, heights) = plt.subplots(1, 2, figsize=(12, 5), gridspec_kw={"width_ratios": [3, 2]})
corners = tilt.to_world(slab.vertices)
axes.fill(*corners[corners[:, 2] > 0][[0, 1, 3, 2], :2].T, color="0.8")
for number, pose in enumerate(poses):
    outline = pose.to_world(mesh.vertices[mesh.faces])[:, :, :2]
    axes.tripcolor(*outline.reshape(-1, 2).T, np.arange(outline.shape[0] * 3).reshape(-1, 3),
                   facecolors=np.full(outline.shape[0], number), vmin=0, vmax=len(poses), cmap="viridis", alpha=0.5)
axes.plot(*np.array(track)[:, :2].T, "k-", linewidth=1)
axes.set(aspect="equal", xlim=(-1.8, 1.8), title="the body every sixth of a second, and the way of its centre")
heights.plot(STEP * np.arange(STEPS), np.array(track)[:, 1], label="height of the centre")
heights.plot(STEP * np.arange(STEPS), depths, label="penetration")
heights.set(xlabel="time [s]")
heights.legend()
save(figure, given.output)
