#!/usr/bin/env python3
"""Writes small Alembic archives and the numbers alembic3d reads from them.

    pip install alembic3d==1.8.12.1 numpy
    python oracles/alembic_fixtures.py

Every `NAME.abc` in crates/froufrou/tests/fixtures/alembic gets a `NAME.json`: for each object its
path, kind and key times, and at some of them its world matrix (row-major, column vectors), world
positions and faces (clockwise, as Alembic stores them). All of it is evaluated by the C++ library,
which knows nothing of our reader.
"""

import json
import math
from pathlib import Path

import imath
from alembic3d import Abc, AbcCoreAbstract, AbcGeom

import alembic_oracle

FOLDER = Path(__file__).parent.parent / "crates/froufrou/tests/fixtures/alembic"
V3 = imath.V3d
Op = AbcGeom.XformOperationType

CUBE_POINTS = [(x, y, z) for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)]
# Clockwise from outside, as Alembic has it.
CUBE_FACES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]


def archive(name):
    return Abc.OArchive(str(FOLDER / f"{name}.abc"))


def uniform(rate, start=0.0):
    return AbcCoreAbstract.TimeSampling(1.0 / rate, start)


def sampled(kind, times):
    vector = AbcCoreAbstract.TimeVector()
    vector.extend(times)
    return AbcCoreAbstract.TimeSampling(kind, vector)


def acyclic(times):
    flag = AbcCoreAbstract.AcyclicFlag.kAcyclic
    return sampled(AbcCoreAbstract.TimeSamplingType(flag), times)


def cyclic(times, period):
    return sampled(AbcCoreAbstract.TimeSamplingType(len(times), period), times)


def xform(parent, name, samples, sampling=None, inherits=True):
    """A transform from lists of (operation, *values); `inherits` is one flag or one per sample."""
    out = AbcGeom.OXform(parent, name)
    if sampling is not None:
        out.getSchema().setTimeSampling(sampling)
    for index, operations in enumerate(samples):
        sample = AbcGeom.XformSample()
        for kind, *values in operations:
            sample.addOp(AbcGeom.XformOp(kind, 0), *values)
        sample.setInheritsXforms(inherits if isinstance(inherits, bool) else inherits[index])
        out.getSchema().set(sample)
    return out


def mesh(parent, name, samples, sampling=None):
    """A mesh from (points, faces) per sample; faces may be None for those of the sample before."""
    out = AbcGeom.OPolyMesh(parent, name)
    if sampling is not None:
        out.getSchema().setTimeSampling(sampling)
    for points, faces in samples:
        array = imath.V3fArray(len(points))
        for i, point in enumerate(points):
            array[i] = imath.V3f(*point)
        if faces is None:
            sample = AbcGeom.OPolyMeshSchemaSample(array)
        else:
            sample = AbcGeom.OPolyMeshSchemaSample(
                array, ints([i for face in faces for i in face]), ints([len(face) for face in faces])
            )
        out.getSchema().set(sample)
    return out


def ints(values):
    array = imath.IntArray(len(values))
    for i, value in enumerate(values):
        array[i] = value
    return array


def cube(parent, name="cube"):
    return mesh(parent, name, [(CUBE_POINTS, CUBE_FACES)])


def scaled(matrix, factor):
    rows = [[matrix[i][j] * (factor if i < 3 else 1) for j in range(4)] for i in range(4)]
    return imath.M44d(*[value for row in rows for value in row])


def shifted(amount, points=CUBE_POINTS):
    return [(x + amount * (i + 1) * 0.1, y - amount, z * (1 + amount)) for i, (x, y, z) in enumerate(points)]


def operations():
    """Each operation alone and constant, each moving, and a long stack with one moving channel."""
    top = archive("operations")
    root = top.getTop()
    turned = AbcGeom.XformSample()
    turned.addOp(AbcGeom.XformOp(Op.kTranslateOperation, 0), V3(1, -2, 3))
    turned.addOp(AbcGeom.XformOp(Op.kRotateOperation, 0), V3(0.3, -0.7, 1.1), 65.0)
    matrix = turned.getMatrix()
    matrix[0][1] += 0.25  # some shear
    alone = {
        "translate": [Op.kTranslateOperation, V3(1, 2, 3)],
        "scale": [Op.kScaleOperation, V3(2, 0.5, -1.5)],
        "rotate": [Op.kRotateOperation, V3(1, 2, -2), 50.0],
        "matrix": [Op.kMatrixOperation, matrix],
        "rotate_x": [Op.kRotateXOperation, 30.0],
        "rotate_y": [Op.kRotateYOperation, -40.0],
        "rotate_z": [Op.kRotateZOperation, 400.0],
    }
    for name, operation in alone.items():
        cube(xform(root, name, [[operation]]))
    film = uniform(24, 1 / 24)
    frames = range(4)
    moving = {
        "translate": lambda f: [Op.kTranslateOperation, V3(f, f * f, -f)],
        "scale": lambda f: [Op.kScaleOperation, V3(1 + f, 1, 1 / (1 + f))],
        "rotate": lambda f: [Op.kRotateOperation, V3(0, 1, 1), 20.0 * f],
        "matrix": lambda f: [Op.kMatrixOperation, scaled(matrix, 1 + 0.1 * f)],
        "rotate_x": lambda f: [Op.kRotateXOperation, 10.0 * f],
        "rotate_y": lambda f: [Op.kRotateYOperation, -10.0 * f],
        "rotate_z": lambda f: [Op.kRotateZOperation, 100.0 * f],
    }
    for name, operation in moving.items():
        xform(root, "moving_" + name, [[operation(f)] for f in frames], film)
    stack = [
        [
            [Op.kTranslateOperation, V3(1, 2, 3)],
            [Op.kTranslateOperation, V3(0.1, 0.2, 0.3)],
            [Op.kRotateZOperation, 10.0],
            [Op.kRotateYOperation, 20.0 + (5.0 * f)],
            [Op.kRotateXOperation, 30.0],
            [Op.kScaleOperation, V3(1, 2, 3)],
            [Op.kMatrixOperation, matrix],
            [Op.kTranslateOperation, V3(-0.1, -0.2, -0.3)],
        ]
        for f in frames
    ]
    cube(xform(root, "stack", stack, film))
    xform(root, "nothing_written", [])
    xform(root, "no_operations", [[]])


def many_operations():
    """More than 256 numbers, which are stored as an array instead of a scalar."""
    root = archive("many_operations").getTop()
    stack = lambda f: [[Op.kTranslateOperation, V3(0.01 * i, f, 0)] for i in range(90)]
    xform(root, "long", [stack(f) for f in range(3)], uniform(10))


def nesting():
    """Transforms under transforms, with and without inheritance, of equal and other samplings."""
    root = archive("nesting").getTop()
    turn = lambda f, rate: [[Op.kTranslateOperation, V3(f * 0.1, 0, 1)], [Op.kRotateYOperation, f * rate]]
    film = uniform(24)
    outer = xform(root, "outer", [turn(f, 7.0) for f in range(6)], film)
    inner = xform(outer, "inner", [turn(f, -11.0) for f in range(6)], film)
    cube(inner)
    still = xform(inner, "still", [[[Op.kScaleOperation, V3(1, 2, 3)]]])
    cube(still)
    free = xform(inner, "free", [[[Op.kTranslateOperation, V3(5, 5, 5)]]], inherits=False)
    cube(free)
    cube(xform(free, "below_free", [turn(f, 3.0) for f in range(4)], uniform(12)))
    xform(inner, "other_rate", [turn(f, 3.0) for f in range(4)], uniform(10))
    flags = [True, True, False, False, True, True]
    cube(xform(inner, "sometimes", [turn(f, 5.0) for f in range(6)], film, flags))


def topologies():
    """A mesh that stands still, one that moves, one whose faces change."""
    root = archive("topologies").getTop()
    film = uniform(25, 0.04)
    cube(root, "constant")
    mesh(
        root,
        "homogeneous",
        [(shifted(0.2 * f), CUBE_FACES if f == 0 else None) for f in range(5)],
        film,
    )
    pyramid = ([(0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1), (0.5, 1, 0.5)], [[0, 1, 2, 3], [0, 4, 1], [1, 4, 2], [2, 4, 3], [3, 4, 0]])
    pentagon = ([(math.cos(a), 0.0, math.sin(a)) for a in (0, 1, 2, 3, 4)], [[0, 1, 2, 3, 4]])
    mesh(
        root,
        "heterogeneous",
        [(CUBE_POINTS, CUBE_FACES), (shifted(0.3), CUBE_FACES), pyramid, pentagon, (shifted(1.0, pentagon[0]), pentagon[1])],
        film,
    )
    # As many points before and after, but other faces: nothing may be interpolated.
    mesh(root, "rewired", [(CUBE_POINTS, CUBE_FACES), (shifted(1.0), list(reversed(CUBE_FACES)))], film)
    cage = AbcGeom.OSubD(root, "subdivision")
    points = imath.V3fArray(8)
    for i, point in enumerate(CUBE_POINTS):
        points[i] = imath.V3f(*point)
    cage.getSchema().set(
        AbcGeom.OSubDSchemaSample(points, ints(sum(CUBE_FACES, [])), ints([4] * 6))
    )


def samplings():
    """Cyclic and acyclic times, on meshes and on transforms, and both together."""
    root = archive("samplings").getTop()
    shutter = cyclic([0.0, 0.01, 0.03], 0.1)
    uneven = acyclic([-0.5, 0.0, 0.125, 1.0, 1.5, 4.0])
    move = lambda f: [[Op.kTranslateOperation, V3(f, 0.5 * f * f, 0)]]
    moving = lambda n: [(shifted(0.1 * f), CUBE_FACES if f == 0 else None) for f in range(n)]
    mesh(root, "cyclic", moving(8), shutter)
    mesh(root, "acyclic", moving(6), uneven)
    mesh(xform(root, "cyclic_move", [move(f) for f in range(7)], shutter), "acyclic", moving(6), uneven)
    # Fewer samples than the sampling has times.
    xform(root, "acyclic_short", [move(f) for f in range(4)], uneven)


def instances():
    """Instances of a mesh and of a group, below moving transforms, and of a group that holds one."""
    root = archive("instances").getTop()
    film = uniform(24)
    move = lambda f, x: [[Op.kTranslateOperation, V3(x, 0.1 * f, 0)], [Op.kRotateZOperation, 5.0 * f]]
    original = xform(root, "original", [move(f, 1.0) for f in range(4)], film)
    solid = cube(original)
    elsewhere = xform(root, "elsewhere", [move(f, 10.0) for f in range(3)], film)
    assert elsewhere.addChildInstance(solid, "copy_of_cube")
    assert elsewhere.addChildInstance(original, "copy_of_original")
    assert root.addChildInstance(elsewhere, "copy_of_elsewhere")


def repeats():
    """Samples that equal those before: at the start, in the middle, at the end, and all of them."""
    root = archive("repeats").getTop()
    film = uniform(24)
    patterns = {
        "late": [0, 0, 0, 0, 1, 2, 3],
        "early": [0, 1, 2, 2, 2, 2, 2],
        "middle": [0, 0, 1, 1, 1, 2, 2],
        "last": [0, 0, 0, 0, 0, 0, 1],
        "second": [0, 1, 1, 1, 1, 1, 1],
        "back": [0, 1, 0, 1, 0, 0, 0],
        "never": [0, 0, 0, 0, 0, 0, 0],
        "always": [0, 1, 2, 3, 4, 5, 6],
    }
    for name, pattern in patterns.items():
        moves = [[[Op.kTranslateOperation, V3(v, 0, 0)]] for v in pattern]
        mesh(
            xform(root, "move_" + name, moves, film),
            "shape",
            [(shifted(0.1 * v), CUBE_FACES if f == 0 else None) for f, v in enumerate(pattern)],
            film,
        )


def cameras():
    """A still camera, and one that moves and zooms."""
    root = archive("cameras").getTop()
    film = uniform(24)
    still = AbcGeom.OCamera(xform(root, "stand", [[[Op.kTranslateOperation, V3(0, 1.6, 3)]]]), "still")
    sample = AbcGeom.CameraSample()
    still.getSchema().set(sample)
    move = [[[Op.kTranslateOperation, V3(f, 2, 0)], [Op.kRotateYOperation, 15.0 * f]] for f in range(5)]
    zoom = AbcGeom.OCamera(xform(root, "dolly", move, film), "zoom")
    zoom.getSchema().setTimeSampling(film)
    for frame in range(5):
        sample = AbcGeom.CameraSample()
        sample.setFocalLength(35.0 + 10 * frame)
        sample.setHorizontalAperture(2.4)
        sample.setVerticalAperture(1.35)
        zoom.getSchema().set(sample)


def edges():
    """Empty and degenerate meshes, one frame, a face without corners, other schemas."""
    root = archive("edges").getTop()
    film = uniform(24)
    mesh(root, "empty", [([], [])])
    mesh(root, "never_set", [])
    mesh(root, "sometimes_empty", [(CUBE_POINTS, CUBE_FACES), ([], []), (CUBE_POINTS, CUBE_FACES)], film)
    mesh(root, "points_without_faces", [(CUBE_POINTS, [])])
    mesh(root, "degenerate", [([(1, 1, 1)] * 3, [[0, 1, 2], [0, 0, 0], [2, 1]])])
    mesh(root, "hollow_face", [([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [[], [0, 1, 2], []])])
    mesh(xform(root, "one_frame", [[[Op.kTranslateOperation, V3(1, 0, 0)]]], film), "cube", [(CUBE_POINTS, CUBE_FACES)], film)
    AbcGeom.OPoints(root, "points")
    cube(AbcGeom.OCurves(xform(root, "hair", [[[Op.kTranslateOperation, V3(0, 7, 0)]]]), "curves"))
    child = Abc.OObject(root, "no_schema")
    cube(child)
    xform(root, "größe", [[[Op.kScaleOperation, V3(2, 2, 2)]]])


def beside():
    """A sheet dragged along the floor, with forces beside its points: one number each, vectors, and named by indices."""
    root = archive("beside").getTop()
    film, side = uniform(24), 5
    corners = [(x / 4 - 0.5, 0.005, z / 4 - 0.5) for z in range(side) for x in range(side)]
    faces = [
        [i + z * side for i in (x, x + 1, x + 1 + side, x + side)] for z in range(side - 1) for x in range(side - 1)
    ]
    frames = [([(x + 0.4 * f / 24, y, z) for x, y, z in corners], faces if f == 0 else None) for f in range(24)]
    out = mesh(root, "sheet", frames, film)
    params = out.getSchema().getArbGeomParams()
    vertex = AbcGeom.GeometryScope.kVertexScope
    forces = AbcGeom.OFloatGeomParam(params, "force", False, vertex, 1)
    forces.setTimeSampling(film)
    for frame in range(24):
        values = imath.FloatArray(side * side)
        for i in range(side * side):
            values[i] = (0.02 if frame < 12 else 0.08) * (1 + i % side)
        forces.set(AbcGeom.OFloatGeomParamSample(values, vertex))
    vectors = imath.V3fArray(side * side)
    for i in range(side * side):
        vectors[i] = imath.V3f(0.1 * i, -0.2, 0.05 * i)
    pushes = AbcGeom.OV3fGeomParam(params, "push", False, vertex, 1)
    pushes.set(AbcGeom.OV3fGeomParamSample(vectors, vertex))
    two, places = imath.FloatArray(2), imath.UnsignedIntArray(side * side)
    two[0], two[1] = 0.5, 2.5
    for i in range(side * side):
        places[i] = i % 2
    shared = AbcGeom.OFloatGeomParam(params, "shared", True, vertex, 1)
    shared.set(AbcGeom.OFloatGeomParamSample(two, places, vertex))


def golden_beside():
    """What alembic3d reads of the numbers beside the points, at some frames."""
    sheet = next(entry for entry in alembic_oracle.objects(FOLDER / "beside.abc") if entry.path == "/sheet")
    beside = sheet.schema.getArbGeomParams()
    kinds = {"force": AbcGeom.IFloatGeomParam, "push": AbcGeom.IV3fGeomParam, "shared": AbcGeom.IFloatGeomParam}
    found = []
    for name, kind in kinds.items():
        for frame in (0, 11, 12, 23):
            select = Abc.ISampleSelector(float(frame / 24))
            values = kind(beside, name).getExpandedValue(select).getVals()
            lengths = [v.length() if name == "push" else float(v) for v in values]
            found.append({"name": name, "time_s": frame / 24, "values": lengths})
    (FOLDER / "beside_numbers.json").write_text(json.dumps(round_all(found), separators=(",", ":")) + "\n")


def golden(name):
    """What alembic3d reads back."""
    found = []
    for entry in alembic_oracle.objects(FOLDER / f"{name}.abc"):
        times = entry.key_times()
        at = []
        for time in [time for time in times if entry.has_samples_at(time)][:7] or [0.0]:
            moment = {"time_s": time, "transform": entry.world(time).ravel().tolist()}
            if entry.kind == "Mesh":
                moment["positions"] = entry.positions(time).tolist()
                moment["face_vertices"], moment["face_sizes"] = entry.faces(time)
            if entry.kind == "Camera":
                moment["horizontal_field_of_view_rad"] = math.radians(
                    entry.schema.getValue(Abc.ISampleSelector(float(time))).getFieldOfView()
                )
            at.append(moment)
        found.append({"path": entry.path, "kind": entry.kind, "key_times_s": times, "at": at})
    (FOLDER / f"{name}.json").write_text(
        json.dumps(round_all(found), separators=(",", ":"), ensure_ascii=False) + "\n"
    )


def round_all(value):
    if isinstance(value, float):
        return round(value, 10)
    if isinstance(value, list):
        return [round_all(item) for item in value]
    if isinstance(value, dict):
        return {key: round_all(item) for key, item in value.items()}
    return value


if __name__ == "__main__":
    FOLDER.mkdir(parents=True, exist_ok=True)
    for write in (
        operations, many_operations, nesting, topologies, samplings, instances, repeats, cameras, edges, beside
    ):
        write()
        golden(write.__name__)
        size = sum((FOLDER / f"{write.__name__}.{end}").stat().st_size for end in ("abc", "json"))
        print(f"{write.__name__:20} {size / 1000:8.1f} kB")
    golden_beside()
