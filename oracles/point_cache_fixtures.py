#!/usr/bin/env python3
"""Writes small point caches, OBJ files and an OBJ sequence with Blender, and what Blender makes of them.

    pip install bpy==4.5.15 'numpy<2'
    git clone https://github.com/blender/blender-addons
    python oracles/point_cache_fixtures.py blender-addons

A mesh of 35 vertices bends and waves for eight frames at 25 Hz. Blender's own add-ons write it as PC2
and MDD (they are no part of the bpy module, hence their source is asked for), Blender itself writes
the same as Alembic, as one OBJ file and as an OBJ sequence, all to
crates/froufrou/tests/fixtures/point_cache. `mesh_cache.json` has the positions that Blender's Mesh
Cache modifier reads from the PC2 and MDD files, also halfway between frames.
"""

import importlib
import json
import math
import sys
from pathlib import Path
from types import SimpleNamespace

import bpy

FOLDER = Path(__file__).parent.parent / "crates/froufrou/tests/fixtures/point_cache"
FRAMES = 8
RATE_HZ = 25


def cloth():
    """A grid that is keyed by two shape keys and lies askew of the axes, so that none goes unnoticed."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=6, y_subdivisions=4, size=2)
    grid = bpy.context.object
    grid.name = grid.data.name = "cloth"
    for vertex in grid.data.vertices:
        x, y, z = vertex.co
        vertex.co = (x + 0.3 * y, 0.6 * y - 0.2, 0.1 * x * y + 1.5)
    grid.shape_key_add(name="Basis")
    for number, bend in enumerate((lambda x, y: math.sin(3 * x), lambda x, y: x * y)):
        key = grid.shape_key_add(name=f"bend {number}")
        for point in key.data:
            x, y, z = point.co
            point.co = (x - 0.1 * number, y + 0.2 * bend(y, x), z + 0.5 * bend(x, y))
        for frame in range(1, FRAMES + 1):
            key.value = 0.5 + 0.5 * math.sin(0.9 * frame + number)
            key.keyframe_insert("value", frame=frame)
    return grid


def select(thing):
    bpy.ops.object.select_all(action="DESELECT")
    thing.select_set(True)
    bpy.context.view_layer.objects.active = thing


def mesh_cache(kind, indices):
    """The positions that the modifier gives for frame numbers of the cache, counted from 0."""
    select(bpy.data.objects["cloth"])
    # The rest mesh, without the shape keys that made the cache.
    bpy.ops.object.duplicate()
    rest = bpy.context.object
    rest.shape_key_clear()
    modifier = rest.modifiers.new("cache", "MESH_CACHE")
    modifier.cache_format = kind
    modifier.filepath = str(FOLDER / f"cloth.{kind.lower()}")
    modifier.interpolation = "LINEAR"
    modifier.play_mode, modifier.time_mode = "CUSTOM", "FRAME"
    found = []
    for index in indices:
        modifier.eval_frame = index
        bpy.context.view_layer.update()
        mesh = rest.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
        found.append([round(float(c), 7) for vertex in mesh.vertices for c in vertex.co])
    bpy.data.objects.remove(rest)
    return found


def main():
    addons = sys.argv[1]
    sys.path[:0] = [addons]
    FOLDER.mkdir(parents=True, exist_ok=True)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.fps, scene.frame_start, scene.frame_end = RATE_HZ, 1, FRAMES
    select(cloth())

    importlib.import_module("io_shape_mdd.export_mdd").save(
        bpy.context, str(FOLDER / "cloth.mdd"), frame_start=1, frame_end=FRAMES, fps=RATE_HZ
    )
    pc2 = importlib.import_module("io_export_pc2")
    settings = {"range_start": 1, "range_end": FRAMES, "apply_modifiers": True}
    settings |= {"rot_x90": False, "world_space": True}
    every, halves = (SimpleNamespace(**settings, sampling=step) for step in ("1", "0.5"))
    assert pc2.do_export(bpy.context, every, str(FOLDER / "cloth.pc2"))
    assert pc2.do_export(bpy.context, halves, str(FOLDER / "halves.pc2"))
    indices = [0, 0.5, 1, 2.25, 3, 4.75, 6.5, 7]
    read = {kind: mesh_cache(kind, indices) for kind in ("PC2", "MDD")}
    (FOLDER / "mesh_cache.json").write_text(json.dumps({"indices": indices, **read}) + "\n")

    select(bpy.data.objects["cloth"])
    bpy.ops.wm.alembic_export(
        filepath=str(FOLDER / "cloth.abc"), start=1, end=FRAMES, selected=True, as_background_job=False,
        uvs=False, normals=False, vcolors=False, face_sets=False, packuv=False, apply_subdiv=False,
    )
    raw = {"forward_axis": "Y", "up_axis": "Z", "export_materials": False, "export_selected_objects": True}
    scene.frame_set(1)
    bpy.ops.wm.obj_export(filepath=str(FOLDER / "cloth.obj"), export_uv=False, export_normals=False, **raw)
    bpy.ops.wm.obj_export(
        filepath=str(FOLDER / "frame_.obj"), export_animation=True, start_frame=1, end_frame=FRAMES,
        export_uv=False, export_normals=True, **raw,
    )
    # Two objects with everything that Blender writes, Y up as is its default.
    bpy.ops.mesh.primitive_cube_add(size=1, location=(3, 0, 0))
    bpy.context.object.name = "box"
    bpy.data.objects["cloth"].select_set(True)
    bpy.ops.wm.obj_export(filepath=str(FOLDER / "two.obj"), export_materials=False, export_selected_objects=True)


main()
