"""Pictures as files that are replaced as a whole."""

import io
from pathlib import Path
from typing import Any

from perfplast_fenicsx.atomic_files import replace


def replace_picture(path: Path, figure: Any) -> None:
    """Save a figure of matplotlib in the format that the name ends in.

    Raises:
        OSError: If the system refuses; the file is then as it was.
    """
    image = io.BytesIO()
    figure.savefig(image, format=path.suffix.lstrip(".") or "png")
    replace(path, image.getvalue())
