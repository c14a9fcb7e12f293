"""How far a run has come."""

from __future__ import annotations

from dataclasses import dataclass, field

from attrito.library.points import Point


@dataclass
class RunPosition:
    """How far a run has come.

    Parameters
    ----------
    stretch, taken : the sweep it is in (a level and a direction), from 0, and points of it that are done
    finished : whether that sweep is done
    level : number of its level, from 0
    searching : other branches of the level are being sought
    branch : the highest number of a branch so far
    points : points done of all sweeps
    outcomes : how many points ended how
    before : branch and outcome of the last point
    incomplete : branches and sweeps that ended before their stop, in words
    warnings : of the static solution
    """

    stretch: int = 0
    taken: int = 0
    finished: bool = False
    level: int = 0
    searching: bool = False
    branch: int = 0
    points: int = 0
    before: tuple[int, str] | None = None
    outcomes: dict[str, int] = field(default_factory=dict)
    incomplete: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    def add(self, point: Point) -> None:
        """Count a point that is done."""
        self.branch = max(self.branch, point.branch)
        self.points += 1
        self.before = (point.branch, point.outcome)
        self.outcomes[point.outcome] = self.outcomes.get(point.outcome, 0) + 1
