"""Errors that a user can cause, each one line with a remedy and a documented exit code."""


class BakelightError(Exception):
    """Base of all typed errors: `str(error)` is the one line that the command line prints.

    exit_code : process exit status; 2 input, 3 machine, 4 damaged asset.
    """

    exit_code = 1

    def __init__(self, file: object, field: str, value: object, remedy: str) -> None:
        self.file, self.field, self.value, self.remedy = str(file), field, value, remedy
        shown = value if isinstance(value, str) else repr(value)
        parts = [self.file, field, shown if len(shown) <= 200 else shown[:197] + "..."]
        super().__init__(": ".join(p for p in parts if p).replace("\n", " ") + f" -- {remedy}")


class InputError(BakelightError):
    """A file, a field or an argument that cannot be used as it is."""

    exit_code = 2


class MachineError(BakelightError):
    """The machine lacks something: OpenGL, disk space, memory."""

    exit_code = 3


class DamagedError(BakelightError):
    """A baked asset whose bytes are not those that were sealed."""

    exit_code = 4


def reason(error: BaseException) -> str:
    """Return what an exception says in one line, behind its type where that says more than
    ValueError does.

    >>> reason(ValueError("no header")), reason(KeyError("size"))
    ('no header', "KeyError: 'size'")
    """
    text = " ".join(str(error).split())
    return text if type(error) is ValueError and text else f"{type(error).__name__}: {text}"
