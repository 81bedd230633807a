"""Draws the panels of a picture from a file; run as a program of its own.

:mod:`render_process` starts it, so that a graphics system that fails takes nothing with it. Hence
nothing of this package or of MPI is imported here.
"""

import json
import sys
from typing import Any

import numpy as np
import numpy.typing as npt
import pyvista as pv

Floats = npt.NDArray[np.float64]

SHARP = 30.0
"""Edges between facets that differ by more degrees are drawn."""

MOST_EDGES = 40_000
"""The mesh is drawn where it has no more triangles than this."""

IN_FRONT = 1e-3
"""In the plane, what is drawn upon the bodies is so far before them, relative to their size."""

GLASS = {True: 0.2, False: 0.12}
"""Opacity of bodies in the plane, and of their skins in space."""

HATCHES = 60
"""Hatching has so many lines across the picture."""


class Scene:
    """The deformed bodies of a file and what is around them, seen from one direction.

    The frames of an animation differ in the deformation, the arrows and the colours. They have one
    camera, which sees all of them.
    """

    def __init__(self, data: dict[str, npt.NDArray[Any]], about: dict[str, Any]) -> None:
        self.data, self.about = data, about
        self.triangles, self.facets = data["triangles"], data["facets"]
        self.undeformed, self.frames = data["undeformed"], data["points"]
        self.pixels = tuple(about["pixels"])
        self.size = float(np.linalg.norm(np.ptp(self.undeformed, axis=0)))
        self.flat = self.facets.shape[1] == 2
        self.sharp = [] if self.flat else [self._sharp(body) for body in range(len(about["hues"]))]
        self.obstacles = [
            self._obstacle(data[f"obstacle {i}"]) for i in range(about["num_obstacles"])
        ]

    def draw(self, frame: int, panel: int) -> npt.NDArray[np.uint8]:
        """An image of a panel, shape (height, width, 3)."""
        plotter = pv.Plotter(off_screen=True, window_size=list(self.pixels))
        plotter.set_background("white")
        points = self.frames[frame]
        colours = self.data[f"colours {panel}"][frame]
        chosen = self.data.get(f"facets {panel}")
        if chosen is None:
            self._add_bodies(plotter, points, colours)
        else:
            self._add_contact(plotter, points, colours, chosen)
        for before, after in self._outlines(points):
            plotter.add_mesh(before, color="#b0b0b0", line_width=1.5, lighting=False)
            plotter.add_mesh(after, color="#202020", line_width=2.5, lighting=False)
        for parts in self.obstacles:
            for mesh, paint in parts:
                plotter.add_mesh(mesh, lighting=not self.flat, **paint)
        plotter.view_vector(self.about["view"], viewup=(0, 1, 0) if self.flat else (0, 0, 1))
        plotter.enable_parallel_projection()
        if self.about["loads"][panel] and len(self.data["arrows"]):
            start, vector = self.data["arrow_starts"][frame], self.data["arrows"]
            plotter.add_arrows(start, vector, color="#111111", lighting=False)
        self._frame(plotter)
        plotter.enable_anti_aliasing("ssaa")
        image = plotter.screenshot(return_img=True)
        plotter.close()
        return np.asarray(image)

    def _add_bodies(self, plotter: pv.Plotter, points: Floats, colours: Floats) -> None:
        plotter.add_mesh(
            _mesh(points, self.triangles),
            scalars=colours,
            rgb=True,
            lighting=not self.flat,
            ambient=0.6,
            diffuse=0.45,
            show_edges=len(self.triangles) <= MOST_EDGES,
            edge_color="#404040",
            edge_opacity=0.2,
            line_width=0.5,
        )

    def _add_contact(
        self, plotter: pv.Plotter, points: Floats, colours: Floats, chosen: npt.NDArray[np.bool_]
    ) -> None:
        """The chosen facets over bodies of glass: triangles, or thick lines with a rim."""
        for body, hue in enumerate(self.about["hues"]):
            glass = self.data["body"] == body
            if not self.flat:  # two skins at the same place would be mixed up
                glass &= ~(chosen | self.data["opposite"])
            if glass.any():
                mesh = _mesh(points, self.triangles[glass])
                plotter.add_mesh(mesh, color=hue, opacity=GLASS[self.flat], lighting=False)
        if not self.flat:
            mesh = _mesh(points, self.facets[chosen])
            plotter.add_mesh(mesh, scalars=colours, rgb=True, lighting=False)
            return
        rim: dict[str, Any] = {"color": "#404040", "line_width": 30}
        line: dict[str, Any] = {"scalars": colours, "rgb": True, "line_width": 24}
        for layer, paint in enumerate((rim, line), start=1):
            lifted = points + np.array([0, 0, layer * IN_FRONT * self.size])
            plotter.add_mesh(_mesh(lifted, self.facets[chosen]), lighting=False, **paint)

    def _obstacle(self, distance: Floats) -> list[tuple[pv.DataSet, dict[str, Any]]]:
        """Meshes of an obstacle near the bodies, from distances on a grid, and how to draw them."""
        about = self.about
        if distance.min() >= 0:
            return []
        grid = pv.ImageData(
            dimensions=distance.shape, spacing=about["spacing"], origin=about["corner"]
        )
        grid.point_data["distance"] = distance.ravel(order="F")
        # in space a little inside, since it would be mixed up with the surface that touches it
        depth = 0.0 if self.flat else IN_FRONT * self.size
        skin = grid.contour([-depth], scalars="distance")
        if not self.flat:
            parts = [(skin, {"color": "#808080", "opacity": 0.25, "smooth_shading": True})]
        else:
            inside = grid.clip_scalar("distance", value=0.0)
            inside.translate((0, 0, -IN_FRONT * self.size), inplace=True)
            across = inside.points[:, :2].sum(axis=1)
            inside.point_data["across"] = across
            step = self.size / HATCHES
            lines = np.arange(across.min(), across.max() + step, step)
            parts = [
                (inside, {"color": "#eeeeee"}),
                (inside.contour(lines, scalars="across"), {"color": "#b0b0b0", "line_width": 1}),
                (skin, {"color": "#606060", "line_width": 2.5}),
            ]
        return [(mesh, paint) for mesh, paint in parts if mesh.n_points]

    def _frame(self, plotter: pv.Plotter) -> None:
        """Fill the image with what there is to see, loads included, alike in all panels."""
        towards = np.array(self.about["view"]) / np.linalg.norm(self.about["view"])
        right = np.cross(plotter.camera.up, towards)
        right /= np.linalg.norm(right)
        axes = np.array([right, np.cross(towards, right)])
        around = [mesh.points for parts in self.obstacles for mesh, _ in parts]
        starts = self.data["arrow_starts"]
        arrows = np.concatenate([starts, starts + self.data["arrows"]]).reshape(-1, 3)
        seen = np.concatenate([self.frames.reshape(-1, 3), self.undeformed, arrows, *around])
        low, high = (seen @ axes.T).min(axis=0), (seen @ axes.T).max(axis=0)
        half = (high - low) / 2
        centre = (low + high) / 2 @ axes + (seen.mean(axis=0) @ towards) * towards
        plotter.camera.focal_point = centre
        plotter.camera.position = centre + 3 * self.size * towards
        plotter.camera.parallel_scale = 1.04 * max(
            half[1], half[0] * self.pixels[1] / self.pixels[0]
        )
        plotter.reset_camera_clipping_range()

    def _outlines(self, points: Floats) -> list[tuple[pv.PolyData, pv.PolyData]]:
        """Edges of the bodies before and after a deformation."""
        if self.flat:
            return [(_mesh(self.undeformed, self.facets), _mesh(points, self.facets))]
        found = []
        for before in self.sharp:
            after = before.copy()
            after.points = points[before.point_data["number"]]
            found.append((before, after))
        return found

    def _sharp(self, body: int) -> pv.PolyData:
        """Sharp edges of a body; found before it bends, where an edge is sharp all along."""
        mesh = _mesh(self.undeformed, self.triangles[self.data["body"] == body])
        mesh.point_data["number"] = np.arange(len(self.undeformed))
        return mesh.clean().extract_feature_edges(
            SHARP, boundary_edges=False, manifold_edges=False, non_manifold_edges=False
        )


def _mesh(points: Floats, cells: npt.NDArray[np.int64]) -> pv.PolyData:
    """Of triangles or lines."""
    size = cells.shape[1]
    numbers = np.column_stack([np.full(len(cells), size), cells]).ravel()
    return pv.PolyData(points, faces=numbers) if size == 3 else pv.PolyData(points, lines=numbers)


def main(source: str, target: str) -> None:
    """Draw all panels of the frames of ``source`` (npz) as arrays of pixels in ``target`` (npy)."""
    with np.load(source) as file:
        data = {name: file[name] for name in file.files}
    scene = Scene(data, json.loads(str(data.pop("about"))))
    frames, panels = range(len(scene.frames)), range(len(scene.about["loads"]))
    np.save(target, np.stack([[scene.draw(frame, panel) for panel in panels] for frame in frames]))


if __name__ == "__main__":
    main(*sys.argv[1:])
