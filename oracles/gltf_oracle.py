"""Evaluates glTF 2.0 files in numpy, by the text of the specification: what a file's nodes and
vertices are at a time. Used by gltf_golden.py; it shares nothing with the reader it checks."""

import base64
import json
import struct
from pathlib import Path
from urllib.parse import unquote

import numpy as np

TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
GREATEST = {5120: 127.0, 5121: 255.0, 5122: 32767.0, 5123: 65535.0}


def unit(q):
    return q / np.linalg.norm(q)


def slerp(a, b, t):
    """Appendix C.4."""
    a, b = unit(a), unit(b)
    d = float(np.dot(a, b))
    angle = np.arccos(min(1.0, abs(d)))
    if angle < 1e-9:
        return unit(a + (np.copysign(1.0, d) * b - a) * t)
    s = np.copysign(1.0, d)
    return (np.sin(angle * (1 - t)) * a + s * np.sin(angle * t) * b) / np.sin(angle)


def rotation_matrix(q):
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


class File:
    def __init__(self, path):
        path = Path(path)
        data = path.read_bytes()
        binary = None
        if data[:4] == b"glTF":
            size = struct.unpack_from("<I", data, 12)[0]
            self.json = json.loads(data[20 : 20 + size])
            if 20 + size < len(data):
                length = struct.unpack_from("<I", data, 20 + size)[0]
                binary = data[28 + size : 28 + size + length]
        else:
            self.json = json.loads(data)
        self.buffers = []
        for buffer in self.json.get("buffers", []):
            uri = buffer.get("uri")
            if uri is None:
                self.buffers.append(binary)
            elif uri.startswith("data:"):
                self.buffers.append(base64.b64decode(uri.split(",", 1)[1]))
            else:
                self.buffers.append((path.parent / unquote(uri)).read_bytes())
        self.nodes = self.json.get("nodes", [])
        self.parents = {c: i for i, n in enumerate(self.nodes) for c in n.get("children", [])}
        self.cached = {}

    def raw(self, view, offset, component, width, count):
        view = self.json["bufferViews"][view]
        kind = np.dtype(TYPES[component])
        element = kind.itemsize * width
        stride = view.get("byteStride", element)
        start = view.get("byteOffset", 0) + offset
        data = self.buffers[view["buffer"]]
        rows = [np.frombuffer(data, kind, width, start + i * stride) for i in range(count)]
        return np.array(rows).reshape(count, width)

    def accessor(self, index, normalized=None):
        if (index, normalized) in self.cached:
            return self.cached[index, normalized]
        a = self.json["accessors"][index]
        component, width, count = a["componentType"], WIDTHS[a["type"]], a["count"]
        if "bufferView" in a:
            values = self.raw(a["bufferView"], a.get("byteOffset", 0), component, width, count)
        else:
            values = np.zeros((count, width))
        if "sparse" in a:
            sparse = a["sparse"]
            where, what = sparse["indices"], sparse["values"]
            places = self.raw(where["bufferView"], where.get("byteOffset", 0), where["componentType"], 1, sparse["count"])
            values = values.copy().astype(TYPES[component])
            values[places[:, 0]] = self.raw(what["bufferView"], what.get("byteOffset", 0), component, width, sparse["count"])
        values = values.astype(np.float64)
        if (a.get("normalized", False) if normalized is None else normalized) and component in GREATEST:
            values = np.maximum(values / GREATEST[component], -1.0)
        self.cached[index, normalized] = values
        return values

    def clips(self):
        found = []
        for number, animation in enumerate(self.json.get("animations", [])):
            times = [self.accessor(s["input"])[:, 0] for s in animation["samplers"]]
            name = animation.get("name") or f"animation{number}"
            found.append((name, min(t[0] for t in times), max(t[-1] for t in times)))
        return found

    def channel(self, clip, node, path):
        """Times, values (keys × parts × width) and interpolation of what moves a node."""
        if clip is None:
            return None
        animation = self.json["animations"][clip]
        for channel in animation["channels"]:
            if channel["target"].get("node") == node and channel["target"]["path"] == path:
                sampler = animation["samplers"][channel["sampler"]]
                times = self.accessor(sampler["input"])[:, 0]
                mode = sampler.get("interpolation", "LINEAR")
                normalized = None if path in ("translation", "scale") else True
                values = self.accessor(sampler["output"], normalized)
                parts = 3 if mode == "CUBICSPLINE" else 1
                return times, values.reshape(len(times), parts, -1), mode
        return None

    def sampled(self, clip, node, path, time):
        """Appendix C."""
        found = self.channel(clip, node, path)
        if found is None:
            return None
        times, values, mode = found
        value = (lambda k: values[k, 1]) if mode == "CUBICSPLINE" else (lambda k: values[k, 0])
        finish = unit if path == "rotation" else (lambda v: v)
        if time <= times[0]:
            return finish(value(0))
        if time >= times[-1]:
            return finish(value(len(times) - 1))
        k = int(np.nonzero(times <= time)[0][-1])
        if mode == "STEP":
            return finish(value(k))
        td = times[k + 1] - times[k]
        t = (time - times[k]) / td
        if mode == "CUBICSPLINE":
            return finish(
                (2 * t**3 - 3 * t**2 + 1) * values[k, 1]
                + td * (t**3 - 2 * t**2 + t) * values[k, 2]
                + (-2 * t**3 + 3 * t**2) * values[k + 1, 1]
                + td * (t**3 - t**2) * values[k + 1, 0]
            )
        if path == "rotation":
            return slerp(value(k), value(k + 1), t)
        return (1 - t) * value(k) + t * value(k + 1)

    def local(self, clip, node, time):
        written = self.nodes[node]
        if "matrix" in written:
            return np.array(written["matrix"], float).reshape(4, 4).T
        part = lambda path, rest: next(
            v for v in (self.sampled(clip, node, path, time), written.get(path), rest) if v is not None
        )
        matrix = np.eye(4)
        scale = np.diag(np.array(part("scale", [1, 1, 1]), float))
        matrix[:3, :3] = rotation_matrix(unit(np.array(part("rotation", [0, 0, 0, 1]), float))) @ scale
        matrix[:3, 3] = part("translation", [0, 0, 0])
        return matrix

    def world(self, clip, node, time):
        above = self.parents.get(node)
        local = self.local(clip, node, time)
        return local if above is None else self.world(clip, above, time) @ local

    def objects(self):
        """Numbers of the nodes of the scene with their paths, parents before children."""
        if "scenes" in self.json:
            roots = self.json["scenes"][self.json.get("scene", 0)].get("nodes", [])
        else:
            roots = [i for i in range(len(self.nodes)) if i not in self.parents]
        found = []

        def walk(siblings, above):
            plain = [(self.nodes[n].get("name") or f"node{n}").replace("/", "_") for n in siblings]
            taken, names = set(plain), []
            for i, name in enumerate(plain):
                if name in plain[:i]:
                    k = 2
                    while f"{name}.{k}" in taken:
                        k += 1
                    name = f"{name}.{k}"
                    taken.add(name)
                names.append(name)
            for node, name in zip(siblings, names):
                found.append((node, f"{above}/{name}"))
                walk(self.nodes[node].get("children", []), f"{above}/{name}")

        walk(roots, "")
        return found

    def kind(self, node):
        written = self.nodes[node]
        return "Mesh" if "mesh" in written else "Camera" if "camera" in written else "Transform"

    def key_times(self, clip, node):
        """How many different moments move a node, its ancestors, or the joints of its skin."""
        times = set()

        def add(node, paths):
            for path in paths:
                found = self.channel(clip, node, path)
                if found is not None and len(found[0]) > 1:
                    times.update(np.round(found[0], 5))

        def up(node):
            while node is not None:
                add(node, ["translation", "rotation", "scale"])
                node = self.parents.get(node)

        up(node)
        if "mesh" in self.nodes[node]:
            add(node, ["weights"])
            if "skin" in self.nodes[node]:
                for joint in self.json["skins"][self.nodes[node]["skin"]]["joints"]:
                    up(joint)
        return len(times)

    def mesh(self, clip, node, time):
        """World positions and triangles."""
        written = self.nodes[node]
        mesh = self.json["meshes"][written["mesh"]]
        weights = self.sampled(clip, node, "weights", time)
        if weights is None:
            weights = written.get("weights", mesh.get("weights", []))
        world = self.world(clip, node, time)
        joints = None
        if "skin" in written:
            skin = self.json["skins"][written["skin"]]
            joints = np.array([self.world(clip, j, time) for j in skin["joints"]])
            if "inverseBindMatrices" in skin:
                binds = self.accessor(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
                joints = joints @ binds[: len(joints)]
        positions, triangles, known, count = [], [], {}, 0
        for primitive in mesh["primitives"]:
            attributes = primitive["attributes"]
            if "POSITION" not in attributes:
                continue
            targets = primitive.get("targets", [])
            key = json.dumps(
                [{k: v for k, v in attributes.items() if k[:4] in ("POSI", "JOIN", "WEIG")}]
                + [t.get("POSITION") for t in targets],
                sort_keys=True,
            )
            own = self.accessor(attributes["POSITION"])
            if key not in known:
                known[key] = count
                count += len(own)
                for weight, target in zip(weights, targets):
                    if "POSITION" in target:
                        own = own + weight * self.accessor(target["POSITION"])
                own = np.c_[own, np.ones(len(own))]
                if joints is None or "JOINTS_0" not in attributes:
                    positions.append((own @ world.T)[:, :3])
                else:
                    moved = np.zeros((len(own), 4))
                    s = 0
                    while f"JOINTS_{s}" in attributes:
                        which = self.accessor(attributes[f"JOINTS_{s}"]).astype(int)
                        pull = self.accessor(attributes[f"WEIGHTS_{s}"], True)
                        for i in range(4):
                            used = pull[:, i] != 0
                            matrices = joints[which[used, i]]
                            moved[used] += pull[used, i, None] * np.einsum("nij,nj->ni", matrices, own[used])
                        s += 1
                    # Homogeneous coordinates: weights count as parts of their sum.
                    positions.append(moved[:, :3] / moved[:, 3:])
            first = known[key]
            if "indices" in primitive:
                corners = self.accessor(primitive["indices"])[:, 0].astype(int)
            else:
                corners = np.arange(len(self.accessor(attributes["POSITION"])))
            mode = primitive.get("mode", 4)
            if mode == 4:
                faces = corners.reshape(-1, 3).tolist()
            elif mode == 5:
                v = corners.tolist()
                faces = [[v[i], v[i + (1 + i % 2)], v[i + (2 - i % 2)]] for i in range(len(v) - 2)]
                faces = [f for f in faces if len(set(f)) == 3]
            elif mode == 6:
                v = corners.tolist()
                faces = [[v[i + 1], v[i + 2], v[0]] for i in range(len(v) - 2)]
            else:
                faces = []
            triangles += [[c + first for c in face] for face in faces]
        if joints is None and np.linalg.det(world[:3, :3]) < 0:
            triangles = [[a, c, b] for a, b, c in triangles]
        return (np.concatenate(positions) if positions else np.zeros((0, 3))), triangles
