"""Keeps of a PyBullet contact log what the scene reads, and writes it as contacts.csv.gz.

    python examples/collisions/make_contacts.py pybullet_mixed_1kHz_contacts.csv.gz
"""

import csv
import gzip
import pathlib
import sys

HERE = pathlib.Path(__file__).parent
COLUMNS = ["t", "bodyA", "bodyB", "px", "py", "pz", "Fn"]


def main():
    with gzip.open(sys.argv[1], "rt", newline="") as log:
        rows = list(csv.DictReader(log))
    # Without a time stamp and a name the bytes depend on the rows alone.
    with open(HERE / "contacts.csv.gz", "wb") as file, gzip.GzipFile("", "wb", 9, file, 0) as packed:
        lines = [",".join(COLUMNS)]
        for row in rows:
            place = [f"{float(row[c]):.3f}" for c in ("px", "py", "pz")]
            lines.append(",".join([row["t"], row["bodyA"], row["bodyB"], *place, f"{float(row['Fn']):.5g}"]))
        packed.write(("\n".join(lines) + "\n").encode())


if __name__ == "__main__":
    main()
