"""How many circular harmonics does a sprite need?

The truth is renders under lights that no fit saw. Bytes are those on the graphics card, all mip
levels of the 8-bit planes; the stored sprite is packed as `chroma`.
"""

from __future__ import annotations

from bake import mips
from pipelines.studies import sprite_errors
from pipelines.studies.answer import PRICES, Answer, Panel, Row, Shot, lines_of, point
from pipelines.studies.subjects import Setting, traced_in

TAKES = ("mesh",)
TERMS = (1, 3, 5, 7, 9, 11)
DEFAULT = 5


def measure(setting: Setting) -> Answer:
    """Bake with K terms and compare with held-out renders."""
    knobs = {"resolution": setting.pick(64, 192), "samples": setting.pick(4, 16), "held_out": 16}
    rows: list[Row] = []
    shots: dict[tuple[str, str], Shot] = {}
    for name, mesh in setting.meshes("knot", "oak", "lantern").items():
        stage = None
        for terms in TERMS[:4] if setting.quick else TERMS:
            master, seconds = traced_in(mesh, **knobs, terms=terms)
            board = mips.pack(master, params=mips.Params(max_lod=0.0))
            Y = sprite_errors.stored(board, master)
            setting_name = f"{terms} terms" if terms > 1 else "1 term"
            rows.append(
                point(
                    name,
                    setting_name,
                    sprite_errors.held_out(master, Y),
                    bake_seconds=seconds,
                    bytes=sum(level.nbytes for level in board.levels),
                    default=terms == DEFAULT,
                    terms=terms,
                    planes=board.planes,
                    held_out_db=board.quality["psnr_full"],
                    stored_db=board.quality["psnr_stored"],
                )
            )
            stage = stage or sprite_errors.stage(mesh, master)
            shots[name, setting_name] = stage.shot(Y)
    gain = [_mean(rows, "stored_db", k) - _mean(rows, "stored_db", k - 2) for k in (5, 7)]
    return Answer(
        question="harmonics",
        title=f"5 terms: the last two bring {gain[0]:.1f} dB, two more would bring {gain[1]:.1f} "
        "dB and cost a plane",
        truth="renders under lights that no fit saw",
        rows=rows,
        unit=sprite_errors.UNIT,
        axes=PRICES,
        decibels=True,
        shots=shots,
        panels=(
            Panel(
                "terms",
                "PSNR of held-out renders, dB",
                lines_of(rows, "terms", "held_out_db", "subject")
                | {
                    f"{name}, stored": points
                    for name, points in lines_of(rows, "terms", "stored_db", "subject").items()
                },
                marked=DEFAULT,
                scales=("linear", "linear"),
                title=f"Terms 4 and 5 bring {gain[0]:.1f} dB, 6 and 7 {gain[1]:.1f} dB",
            ),
        ),
        figures={"gain_of_5_db": gain[0], "gain_of_7_db": gain[1]},
    )


def _mean(rows: list[Row], column: str, terms: int) -> float:
    values = [float(row[column]) for row in rows if row["terms"] == terms]
    return sum(values) / len(values)
