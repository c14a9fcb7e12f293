"""What CalculiX prints of a wheel's natural frequencies."""

from __future__ import annotations

from pathlib import Path


def calculix_frequencies(path: Path) -> dict[int, list[float]]:
    """Hz by nodal diameter, ascending; the file has a part for each."""
    found: dict[int, list[float]] = {}
    for part in path.read_text().split("E I G E N V A L U E   O U T P U T")[1:]:
        for line in part.split("P A R T I C I P A T I O N")[0].splitlines():
            words = line.split()
            if len(words) == 6 and words[0].isdigit():
                found.setdefault(int(words[0]), []).append(float(words[4]))
    return found
