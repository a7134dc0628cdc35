"""Write worlds of cubes as .vox files beside this script.

python assets/voxels/make_voxels.py [--to FOLDER]
"""

import argparse
from pathlib import Path

import courtyard
import numpy as np
import street
import street_parts
import vox_file


def make(folder: Path) -> list[Path]:
    """Write the courtyard, its door, and the street."""
    worlds = {
        "courtyard": (courtyard.courtyard(), courtyard.PALETTE),
        "door": (courtyard.door(), courtyard.PALETTE),
        "street": (street.street(), street_parts.PALETTE),
    }
    found = []
    for name, (cells, colours) in worlds.items():
        palette = {index: f"#{r:02x}{g:02x}{b:02x}" for index, (r, g, b) in colours.items()}
        path = folder / f"{name}.vox"
        # A file's y runs away from the viewer and its z up
        turned = np.ascontiguousarray(cells[::-1].transpose(1, 0, 2))
        vox_file.write(path, [vox_file.Part(turned, name=name)], palette)
        found.append(path)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--to", type=Path, default=Path(__file__).parent)
    for path in make(parser.parse_args().to):
        print(path)


if __name__ == "__main__":
    main()
