"""The first frame of a baked scene, written to a file: what `make bench` times from process start.

As `render` makes it, but for scenes whose light is gathered: these show what a window shows first,
with a few rays a texel, where `render` waits until the light has settled.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from formats.scene import Scene


def main(scene_file: str, out: str, width: str, height: str) -> None:
    """Draw the middle of the scene's time."""
    from pipelines import start

    start.lean()
    start.to_draw()
    from formats import scene as scenes
    from pipelines import current

    path = Path(scene_file)
    scene = scenes.load(path, None)
    folder = current.ensure(path, scene, None, Path("build"))
    from runtime.player import Player

    size = int(width), int(height)
    with Player(folder, size=size, roaming=gathered(scene)) as player:
        picture = player.picture(0.5 * scene.time.duration)
    picture.save(out)


def gathered(scene: Scene) -> bool:
    """Tell whether light of cubes is gathered as the scene plays, from frame to frame."""
    return scene.voxels is not None and bool(scene.voxels.lamps or scene.voxels.bodies)


if __name__ == "__main__":
    main(*sys.argv[1:])
