"""Keeps of a PyBullet log of contacts and of its poses what the scene reads, and writes them as contacts.csv.gz and
poses.csv.gz.

    python examples/collisions/make_contacts.py pybullet_mixed_1kHz_contacts.csv.gz pybullet_mixed_1kHz_poses.csv.gz
"""

import csv
import gzip
import pathlib
import sys

HERE = pathlib.Path(__file__).parent
CONTACTS = {"px": 3, "py": 3, "pz": 3, "nx": 3, "ny": 3, "nz": 3, "Fn": None, "vrel_n": 3, "vrel_t1": 3, "vrel_t2": 3}
POSES = {name: 4 for name in ("x", "y", "z", "qx", "qy", "qz", "qw", "vx", "vy", "vz", "wx", "wy", "wz")}


def keep(log, names, numbers, to, every):
    """The columns of names as they are, those of numbers with so many digits (None: five that count), of every n-th step."""
    with gzip.open(log, "rt", newline="") as file:
        rows = list(csv.DictReader(file))
    # Without a time stamp and a name the bytes depend on the rows alone.
    with open(HERE / to, "wb") as file, gzip.GzipFile("", "wb", 9, file, 0) as packed:
        lines = [",".join([*names, *numbers])]
        for row in rows:
            if (round(float(row["t"]) * 1000) - 1) % every == 0:
                told = [f"{float(row[c]):.{d}f}" if d is not None else f"{float(row[c]):.5g}" for c, d in numbers.items()]
                lines.append(",".join([*(row[c] for c in names), *told]))
        packed.write(("\n".join(lines) + "\n").encode())


def main():
    keep(sys.argv[1], ["t", "bodyA", "bodyB"], CONTACTS, "contacts.csv.gz", 1)
    keep(sys.argv[2], ["t", "body"], POSES, "poses.csv.gz", 4)


if __name__ == "__main__":
    main()
