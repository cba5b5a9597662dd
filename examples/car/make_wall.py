"""Writes wall.gltf, a panel of 4 m x 3 m that turns about its upright axis, once in 4 s, for 8 s.

    python examples/car/make_wall.py

At 1 s, 3 s, 5 s and 7 s it stands as a mirror between the car and the listener's head: its normal halves the angle
between the ways to the two.
"""

import base64
import json
import math
import pathlib
import struct

CAR, HEAD, AXIS = (0.0, -10.0), (0.0, 0.0), (12.0, -12.0)  # x and z
WIDTH, HEIGHT = 4.0, 3.0
RATE, LENGTH, TURN, MIRROR = 24, 8.0, 4.0, 1.0  # keys a second; seconds: in all, a turn, the first mirror


def towards(point):
    x, z = point[0] - AXIS[0], point[1] - AXIS[1]
    return x / math.hypot(x, z), z / math.hypot(x, z)


def main():
    (ax, az), (bx, bz) = towards(CAR), towards(HEAD)
    normal = math.atan2(ax + bx, az + bz)  # as an angle about Y from +Z, which a quad in X and Y faces
    times = [k / RATE for k in range(int(LENGTH * RATE) + 1)]
    angles = [normal + 2 * math.pi * (t - MIRROR) / TURN for t in times]
    w, h = WIDTH / 2, HEIGHT / 2
    corners = [(-w, -h, 0), (w, -h, 0), (w, h, 0), (-w, h, 0)]
    parts = [
        struct.pack("<12f", *(c for corner in corners for c in corner)),
        struct.pack("<6H", 0, 1, 2, 0, 2, 3),
        struct.pack(f"<{len(times)}f", *times),
        b"".join(struct.pack("<4f", 0, math.sin(a / 2), 0, math.cos(a / 2)) for a in angles),
    ]
    views, begin = [], 0
    for part in parts:
        views.append({"buffer": 0, "byteOffset": begin, "byteLength": len(part)})
        begin += len(part)
    wall = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "wall", "mesh": 0, "translation": [AXIS[0], 1.6, AXIS[1]]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "animations": [
            {
                "name": "turning",
                "samplers": [{"input": 2, "output": 3, "interpolation": "LINEAR"}],
                "channels": [{"sampler": 0, "target": {"node": 0, "path": "rotation"}}],
            }
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [-w, -h, 0], "max": [w, h, 0]},
            {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"},
            {"bufferView": 2, "componentType": 5126, "count": len(times), "type": "SCALAR", "min": [0], "max": [LENGTH]},
            {"bufferView": 3, "componentType": 5126, "count": len(times), "type": "VEC4"},
        ],
        "bufferViews": views,
        "buffers": [
            {
                "byteLength": begin,
                "uri": "data:application/octet-stream;base64," + base64.b64encode(b"".join(parts)).decode(),
            }
        ],
    }
    (pathlib.Path(__file__).parent / "wall.gltf").write_text(json.dumps(wall, indent=1) + "\n")


if __name__ == "__main__":
    main()
