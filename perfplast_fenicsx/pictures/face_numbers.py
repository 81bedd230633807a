"""Place the numbers of faces in a picture: on their faces, where these are visible."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt, find_objects

from perfplast_fenicsx.arrays import Longs

Room = dict[int, tuple[float, float, float]]
"""By the number of a face: a pixel (x, y) in it, and its distance from other faces (pixels)."""

ENOUGH = 17.0
"""Distance (pixels) from which a number is drawn on its face, not beside it."""


@dataclass(frozen=True)
class Label:
    """A number in a picture.

    Attributes:
        number: Number of a face.
        at: Pixel (x, y) of the face.
        words_at: Pixel where the number is drawn; a line connects it with ``at`` if they differ.
    """

    number: int
    at: tuple[float, float]
    words_at: tuple[float, float]


def rooms(seen: Longs) -> Room:
    """Return the pixel of each face that is farthest from all other faces.

    Args:
        seen: Number of the face at each pixel, 0 for none, shape (height, width).
    """
    found: Room = {}
    for number, part in enumerate(find_objects(seen), start=1):
        if part is None:
            continue
        distance = np.asarray(distance_transform_edt(np.pad(seen[part] == number, 1)))
        ys, xs = np.nonzero(distance >= 0.97 * distance.max())
        from_middle = (ys - ys.mean()) ** 2 + (xs - xs.mean()) ** 2  # for long faces
        y, x = ys[from_middle.argmin()], xs[from_middle.argmin()]
        if distance[y, x] >= 1.5:  # pixels; a smaller face counts as invisible
            place = (x + part[1].start - 1, y + part[0].start - 1)
            found[number] = (float(place[0]), float(place[1]), float(distance[y, x]))
    return found


def shared_out(views: Sequence[Room]) -> list[Room]:
    """Return the faces of each view: those with the most space for their number, or with enough.

    Args:
        views: Visible faces of each view.
    """
    best = {
        number: max(view[number][2] for view in views if number in view)
        for number in set().union(*views)
    }
    return [
        {n: place for n, place in view.items() if place[2] >= min(best[n], 2 * ENOUGH)}
        for view in views
    ]


def labels(room: Room, pixels: tuple[int, int]) -> list[Label]:
    """Return the positions of the numbers; small faces have theirs beside them, without overlaps.

    Args:
        room: Space of the faces in a view.
        pixels: Width and height of the view.
    """
    size = np.array(pixels)
    taken = [np.array(place[:2]) for place in room.values()]
    found = []
    for number, (x, y, free) in sorted(room.items(), key=lambda item: -item[1][2]):
        at = np.array([x, y])
        words_at = at
        if free < ENOUGH:
            outward = np.arctan2(*(at - size / 2)[::-1])
            turns = np.array([0, 1, -1, 2, -2, 3, -3, 4]) * np.pi / 4
            tried = [
                at + far * np.array([np.cos(outward + turn), np.sin(outward + turn)])
                for far in (34, 52, 76, 104)
                for turn in turns
            ]
            inside = [p for p in tried if (np.minimum(p, size - p) > ENOUGH).all()]
            others = [place for place in taken if (place != at).any()]
            apart = 1.7 * ENOUGH
            words_at = next(
                (p for p in inside if all(np.abs(p - o).max() > apart for o in others)), at
            )
            taken.append(words_at)
        found.append(Label(number, (x, y), (float(words_at[0]), float(words_at[1]))))
    return found
