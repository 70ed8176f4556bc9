"""Units of the trade. Everything inside and in files is m³ and kg; these are for text, tables and options.

Bushels, short and long tons and hundredweights are exact by definition (NIST Handbook 44, Appendix C).
"""

from __future__ import annotations

from siloscope.errors import UsageError

CUBIC_FOOT = 0.3048**3
"""m³."""

BUSHEL = 2150.42 * 0.0254**3
"""Winchester bushel, m³: 2,150.42 cubic inches."""

POUND = 0.45359237
"""kg."""

VOLUMES = {"m3": (1.0, "m³"), "l": (1e-3, "l"), "ft3": (CUBIC_FOOT, "ft³"), "bu": (BUSHEL, "bu")}
"""Name: m³ in one, and the sign."""

MASSES = {
    "kg": (1.0, "kg"),
    "t": (1000.0, "t"),
    "short-ton": (2000.0 * POUND, "short ton"),
    "long-ton": (2240.0 * POUND, "long ton"),
    "cwt": (100.0 * POUND, "cwt"),
    "lb": (POUND, "lb"),
}
"""Name: kg in one, and the sign."""

Units = tuple[tuple[float, str], tuple[float, str]]
"""Scale and sign of volumes and of masses in text."""

SI: Units = (VOLUMES["m3"], MASSES["kg"])


def unit(name: str | None) -> Units:
    """Scale and sign of volumes and of masses in text; m³ and kg for what the name does not say.

    Raises
    ------
    UsageError
        For a unit that nobody knows.
    """
    chosen = [part for part in (name or "").split(",") if part]
    for part in chosen:
        if part not in VOLUMES and part not in MASSES:
            raise UsageError(f"unknown unit '{part}'; known are {', '.join([*VOLUMES, *MASSES])}")
    volume = next((VOLUMES[part] for part in chosen if part in VOLUMES), VOLUMES["m3"])
    mass = next((MASSES[part] for part in chosen if part in MASSES), MASSES["kg"])
    return volume, mass


def test_weight(text: str) -> float:
    """Density, kg/m³, of a test weight: "60" or "60lb/bu" pounds a bushel, "77.2kg/hl" kilograms a hectolitre.

    Raises
    ------
    UsageError
        For a text that is none, or a weight that no feed has.
    """
    plain = text.strip().lower().replace(" ", "")
    metric = plain.endswith("kg/hl")
    number = plain.removesuffix("kg/hl").removesuffix("lb/bu")
    try:
        value = float(number)
    except ValueError:
        value = 0.0
    density = value * 10.0 if metric else value * POUND / BUSHEL
    if not 50.0 <= density <= 2000.0:
        raise UsageError(f"test weight '{text}': give lb/bu such as 60, or kg/hl such as 77.2kg/hl")
    return density


def at_moisture(mass: float, moisture: float, reference: float) -> float:
    """Mass that the same dry matter has at another moisture: m (1 - w) / (1 - w₀). Moistures are fractions, wet basis.

    Raises
    ------
    UsageError
        For a moisture that is no fraction below 0.6.
    """
    for value in (moisture, reference):
        if not 0.0 <= value < 0.6:
            raise UsageError(f"a moisture of {100.0 * value:g} % is none; give percent of the wet mass, 0 to 60")
    return mass * (1.0 - moisture) / (1.0 - reference)
