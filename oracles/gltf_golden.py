#!/usr/bin/env python3
"""Writes small glTF files, and what a numpy reading of the specification finds in them.

    pip install numpy
    python oracles/gltf_golden.py

makes crates/froufrou/tests/fixtures/gltf/NAME.gltf or .glb with NAME.json: paths, transforms,
vertices and faces at a few moments of every clip; and, for the glTF files in $FROUFROU_DATA/anim (or
../shared/data/anim beside the repository), data/NAME.json with every n-th vertex.
"""

import base64
import json
import os
import struct
from pathlib import Path

import numpy as np

from gltf_oracle import TYPES, File

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "crates/froufrou/tests/fixtures/gltf"
CODES = {np.dtype(name): code for code, name in TYPES.items()}


class Writer:
    """Builds a document whose arrays all lie in one buffer."""

    def __init__(self, **rest):
        self.json = {"asset": {"version": "2.0", "generator": "froufrou's oracles"}, **rest}
        self.binary = b""

    def view(self, data, **rest):
        self.binary += b"\0" * (-len(self.binary) % 4)
        views = self.json.setdefault("bufferViews", [])
        views.append({"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data), **rest})
        self.binary += data
        return len(views) - 1

    def accessor(self, kind, component, values, stride=None, normalized=False, lead=0):
        values = np.array(values, component)
        values = values.reshape(len(values), -1)
        if stride:
            # Among other values: `lead` bytes before and some after each element.
            rows = [b"\xee" * lead + row.tobytes() for row in values]
            data = b"".join(row + b"\xee" * (stride - len(row)) for row in rows)
            view = self.view(data, byteStride=stride)
        else:
            view = self.view(values.tobytes())
        entry = {"bufferView": view, "componentType": CODES[values.dtype], "count": len(values), "type": kind}
        if lead:
            entry["byteOffset"] = lead
        if normalized:
            entry["normalized"] = True
        return self.add("accessors", entry)

    def sparse(self, kind, component, count, places, values, base=None):
        values = np.array(values, component)
        entry = {} if base is None else {"bufferView": self.json["accessors"][base]["bufferView"]}
        entry |= {
            "componentType": CODES[values.dtype],
            "count": count,
            "type": kind,
            "sparse": {
                "count": len(places),
                "indices": {"bufferView": self.view(np.array(places, "u1").tobytes()), "componentType": 5121},
                "values": {"bufferView": self.view(values.tobytes())},
            },
        }
        return self.add("accessors", entry)

    def add(self, name, entry):
        self.json.setdefault(name, []).append(entry)
        return len(self.json[name]) - 1

    def clip(self, name, *channels):
        """Channels of node, path, interpolation, times, accessor of values."""
        samplers = [{"input": t, "output": v, "interpolation": i} for _, _, i, t, v in channels]
        targets = [{"sampler": s, "target": {"node": c[0], "path": c[1]}} for s, c in enumerate(channels)]
        self.add("animations", {"name": name, "channels": targets, "samplers": samplers})

    def times(self, *times):
        return self.accessor("SCALAR", "<f4", times)

    def write(self, name, how):
        FOLDER.mkdir(parents=True, exist_ok=True)
        self.json["buffers"] = [{"byteLength": len(self.binary)}]
        if how == "binary":
            text = json.dumps(self.json, separators=(",", ":")).encode()
            text += b" " * (-len(text) % 4)
            binary = self.binary + b"\0" * (-len(self.binary) % 4)
            chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
            chunks += struct.pack("<II", len(binary), 0x004E4942) + binary
            path = FOLDER / f"{name}.glb"
            path.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks)
            return path
        if how == "text":
            data = base64.b64encode(self.binary).decode()
            self.json["buffers"][0]["uri"] = "data:application/octet-stream;base64," + data
        else:
            self.json["buffers"][0]["uri"] = f"{name}%20data.bin"
            (FOLDER / f"{name} data.bin").write_bytes(self.binary)
        path = FOLDER / f"{name}.gltf"
        path.write_text(json.dumps(self.json, separators=(",", ":")) + "\n")
        return path


TETRAHEDRON = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
OUTSIDE = [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]


def turns(rng, count):
    q = rng.normal(size=(count, 4))
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def interpolation():
    """Every kind of track in every interpolation, on a chain of nodes; two clips; cameras."""
    w, rng = Writer(), np.random.default_rng(1)
    positions = w.accessor("VEC3", "<f4", TETRAHEDRON)
    w.add("meshes", {"primitives": [{"attributes": {"POSITION": positions}, "indices": w.accessor("SCALAR", "u1", OUTSIDE)}]})
    w.add("cameras", {"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}})
    matrix = np.eye(4)
    matrix[:3, :3] = [[1, 0.2, 0], [0, 2, 0.3], [0.1, 0, 1.5]]
    matrix[:3, 3] = [1, 2, 3]
    nodes = [
        {"name": "top", "children": [1, 4], "translation": [1, 2, 3]},
        {"name": "middle", "children": [2], "matrix": matrix.T.ravel().tolist()},
        {"name": "low", "children": [3], "scale": [1, 2, 0.5], "rotation": turns(rng, 1)[0].tolist()},
        {"name": "leaf", "mesh": 0},
        {"name": "eye", "camera": 0, "rotation": [0, 0.6, 0, 0.8]},
    ]
    for node in nodes:
        w.add("nodes", node)
    w.add("scenes", {"nodes": [0]})
    few, many = w.times(0.25, 0.75, 1.5), w.times(0, 0.1, 0.3, 0.7, 1.1, 1.3)
    vectors = lambda count: w.accessor("VEC3", "<f4", rng.normal(size=(count, 3)))
    rotations = w.accessor("VEC4", "<f4", turns(rng, 6))
    short = w.accessor("VEC4", "<i2", np.round(turns(rng, 3) * 32767), normalized=True)
    spline = rng.normal(size=(3, 3, 4))
    spline[:, 1] = turns(rng, 3)
    spline = w.accessor("VEC4", "<f4", spline.reshape(9, 4))
    w.clip(
        "all",
        (0, "translation", "LINEAR", few, vectors(3)),
        (0, "rotation", "LINEAR", many, rotations),
        (0, "scale", "CUBICSPLINE", few, vectors(9)),
        (2, "translation", "CUBICSPLINE", many, vectors(18)),
        (2, "rotation", "CUBICSPLINE", few, spline),
        (3, "scale", "STEP", many, vectors(6)),
        (4, "rotation", "LINEAR", few, short),
    )
    w.clip("", (3, "translation", "STEP", few, vectors(3)), (4, "rotation", "STEP", many, rotations))
    return w.write("interpolation", "text")


def skin():
    """A tube on three joints with two sets of weights, morphed before it is bent."""
    w, rng = Writer(), np.random.default_rng(2)
    rings, around = 7, 6
    angle = np.arange(around) / around * 2 * np.pi
    ring = np.c_[np.cos(angle), np.zeros(around), np.sin(angle)] * 0.5
    positions = np.concatenate([ring + [0, y, 0] for y in np.linspace(0, 3, rings)])
    corners = []
    for r in range(rings - 1):
        for i in range(around):
            a, b = r * around + i, r * around + (i + 1) % around
            corners += [a, a + around, b, b, a + around, b + around]
    count = len(positions)
    pull = rng.random((count, 8)) * (rng.random((count, 8)) < 0.6)
    pull[:, 0] += 0.1
    pull /= pull.sum(axis=1, keepdims=True)
    which = rng.integers(0, 3, (count, 8))
    # Joints of no weight may name what is not there.
    which[pull == 0] = 200
    attributes = {
        "POSITION": w.accessor("VEC3", "<f4", positions, stride=20, lead=4),
        "JOINTS_0": w.accessor("VEC4", "u1", which[:, :4]),
        "WEIGHTS_0": w.accessor("VEC4", "u1", np.round(pull[:, :4] * 255), normalized=True),
        "JOINTS_1": w.accessor("VEC4", "<u2", which[:, 4:]),
        "WEIGHTS_1": w.accessor("VEC4", "<u2", np.round(pull[:, 4:] * 65535), normalized=True),
    }
    places = [1, 5, 8, 30]
    targets = [
        {"POSITION": w.accessor("VEC3", "<f4", rng.normal(size=(count, 3)) * 0.1)},
        {"NORMAL": attributes["POSITION"]},
        {"POSITION": w.sparse("VEC3", "<f4", count, places, rng.normal(size=(4, 3)))},
    ]
    indices = w.accessor("SCALAR", "<u2", corners)
    w.add("meshes", {"primitives": [{"attributes": attributes, "indices": indices, "targets": targets}], "weights": [0.5, 0, 1]})
    binds = np.array([np.eye(4)] * 3)
    binds[:, 1, 3] = [0, -1, -2]
    w.add("skins", {"joints": [2, 3, 4], "inverseBindMatrices": w.accessor("MAT4", "<f4", binds.transpose(0, 2, 1))})
    for node in [
        {"name": "body", "mesh": 0, "skin": 0, "translation": [100, 0, 0], "scale": [-1, 1, 1], "weights": [0.2, 0, -0.5]},
        {"name": "rig", "children": [2], "translation": [0, 0, 5], "scale": [2, 2, 2]},
        {"name": "hip", "children": [3]},
        {"name": "knee", "children": [4], "translation": [0, 1, 0]},
        {"name": "foot", "translation": [0, 1, 0], "rotation": [0.6, 0, 0, 0.8]},
    ]:
        w.add("nodes", node)
    w.add("scenes", {"nodes": [1, 0]})
    w.json["scene"] = 0
    times, late = w.times(0, 0.5, 1), w.times(0.2, 0.9)
    rotations = lambda: w.accessor("VEC4", "<f4", turns(rng, 3))
    w.clip(
        "bend",
        (2, "rotation", "LINEAR", times, rotations()),
        (3, "rotation", "LINEAR", times, rotations()),
        (3, "scale", "LINEAR", late, w.accessor("VEC3", "<f4", [[1, 1, 1], [1.5, 0.5, 1]])),
        (0, "weights", "CUBICSPLINE", late, w.accessor("SCALAR", "<f4", rng.normal(size=18))),
    )
    w.clip("stand", (1, "translation", "LINEAR", times, w.accessor("VEC3", "<f4", rng.normal(size=(3, 3)))))
    w.clip("swell", (0, "weights", "LINEAR", times, w.accessor("SCALAR", "i1", rng.integers(-127, 128, 9), normalized=True)))
    return w.write("skin", "binary")


def quantised():
    """KHR_mesh_quantization: integers of every legal kind, in a file beside."""
    extension = ["KHR_mesh_quantization"]
    w, rng = Writer(extensionsUsed=extension, extensionsRequired=extension), np.random.default_rng(3)
    for component, low, high, normalized in [
        ("i1", -128, 128, True),
        ("u1", 0, 256, False),
        ("<i2", -32768, 32768, False),
        ("<u2", 0, 65536, True),
    ]:
        positions = w.accessor("VEC3", component, rng.integers(low, high, (9, 3)), stride=8, normalized=normalized)
        delta = "i1" if component[-1] == "1" else "<i2"
        target = w.accessor("VEC3", delta, rng.integers(-100, 100, (9, 3)), stride=8, normalized=normalized)
        primitive = {"attributes": {"POSITION": positions}, "targets": [{"POSITION": target}]}
        mesh = w.add("meshes", {"primitives": [primitive], "weights": [0.75]})
        scale = 1.0 if normalized else 1e-3
        w.add("nodes", {"mesh": mesh, "scale": [scale] * 3, "translation": [mesh, 0, 0]})
    return w.write("quantised", "beside")


def primitives():
    """All modes, sparse arrays, mirrors, several primitives, names."""
    w = Writer(extensionsUsed=["KHR_materials_unlit"], extensionsRequired=["KHR_materials_unlit"])
    solid = w.accessor("VEC3", "<f4", TETRAHEDRON)
    outside = w.accessor("SCALAR", "<u4", OUTSIDE)
    tetrahedron = w.add("meshes", {"primitives": [{"attributes": {"POSITION": solid}, "indices": outside}]})
    grid = w.accessor("VEC3", "<f4", [[x, y, 0] for y in range(3) for x in range(4)])
    strip = [0, 4, 1, 5, 2, 6, 3, 7, 7, 4, 4, 8, 5, 9, 6, 10, 7, 11]
    bulge = w.sparse("VEC3", "<f4", 12, [5, 6], [[1, 1, 1], [2, 1, 1]], base=grid)
    lone = w.sparse("VEC3", "<f4", 5, [1, 2, 4], [[1, 0, 0], [1, 1, 0], [0, 1, 0]])
    index = lambda values: w.accessor("SCALAR", "u1", values)
    several = w.add(
        "meshes",
        {
            "primitives": [
                {"attributes": {"POSITION": grid}, "indices": index(strip), "mode": 5},
                {"attributes": {"POSITION": bulge}, "indices": index([5, 0, 1, 2, 6, 10]), "mode": 6},
                # The same vertices again, and lines and points on them.
                {"attributes": {"POSITION": grid}, "indices": index([0, 1, 4, 1, 5, 4])},
                {"attributes": {"POSITION": grid}, "mode": 0},
                {"attributes": {"POSITION": lone}, "indices": index([0, 1, 1, 2]), "mode": 1},
                {"attributes": {"POSITION": lone}, "mode": 6},
                {"attributes": {"POSITION": lone}, "mode": 5},
                {"attributes": {"NORMAL": grid}},
            ]
        },
    )
    nothing = w.add("meshes", {"primitives": [{"attributes": {}}]})
    for node in [
        {"name": "plain", "mesh": tetrahedron, "rotation": [0, 0.6, 0, 0.8]},
        {"name": "mirror", "mesh": tetrahedron, "scale": [-1, 2, 1], "children": [2, 3]},
        {"name": "again", "mesh": tetrahedron, "scale": [1, 1, -0.5], "translation": [3, 0, 0]},
        {"name": "again", "mesh": tetrahedron},
        {"mesh": several, "translation": [0, 0, -2]},
        {"name": "a/b", "mesh": nothing},
        {"name": "unseen", "mesh": tetrahedron},
    ]:
        w.add("nodes", node)
    w.json["scenes"] = [{"nodes": [6]}, {"nodes": [4, 0, 1, 5]}]
    w.json["scene"] = 1
    return w.write("primitives", "text")


def golden(path, every, faces):
    """What the file holds; every so-manieth vertex."""
    file = File(path)
    objects = file.objects()
    found = {"paths": [p for _, p in objects], "kinds": [file.kind(n) for n, _ in objects], "clips": []}
    clips = file.clips()
    for clip, (name, start, end) in list(enumerate(clips)) or [(None, (None, 0.0, 0.0))]:
        span = end - start
        moments = [start - 1, start, start + 0.317 * span, start + 0.5 * span, start + 0.9031 * span, end + 1]
        # As they are written: a fast vertex moves far in the digits that are rounded off.
        moments = [round(float(moment), 6) for moment in moments] if clips else [0.0]
        entry = {
            "name": name,
            "start_s": start,
            "end_s": end,
            "key_times": [file.key_times(clip, n) for n, _ in objects],
            "transforms": [],
            "meshes": [],
        }
        for index, (node, _) in enumerate(objects):
            # Of many nodes some; they are all under the vertices too.
            for time in moments if len(objects) < 12 else moments[2:4]:
                entry["transforms"].append([index, time, file.world(clip, node, time)[:3].ravel().tolist()])
            if file.kind(node) == "Mesh":
                for time in moments:
                    positions, triangles = file.mesh(clip, node, time)
                    entry["meshes"].append([index, time, len(positions), positions[::every].ravel().tolist()])
        found["clips"].append(entry)
    meshes = [(i, n) for i, (n, _) in enumerate(objects) if file.kind(n) == "Mesh"]
    triangles = [file.mesh(0 if clips else None, n, 0.0)[1] for _, n in meshes]
    found["face_counts"] = [[i, len(t)] for (i, _), t in zip(meshes, triangles)]
    found["faces"] = [[i, sum(t, [])] for (i, _), t in zip(meshes, triangles)] if faces else []
    return found


def short(value, digits):
    if isinstance(value, float):
        return round(float(value), digits)
    if isinstance(value, list):
        return [short(item, digits) for item in value]
    if isinstance(value, dict):
        return {key: short(item, digits) for key, item in value.items()}
    return value


def write(path, value):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(value, separators=(",", ":")) + "\n")
    print(f"{path.name:32} {path.stat().st_size / 1000:8.1f} kB")


if __name__ == "__main__":
    for path in [interpolation(), skin(), quantised(), primitives()]:
        write(path.with_suffix(".json"), short(golden(path, 1 if path.stem != "skin" else 5, True), 7))
    anim = Path(os.environ.get("FROUFROU_DATA", ROOT.parent / "shared/data")) / "anim"
    for name, every in [("Fox.glb", 149), ("MorphStressTest.gltf", 37)]:
        if (anim / name).exists():
            write(FOLDER / "data" / f"{name.split('.')[0]}.json", short(golden(anim / name, every, False), 6))
        else:
            print(f"skipped: there is no {anim / name}")
