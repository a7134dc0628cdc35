"""What do twelve channels and eight bits cost?

The truth is renders under lights that no fit saw; the loss is against the same fit in full floats,
in dB of their PSNR. `full` keeps every term's colour; `chroma` and `talk` keep only the luma of the
last two, and give it the colour of the first term, or none.
"""

from __future__ import annotations

from bake import mips
from pipelines.studies.answer import Answer, Panel, Row
from pipelines.studies.subjects import Setting, traced

PACKINGS = {"full": ("full", "chroma"), "chroma": ("twelve", "chroma"), "talk": ("twelve", "talk")}
DEPTHS = ("16", "8")
DEFAULT = "chroma"


def measure(setting: Setting) -> Answer:
    """Pack one bake in every way and compare with held-out renders."""
    rows: list[Row] = []
    lines: dict[str, list[tuple[float, float]]] = {}
    for name, mesh in setting.meshes("knot", "lantern", "oak", "flowers").items():
        master = traced(
            mesh, resolution=setting.pick(64, 256), samples=setting.pick(4, 16), held_out=16
        )
        for i, (label, (packing, unpack)) in enumerate(PACKINGS.items()):
            for depth in DEPTHS:
                params = mips.Params(packing=packing, unpack=unpack, depth=depth, max_lod=0.0)
                board = mips.pack(master, params=params)
                quality = board.quality
                loss = quality["psnr_full"] - quality["psnr_stored"]
                rows.append(
                    {
                        "subject": name,
                        "packing": label,
                        "bits": int(depth),
                        "held_out_db": quality["psnr_stored"],
                        "loss_db": loss,
                        "loss_packing_db": quality["loss_packing_db"],
                        "loss_bits_db": quality["loss_bits_db"],
                        "bytes": sum(level.nbytes for level in board.levels),
                    }
                )
                lines.setdefault(f"{name}, {depth} bits", []).append((i, loss))
    worst = {
        label: max(float(r["loss_packing_db"]) for r in rows if r["packing"] == label)
        for label in PACKINGS
    }
    bits = max(float(r["loss_bits_db"]) for r in rows if r["bits"] == 8 and r["packing"] == DEFAULT)
    return Answer(
        question="packing",
        title=f"Twelve channels cost at most {worst['chroma']:.2f} dB as chroma, "
        f"{worst['talk']:.2f} dB as in the talk; eight bits {bits:.3f} dB",
        truth="renders under lights that no fit saw",
        rows=rows,
        panels=(
            Panel(
                "packing",
                "loss of held-out PSNR, dB",
                lines,
                marked=list(PACKINGS).index(DEFAULT),
                scales=("linear", "linear"),
                ticks=tuple(PACKINGS),
                joined=False,
            ),
        ),
        figures={"worst_packing_db": worst, "worst_bits_db": bits},
    )
