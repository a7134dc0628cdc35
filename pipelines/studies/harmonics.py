"""How many circular harmonics does a sprite need?

The truth is renders under lights that no fit saw. Bytes are those on the graphics card, all mip
levels of the 8-bit planes; the stored sprite is packed as `chroma`.
"""

from __future__ import annotations

from bake import mips
from pipelines.studies.answer import Answer, Panel, Row
from pipelines.studies.subjects import Setting, processor_seconds, traced

TERMS = (1, 3, 5, 7, 9, 11)
DEFAULT = 5


def measure(setting: Setting) -> Answer:
    """Bake with K terms and compare with held-out renders."""
    knobs = {"resolution": setting.pick(64, 192), "samples": setting.pick(4, 16), "held_out": 16}
    rows: list[Row] = []
    for name, mesh in setting.meshes("knot", "oak", "lantern").items():
        for terms in TERMS[:4] if setting.quick else TERMS:
            master, seconds = processor_seconds(traced, mesh, **knobs, terms=terms)
            board = mips.pack(master, params=mips.Params(max_lod=0.0))
            rows.append(
                {
                    "subject": name,
                    "terms": terms,
                    "planes": board.planes,
                    "held_out_db": board.quality["psnr_full"],
                    "stored_db": board.quality["psnr_stored"],
                    "bytes": sum(level.nbytes for level in board.levels),
                    "processor_seconds": seconds,
                }
            )
    gain = [_mean(rows, "stored_db", k) - _mean(rows, "stored_db", k - 2) for k in (5, 7)]
    return Answer(
        question="harmonics",
        title=f"5 terms: the last two bring {gain[0]:.1f} dB, two more would bring {gain[1]:.1f} "
        "dB and cost a plane",
        truth="renders under lights that no fit saw",
        rows=rows,
        panels=(
            Panel(
                "terms",
                "PSNR of held-out renders, dB",
                _lines(rows, "terms", "held_out_db")
                | {
                    f"{name}, stored": points
                    for name, points in _lines(rows, "terms", "stored_db").items()
                },
                marked=DEFAULT,
                scales=("linear", "linear"),
            ),
            Panel(
                "bytes on the card",
                "PSNR of held-out renders as stored, dB",
                _lines(rows, "bytes", "stored_db"),
            ),
        ),
        figures={"gain_of_5_db": gain[0], "gain_of_7_db": gain[1]},
    )


def _mean(rows: list[Row], column: str, terms: int) -> float:
    values = [float(row[column]) for row in rows if row["terms"] == terms]
    return sum(values) / len(values)


def _lines(rows: list[Row], x: str, y: str) -> dict[str, list[tuple[float, float]]]:
    lines: dict[str, list[tuple[float, float]]] = {}
    for row in rows:
        lines.setdefault(str(row["subject"]), []).append((float(row[x]), float(row[y])))
    return lines
