"""Render the pictures of README and docs again: the grove at four hours and through a day, a tree
relit, a sprite's light by four methods, the player beside the traced reference, a bust between two
lamps, its shadow by bands of harmonics beside the traced one, a courtyard of cubes, and a night
market.

Run by `make images`; other hours may be given, or `frame`, `bust`, `harmonics`, `cubeworld`,
`lantern` or `cells` for one alone. Writes grove.webp (four panels, 1200 pixels wide, under 400 kB),
grove-day.webp (a loop of 72 frames, under 3 MB), relit.webp, normal-map.webp, frame.webp, bust.webp
and cubeworld.webp (four panels each), lantern.webp (one large panel, three small), cells.webp and
harmonics.webp (five, under 200 kB) beside this file.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
SCENE, CELLS = "assets/scenes/grove.toml", "assets/scenes/cells.toml"
HOURS = [6.7, 12.0, 18.5, 20.75]
WIDTH, GAP, SHEET_BYTES = 1200, 8, 400_000
# The loop lingers where the light changes: frames at which these hours of the day are reached
FRAMES, REACHED, AT = 72, [0, 24, 36, 60, 72], [4.8, 9.0, 16.5, 20.6, 28.8]
RATE, DAY_BYTES = 12, 3_000_000

# One sprite, five lights: morning, noon, afternoon, evening, and two lamps of different colours
TREE = "assets/meshes/oak.glb"
LIGHTS = [
    ["-1,0.25,0.45,7,4.2,1.9"],
    ["-0.5,0.9,0.5,5,4.7,4.2"],
    ["0.6,0.8,0.5,5,4.4,3.6"],
    ["1,0.2,0.45,7.5,2.9,1.3"],
    ["-1,0.1,0.5,0.5,1.2,3.6", "0.9,-0.5,0.5,5.2,2.2,0.6"],
]
BACKDROP = (20, 24, 34)

# One sprite by four methods, under two of the lights that the study of normal maps tests
COMPARED, COMPARED_LIGHTS, COMPARED_BYTES = "lantern", (6, 21), 200_000
BRIGHTER = 2.2  # than measured, to be seen
METHODS = {
    "truth": "truth",
    "normal": "normal map, 8 bytes",
    "ptm": "PTM, 18 bytes",
    "ring": "ring, 12 bytes",
    "dome": "dome, 16 bytes",
}


# The player beside the reference: scene, seconds, size, paths a pixel
WINDOW, WINDOW_BYTES = (960, 640), 150_000
FRAME, FRAME_AT, FRAME_SIZE, FRAME_PATHS, FRAME_BYTES = "glowcaps", 6.0, (480, 270), 32, 300_000


# The bust turns once in 24 seconds
# Light in a courtyard of cubes, at four moments of its sixteen seconds
CUBES, CUBES_AT = "assets/scenes/cubeworld.toml", [0.0, 4.0, 8.0, 12.0]

# The night market: one moment large, three below it as the focus goes from the branch to the cat
MARKET, MARKET_AT = "assets/scenes/lantern.toml", [7.0, 0.0, 1.9, 10.0]

BUST, BUST_AT = "assets/scenes/bust.toml", [0.0, 6.0, 12.0, 18.0]

# Its shadow from near, at one moment: volumes of all components beside the scene's own, and paths a
# pixel of the truth
BANDS = {
    "L2": {"l_max": 2, "components": 9},
    "L3": {"l_max": 3, "components": 16},
    "L4": {"l_max": 4, "components": 25},
}
BANDS_OWN = "L7, as the scene has it"
BANDS_AT, BANDS_SIZE, BANDS_PATHS, BANDS_BYTES = 18.0, (234, 312), 128, 200_000
BANDS_CAMERA, BANDS_EXPOSURE = {"focal_length_mm": 54.0, "target": [0.10, 0.92, 0.0]}, 0.75


# Fins along outlines: a coarse mesh without, with crisp and with soft ones, and a fine mesh
FINS_SIDES, FINS_SIZE, FINS_BYTES = 14, (480, 270), 150_000
FINS: list[tuple[str, dict[str, float]]] = [
    ("coarse", {}),
    ("coarse", {"silhouette_width": 0.1}),
    ("coarse", {"silhouette_width": 0.1, "silhouette_softness": 0.4}),
    ("fine", {}),
]
FINS_LABELS = ("14 sides", "with fins", "with soft fins", "128 sides")
FINS_SCENE: dict[str, Any] = {
    "format": 1,
    "camera": {"position": [0.6, 1.6, 4.6], "target": [0, 0, 0], "focal_length_mm": 46},
    "lights": [
        {"type": "sun", "to_light": [-1, 1.2, 0.8], "irradiance": [3.4, 2.7, 2.0]},
        {"type": "sun", "to_light": [1, 0.3, -0.1], "irradiance": [0.5, 0.9, 1.6]},
    ],
    "picture": {
        "sky": {"zenith": [0.01, 0.02, 0.05], "horizon": [0.05, 0.07, 0.11]},
        "film": {"tonemap": "filmic"},
    },
}


def frame(folder: Path) -> Image.Image:
    """Play a frame and trace it without shadows, side by side; print the PSNR between them."""
    from bake import reference, reference_film
    from formats import scene as scenes
    from maths.image_error import psnr
    from pipelines.bake_scene import bake_scene
    from runtime.player import Player

    path = ROOT / "assets" / "scenes" / f"{FRAME}.toml"
    width, height = FRAME_SIZE
    with Player(bake_scene(path, build_folder=folder).folder, size=FRAME_SIZE) as player:
        played = player.linear(FRAME_AT)[..., :3]
    params = reference.Params(
        width=width, height=height, time=FRAME_AT, samples=FRAME_PATHS, bounces=0, shadows=False
    )
    scene = scenes.load(path)
    traced = reference.render(scene, params=params).radiance
    shown = [reference_film.develop(picture, scene, FRAME_AT) for picture in (played, traced)]
    print(f"{FRAME} at {FRAME_AT:g} s: PSNR {psnr(shown[0] / 255, shown[1] / 255):.1f} dB")
    sheet = Image.new("RGB", (2 * width + GAP, height), "white")
    for i, picture in enumerate(shown):
        sheet.paste(Image.fromarray(picture), (i * (width + GAP), 0))
    return sheet


def relit(folder: Path) -> Image.Image:
    """Bake a tree once and show it under each of the lights, side by side."""
    program = [sys.executable, "-m", "pipelines.cli"]
    bake = ["billboard", TREE, "-o", f"{folder}/tree", "--resolution", "400", "--sky-fill", "0.03"]
    subprocess.run([*program, *bake], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
    width = WIDTH // len(LIGHTS)
    trees = []
    for i, lights in enumerate(LIGHTS):
        flags = [f"--light={light}" for light in lights]
        command = [*program, "relight", f"{folder}/tree", *flags, "--exposure", "1.3"]
        command += ["-o", f"{folder}/{i}.png"]
        subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
        with Image.open(folder / f"{i}.png") as opened:
            trees.append(opened.resize((width, round(width * opened.height / opened.width))))
    sheet = Image.new("RGB", (WIDTH, trees[0].height + 24), BACKDROP)
    for i, tree in enumerate(trees):
        sheet.paste(tree, (i * width, 12), tree)
    return sheet


def compared() -> Image.Image:
    """Show truth and methods side by side, a row a light, with the PSNR of each."""
    from maths.colour import srgb_decode, srgb_encode
    from pipelines.studies import normal_map, subjects

    mesh, setting = subjects.named(COMPARED), subjects.Setting()
    lights = normal_map.unseen()[list(COMPARED_LIGHTS)]
    one = normal_map.subject(mesh, setting, resolution=420, lights=lights)
    found = normal_map.errors(one)
    assert one.truth.coverage is not None
    behind = srgb_decode(np.array(BACKDROP) / 255) * (1 - one.truth.coverage[..., None])
    width, (height, wide) = WIDTH // len(METHODS), one.truth.coverage.shape
    sheet = Image.new("RGB", (WIDTH, 30 + 2 * (height + 40)), BACKDROP)
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(17)
    for column, (method, title) in enumerate(METHODS.items()):
        middle = column * width + width // 2
        draw.text((middle, 20), title, "white", font, anchor="mm")
        for row, light in enumerate(lights):
            truth = method == "truth"
            picture = one.truth.pictures[row] if truth else one.methods[method](light)
            shown = BRIGHTER * picture * (one.truth.coverage[..., None] > 0) + behind
            codes = np.rint(255 * srgb_encode(np.clip(shown, 0, 1))).astype(np.uint8)
            top = 40 + row * (height + 40)
            sheet.paste(Image.fromarray(codes), (middle - wide // 2, top))
            elevation = np.degrees(np.arcsin(light[2]))
            said = f"{elevation:.0f} degrees" if truth else f"{found[method][row]:.1f} dB"
            draw.text((middle, top + height + 14), said, "white", font, anchor="mm")
    return sheet


def render(folder: Path, hours: list[float], size: str, scene: str = SCENE) -> list[Image.Image]:
    """Render the scene at these hours, in one process, as pictures in their order."""
    times = [word for hour in hours for word in ("--time", f"{hour:.2f}")]
    program = [sys.executable, "-m", "pipelines.cli", "render", scene, "--size", size]
    command = [*program, *times, "-o", f"{folder}/"]
    subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
    paths = [folder / f"{Path(scene).stem}-{hour:06.2f}.png" for hour in hours]
    return [Image.open(path).convert("RGB") for path in paths]


def arrange(pictures: list[Image.Image]) -> Image.Image:
    """Put four pictures on a white sheet, two rows of two, scaled to its width."""
    width = (WIDTH - GAP) // 2
    height = round(width * pictures[0].height / pictures[0].width)
    sheet = Image.new("RGB", (WIDTH, 2 * height + GAP), "white")
    for i, picture in enumerate(pictures):
        panel = picture.resize((width, height), Image.Resampling.LANCZOS)
        sheet.paste(panel, ((i % 2) * (width + GAP), (i // 2) * (height + GAP)))
    return sheet


def bust(folder: Path) -> Image.Image:
    """Show the turning bust at four moments, on a sheet."""
    return arrange(render(folder, BUST_AT, "1192x672", BUST))


def cubeworld(folder: Path) -> Image.Image:
    """Show the courtyard of cubes at four moments, on a sheet."""
    return arrange(render(folder, CUBES_AT, "1192x672", CUBES))


def lantern(folder: Path) -> Image.Image:
    """Show the night market at one moment large, and at three small below it."""
    large, *small = render(folder, MARKET_AT, "1200x676", MARKET)
    width = (WIDTH - 2 * GAP) // 3
    height = round(width * large.height / large.width)
    sheet = Image.new("RGB", (WIDTH, large.height + GAP + height), "white")
    sheet.paste(large, (0, 0))
    for i, picture in enumerate(small):
        panel = picture.resize((width, height), Image.Resampling.LANCZOS)
        sheet.paste(panel, (i * (width + GAP), large.height + GAP))
    return sheet


def cells(folder: Path) -> Image.Image:
    """Show pictures alone through a lens: focus on the near cell above, below on those behind."""
    near, far = (np.asarray(p) for p in render(folder, [0.5, 5.2], "1200x600", CELLS))
    return Image.fromarray(np.concatenate([near, np.full_like(near[:GAP], 255), far]))


def harmonics(folder: Path) -> Image.Image:
    """Show the shadow of the bust by more and more bands, and traced, a label under each."""
    from bake import reference, reference_film
    from formats import scene as scenes
    from pipelines.studies import shadow_truth

    def closer(data: dict[str, Any]) -> None:
        data["camera"] |= BANDS_CAMERA
        data["picture"]["film"]["exposure"] = BANDS_EXPOSURE

    width, height = BANDS_SIZE
    volumes: dict[str, shadow_truth.Volume] = {**BANDS, BANDS_OWN: "as it is"}
    played = shadow_truth.play(volumes, [BANDS_AT], BANDS_SIZE, closer)
    data: dict[str, Any] = dict(scenes.load(ROOT / BUST).raw)
    closer(data)
    path = folder / "closer.json"
    path.write_text(json.dumps(data))
    scene = scenes.load(path, ROOT / "assets")
    params = reference.Params(width=width, height=height, time=BANDS_AT, samples=BANDS_PATHS)
    truth = reference.render(scene, params=params).radiance
    shown = {name: one.pictures[BANDS_AT] for name, one in played.items()}
    shown["traced"] = reference_film.develop(truth, scene, BANDS_AT)
    sheet = Image.new("RGB", (len(shown) * (width + GAP) - GAP, height + 28), BACKDROP)
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(15)
    for i, (name, picture) in enumerate(shown.items()):
        left = i * (width + GAP)
        sheet.paste(Image.fromarray(picture), (left, 0))
        draw.text((left + width // 2, height + 14), name, "white", font, anchor="mm")
    return sheet


def silhouettes(folder: Path) -> Image.Image:
    """Show a coarse ball and ring without fins, with them, crisp and soft, and fine ones."""
    from formats.files import glb
    from pipelines.bake_scene import bake_scene
    from runtime.player import Player

    (folder / "scenes").mkdir()
    for name, sides in (("coarse", FINS_SIDES), ("fine", 128)):
        parts = [_wound(sides, 0.0, 0.62, 0.1), _wound(sides, 0.9, 0.2, 0.0)]
        glb.write(folder / f"{name}.glb", [glb.Node(name, tuple(parts))])
    shown = []
    for number, (name, look) in enumerate(FINS):
        raw = {**FINS_SCENE, "meshes": [{"name": "m", "source": f"{name}.glb", **look}]}
        path = folder / "scenes" / f"fins{number}.json"
        path.write_text(json.dumps(raw))
        done = bake_scene(path, build_folder=folder / "build")
        with Player(done.folder, size=FINS_SIZE) as player:
            shown.append(Image.fromarray(player.frame(0.0)[..., :3]))
    width, height = FINS_SIZE
    sheet = Image.new("RGB", (WIDTH, 2 * (3 * height // 2 + 28)), BACKDROP)
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(15)
    left, top = 5 * width // 12, height // 7
    for i, (picture, label) in enumerate(zip(shown, FINS_LABELS, strict=True)):
        corner = (i % 2) * (WIDTH + GAP) // 2, (i // 2) * (3 * height // 2 + 28)
        crop = picture.crop((left, top, left + (WIDTH - GAP) // 8, top + 3 * height // 8))
        large = crop.resize((crop.width * 4, crop.height * 4), Image.Resampling.NEAREST)
        sheet.paste(large, corner)
        middle = corner[0] + large.width // 2, corner[1] + large.height + 14
        draw.text(middle, label, "white", font, anchor="mm")
    return sheet


def _wound(sides: int, middle: float, thick: float, up: float) -> Any:
    """A ring about +y, a ball where its radius is 0, as a part of a mesh."""
    from formats.files import glb

    count = sides if middle else sides // 2 + 1
    across = np.arange(count) * 2 * np.pi / sides - (0.0 if middle else np.pi / 2)
    u, v = np.meshgrid(np.arange(sides) * 2 * np.pi / sides, across, indexing="ij")
    normals = np.stack([np.cos(v) * np.cos(u), np.sin(v), np.cos(v) * np.sin(u)], axis=-1)
    places = thick * normals + middle * np.stack([np.cos(u), 0 * u, np.sin(u)], axis=-1)
    places[..., 1] += up
    i, j = np.meshgrid(np.arange(sides), np.arange(count - (not middle)), indexing="ij")
    a, b = i * count + j, i * count + (j + 1) % count
    c, d = ((k - i * count + (i + 1) % sides * count) for k in (b, a))
    faces = np.concatenate([np.stack(f, axis=-1).reshape(-1, 3) for f in ([a, b, c], [a, c, d])])
    corners = places.reshape(-1, 3)[faces]
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    colour = (0.75, 0.45, 0.3, 1.0) if middle else (0.7, 0.68, 0.62, 1.0)
    return glb.Primitive(
        positions=places.reshape(-1, 3).astype(np.float32),
        indices=faces[area > 1e-6].astype(np.uint32),
        normals=normals.reshape(-1, 3).astype(np.float32),
        material=glb.Material(name="m", base_color=colour),
    )


def window(folder: Path) -> Image.Image:
    """Open the window on a virtual display (Xvfb, xdotool), half its picture without the lens."""
    from PIL import ImageGrab

    read, write = os.pipe()
    size = f"{WINDOW[0] + 320}x{WINDOW[1]}"
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", f"{size}x24"]
    server = subprocess.Popen(command, pass_fds=(write,), stderr=subprocess.DEVNULL)
    os.close(write)
    with os.fdopen(read) as stream:
        display = ":" + stream.readline().strip()
    program = [sys.executable, "-m", "pipelines.cli", "view", f"assets/scenes/{FRAME}.toml"]
    program += ["--size", f"{WINDOW[0]}x{WINDOW[1]}", "--build", str(folder), "--json"]
    env = {k: v for k, v in os.environ.items() if k != "WAYLAND_DISPLAY"} | {"DISPLAY": display}
    shown = subprocess.Popen(program, cwd=ROOT, env=env, stdout=subprocess.PIPE, text=True)
    try:
        # At rest before and after: the truth, then the picture without the last effect
        for keys in (["mousemove", "300", "200", "key", "Tab", "key", "Tab"], []):
            while '"drawn"' not in (line := shown.stdout.readline() if shown.stdout else ""):
                if not line:
                    raise SystemExit("the window closed before it was drawn")
            if keys:
                subprocess.run(["xdotool", *keys], env=env, check=True)
        return ImageGrab.grab(xdisplay=display)
    finally:
        shown.terminate()
        shown.wait()
        server.terminate()
        server.wait()


def save(pictures: list[Image.Image], path: Path, largest: int) -> None:
    """Save one picture, or a loop of several, at the best quality whose file is small enough."""
    moving: dict[str, Any] = {"save_all": True, "append_images": pictures[1:], "loop": 0}
    options = {**moving, "duration": 1000 // RATE} if pictures[1:] else {}
    for quality in range(92, 40, -4):
        pictures[0].save(path, quality=quality, method=4, **options)
        if path.stat().st_size <= largest:
            break
    else:
        raise SystemExit(f"{path}: still over {largest} bytes; make it smaller or shorter")
    print(f"{path.relative_to(ROOT)}: {path.stat().st_size} bytes at quality {quality}")


# Pictures that may be asked for by name, and their largest sizes in bytes
ALONE = {
    "window": (window, WINDOW_BYTES),
    "frame": (frame, FRAME_BYTES),
    "bust": (bust, SHEET_BYTES),
    "harmonics": (harmonics, BANDS_BYTES),
    "cubeworld": (cubeworld, SHEET_BYTES),
    "silhouettes": (silhouettes, FINS_BYTES),
    "lantern": (lantern, SHEET_BYTES),
    "cells": (cells, SHEET_BYTES),
}


def main() -> None:
    """Render, arrange, save, and say where."""
    if len(sys.argv) == 2 and sys.argv[1] in ALONE:
        draw, largest = ALONE[sys.argv[1]]
        with tempfile.TemporaryDirectory() as folder:
            save([draw(Path(folder))], HERE / f"{sys.argv[1]}.webp", largest)
        return
    hours = [float(word) for word in sys.argv[1:]] or HOURS
    day = np.interp(np.arange(FRAMES), REACHED, AT) % 24
    with tempfile.TemporaryDirectory() as folder:
        stills = render(Path(folder), hours, "1192x672")
        frames = render(Path(folder), [round(float(hour), 2) for hour in day], "480x270")
        tree = relit(Path(folder))
        alone = {name: draw(Path(folder)) for name, (draw, _) in ALONE.items()}
    save([arrange(stills)], HERE / "grove.webp", SHEET_BYTES)
    save(frames, HERE / "grove-day.webp", DAY_BYTES)
    save([tree], HERE / "relit.webp", SHEET_BYTES)
    for name, picture in alone.items():
        save([picture], HERE / f"{name}.webp", ALONE[name][1])
    save([compared()], HERE / "normal-map.webp", COMPARED_BYTES)


if __name__ == "__main__":
    main()
