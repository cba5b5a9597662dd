"""Writes crates/froufrou/tests/fixtures/bar_modes.tsv: wave numbers and shapes of bending bars.

Needs: pip install mpmath
Run from the root of the repository: python oracles/bar_modes.py

The roots of cos k cosh k = ±1 and the textbook's shapes (hyperbolic functions and all), in fifty
digits, where nothing cancels.
"""

from mpmath import cos, cosh, findroot, mp, mpf, nstr, pi, sin, sinh

mp.dps = 50


def shape(ends, k, x):
    """The mode's shape, scaled to a greatest value of 1."""
    if ends == "free":
        sigma = (cosh(k) - cos(k)) / (sinh(k) - sin(k))
        return (cosh(k * x) + cos(k * x) - sigma * (sinh(k * x) + sin(k * x))) / 2
    sigma = (sinh(k) - sin(k)) / (cosh(k) + cos(k))
    return (cosh(k * x) - cos(k * x) - sigma * (sinh(k * x) - sin(k * x))) / 2


with open("crates/froufrou/tests/fixtures/bar_modes.tsv", "w", encoding="utf-8") as out:
    out.write("# oracles/bar_modes.py: ends, mode, wave number times length, shape at 0, 0.1, …, 1\n")
    for ends, shift, sign in (("free", mpf(1) / 2, 1), ("clamped", -mpf(1) / 2, -1)):
        for n in (*range(1, 11), 15, 25):
            # Divided by cosh, so that the slope stays tame.
            k = findroot(lambda k: cos(k) - sign / cosh(k), (n + shift) * pi)
            values = [k] + [shape(ends, k, mpf(i) / 10) for i in range(11)]
            out.write("\t".join([ends, str(n)] + [nstr(v, 17) for v in values]) + "\n")
