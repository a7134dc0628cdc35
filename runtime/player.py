"""The player: a baked scene folder in, pictures out.

Only the passes that the manifest's plan calls for are imported, compiled and allocated. The frame
is the plan's effects read top to bottom. The same time gives the same bytes in every process;
where light of cubes is gathered, the same times in the same order do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats import scene as scenes
from formats import seal
from formats.errors import DamagedError, InputError
from formats.files.reading import strict_json
from runtime import capture, lighting, profile, reuse, sprites
from runtime.camera import Camera
from runtime.frame import Frame
from runtime.shader import Programs

FORMAT = 1
LARGEST = 16384  # pixels a side
HALF_PIXEL = 0.5  # a smaller circle of confusion changes nothing
PINHOLE = 1e6  # f-number of a lens that blurs nothing
SAMPLES = 4  # a pixel of what is opaque, where meshes have edges


class Player:
    """Plays one baked scene.

    folder : what `bakelight bake` wrote. size : (width, height) pixels. context : a moderngl
    context to draw with; without one a headless context is made, and released again by `close`.
    camera : set it to a runtime.camera.Camera to look from elsewhere than the scene does. roaming :
    it will be: also draw ground and sky where the plan left them out as never seen, and let light
    settle from frame to frame.
    sun_turn : (azimuth, elevation) radians added to the first sun. reuse : set it to False to draw
    every pass of every frame. plan : of the scene, as its manifest has it. hidden, off : what
    `change` left out. own : the scene as its file has it. haste : seconds that light may take to
    settle in each frame of a roaming player; None for as long as the scene's rays take. linked :
    programs of each pass. Raises InputError where there is no such
    scene, DamagedError where its bytes changed, MachineError where no OpenGL context can be made.
    """

    def __init__(
        self,
        folder: str | Path,
        *,
        size: tuple[int, int] = (640, 360),
        context: Any = None,
        roaming: bool = False,
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
        self.plan = plan = manifest["plan"]
        self.hidden, self.off = frozenset[str](), frozenset[str]()
        self._changes = 0
        self._take_lights(plan.get("lights", []))
        self.own = self.scene
        found = {"ground": self.scene.ground, "sky": self.scene.picture.sky} if roaming else {}
        unseen = [name for name, described in found.items() if described is not None]
        lines = size[1] / plan.get("lines", size[1])
        self.called = tuple(
            effect["name"]
            for effect in plan["effects"]
            if effect["called"]
            or (not effect.get("forced") and (effect["name"] in unseen or _finer(effect, lines)))
        )
        self.camera: Camera | None = None
        self.sun_turn = (0.0, 0.0)
        self.patient = not roaming
        self.haste: float | None = None
        self.reuse, self.skipped = True, tuple[str, ...]()
        self._reuse, self._made_for = reuse.Reuse(), tuple[Any, ...]()
        self.linked: dict[str, int] = {}
        self._made: list[Any] = []
        self._shared: dict[Any, Any] = {}
        # Decode assets while the driver starts
        with ThreadPoolExecutor() as pool:
            loading = self._load_sprites(pool)
            self._owns_context = context is None
            self.ctx = capture.make_context() if context is None else context
            opaque = {"surface", "transfer", "voxels"}.intersection(self.called)
            self.programs = Programs(self.ctx)
            self.targets = Frame(self.ctx, size, SAMPLES if opaque else 1, self.programs)
            self.passes: dict[str, Any] = {}
            try:
                self._open(loading)
            except BaseException:
                # A shader that is being edited breaks here
                self.close()
                raise

    def _open(self, loading: list[tuple[Any, Future[Any]]]) -> None:
        """Put assets on the card and make the passes."""
        with self._within("billboard"):
            groups = [(billboards, asset.result()) for billboards, asset in loading]
            self.sprites = sprites.load(self.ctx, self.targets, groups)
        self.sprite_lighting = lighting.SpriteLighting()
        self.look(0.0)
        for name in self.called:
            with self._within(name):
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

    def picture(self, time: float) -> Any:
        """Return the finished picture at `time` seconds as an object that notebooks show."""
        return import_module("runtime.picture").Picture(self.frame(time)[..., :3])

    def movie(self, times: Sequence[float], rate: float | None = None) -> Any:
        """Return a loop of pictures as an object that notebooks show; the scene's rate if None."""
        frames = [self.frame(time)[..., :3] for time in times]
        return import_module("runtime.picture").Movie(frames, rate or self.scene.time.frame_rate)

    def draw(self, time: float, *, finished: bool = True) -> None:
        """Draw the frame of `time` seconds into the targets `colour` and, finished, `picture`.

        A pass whose inputs did not change since the last frame is not run again.
        """
        self.targets.begin()
        with self.targets.timed("start"):
            self.look(time)
            wanted = {
                n: p
                for n, p in self.passes.items()
                if n not in self.off and (finished or n != "film")
            }
            steps, chain = self._steps(wanted, time)
            if steps.restore:
                self.targets.restore(steps.restore_depth)
        clear = steps.first == 0
        self.skipped = tuple(wanted)[: steps.first]
        for number, (name, drawn) in enumerate(wanted.items()):
            if number < steps.first:
                continue
            # The first pass that is not opaque sees the mean of the samples
            if (drawn.reads or drawn.writes) and not getattr(drawn, "opaque", False):
                self._resolve()
            if number == steps.keep:
                self._resolve()
                with self.targets.timed("keep"):
                    self.targets.keep(steps.keep_depth)
            with self._within(name), self.targets.timed(name):
                # A clear by itself would cost more: drivers join it with the first draw
                if clear and drawn.writes:
                    self._clear()
                    clear = False
                drawn.draw(time)
        if clear:
            self._clear()
        self._resolve()
        self._reuse.done(chain, steps)

    def _steps(self, wanted: dict[str, Any], time: float) -> tuple[reuse.Steps, reuse.Chain]:
        if not self.reuse:
            self._reuse.forget()
            return reuse.Steps(), ()
        # What was drawn is gone where the targets were made anew
        made = (self.targets.generation, *self.passes)
        if made != self._made_for:
            self._reuse.forget()
            self._made_for = made
        chain = tuple(
            (name, (self._changes, reuse.key(drawn, time))) for name, drawn in wanted.items()
        )
        return self._reuse.plan(chain, list(wanted.values()), self.targets.samples > 1), chain

    def _clear(self) -> None:
        owner, self.targets.owner = self.targets.owner, "start"
        sampled = self.targets.samples > 1
        target = self.targets.opaque() if sampled else self.targets.target("colour", self._depth)
        target.use()
        target.clear(0.0, 0.0, 0.0, 1.0, depth=1.0)
        self.targets.owner = owner

    def _resolve(self) -> None:
        if self.targets.unresolved:
            with self._within("resolve"), self.targets.timed("resolve"):
                self.targets.resolve()

    @contextmanager
    def _within(self, name: str) -> Iterator[None]:
        """Count programs linked meanwhile as those of a pass."""
        before, owner, self.targets.owner = self.programs.count, self.targets.owner, name
        try:
            yield
        finally:
            self.targets.owner = owner
            self.linked[name] = self.linked.get(name, 0) + self.programs.count - before

    def look(self, time: float) -> None:
        """Set camera (`view`) and `lights` to those of `time` seconds."""
        # A copy keeps nothing of arrays that were written to in place since
        own = self.camera
        self.view = replace(own) if own else Camera.of_scene(self.scene, time)
        if "lens" in self.off and self.view.f_number is not None:
            self.view = replace(self.view, f_number=PINHOLE)
        self.lights = lighting.at(self.scene, time, self.sun_turn)

    # changes

    def change(
        self,
        scene: scenes.Scene | None = None,
        *,
        hidden: Iterable[str] | None = None,
        off: Iterable[str] | None = None,
    ) -> None:
        """Play a changed scene from the next frame on; None leaves a part as it is.

        scene : of as many lights, meshes, sets and lamps of the same kinds, in other light, places
        and pictures. hidden : names such as mesh/NAME, billboard/NAME, and shadow/NAME of a mesh
        or set that casts one. off : names of effects that may be left out, see `optional`, and
        `lens`. Nothing is baked or loaded; a tone curve or grain is compiled the first time.
        """
        if scene is not None:
            self.scene = scene
        if hidden is not None:
            self.hidden = frozenset(hidden)
        if off is not None:
            self.off = frozenset(off) & {*self.optional, "lens"}
        described = {each.name: each for each in self.scene.billboards}
        for each in (each for each in self.sprites if each.name in described):
            casts = described[each.name].shadow and self.shows("shadow", each.name)
            each.shadow = casts and self.shows("billboard", each.name)
        self._changes += 1

    @property
    def optional(self) -> tuple[str, ...]:
        """Passes that the picture can do without: they only add to it or alter it."""
        own = {"colour", "depth"}
        return tuple(
            name
            for name, drawn in self.passes.items()
            if drawn.writes and own.issuperset(drawn.writes) and name != "occlusion"
        )

    def shows(self, kind: str, name: str) -> bool:
        """Whether `change` leaves something in the picture."""
        return f"{kind}/{name}" not in self.hidden

    def settle(self) -> None:
        """Let light go on settling, within `haste`; the next frame shows it."""
        for drawn in self.passes.values():
            if hasattr(drawn, "settle"):
                drawn.settle()

    @property
    def settled(self) -> bool:
        """Whether the same moment drawn again would be the same picture."""
        return all(getattr(drawn, "settled", True) for drawn in self.passes.values())

    @property
    def profile(self) -> dict[str, Any]:
        """Counts of the last frame, and milliseconds of each pass when it last ran.

        timing : how time was taken.
        by_pass : programs, textures, bytes and draw calls of each pass; `start` has what all share.
        skipped : passes that the last frame did not run again.
        """
        return profile.of(self)

    def close(self) -> None:
        """Free everything on the card; the context too where the player made it."""
        for drawn in self.passes.values():
            if hasattr(drawn, "release"):
                drawn.release()
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

    def vertex_array(self, program: Any, content: Any = (), index: Any = None) -> Any:
        """Return a vertex array that `close` frees; without content the shader counts vertices.

        index : buffer of 32-bit numbers of vertices, None to take them in order.
        """
        return self.keep(self.ctx.vertex_array(program, list(content), index))

    def buffer(self, size: int) -> Any:
        """Return a vertex buffer of `size` bytes that `close` frees."""
        return self.keep(self.ctx.buffer(reserve=size, dynamic=True))

    def once(self, make: Callable[[Player], Any]) -> Any:
        """Return what `make(player)` made when it was first asked for."""
        if make not in self._shared:
            self._shared[make] = make(self)
        return self._shared[make]

    def keep(self, made: Any) -> Any:
        """Return something made on the card that `close` frees."""
        self._made.append(made)
        return made

    def _take_lights(self, plans: list[dict[str, Any]]) -> None:
        """Drop the lights that the plan left out; maps are named by their light's new number."""
        left_out = {plan["index"] for plan in plans if not plan["kept"]}
        kept = [i for i in range(len(self.scene.lights)) if i not in left_out]
        number = {f"environment/{old}": f"environment/{new}" for new, old in enumerate(kept)}
        self._assets = {number.get(name, name): path for name, path in self._assets.items()}
        self.scene = replace(self.scene, lights=tuple(self.scene.lights[i] for i in kept))

    def _load_sprites(self, pool: ThreadPoolExecutor) -> list[tuple[Any, Future[Any]]]:
        if "billboard" not in self.called:
            return []
        folders = self.folders("billboard")
        missing = [b.name for b in self.scene.billboards if b.name not in folders]
        if missing:
            where = f"assets.billboard/{missing[0]}"
            raise DamagedError(self.folder / "manifest.json", where, "missing", "bake it again")
        return [(b, pool.submit(sprites.read, folders[b.name])) for b in self.scene.billboards]

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


def _finer(effect: dict[str, Any], lines: float) -> bool:
    """Tell whether a circle under half a pixel of the plan's lines is not of so many times them."""
    return effect.get("unit") == "px" and effect["bound"] * lines >= HALF_PIXEL


def _check_order(passes: dict[str, Any]) -> None:
    """Check that every target that a pass reads was cleared or written before."""
    written = {"colour", "depth"}
    for name, drawn in passes.items():
        if lacking := set(drawn.reads) - written:
            raise RuntimeError(f"pass {name} reads {sorted(lacking)[0]}, which none wrote before")
        written |= set(drawn.writes)
