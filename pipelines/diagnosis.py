"""What is found wrong with a file: facts, findings with a measure, and what a bake will do."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, Literal

Level = Literal["fine", "note", "warning", "fault"]
RANK: tuple[Level, ...] = ("fine", "note", "warning", "fault")


@dataclass(frozen=True)
class Finding:
    """level : fault, where a bake will refuse the file; warning, where the result suffers; note.
    what : is found. measure : how bad, a number of `unit`. bake : what will be done about it."""

    level: Level
    what: str
    measure: float
    unit: str
    bake: str


@dataclass
class Diagnosis:
    """What is known of a file. kind : mesh, photographs, voxels, environment, picture, scene or
    texture. facts : in words. findings : worst first once `finished`."""

    file: str
    kind: str
    facts: list[str] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)

    def find(self, level: Level, what: str, measure: float, unit: str, bake: str) -> None:
        """Add a finding."""
        self.findings.append(Finding(level, what, float(measure), unit, bake))

    def noted(self, notes: Any) -> None:
        """Add what a reader or a stage said of the file, in its own words."""
        for note in dict.fromkeys(str(n) for n in notes):
            self.find("note", note, 1, "", "as it says")

    def finished(self) -> Diagnosis:
        """Sort the findings, worst first."""
        self.findings.sort(key=lambda f: -RANK.index(f.level))
        return self

    @property
    def verdict(self) -> Level:
        """The worst level found."""
        return max((f.level for f in self.findings), key=RANK.index, default="fine")

    def as_json(self) -> dict[str, Any]:
        """Return everything as plain tables."""
        return asdict(self) | {"verdict": self.verdict}

    def lines(self) -> list[str]:
        """Return what a person reads: a head, facts, then a line a finding."""
        found = [f"{self.file}: {self.kind}, {self.verdict}"]
        found += [f"    {fact}" for fact in self.facts]
        for f in self.findings:
            tail = "" if f.bake == "as it says" else f" -> {f.bake}"
            found.append(f"  {f.level:8}{f.what}{tail}")
        return found


def amount(count: float, what: str, of: float | None = None) -> str:
    """Return a count with its noun, and its share of a whole.

    >>> amount(1, "open edge"), amount(3, "open edge", 12)
    ('1 open edge', '3 open edges (25%)')
    """
    plural = what if count == 1 else f"{what}s"
    share = (
        ""
        if not of
        else f" ({100 * count / of:.2g}%)"
        if count / of < 0.01
        else f" ({count / of:.0%})"
    )
    return f"{count:g} {plural}{share}"
