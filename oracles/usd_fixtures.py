"""Writes one small Blender scene as Alembic and as USD, for `crates/froufrou/tests/usd.rs`.

    python3.11 -m venv venv && venv/bin/pip install 'bpy==4.5.15' 'numpy<2'
    venv/bin/python oracles/usd_fixtures.py

What our two readers make of the two formats must be the same: Blender's own exporters are the oracle.
The files are

    scene.abc                    baked
    baked.usda, baked.usdc       the same, Z up, every mesh baked
    y_up.usdc                    the same, converted to Y up
    skeleton.usda, skeleton.usdc armature and shape keys as UsdSkel, for readers to evaluate
    skeleton.usdz                the last one as a package
"""
import math
import sys
from pathlib import Path

import bpy

FOLDER = Path(__file__).resolve().parent.parent / "crates/froufrou/tests/usd"
FRAMES = 25
RATE = 24


def add(name, data, parent=None):
    thing = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(thing)
    thing.parent = parent
    return thing


def mesh(name, vertices, faces):
    data = bpy.data.meshes.new(name)
    data.from_pydata(vertices, [], faces)
    data.update()
    return data


def box(name, sx, sy, sz):
    vertices = [(x * sx, y * sy, z * sz) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return mesh(name, vertices, faces)


def key(thing, name, values):
    for frame, value in values:
        setattr(thing, name, value)
        thing.keyframe_insert(name, frame=frame)


def column(name, rings):
    """A square column along z with so many rings of four vertices."""
    vertices = [(x, y, z * 0.5) for z in range(rings) for x, y in ((-0.2, -0.2), (0.2, -0.2), (0.2, 0.2), (-0.2, 0.2))]
    faces = [(4 * r + i, 4 * r + (i + 1) % 4, 4 * r + 4 + (i + 1) % 4, 4 * r + 4 + i)
             for r in range(rings - 1) for i in range(4)]
    return mesh(name, vertices, faces + [(3, 2, 1, 0)])


def build():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end, scene.render.fps = 1, FRAMES, RATE

    carrier = add("Carrier", None)
    key(carrier, "location", [(1, (0, 0, 1)), (FRAMES, (2, -1, 1.5))])
    key(carrier, "rotation_euler", [(1, (0, 0.2, 0)), (FRAMES, (0.4, 0.2, 1.5))])
    rider = add("Rider", box("RiderMesh", 0.5, 0.3, 0.2), carrier)
    rider.scale = (1.0, 2.0, 0.5)
    key(rider, "location", [(1, (1, 0, 0)), (FRAMES, (1, 0.5, -0.5))])
    key(rider, "rotation_euler", [(1, (0, 0, 0)), (13, (1.2, -0.7, 0.4)), (FRAMES, (2.0, 0.3, -1.0))])

    # A mesh without a motion of its own under one that turns and is scaled unevenly.
    add("Passenger", box("PassengerMesh", 0.1, 0.1, 0.1), rider).location = (0, 0, 1)

    bent = add("Bent", column("BentMesh", 4))
    bent.location = (-2, 1, 0)
    modifier = bent.modifiers.new("Twist", "SIMPLE_DEFORM")
    modifier.deform_method, modifier.deform_axis = "TWIST", "Z"
    for frame, angle in ((1, 0.0), (FRAMES, 2.0)):
        modifier.angle = angle
        modifier.keyframe_insert("angle", frame=frame)

    armature = add("Armature", bpy.data.armatures.new("Bones"))
    armature.location = (0, 3, 0)
    armature.rotation_euler = (0, 0, 0.5)
    armature.scale = (1.5, 1.5, 1.5)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    lower = armature.data.edit_bones.new("Lower")
    lower.head, lower.tail = (0, 0, 0), (0, 0, 1)
    upper = armature.data.edit_bones.new("Upper")
    upper.head, upper.tail, upper.parent = (0, 0, 1), (0.1, 0, 2), lower
    bpy.ops.object.mode_set(mode="OBJECT")
    skinned = add("Skinned", column("SkinnedMesh", 5), armature)
    skinned.location = (0.1, 0, 0)
    groups = [skinned.vertex_groups.new(name=name) for name in ("Lower", "Upper")]
    for vertex in skinned.data.vertices:
        weight = min(max(vertex.co.z - 0.5, 0.0), 1.0)
        for group, share in zip(groups, (1 - weight, weight)):
            if share > 0:
                group.add([vertex.index], share, "REPLACE")
    skinned.modifiers.new("Armature", "ARMATURE").object = armature
    for name, turns in (("Lower", [(1, (0, 0, 0)), (FRAMES, (0.3, 0, 0.2))]),
                        ("Upper", [(1, (0, 0, 0)), (13, (1.0, 0, 0)), (FRAMES, (-0.5, 0.6, 0))])):
        bone = armature.pose.bones[name]
        bone.rotation_mode = "XYZ"
        key(bone, "rotation_euler", turns)

    shaped = add("Shaped", box("ShapedMesh", 0.4, 0.4, 0.4))
    shaped.location = (0, -3, 0.5)
    shaped.shape_key_add(name="Basis")
    for name, corner, end in (("Tall", 7, 1.0), ("Wide", 1, 0.6)):
        shape = shaped.shape_key_add(name=name)
        shape.data[corner].co.z += 0.7
        shape.data[corner].co.x += 0.2
        key(shape, "value", [(1, 0.0), (FRAMES, end)])

    camera = add("Eye", bpy.data.cameras.new("EyeLens"))
    key(camera, "location", [(1, (5, -5, 3)), (FRAMES, (6, -2, 2))])
    key(camera, "rotation_euler", [(1, (1.1, 0, 0.8)), (FRAMES, (1.3, 0.1, 1.2))])

    # Everything moves at a constant rate between its keys; Blender 4.4 and later keep curves in layers.
    for action in bpy.data.actions:
        for curve in action.fcurves:
            for point in curve.keyframe_points:
                point.interpolation = "LINEAR"
    scene.frame_set(1)


def usd(name, **settings):
    bpy.ops.wm.usd_export(filepath=str(FOLDER / name), export_animation=True, export_hair=False, export_uvmaps=False,
                          export_normals=False, export_materials=False, export_lights=False, convert_world_material=False,
                          export_custom_properties=False, **settings)


def main():
    FOLDER.mkdir(parents=True, exist_ok=True)
    build()
    bpy.ops.wm.alembic_export(filepath=str(FOLDER / "scene.abc"), start=1, end=FRAMES, uvs=False, normals=False, packuv=False,
                              export_hair=False, export_particles=False, as_background_job=False)
    baked = {"export_armatures": False, "export_shapekeys": False}
    usd("baked.usda", **baked)
    usd("baked.usdc", **baked)
    usd("y_up.usdc", convert_orientation=True, **baked)
    for name in ("skeleton.usda", "skeleton.usdc", "skeleton.usdz"):
        usd(name, export_armatures=True, export_shapekeys=True, only_deform_bones=False)
    for path in sorted(FOLDER.iterdir()):
        print(f"{path.stat().st_size:8} {path.name}")
    print(sum(path.stat().st_size for path in FOLDER.iterdir()), "bytes", file=sys.stderr)


if __name__ == "__main__":
    main()
