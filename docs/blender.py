# SPDX-License-Identifier: Apache-2.0
# Renders the surface of a liquid, as `bilayer seed` writes it, as water:
#   blender --background --factory-startup --python docs/blender.py -- FILE.vdb PICTURE.png [WIDTH SAMPLES]
import math
import sys

import bpy
from mathutils import Vector

path, picture, *rest = sys.argv[sys.argv.index("--") + 1:]
width, samples = (int(word) for word in rest or (1200, 96))

scene = bpy.context.scene
for thing in list(bpy.data.objects):
    bpy.data.objects.remove(thing)


def material(name, **inputs):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    nodes = made.node_tree.nodes
    nodes.clear()
    surface = nodes.new("ShaderNodeBsdfPrincipled")
    for key, value in inputs.items():
        surface.inputs[key.replace("_", " ")].default_value = value
    made.node_tree.links.new(surface.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs[0])
    return made


# the liquid: a volume, and its zero set as a mesh; the y axis points up in the bunny's file
bpy.ops.object.volume_import(filepath=path, rotation=(math.pi / 2, 0, 0))
volume = bpy.context.object
volume.hide_render = True
volume.data.grids.load()
water = bpy.data.objects.new("water", bpy.data.meshes.new("water"))
scene.collection.objects.link(water)
modifier = water.modifiers.new("surface", "VOLUME_TO_MESH")
modifier.object, modifier.grid_name, modifier.threshold = volume, volume.data.grids[0].name, 0
modifier.use_smooth_shade = True
water.data.materials.append(material("water", Base_Color=(0.75, 0.93, 1, 1), Roughness=0, IOR=1.33, Transmission=1))
box = [volume.matrix_world @ Vector(corner) for corner in volume.bound_box]
lower, upper = (Vector(choose(corner[axis] for corner in box) for axis in range(3)) for choose in (min, max))
centre, size = (lower + upper) / 2, max(upper - lower)

bpy.ops.mesh.primitive_plane_add(size=40 * size, location=(centre.x, centre.y, lower.z + 0.03 * size))
bpy.context.object.data.materials.append(material("ground", Base_Color=(0.35, 0.33, 0.3, 1), Roughness=0.6))

world = scene.world = bpy.data.worlds.new("sky")
world.use_nodes = True
nodes = world.node_tree.nodes
nodes.clear()
sky, light = nodes.new("ShaderNodeTexSky"), nodes.new("ShaderNodeBackground")
sky.sun_elevation, sky.sun_rotation, sky.sun_size = math.radians(35), math.radians(130), math.radians(3)
light.inputs[1].default_value = 0.08
world.node_tree.links.new(sky.outputs[0], light.inputs[0])
world.node_tree.links.new(light.outputs[0], nodes.new("ShaderNodeOutputWorld").inputs[0])

eye = centre + size * Vector((0.75, -2.5, 0.55))
camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
camera.location = eye
camera.rotation_euler = (centre - Vector((0, 0, 0.03 * size)) - eye).to_track_quat("-Z", "Y").to_euler()
camera.data.lens = 55
scene.collection.objects.link(camera)
scene.camera = camera

scene.render.engine = "CYCLES"
scene.cycles.samples = samples
scene.cycles.use_denoising = False
scene.cycles.sample_clamp_indirect = 2
scene.view_settings.view_transform = "Filmic"
scene.render.resolution_x, scene.render.resolution_y = width, width * 3 // 4
scene.render.filepath = picture
bpy.ops.render.render(write_still=True)
