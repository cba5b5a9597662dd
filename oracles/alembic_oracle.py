"""World-space truth about an Alembic archive, evaluated by alembic3d (the C++ library itself).

Shared by the other alembic_*.py scripts here. Needs `pip install alembic3d numpy`.
"""

import imath
import numpy as np
from alembic3d import Abc, AbcGeom

EXISTING = Abc.WrapExistingFlag.kWrapExisting
KINDS = {
    "AbcGeom_Xform_v3": "Transform",
    "AbcGeom_PolyMesh_v1": "Mesh",
    "AbcGeom_SubD_v1": "Mesh",
    "AbcGeom_Camera_v1": "Camera",
}


def matrix(m44d):
    """An imath matrix (row vectors) as a 4x4 array for column vectors."""
    return np.array([[m44d[i][j] for j in range(4)] for i in range(4)]).T


def changes(prop):
    """The sample times of a property that changes, as a set of seconds."""
    if prop.isConstant() or prop.getNumSamples() < 2:
        return set()
    sampling = prop.getTimeSampling()
    return {sampling.getSampleTime(i) for i in range(prop.getNumSamples())}


class Object:
    """One object with its schema opened; `above` is the Object it hangs from, or None."""

    def __init__(self, iobject, above, path):
        self.path = path
        self.above = above
        self.kind = KINDS.get(iobject.getMetaData().get("schema"), "Other")
        schema = iobject.getMetaData().get("schema")
        self.schema = None
        parts = []
        if schema == "AbcGeom_Xform_v3":
            self.schema = AbcGeom.IXform(iobject, EXISTING).getSchema()
            compound = Abc.ICompoundProperty(iobject.getProperties(), ".xform")
            for name in (".vals", ".inherits"):
                if header(compound, name) is not None:
                    h = header(compound, name)
                    prop = Abc.IScalarProperty if h.isScalar() else Abc.IArrayProperty
                    parts.append(changes(prop(compound, name)))
        elif schema in ("AbcGeom_PolyMesh_v1", "AbcGeom_SubD_v1"):
            kind = AbcGeom.IPolyMesh if "Poly" in schema else AbcGeom.ISubD
            self.schema = kind(iobject, EXISTING).getSchema()
            for prop in (
                self.schema.getPositionsProperty(),
                self.schema.getFaceIndicesProperty(),
                self.schema.getFaceCountsProperty(),
            ):
                parts.append(changes(prop))
        elif schema == "AbcGeom_Camera_v1":
            self.schema = AbcGeom.ICamera(iobject, EXISTING).getSchema()
            compound = Abc.ICompoundProperty(iobject.getProperties(), ".geom")
            parts.append(changes(Abc.IScalarProperty(compound, ".core")))
        self.parts = [part for part in parts if part] + (above.parts if above else [])
        self.times = set().union(*self.parts)
        self.is_xform = schema == "AbcGeom_Xform_v3"

    def key_times(self):
        """Ascending; the same moment reached by two sums is one moment."""
        merged = []
        for time in sorted(self.times):
            if not merged or time - merged[-1] > 1e-9:
                merged.append(time)
        return merged

    def has_samples_at(self, time):
        """True if nothing would have to be interpolated, which the C++ library does not do."""
        return all(
            time <= min(part) or time >= max(part) or min(abs(time - t) for t in part) < 1e-9
            for part in self.parts
        )

    def world(self, time):
        """Local to world, 4x4 for column vectors."""
        world = np.eye(4)
        link = self
        while link is not None:
            if link.is_xform:
                sample = link.schema.getValue(Abc.ISampleSelector(float(time)))
                world = matrix(sample.getMatrix()) @ world
                if not sample.getInheritsXforms():
                    break
            link = link.above
        return world

    def local_positions(self, time):
        """Vertices as in the file, (n, 3) float32."""
        prop = self.schema.getPositionsProperty()
        if prop.getNumSamples() == 0:
            return np.zeros((0, 3), np.float32)
        sample = prop.getValue(Abc.ISampleSelector(float(time)))
        return np.array(sample, dtype=np.float32).reshape(-1, 3)

    def positions(self, time):
        """World-space vertices, (n, 3) float64."""
        world = self.world(time)
        return self.local_positions(time).astype(float) @ world[:3, :3].T + world[:3, 3]

    def faces(self, time):
        """Vertex indices as in the file (clockwise) and face sizes."""
        select = Abc.ISampleSelector(float(time))
        if self.schema.getFaceCountsProperty().getNumSamples() == 0:
            return [], []
        return (
            [int(i) for i in self.schema.getFaceIndicesProperty().getValue(select)],
            [int(i) for i in self.schema.getFaceCountsProperty().getValue(select)],
        )


def header(compound, name):
    for i in range(compound.getNumProperties()):
        if compound.getPropertyHeader(i).getName() == name:
            return compound.getPropertyHeader(i)
    return None


def objects(path):
    """Every object of an archive, parents before children; instances unfolded."""
    archive = Abc.IArchive(str(path))
    found = []

    def walk(iobject, above, path):
        for i in range(iobject.getNumChildren()):
            child = iobject.getChild(i)
            # An instance gives its own name only through the header of its parent.
            name = iobject.getChildHeader(i).getName()
            entry = Object(child, above, f"{path}/{name}")
            entry.keep = (archive, child)
            found.append(entry)
            walk(child, entry, entry.path)

    walk(archive.getTop(), None, "")
    return found
