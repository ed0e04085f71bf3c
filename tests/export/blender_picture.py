# SPDX-License-Identifier: Apache-2.0
# Real Blender shows an exported volume as nerfvdb does, and opens its meshes:
#   blender --background --factory-startup --python-exit-code 1 --python blender_picture.py -- \
#       SCRIPT.blender.py NAME:TYPE,NAME:TYPE CAMERA PICTURE.png OPACITY.png MESH...
# Runs the script that was exported beside the volume, with --render and --camera CAMERA, then compares with PICTURE
# (over a white background) and OPACITY, nerfvdb's own from the same camera. These may be larger by a whole number:
# nerfvdb looks through the middle of a pixel, Blender all over it. Meshes must come with colours.
import os
import runpy
import sys

import bpy
import numpy as np

LEAST_IOU = 0.98
LARGEST_DIFFERENCE = 4 / 255  # of sRGB values, mean over pixels and channels

script, expected_grids, camera, picture, opacity, *meshes = sys.argv[sys.argv.index("--") + 1:]


def pixels(path):
    """[row][column][channel] values as they stand in the file, the lowest row first."""
    image = bpy.data.images.load(os.path.abspath(path))
    values = np.array(image.pixels[:], dtype=np.float64).reshape(image.size[1], image.size[0], image.channels)
    bpy.data.images.remove(image)
    return values


def linear(srgb):
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def srgb(linear):
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def over_white(straight):
    """A picture with an alpha of its own, over white, as light."""
    alpha = straight[..., 3:]
    return alpha * linear(straight[..., :3]) + 1 - alpha


def shrunk(image, height):
    """Means over square blocks of pixels, so many that `height` rows are left."""
    block = image.shape[0] // height
    rows, columns = image.shape[0] // block, image.shape[1] // block
    return image.reshape(rows, block, columns, block, -1).mean(axis=(1, 3))


def overlap(a, b):
    return (a & b).sum() / (a | b).sum()


# --- the volume, as the exported script shows it ---

out = os.path.splitext(script)[0] + ".png"
sys.argv = [script, "--", "--render", out, "--camera", camera, "--samples", "16"]
runpy.run_path(script, run_name="__main__")

volumes = [thing for thing in bpy.data.objects if thing.type == "VOLUME"]
grids = ",".join(sorted(f"{grid.name}:{grid.data_type}" for grid in volumes[0].data.grids))
assert grids == expected_grids, f"found {grids}, expected {expected_grids}"
assert len([thing for thing in bpy.data.objects if thing.type == "CAMERA"]) > 1

blender = pixels(out)
ours = shrunk(linear(pixels(picture)[..., :3]), blender.shape[0])
inside = shrunk(pixels(opacity)[..., :1], blender.shape[0])[..., 0] > 0.5
assert blender.shape[:2] == ours.shape[:2], (blender.shape, ours.shape)
shown = blender[..., 3] > 0.5
assert 0.02 < inside.mean() < 0.9, "a picture that shows too little or too much to tell"
iou = overlap(inside, shown)
both = inside & shown
difference = np.abs(srgb(over_white(blender)) - srgb(ours))[both].mean()
print(f"Emission: IoU of silhouettes {iou:.4f}, mean difference inside {255 * difference:.2f}/255")
assert iou >= LEAST_IOU
assert difference <= LARGEST_DIFFERENCE

# --- the same through Principled Volume, whose colours need lights: only what it covers ---

material = volumes[0].data.materials[0]
nodes = material.node_tree.nodes
nodes.clear()
principled, output = nodes.new("ShaderNodeVolumePrincipled"), nodes.new("ShaderNodeOutputMaterial")
principled.inputs["Density"].default_value = 1
principled.inputs["Density Attribute"].default_value = "density"
principled.inputs["Color Attribute"].default_value = "color"
material.node_tree.links.new(principled.outputs[0], output.inputs["Volume"])
bpy.ops.render.render(write_still=True)
iou = overlap(inside, pixels(out)[..., 3] > 0.5)
print(f"Principled Volume: IoU of silhouettes {iou:.4f}")
assert iou >= LEAST_IOU

# --- meshes ---


def import_mesh(path):
    if path.endswith(".obj"):
        bpy.ops.wm.obj_import(filepath=path)
    elif "ply_import" in dir(bpy.ops.wm):  # Blender 3.6 and later
        bpy.ops.wm.ply_import(filepath=path)
    else:
        bpy.ops.import_mesh.ply(filepath=path)
    return bpy.context.selected_objects[0]


for path in meshes:
    mesh = import_mesh(os.path.abspath(path)).data
    assert len(mesh.color_attributes) == 1, f"{path}: found {len(mesh.color_attributes)} colour attributes, expected 1"
    attribute = mesh.color_attributes[0]
    values = np.empty(4 * len(attribute.data))
    attribute.data.foreach_get("color", values)
    assert values.reshape(-1, 4)[:, :3].std() > 0.02, f"{path}: colours that are all alike"
    print(f"{path}: {len(mesh.polygons)} faces, {attribute.data_type} '{attribute.name}' for each {attribute.domain}")
