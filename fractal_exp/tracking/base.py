"""What a fit may ask of a tracker."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    import pandas as pd


class Tracker:
    """Where a fit's numbers, pictures and files go. This one keeps nothing.

    As a context manager it ends the run when the block ends: FINISHED, KILLED by KeyboardInterrupt, or FAILED.
    """

    run_id: str | None = None

    def log(self, metrics: Mapping[str, float], step: int = 0) -> None:
        """Log numbers by name (train/…, eval/…, time/…) at a step; a number is anything that float() takes.

        NaN and infinities are left out, since MLflow would store other numbers for them, and counted in the tag
        non_finite. Raises `InputError` on a name that MLflow refuses.
        """

    def image(self, name: str, image: Any, step: int | None = None) -> None:
        """Log a picture: with a step, one of the series `name`; without, the file views/`name`.png.

        image: array or tensor (R,C) or (R,C,3), uint8 or real in [0,1]. Raises `InputError` on anything else and on a
        name that MLflow refuses.
        """

    def artifact(self, name: str, content: Path | str | bytes) -> None:
        """Log a file under `name`, a relative path: a copy of the file at a Path, or a text, or bytes.

        A file of the same name is replaced. Raises `InputError` on a name that MLflow refuses, OSError if the Path
        cannot be read.
        """

    def table(self, name: str, frame: pd.DataFrame) -> None:
        """Log a frame as a table of the dashboard under `name`, which ends in .json; a table of that name is replaced.

        The index is dropped, non-finite numbers become null. Raises `InputError` on a name that MLflow refuses.
        """

    def secure(self) -> None:
        """Make sure that what was logged so far arrives even if this process is killed now."""

    def finish(self, status: str = "FINISHED", error: BaseException | str | None = None) -> None:
        """Send what waits and end the run as FINISHED, FAILED or KILLED; a second call does nothing.

        An error becomes the tag error and, if it is an exception, the file traceback.txt.
        """

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: Any) -> None:
        if error is None or (isinstance(error, SystemExit) and not error.code):
            self.finish()
        else:
            self.finish("KILLED" if isinstance(error, KeyboardInterrupt) else "FAILED", error)
