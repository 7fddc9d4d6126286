"""Runs inside Blender's Python: import a file and draw it through the camera it brings.

    python blender_render.py FILE OUT.png SETTINGS_JSON

SETTINGS_JSON: {"frame", "width_px", "height_px", "samples", "turn_deg"}. Nothing but the import
decides what is seen: no light but a white world, no material but the file's; `turn_deg` carries the
camera around the object.
"""

import json
import math
import sys

import bpy
from blender_play import import_file
from mathutils import Matrix, Vector


def center_of_meshes() -> Vector:
    """Return the middle of the box around all meshes, as posed."""
    graph = bpy.context.evaluated_depsgraph_get()
    corners = [
        thing.matrix_world @ Vector(corner)
        for thing in (mesh.evaluated_get(graph) for mesh in bpy.data.objects if mesh.type == "MESH")
        for corner in thing.bound_box
    ]
    return sum(corners, Vector()) / len(corners)


def main(path: str, out: str, settings_json: str) -> None:
    settings = json.loads(settings_json)
    import_file(path)
    scene = bpy.context.scene
    scene.frame_set(settings["frame"])
    scene.camera = next(thing for thing in bpy.data.objects if thing.type == "CAMERA")
    if settings.get("turn_deg"):
        center = center_of_meshes()
        turn = Matrix.Rotation(math.radians(settings["turn_deg"]), 4, "Z")
        around = Matrix.Translation(center) @ turn @ Matrix.Translation(-center)
        # A copy without the parent's axes and without keys.
        camera = bpy.data.objects.new("turned", scene.camera.data)
        camera.matrix_world = around @ scene.camera.matrix_world
        scene.collection.objects.link(camera)
        scene.camera = camera
    scene.render.engine = "CYCLES"
    scene.cycles.samples = settings["samples"]
    scene.cycles.use_denoising = False
    scene.render.threads_mode = "FIXED"
    scene.render.threads = 1
    scene.render.resolution_x = settings["width_px"]
    scene.render.resolution_y = settings["height_px"]
    scene.view_settings.view_transform = "Standard"
    scene.world = bpy.data.worlds.new("white")
    scene.world.color = (1.0, 1.0, 1.0)
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    scene.render.filepath = out
    bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    main(*sys.argv[-3:])
