"""What do twelve channels, eight bits and blocks cost?

The truth is renders under lights that no fit saw; the loss is against the same fit in full floats,
in dB of their PSNR. `full` keeps every term's colour; `chroma` and `talk` keep only the luma of the
last two, and give it the colour of the first term, or none. Blocks are BC7 of mode 6, a byte a
texel and plane, of the same codes of 8 bits.
"""

from __future__ import annotations

from dataclasses import replace

from bake import mips
from bake.billboard import held_out_relit
from formats.billboard import Billboard
from maths import bc7
from maths.image_error import psnr
from pipelines.studies import sprite_errors
from pipelines.studies.answer import Answer, Panel, Row, Shot, point
from pipelines.studies.stages import processor_seconds
from pipelines.studies.subjects import Setting, traced_in

TAKES = ("mesh",)
PACKINGS = {"full": ("full", "chroma"), "chroma": ("twelve", "chroma"), "talk": ("twelve", "talk")}
DEPTHS = {"16 bits": "16", "8 bits": "8", "BC7": "8"}
DEFAULT = ("chroma", "8 bits")


def measure(setting: Setting) -> Answer:
    """Pack one bake in every way and compare with held-out renders."""
    rows: list[Row] = []
    lines: dict[str, list[tuple[float, float]]] = {}
    shots: dict[tuple[str, str], Shot] = {}
    for name, mesh in setting.meshes("knot", "lantern", "oak", "flowers").items():
        master, spent = traced_in(
            mesh, resolution=setting.pick(64, 256), samples=setting.pick(4, 16), held_out=16
        )
        stage = sprite_errors.stage(mesh, master)
        for i, (label, (packing, unpack)) in enumerate(PACKINGS.items()):
            for stored, depth in DEPTHS.items():
                params = mips.Params(packing=packing, unpack=unpack, depth=depth, max_lod=0.0)
                board, seconds = processor_seconds(mips.pack, master, params=params)
                size = sum(level.nbytes for level in board.levels)
                if stored == "BC7":
                    board, more = processor_seconds(in_blocks, board)
                    seconds, size = seconds + more, size // 4
                Y = sprite_errors.stored(board, master)
                quality = board.quality
                held_out = psnr(
                    master.held_out,
                    held_out_relit(master, Y),
                    float(master.held_out.max()) or 1.0,
                )
                loss = quality["psnr_full"] - held_out
                rows.append(
                    point(
                        name,
                        f"{label}, {stored}",
                        sprite_errors.held_out(master, Y),
                        series=label,
                        bake_seconds=spent + seconds,
                        bytes=size,
                        default=(label, stored) == DEFAULT,
                        packing=label,
                        stored=stored,
                        held_out_db=held_out,
                        loss_db=loss,
                        loss_packing_db=quality["loss_packing_db"],
                        loss_bits_db=loss - quality["loss_packing_db"],
                    )
                )
                shots[name, f"{label}, {stored}"] = stage.shot(Y)
                lines.setdefault(f"{name}, {stored}", []).append((i, loss))
    packings = {label: _worst(rows, "loss_packing_db", "packing", label) for label in PACKINGS}
    own = [row for row in rows if row["packing"] == DEFAULT[0]]
    bits = {stored: _worst(own, "loss_bits_db", "stored", stored) for stored in DEPTHS}
    return Answer(
        question="packing",
        title=f"Twelve channels cost at most {packings['chroma']:.2f} dB as chroma, "
        f"{packings['talk']:.2f} dB as in the talk; eight bits {bits['8 bits']:.3f} dB, "
        f"blocks of a quarter of the bytes {bits['BC7']:.2f} dB",
        truth="renders under lights that no fit saw",
        rows=rows,
        unit=sprite_errors.UNIT,
        decibels=True,
        shots=shots,
        panels=(
            Panel(
                "packing",
                "loss of held-out PSNR, dB",
                lines,
                marked=list(PACKINGS).index(DEFAULT[0]),
                title=f"Twelve channels lose {packings['chroma']:.2f} dB at most, the talk's "
                f"{packings['talk']:.2f} dB",
                scales=("linear", "linear"),
                ticks=tuple(PACKINGS),
                joined=False,
            ),
        ),
        figures={"worst_packing_db": packings, "worst_bits_db": bits},
    )


def in_blocks(board: Billboard) -> Billboard:
    """Return a sprite whose codes of 8 bits went through blocks of BC7."""
    levels = []
    for level in board.levels:
        height, width = level.shape[1:3]
        levels.append(bc7.decode_volume(bc7.encode_volume(level), height, width))
    return replace(board, levels=tuple(levels))


def _worst(rows: list[Row], column: str, name: str, value: str) -> float:
    return max(float(row[column]) for row in rows if row[name] == value)
