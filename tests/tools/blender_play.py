"""Runs inside Blender's Python: import a file, play it, save where the vertices of its meshes are.

    python blender_play.py FILE OUT.npz FRAMES_JSON

The archive holds, for each mesh, `NAME/rest`, shape (V, 3), and `NAME/posed`, shape (T, V, 3), in
Blender's world (Z-up, meters), and `scene`, JSON about the import.
"""

import json
import sys

import bpy
import numpy as np


def import_file(path: str) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if path.endswith((".glb", ".gltf")):
        bpy.ops.import_scene.gltf(filepath=path, disable_bone_shape=True)
    else:
        bpy.ops.wm.usd_import(filepath=path)


def world_points(mesh: bpy.types.Mesh, world_from_object: np.ndarray) -> np.ndarray:
    points = np.zeros(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", points)
    return points.reshape(-1, 3) @ world_from_object[:3, :3].T + world_from_object[:3, 3]


def posed_points(skinned: bpy.types.Object) -> np.ndarray:
    evaluated = skinned.evaluated_get(bpy.context.evaluated_depsgraph_get())
    points = world_points(evaluated.to_mesh(), np.array(evaluated.matrix_world))
    evaluated.to_mesh_clear()
    return points


def describe_scene() -> dict:
    scene = bpy.context.scene
    return {
        "objects": {thing.name: thing.type for thing in bpy.data.objects},
        "fps": scene.render.fps / scene.render.fps_base,
        "frame_end": scene.frame_end,
        "skinned": [
            thing.name
            for thing in bpy.data.objects
            if any(part.type == "ARMATURE" for part in thing.modifiers)
        ],
        "materials": {
            thing.name: [slot.name for slot in thing.data.materials]
            for thing in bpy.data.objects
            if thing.type == "MESH"
        },
    }


def main(path: str, out: str, frames_json: str) -> None:
    import_file(path)
    # The scenes of a glTF file become collections; all but the default one come switched off, and
    # what is off is not animated.
    collections = bpy.context.view_layer.layer_collection.children
    switched_off = [collection.name for collection in collections if collection.exclude]
    for collection in collections:
        collection.exclude = False
    bpy.context.view_layer.update()
    meshes = [thing for thing in bpy.data.objects if thing.type == "MESH"]
    saved = {f"{mesh.name}/posed": [] for mesh in meshes}
    for mesh in meshes:
        saved[f"{mesh.name}/rest"] = world_points(mesh.data, np.array(mesh.matrix_world))
    for frame in json.loads(frames_json):
        bpy.context.scene.frame_set(int(frame // 1), subframe=frame % 1)
        for mesh in meshes:
            saved[f"{mesh.name}/posed"].append(posed_points(mesh))
    np.savez(out, scene=json.dumps({**describe_scene(), "switched_off": switched_off}), **saved)


if __name__ == "__main__":
    main(*sys.argv[-3:])
