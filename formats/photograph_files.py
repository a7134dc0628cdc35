"""The files of a photographed source: a `.lp` file and the pictures that it names."""

from pathlib import Path

from formats.errors import InputError
from formats.files import light_positions

SUFFIX = ".lp"
_TURNED = 5  # EXIF orientations from here on swap width and height
_ORIENTATION = 274


def is_photographed(source: Path) -> bool:
    """Tell whether a source is a `.lp` file by its name."""
    return source.suffix.lower() == SUFFIX


def files(source: Path) -> tuple[Path, ...]:
    """The `.lp` file itself, then its photographs, each once, in its order.

    Raises InputError for what is no `.lp` file and for photographs that are not there.
    """
    return (source, *dict.fromkeys(light_positions.read(source).files))


def require_inside(source: Path, root: Path) -> tuple[Path, ...]:
    """`files` of a source whose photographs all lie under `root`, links followed.

    Raises InputError that names the first photograph that does not. The `.lp` file is not asked.
    """
    found = files(source)
    inside = root.resolve()
    for photograph in found[1:]:
        if not photograph.resolve().is_relative_to(inside):
            remedy = f"put it inside {inside}; neither .. nor links may leave it"
            raise InputError(source, "photograph", str(photograph), remedy)
    return found


def size(source: Path) -> tuple[int, int]:
    """(width, height) in texels of the first photograph of a `.lp` file, no pixel decoded.

    Raises InputError where it is no picture.
    """
    from PIL import Image

    from formats.files.image import FORMATS
    from formats.files.reading import refusing

    path = light_positions.read(source).files[0]
    kind = "picture (PNG, JPEG, WebP or TIFF)"
    with refusing(str(path), kind), Image.open(path, formats=FORMATS) as picture:
        width, height = picture.size
        turned = picture.getexif().get(_ORIENTATION, 1) >= _TURNED
    return (height, width) if turned else (width, height)
