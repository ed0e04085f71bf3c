# SPDX-License-Identifier: Apache-2.0
# Shows the exported volume beside this file in Blender (3.4 and later) as it was learned, with one camera for each
# photograph. By hand: Scripting > Open > Run Script. From the command line:
#
#   blender --python FILE.blender.py -- --plates FOLDER                                       # look at it
#   blender --background --python FILE.blender.py -- --render OUT.png --camera 3              # a picture
#   blender --background --python FILE.blender.py -- --save SCENE.blend
#
#   --plates FOLDER   the data set's folder: photographs become the background images of their cameras
#   --camera N        the camera that looks, counted from 0 in the order of the .cameras.json [0]
#   --render OUT.png  render with Cycles; transparent where there is nothing
#   --samples N       samples a pixel for --render [32]
#   --size PERCENT    size of the picture for --render [100]
#   --save FILE.blend
#
# The cameras made here are pinholes, without lens distortion, and without what a fisheye sees beyond a pinhole's reach.
# Where photographs have either, a warning is printed, and each camera carries the numbers as properties: undistort
# plates before lining them up.
import argparse
import json
import math
import os
import sys

import bpy
from mathutils import Matrix, Vector

SCENE = None  # what the exporter knows: names of the files beside this one, of the grids, and the axis that is up


def words():
    parser = argparse.ArgumentParser(prog="blender --python " + os.path.basename(__file__) + " --")
    parser.add_argument("--plates", metavar="FOLDER")
    parser.add_argument("--camera", type=int, default=0, metavar="N")
    parser.add_argument("--render", metavar="OUT.png")
    parser.add_argument("--samples", type=int, default=32, metavar="N")
    parser.add_argument("--size", type=int, default=100, metavar="PERCENT")
    parser.add_argument("--save", metavar="FILE.blend")
    return parser.parse_args(sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else [])


def folder():
    """Of this script; a text that was opened inside Blender knows it by its own path."""
    text = getattr(getattr(bpy.context, "space_data", None), "text", None)
    path = bpy.path.abspath(text.filepath) if text and text.filepath else __file__
    return os.path.dirname(os.path.abspath(path))


def fail(message):
    """Ends the script, and Blender with it only where nobody's work is open."""
    if bpy.app.background:
        sys.exit(message)
    raise RuntimeError(message)


def collection(name):
    made = bpy.data.collections.new(name)
    bpy.context.scene.collection.children.link(made)
    return made


def exported_world():
    """An empty that all else hangs on: move, turn or scale it, and volume and cameras stay in line."""
    world = bpy.data.objects.new("Radiance field", None)
    bpy.context.scene.collection.objects.link(world)
    if SCENE["up"] == "y":  # Blender's z is up
        world.rotation_euler.x = math.pi / 2
    return world


# --- the volume -----------------------------------------------------------------------------------------------------


def half_voxel(volume):
    """Where Blender shows a value off the place that its grid names, as a shift of the object that undoes it.

    OpenVDB's values lie at integer index coordinates. Blender 3 and the first 4 show them half a voxel further along
    each axis; later ones do not. Which one this is shows in the object's bounds: whole leaves of eight voxels where
    values are taken as centres of voxels, one voxel less before.
    """
    grid = volume.data.grids[0]
    object_from_index = grid.matrix_object
    to_index = object_from_index.inverted()
    corners = [to_index @ Vector(corner) for corner in volume.bound_box]
    extent = max(corner.x for corner in corners) - min(corner.x for corner in corners)
    if abs(extent / 8 - round(extent / 8)) < 0.02:
        return Vector((0, 0, 0))
    return object_from_index.to_3x3() @ Vector((-0.5, -0.5, -0.5))


def emission_and_absorption():
    """The model's own rendering: light is emitted as colour times density, and stopped by density."""
    material = bpy.data.materials.new("radiance field")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()

    def node(kind, x, y):
        made = nodes.new(kind)
        made.location = x, y
        return made

    density = node("ShaderNodeAttribute", -600, 0)
    density.attribute_name = SCENE["density"]
    emission = node("ShaderNodeEmission", -300, 150)
    absorption = node("ShaderNodeVolumeAbsorption", -300, -100)
    absorption.inputs["Color"].default_value = (0, 0, 0, 1)
    both = node("ShaderNodeAddShader", -50, 50)
    output = node("ShaderNodeOutputMaterial", 150, 50)
    if SCENE["color"]:
        color = node("ShaderNodeAttribute", -600, 250)
        color.attribute_name = SCENE["color"]
        links.new(color.outputs["Color"], emission.inputs["Color"])
    else:
        emission.inputs["Color"].default_value = (0.8, 0.8, 0.8, 1)
    links.new(density.outputs["Fac"], emission.inputs["Strength"])
    links.new(density.outputs["Fac"], absorption.inputs["Density"])
    links.new(emission.outputs[0], both.inputs[0])
    links.new(absorption.outputs[0], both.inputs[1])
    links.new(both.outputs[0], output.inputs["Volume"])
    return material


def import_volumes(world):
    material = emission_and_absorption()
    target = collection("Volume")
    volumes = []
    for name in SCENE["volumes"]:
        path = os.path.join(folder(), name)
        if not os.path.exists(path):
            fail(f"{path}: found no file, expected the volume that was exported with this script")
        bpy.ops.object.volume_import(filepath=path)
        volume = bpy.context.object
        if not volume.data.grids.load():
            fail(f"{path}: {volume.data.grids.error_message}")
        for holder in list(volume.users_collection):
            holder.objects.unlink(volume)
        target.objects.link(volume)
        bpy.context.view_layer.update()
        volume.parent = world
        volume.matrix_basis = Matrix.Translation(half_voxel(volume))
        volume.data.materials.clear()
        volume.data.materials.append(material)
        volume.data.render.clipping = 0  # by default densities below 0.001 are dropped, whatever the unit of length
        volumes.append(volume)
    return volumes


# --- the cameras ----------------------------------------------------------------------------------------------------


LENS_TERMS = ("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2")


def add_camera(frame, number, world, corners):
    name = frame["file_path"] or f"camera {number}"
    data = bpy.data.cameras.new(name)
    camera = bpy.data.objects.new(name, data)
    camera.parent = world
    camera.matrix_basis = Matrix(frame["transform_matrix"])

    # Lengths on the sensor are told in widths of the picture; pixels that are not square make it higher or lower.
    width, height, pixel_height = frame["w"], frame["h"], frame["fl_x"] / frame["fl_y"]
    data.sensor_fit = "HORIZONTAL"
    data.sensor_width = 36
    data.lens = data.sensor_width * frame["fl_x"] / width
    data.shift_x = 0.5 - frame["cx"] / width
    data.shift_y = pixel_height * (frame["cy"] - 0.5 * height) / width

    farthest = max((corner - camera.matrix_basis.translation).length for corner in corners)
    data.clip_start, data.clip_end = 1e-4 * farthest, 1.1 * farthest
    data.display_size = 0.03 * farthest
    for key in ("camera_model", "w", "h", "fl_x", "fl_y", "cx", "cy") + LENS_TERMS:
        if key in frame:
            camera[key] = frame[key]
    return camera


def add_plate(camera, path):
    if not os.path.exists(path):
        print(f"warning: {path}: no photograph for {camera.name}")
        return
    plate = camera.data.background_images.new()
    plate.image = bpy.data.images.load(path, check_existing=True)
    plate.frame_method = "STRETCH"
    plate.alpha = 0.5
    camera.data.show_background_images = True


def add_cameras(world, volumes, plates):
    if not SCENE["cameras"]:
        return []
    with open(os.path.join(folder(), SCENE["cameras"]), encoding="utf-8") as file:
        document = json.load(file)
    frames = [{"camera_model": document["camera_model"], **frame} for frame in document["frames"]]
    corners = [volume.matrix_basis @ Vector(corner) for volume in volumes for corner in volume.bound_box]
    groups = {False: collection("Photographs")}
    if any(frame["held_out"] for frame in frames):
        groups[True] = collection("Held-out photographs")
    cameras = []
    for number, frame in enumerate(frames):
        cameras.append(add_camera(frame, number, world, corners))
        groups[frame["held_out"]].objects.link(cameras[-1])
        if plates and frame["file_path"]:
            add_plate(cameras[-1], os.path.join(plates, frame["file_path"]))
    fisheyes = sum(frame["camera_model"] == "OPENCV_FISHEYE" for frame in frames)
    if fisheyes:
        print(f"warning: {fisheyes} photographs are a fisheye's, where cameras here are pinholes: undistort plates")
    distorted = sum(frame["camera_model"] != "OPENCV_FISHEYE" and any(frame.get(key) for key in LENS_TERMS)
                    for frame in frames)
    if distorted:
        print(f"warning: {distorted} photographs have lens distortion, which cameras here do not: undistort plates")
    return cameras


def look_through(camera):
    """The scene's picture takes the size and the pixels of the camera's."""
    scene = bpy.context.scene
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y = camera["w"], camera["h"]
    pixel_height = camera["fl_x"] / camera["fl_y"]
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = max(1, 1 / pixel_height), max(1, pixel_height)


# --- the picture ----------------------------------------------------------------------------------------------------


def show_colours_as_they_are():
    scene = bpy.context.scene
    scene.view_settings.view_transform = "Standard"
    scene.view_settings.look = "None"
    scene.view_settings.exposure, scene.view_settings.gamma = 0, 1
    scene.render.film_transparent = True


def set_known(owner, **values):
    """Settings come and go between versions of Blender."""
    for name, value in values.items():
        if hasattr(owner, name):
            setattr(owner, name, value)


def use_cycles(volumes, samples):
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    dims = [volume.data.grids[0].matrix_object.inverted().to_3x3() @ Vector(volume.dimensions) for volume in volumes]
    longest = max(sum(abs(length) for length in dim) for dim in dims)
    # Half a voxel a step; no ray may end before it is through.
    set_known(scene.cycles, samples=samples, use_denoising=False, use_adaptive_sampling=False, volume_bounces=0,
              volume_step_rate=0.5, volume_max_steps=min(65536, max(1024, int(4 * longest))), pixel_filter_type="BOX")


def render(path, size):
    settings = bpy.context.scene.render
    settings.resolution_percentage = size
    settings.image_settings.file_format = "PNG"
    settings.image_settings.color_mode = "RGBA"
    settings.image_settings.color_depth = "8"
    settings.filepath = os.path.abspath(path)
    bpy.ops.render.render(write_still=True)


def main():
    options = words()
    if not bpy.data.filepath and not getattr(bpy.context, "space_data", None):
        for thing in list(bpy.data.objects):  # the start-up file's: started from a command line, without another one
            bpy.data.objects.remove(thing)
    world = exported_world()
    volumes = import_volumes(world)
    cameras = add_cameras(world, volumes, options.plates)
    show_colours_as_they_are()
    if cameras:
        if not 0 <= options.camera < len(cameras):
            fail(f"--camera: found {options.camera}, expected 0 to {len(cameras) - 1}")
        look_through(cameras[options.camera])
    use_cycles(volumes, options.samples)
    if options.save:
        bpy.ops.wm.save_as_mainfile(filepath=os.path.abspath(options.save))
    if options.render:
        if not cameras:
            fail("--render: found no camera, expected one; the model was made without")
        render(options.render, options.size)


main()
