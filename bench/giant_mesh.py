#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""giant_mesh.py MILLIONS FILE.ply: writes a closed mesh of so many million triangles, part by part.

The mesh is a torus with ripples, as a binary PLY file. It need not fit into memory.
"""
import math
import sys

import numpy as np


def main():
    millions, path = float(sys.argv[1]), sys.argv[2]
    rows = max(3, math.ceil(math.sqrt(millions * 1e6 / 2 * 2.5)))  # around the ring, which is longer than the tube
    columns = max(3, math.ceil(millions * 1e6 / 2 / rows))
    v = np.arange(columns) * (2 * math.pi / columns)
    with open(path, "wb") as file:
        file.write(
            f"ply\nformat binary_little_endian 1.0\nelement vertex {rows * columns}\n"
            "property float x\nproperty float y\nproperty float z\n"
            f"element face {2 * rows * columns}\nproperty list uchar int vertex_indices\nend_header\n".encode())
        for row in range(rows):
            u = row * 2 * math.pi / rows
            tube = 0.4 + 0.01 * np.sin(40 * v) * math.sin(60 * u)
            ring = 1 + tube * np.cos(v)
            points = np.stack([ring * math.cos(u), ring * math.sin(u), tube * np.sin(v)], axis=1)
            file.write(points.astype("<f4").tobytes())
        faces = np.empty(2 * columns, dtype=[("count", "u1"), ("corners", "<i4", 3)])
        faces["count"] = 3
        here = np.arange(columns, dtype=np.int64)
        there = np.roll(here, -1)
        for row in range(rows):
            a, b = row * columns, (row + 1) % rows * columns
            faces["corners"][0::2] = np.stack([a + here, b + here, b + there], axis=1)
            faces["corners"][1::2] = np.stack([a + here, b + there, a + there], axis=1)
            file.write(faces.tobytes())


main()
