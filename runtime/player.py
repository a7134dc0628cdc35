"""The player: a baked scene folder in, pictures out.

Only the passes that the manifest's plan calls for are imported, compiled and allocated. The frame
is the plan's effects read top to bottom. The same time gives the same bytes in every process.
"""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats import scene as scenes
from formats import seal
from formats.billboard import Billboard
from formats.errors import DamagedError, InputError
from formats.files.reading import strict_json
from runtime import capture, lighting, sprites
from runtime.camera import Camera
from runtime.frame import Frame
from runtime.shader import Programs

FORMAT = 1
LARGEST = 16384  # pixels a side


class Player:
    """Plays one baked scene.

    folder : what `bakelight bake` wrote. size : (width, height) pixels. context : a moderngl
    context to draw with; without one a headless context is made, and released again by `close`.
    camera : set it to a runtime.camera.Camera to look from elsewhere than the scene does.
    sun_turn : (azimuth, elevation) radians added to the first sun. Raises InputError where there
    is no such scene, DamagedError where its bytes changed, MachineError where no OpenGL context
    can be made.
    """

    def __init__(
        self, folder: str | Path, *, size: tuple[int, int] = (640, 360), context: Any = None
    ) -> None:
        self.folder = Path(folder)
        if not all(1 <= side <= LARGEST for side in size):
            raise InputError(self.folder, "size", size, f"ask for 1 to {LARGEST} pixels a side")
        manifest = _manifest(self.folder)
        self._assets: dict[str, str] = manifest["assets"]
        where = self.folder / "manifest.json"
        self.scene = scenes.from_dict(
            manifest["scene"], where=where, root=None, name=manifest["name"]
        )
        effects = manifest["plan"]["effects"]
        self.called = tuple(effect["name"] for effect in effects if effect["called"])
        self.camera: Camera | None = None
        self.sun_turn = (0.0, 0.0)
        self._made: list[Any] = []
        # Decode assets while the driver starts
        with ThreadPoolExecutor() as pool:
            loading = self._load_sprites(pool)
            self._owns_context = context is None
            self.ctx = capture.make_context() if context is None else context
            self.targets = Frame(self.ctx, size)
            self.programs = Programs(self.ctx)
            self.sprites = [
                sprites.load(self.ctx, self.targets, billboards, asset.result())
                for billboards, asset in loading
            ]
        self.sprite_lighting = lighting.SpriteLighting()
        self.look(0.0)
        self.passes: dict[str, Any] = {}
        for name in self.called:
            self.passes[name] = import_module(f"runtime.passes.{name}").Pass(self)
        _check_order(self.passes)
        uses = {t for p in self.passes.values() for t in (*p.reads, *p.writes)}
        self._depth = "depth" if "depth" in uses else None

    # pictures

    def frame(self, time: float) -> NDArray[np.uint8]:
        """Return the finished picture (h, w, 4) uint8 at `time` seconds, row 0 on top."""
        self.draw(time)
        return self._read("picture", np.uint8)

    def linear(self, time: float) -> NDArray[np.float32]:
        """Return scene-linear radiance (h, w, 4) before the film, row 0 on top."""
        self.draw(time, finished=False)
        return self._read("colour", np.float16).astype(np.float32)

    def draw(self, time: float, *, finished: bool = True) -> None:
        """Draw the frame of `time` seconds into the targets `colour` and, finished, `picture`."""
        self.look(time)
        self.targets.draw_calls = 0
        target = self.targets.target("colour", self._depth)
        target.use()
        target.clear(0.0, 0.0, 0.0, 1.0, depth=1.0)
        for name, drawn in self.passes.items():
            if finished or name != "film":
                with self.targets.timed(name):
                    drawn.draw(time)

    def look(self, time: float) -> None:
        """Set camera (`view`) and `lights` to those of `time` seconds."""
        self.view = self.camera or Camera.of_scene(self.scene, time)
        self.lights = lighting.at(self.scene, time, self.sun_turn)

    @property
    def profile(self) -> dict[str, Any]:
        """Counts, and milliseconds per pass of the last frame; `timing` says how time was taken."""
        targets = self.targets
        return {
            "renderer": self.ctx.info["GL_RENDERER"],
            "size": list(targets.size),
            "passes": list(self.called),
            "programs": self.programs.count,
            "textures": targets.texture_count,
            "bytes": targets.texture_bytes,
            "draw_calls": targets.draw_calls,
            "milliseconds": dict(targets.milliseconds),
            "timing": targets.timing,
        }

    def close(self) -> None:
        """Free everything on the card; the context too where the player made it."""
        for made in self._made:
            made.release()
        self.targets.release()
        self.programs.release()
        if self._owns_context:
            self.ctx.release()

    def __enter__(self) -> Player:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # what passes ask for

    def folders(self, kind: str) -> dict[str, Path]:
        """Return name -> folder of the scene's assets of one kind; DamagedError if one is gone."""
        prefix = f"{kind}/"
        found = {
            name.removeprefix(prefix): self.folder / where
            for name, where in self._assets.items()
            if name.startswith(prefix)
        }
        for folder in found.values():
            if not folder.is_dir():
                raise DamagedError(folder, "", "missing", "bake the scene again")
        return found

    def vertex_array(self, program: Any, content: Any = ()) -> Any:
        """Return a vertex array that `close` frees; without content the shader counts vertices."""
        return self._keep(self.ctx.vertex_array(program, list(content)))

    def buffer(self, size: int) -> Any:
        """Return a vertex buffer of `size` bytes that `close` frees."""
        return self._keep(self.ctx.buffer(reserve=size, dynamic=True))

    def _keep(self, made: Any) -> Any:
        self._made.append(made)
        return made

    def _load_sprites(self, pool: ThreadPoolExecutor) -> list[tuple[Any, Future[Billboard]]]:
        if "billboard" not in self.called:
            return []
        folders = self.folders("billboard")
        missing = [b.name for b in self.scene.billboards if b.name not in folders]
        if missing:
            where = f"assets.billboard/{missing[0]}"
            raise DamagedError(self.folder / "manifest.json", where, "missing", "bake it again")
        return [(b, pool.submit(Billboard.load, folders[b.name])) for b in self.scene.billboards]

    def _read(self, name: str, dtype: Any) -> NDArray[Any]:
        width, height = self.targets.size
        data = np.frombuffer(self.targets.texture(name).read(alignment=1), dtype)
        return data.reshape(height, width, 4)[::-1].copy()


def _manifest(folder: Path) -> dict[str, Any]:
    if not (folder / "manifest.json").is_file():
        raise InputError(folder, "", "not a baked scene", "bake the scene first: bakelight bake")
    path = folder / "manifest.json"
    data = strict_json(seal.read_bytes(folder, "manifest.json"), path)
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise DamagedError(path, "format", f"not {FORMAT}", "bake the scene again")
    return data


def _check_order(passes: dict[str, Any]) -> None:
    """Check that every target that a pass reads was cleared or written before."""
    written = {"colour", "depth"}
    for name, drawn in passes.items():
        if lacking := set(drawn.reads) - written:
            raise RuntimeError(f"pass {name} reads {sorted(lacking)[0]}, which none wrote before")
        written |= set(drawn.writes)
