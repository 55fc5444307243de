# SPDX-License-Identifier: Apache-2.0
# Opens a .vdb file in Blender and prints, as a line of JSON behind "found ", its grids and the surface of the first one:
#   blender --background --factory-startup --python-exit-code 1 --python blender.py -- FILE
import json
import sys

import bmesh
import bpy

path = sys.argv[sys.argv.index("--") + 1]
bpy.ops.object.volume_import(filepath=path)
volume = bpy.context.object
grids = volume.data.grids
if not grids.load():
    raise RuntimeError(grids.error_message)

surface = bpy.data.objects.new("surface", bpy.data.meshes.new("surface"))
bpy.context.collection.objects.link(surface)
modifier = surface.modifiers.new("surface", "VOLUME_TO_MESH")
modifier.object = volume
modifier.grid_name = grids[0].name
modifier.threshold = 0
mesh = surface.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
solid = bmesh.new()
solid.from_mesh(mesh)
corners = [vertex.co for vertex in mesh.vertices]
print("found " + json.dumps({
    "grids": {grid.name: grid.data_type for grid in grids},
    "lower": [min(corner[axis] for corner in corners) for axis in range(3)],
    "upper": [max(corner[axis] for corner in corners) for axis in range(3)],
    "volume": abs(solid.calc_volume(signed=True)),
}))
