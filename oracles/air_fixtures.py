"""Writes the absorption of air that the test of air.rs reads, as the package python-acoustics has it.

Dev-only. Needs acoustics (0.2.6) and scipy from PyPI:

    pip install acoustics scipy
    python oracles/air_fixtures.py

Each row: temperature in degrees C, relative humidity in %, pressure in kPa, frequency in Hz, absorption in dB/m and
the speed of sound in m/s.
"""

import itertools
import pathlib

import scipy.special

# The package imports a function that newer SciPy no longer has, and does not use it here.
scipy.special.sph_harm = getattr(scipy.special, "sph_harm", None)
from acoustics.standards import iso_9613_1_1993 as iso  # noqa: E402

OUT = pathlib.Path(__file__).parent.parent / "crates/froufrou/tests/fixtures/air.tsv"

lines = ["# C, % relative humidity, kPa, Hz, dB/m, m/s (oracles/air_fixtures.py)"]
grid = itertools.product([-20.0, 0.0, 15.0, 50.0], [10.0, 55.0, 100.0], [70.0, 101.325], [50.0, 1000.0, 10000.0])
for celsius, humidity, pressure, frequency in grid:
    kelvin = celsius + 273.15
    saturation = iso.saturation_pressure(kelvin)
    water = iso.molar_concentration_water_vapour(humidity, saturation, pressure)
    oxygen = iso.relaxation_frequency_oxygen(pressure, water)
    nitrogen = iso.relaxation_frequency_nitrogen(pressure, kelvin, water)
    absorption = iso.attenuation_coefficient(
        pressure, kelvin, iso.REFERENCE_PRESSURE, iso.REFERENCE_TEMPERATURE, nitrogen, oxygen, frequency
    )
    row = [celsius, humidity, pressure, frequency, absorption, iso.soundspeed(kelvin)]
    lines.append("\t".join(f"{float(v):.16g}" for v in row))
OUT.write_text("\n".join(lines) + "\n")
