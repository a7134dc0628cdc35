"""Write plants, stones, glowing mushrooms and a bust as GLB files beside this script.

python assets/meshes/make_meshes.py [NAME ...] [--to FOLDER]
"""

import argparse
from collections.abc import Callable
from pathlib import Path

import birch
import broadleaf
import bust
import cat
import conifers
import glowcaps
import grasses
import herbs
import market
import plinth
import plum
import shrubs
import stonework
from clay import Clay

from formats.files import glb

MAKERS: dict[str, Callable[[], Clay]] = {
    "oak": broadleaf.oak,
    "birch": birch.birch,
    "sapling": broadleaf.sapling,
    "bare_tree": broadleaf.bare_tree,
    "spruce": conifers.spruce,
    "cypress": conifers.cypress,
    "bush": shrubs.bush,
    "fern": herbs.fern,
    "umbellifer": herbs.umbellifer,
    "flowers": herbs.flowers,
    "near_branch": shrubs.near_branch,
    "meadow_grass": grasses.meadow_grass,
    "sedge": grasses.sedge,
    "seeded_grass": grasses.seeded_grass,
    "reeds": grasses.reeds,
    "lantern": stonework.lantern,
    "stones": stonework.stones,
    "mushrooms": stonework.mushrooms,
    "parasol": glowcaps.parasol,
    "bell": glowcaps.bell,
    "firefly": glowcaps.firefly,
    "bust": bust.bust,
    "plinth": plinth.plinth,
    "gallery_wall": plinth.wall,
    "cat": cat.sitting_cat,
    "paper_lantern": market.paper_lantern,
    "banner": market.banner,
    "plum_branch": plum.plum_branch,
}


def make(name: str, folder: Path) -> Path:
    """Model one kind and write FOLDER/NAME.glb."""
    path = folder / f"{name}.glb"
    glb.write(path, MAKERS[name]().nodes(name))
    return path


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(MAKERS))
    parser.add_argument("--to", type=Path, default=Path(__file__).parent)
    options = parser.parse_args()
    for name in options.names or MAKERS:
        if name not in MAKERS:
            parser.error(f"{name}: no such mesh; choose from {', '.join(MAKERS)}")
        path = make(name, options.to)
        print(f"{path}  {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
