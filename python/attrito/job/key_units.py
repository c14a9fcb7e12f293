"""Units of the job's keys, in words of a consistent set; `1` is a pure number."""

from __future__ import annotations

ENDINGS = {"_hz": "Hz", "_gb": "GB"}
# Of both kinds of contacts
OF_CONTACTS = {
    "tangential_stiffness": "force/length",
    "normal_stiffness": "force/length",
    "friction_coefficient": "1",
    "chi": "1",
    "beta": "1",
    "gap": "length",
    "preload": "force",
}
UNITS = {
    "model": {
        "mass": "mass",
        "stiffness": "force/length",
        "damping": "force*time/length",
        "gyroscopic": "force*time/length",
    },
    "damping": {"rayleigh": "1/time, time", "ratio": "1", "loss_factor": "1"},
    "reduction": {"error": "1"},
    "contact": OF_CONTACTS
    | {"normal": "1", "tangents": "1", "normal_next": "1", "tangents_next": "1", "area": "length^2"},
    "contact_set": OF_CONTACTS | {"tolerance": "length", "gap_file": "length"},
    "load": {
        "dofs": "force",
        "cosine": "force",
        "sine": "force",
        "gravity": "length/time^2",
        "base_cosine": "length/time^2",
        "base_sine": "length/time^2",
        "axis_point": "length",
        "axis_direction": "1",
    },
    "cyclic": {"tolerance": "length", "axis_point": "length", "axis_direction": "1"},
    "static": {"load_path": "1"},
    "balance": {"tolerance": "1", "residual_tolerance": "1"},
    "sweep": {"levels": "1"},
    "continuation": {"curve_tolerance": "1"},
    "peak": {"start": "1", "stop": "1", "values": "1", "level": "1"},
    "mode": {"start": "length*mass^0.5", "stop": "length*mass^0.5"},
    "campbell": {"stiffness_at_rest": "force/length"},
    "integrate": {
        "dissipation": "1",
        "level": "1",
        "static_profile": "time, 1",
        "harmonic_profile": "time, 1",
        "sliders": "length",
        "periodicity_tolerance": "1",
    },
}


def unit_of(table: str, key: str) -> str:
    """The unit of a key's numbers; empty where it takes none, or an integer."""
    ending = next((unit for end, unit in ENDINGS.items() if key.endswith(end)), "")
    return ending or UNITS.get(table, {}).get(key, "")
