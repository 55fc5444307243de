# SPDX-License-Identifier: Apache-2.0
"""usage: python_reference.py: prints docs/python-reference.md, from the docstrings of the module."""

import inspect

import bilayer

GROUPS = {
    "Meshes": ["Mesh", "read_mesh", "inspect", "MeshReport", "as_mesh", "box", "sphere"],
    "Fields": ["build", "rebuild", "LevelSet", "Dense", "Sparse", "devices", "Cancelled", "DeviceError"],
    "Queries": ["Field", "TiledField", "Samples", "ClosestPoints", "Hits"],
    "Bodies": [
        "Pose", "Collider", "Shape", "with_body", "mass_properties", "MassProperties", "collide", "Contacts", "ContactCache",
        "distance", "distances", "BodyDistance", "time_of_impact", "Impact",
    ],
    "Liquids": ["seed", "Seeded", "particles", "obstacle", "Obstacle"],
}


def text(value):
    return inspect.cleandoc((value.__func__ if isinstance(value, staticmethod) else value).__doc__ or "")


def block(doc):
    return f"```\n{doc}\n```\n"


def members(kind):
    """The properties of a class as a list, then its methods."""
    items = [(name, value) for name, value in vars(kind).items() if not name.startswith("_") and text(value)]
    properties = [f"- `{name}`: {text(value)}\n" for name, value in items if isinstance(value, property)]
    methods = [block(text(value)) for _, value in items if not isinstance(value, property)]
    return ["".join(properties)] * bool(properties) + methods


def fields(kind):
    """The fields of a named tuple or dataclass, with their order."""
    names = getattr(kind, "_fields", None) or list(getattr(kind, "__dataclass_fields__", {}))
    return ["Fields: " + ", ".join(f"`{name}`" for name in names) + ".\n"] if names else []


def entry(name):
    value = getattr(bilayer, name)
    parts = [f"### `{name}`\n", block(text(value))]
    if inspect.isclass(value) and not issubclass(value, Exception):
        parts += fields(value) or members(value)
    return "\n".join(parts)


def page():
    listed = sorted(name for names in GROUPS.values() for name in names)
    missing = set(bilayer.__all__) - set(listed) - {"__version__"}
    if missing:
        raise SystemExit(f"python_reference.py: no group lists {', '.join(sorted(missing))}")
    parts = ["# Reference of the Python module\n",
             "Written by `docs/python_reference.py` from the docstrings. [python.md](python.md) is where to begin.\n"]
    for group, names in GROUPS.items():
        parts += [f"## {group}\n"] + [entry(name) for name in names]
    return "\n".join(parts)


if __name__ == "__main__":
    print(page(), end="")
