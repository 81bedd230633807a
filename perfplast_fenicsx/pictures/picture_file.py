"""Write pictures as files that are replaced as a whole."""

import io
from pathlib import Path
from typing import Any

from perfplast_fenicsx.atomic_files import replace


def replace_picture(path: Path, figure: Any) -> None:
    """Save a matplotlib figure in the format of the file name's suffix.

    Raises:
        OSError: If the system refuses; the old file is then unchanged.
    """
    image = io.BytesIO()
    figure.savefig(image, format=path.suffix.lstrip(".") or "png")
    replace(path, image.getvalue())
