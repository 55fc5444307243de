# SPDX-License-Identifier: Apache-2.0
"""Checks that page.py accepts outputs that differ by rounding or times alone, and no others."""

from page import same_output

SAME = [
    ("0.50 s: height 0.1233 m, 20 contacts\n", "0.50 s: height 0.1234 m, 21 contacts\n"),
    ("distance  0.0000 m\n", "distance -0.0000 m\n"),
    ("active voxels  14,519\n", "active voxels   14,520\n"),
    ("  build   0.193 s: prepare 0.017\n", "  build   7 s: tiles 1\n"),
]
DIFFERENT = [
    ("sign conflicts  0 pairs\n", "sign conflicts  2 pairs\n"),
    ("error bound  6.25e-06 m, 0.0001 voxels\n", "error bound  0.19 m, 0.0003 voxels\n"),
    ("error bound  6.25e-06 m\n", "error bound  9.25e-06 m\n"),
    ("in the band 1\n", "in the band 0\n"),
    ("substeps 1\n", "substeps 3\n"),
    ("5 contacts\n", "8 contacts\n"),
    ("volume 1.5998 m^3\n", "volume 1.7 m^3\n"),
    ("closed yes\n", "closed no\n"),
    ("a 1\nb 2\n", "a 1\n"),
]
for shown, printed in SAME:
    assert same_output(shown, printed), (shown, printed)
for shown, printed in DIFFERENT:
    assert not same_output(shown, printed), (shown, printed)
