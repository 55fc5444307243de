# SPDX-License-Identifier: Apache-2.0
"""What the examples share: their arguments, and pictures without a screen."""

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import bilayer

BUNNY = Path("/usr/share/glmark2/models/bunny.obj")  # Debian's glmark2-data


def arguments(description, output):
    """The mesh, scaled to a longest side of 1 around zero, and the parsed arguments."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("mesh", nargs="?", help="a mesh file; default: the bunny of Debian's glmark2-data, or a torus")
    parser.add_argument("-o", "--output", default=output, help="the picture to write (default: %(default)s)")
    given = parser.parse_args()
    path = given.mesh or (BUNNY if BUNNY.exists() else None)
    mesh = bilayer.read_mesh(path) if path else torus()
    return unit(mesh), given


def unit(mesh):
    lower, upper = mesh.bounds
    return bilayer.Mesh((mesh.vertices - (lower + upper) / 2) / (upper - lower).max(), mesh.faces)


def torus(around=96, across=48):
    u, v = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")
    a, b = 2 * np.pi * u / around, 2 * np.pi * v / across
    ring = 1 + 0.4 * np.cos(b)
    vertices = np.stack([ring * np.cos(a), ring * np.sin(a), 0.4 * np.sin(b)], axis=-1).reshape(-1, 3)

    def index(i, j):
        return (i % around) * across + j % across

    corners = np.stack([index(u, v), index(u + 1, v), index(u + 1, v + 1), index(u, v + 1)], axis=-1).reshape(-1, 4)
    return bilayer.Mesh(vertices, np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]]))


def save(figure, path):
    figure.savefig(path, dpi=110, bbox_inches="tight")
    plt.close(figure)
    print(f"wrote {path}")
