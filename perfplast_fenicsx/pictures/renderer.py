"""Render images of the deformed bodies and their surroundings with VTK.

A failure of the graphics system may end the process. Therefore only the drawing process imports
this module (:mod:`drawing_process`).
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pyvista as pv

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.io.case.scene import Scene
from perfplast_fenicsx.pictures.acting import Acting, shares
from perfplast_fenicsx.pictures.annotations import load_arrows, sample_obstacles
from perfplast_fenicsx.pictures.boundary_surface import Surface
from perfplast_fenicsx.pictures.figure_panels import Panel, hue
from perfplast_fenicsx.pictures.views import view_of

Paint = dict[str, Any]
"""Options of pyvista for drawing a mesh."""


DARK = 17
"""Value of red, green and blue in the colour of load arrows."""

IN_FRONT = 1e-3
"""In the plane, distance of overlays in front of the bodies, relative to their size."""


class Renderer:
    """The bodies and their surroundings, seen from one direction.

    The frames of an animation differ in the deformation, the arrows and the colours. They share one
    camera, which shows all of them.

    Attributes:
        view: Direction of view.
    """

    def __init__(
        self,
        frames: Sequence[Surface],
        scene: Scene,
        scale: float,
        pixels: tuple[int, int],
        states: Sequence[Acting] = (Acting(),),
    ) -> None:
        """Build the scene.

        Args:
            frames: One skin in one or more states.
            scene: Surroundings of the bodies.
            scale: Scale of the displacements.
            pixels: Width and height of each image.
            states: States of loads and obstacles in the frames.
        """
        self._skin = skin = frames[-1]
        self._pixels, self._flat, self._size = pixels, skin.plane, skin.size
        self._frames = np.array([a.points + scale * a.at_points["displacement"] for a in frames])
        # on the same facets in all frames, so that arrows move with the bodies and do not jump
        lengths = shares(states, scene.on_surfaces)
        self._arrows = [
            load_arrows(skin, moved, scene.on_surfaces, lengths[number])
            for number, moved in enumerate(self._frames)
        ]
        self.view = view_of(skin, scene.axisymmetric)
        self._axis = _axis(skin) if scene.axisymmetric else None
        bodies = range(len(skin.names))
        self._sharp = [] if self._flat else [self._sharp_edges(body) for body in bodies]
        travels = [
            tuple(
                scale * state.of_obstacle(one) if len(one.move) else 0.0 for one in scene.obstacles
            )
            for state in states
        ]
        parts = {each: self._obstacles_at(scene, each) for each in set(travels)}
        self._obstacles = [parts[each] for each in travels]

    def __repr__(self) -> str:
        return f"Renderer({self._skin!r}, {len(self._frames)} frames)"

    def draw(self, frame: int, panel: Panel) -> npt.NDArray[np.uint8]:
        """Return an image of a panel, shape (height, width, 3)."""
        plotter = pv.Plotter(off_screen=True, window_size=list(self._pixels))
        plotter.set_background("white")
        points, colours = self._frames[frame], panel.colours[frame]
        if panel.facets is None:
            self._add_bodies(plotter, points, colours)
        else:
            self._add_contact(plotter, points, colours, panel.facets)
        for before, after in self._outlines(points):
            plotter.add_mesh(before, color="#b0b0b0", line_width=1.5, lighting=False)
            plotter.add_mesh(after, color="#202020", line_width=2.5, lighting=False)
        for mesh, paint in self._obstacles[frame]:
            plotter.add_mesh(mesh, lighting=not self._flat, **paint)
        plotter.view_vector(self.view.towards, viewup=self.view.up)
        plotter.enable_parallel_projection()
        if self._axis is not None:
            plotter.add_mesh(self._axis, color="#606060", line_width=2, lighting=False)
        shows_loads = panel.loads and len(self._arrows[frame].starts) > 0
        if shows_loads:
            self._add_loads(plotter, frame)
        self._aim(plotter)
        plotter.enable_anti_aliasing("ssaa")
        image = np.asarray(plotter.screenshot(return_img=True))[..., :3]
        if shows_loads:  # hidden loads show faintly through the bodies
            plotter.clear_actors()
            self._add_loads(plotter, frame)
            plotter.render()
            alone = np.asarray(plotter.screenshot(return_img=True))[..., :3]
            faint = 0.4
            share = faint * (255.0 - alone) / (255.0 - DARK)
            image = (image - share * np.maximum(image - float(DARK), 0.0)).astype(np.uint8)
        plotter.close()
        return image

    def _add_loads(self, plotter: pv.Plotter, frame: int) -> None:
        arrows = self._arrows[frame]
        plotter.add_arrows(arrows.starts, arrows.vectors, color=(DARK,) * 3, lighting=False)

    def _add_bodies(self, plotter: pv.Plotter, points: Floats, colours: Floats) -> None:
        most_edges = 40_000  # largest number of triangles with which the mesh is drawn
        plotter.add_mesh(
            _mesh(points, self._skin.triangles),
            scalars=colours,
            rgb=True,
            lighting=not self._flat,
            ambient=0.6,
            diffuse=0.45,
            show_edges=len(self._skin.triangles) <= most_edges,
            edge_color="#404040",
            edge_opacity=0.4,
            line_width=0.5,
        )

    def _add_contact(
        self, plotter: pv.Plotter, points: Floats, colours: Floats, chosen: npt.NDArray[np.bool_]
    ) -> None:
        """Add the chosen facets over transparent bodies: triangles, or thick lines with a rim."""
        skin = self._skin
        # Opacity of bodies in the plane, and of skins in space.
        opacities = {True: 0.2, False: 0.12}
        for body in range(len(skin.names)):
            glass = skin.body == body
            if not self._flat:  # two skins at the same position would be mixed
                glass &= ~(chosen | skin.marks["opposite"])
            if glass.any():
                mesh = _mesh(points, skin.triangles[glass])
                plotter.add_mesh(
                    mesh, color=hue(body), opacity=opacities[self._flat], lighting=False
                )
        if not self._flat:
            mesh = _mesh(points, skin.facets[chosen])
            plotter.add_mesh(mesh, scalars=colours, rgb=True, lighting=False)
            return
        rim: Paint = {"color": "#404040", "line_width": 30}
        line: Paint = {"scalars": colours, "rgb": True, "line_width": 24}
        for layer, paint in enumerate((rim, line), start=1):
            lifted = points + np.array([0, 0, layer * IN_FRONT * self._size])
            plotter.add_mesh(_mesh(lifted, skin.facets[chosen]), lighting=False, **paint)

    def _obstacles_at(
        self, scene: Scene, travels: Sequence[float]
    ) -> list[tuple[pv.DataSet, Paint]]:
        """Return all obstacles, each displaced by a multiple of its move."""
        near = sample_obstacles(self._skin, self._frames.reshape(-1, 3), scene.obstacles, travels)
        return [
            part
            for distances in near.distances
            for part in self._obstacle(distances, near.corner, near.spacing)
        ]

    def _obstacle(
        self, distances: Floats, corner: Floats, spacing: Floats
    ) -> list[tuple[pv.DataSet, Paint]]:
        """Return meshes of an obstacle near the bodies with their options, given distances."""
        if distances.min() >= 0:
            return []
        grid = pv.ImageData(dimensions=distances.shape, spacing=spacing, origin=corner)
        grid.point_data["distance"] = distances.ravel(order="F")
        # in space slightly inside, since it would be mixed with the surface that touches it
        depth = 0.0 if self._flat else IN_FRONT * self._size
        skin = grid.contour([-depth], scalars="distance")
        if not self._flat:
            parts = [(skin, {"color": "#808080", "opacity": 0.25, "smooth_shading": True})]
        else:
            inside = grid.clip_scalar("distance", value=0.0)
            inside.translate((0, 0, -IN_FRONT * self._size), inplace=True)
            across = inside.points[:, :2].sum(axis=1)
            inside.point_data["across"] = across
            hatches = 60  # number of hatching lines across the picture
            step = self._size / hatches
            lines = np.arange(across.min(), across.max() + step, step)
            parts = [
                (inside, {"color": "#eeeeee"}),
                (inside.contour(lines, scalars="across"), {"color": "#b0b0b0", "line_width": 1}),
                (skin, {"color": "#606060", "line_width": 2.5}),
            ]
        return [(mesh, paint) for mesh, paint in parts if mesh.n_points]

    def _aim(self, plotter: pv.Plotter) -> None:
        """Fill the image with everything visible, loads included, in the same way in all panels."""
        axes, towards = self.view.frame[:2], self.view.frame[2]
        around = [mesh.points for parts in self._obstacles for mesh, _ in parts]
        arrows = [end for a in self._arrows for end in (a.starts, a.starts + a.vectors)]
        seen = np.concatenate([*self._frames, self._skin.points, *arrows, *around])
        low, high = (seen @ axes.T).min(axis=0), (seen @ axes.T).max(axis=0)
        half = (high - low) / 2
        centre = (low + high) / 2 @ axes + (seen.mean(axis=0) @ towards) * towards
        plotter.camera.focal_point = centre
        plotter.camera.position = centre + 3 * self._size * towards
        width, height = self._pixels
        plotter.camera.parallel_scale = 1.04 * max(half[1], half[0] * height / width)
        plotter.reset_camera_clipping_range()

    def _outlines(self, points: Floats) -> list[tuple[pv.PolyData, pv.PolyData]]:
        """Return edges of the bodies before and after a deformation."""
        if self._flat:
            return [(_mesh(self._skin.points, self._skin.facets), _mesh(points, self._skin.facets))]
        found = []
        for before in self._sharp:
            after = before.copy()
            after.points = points[before.point_data["number"]]
            found.append((before, after))
        return found

    def _sharp_edges(self, body: int) -> pv.PolyData:
        """Return the sharp edges of a body, found before it deforms."""
        mesh = _mesh(self._skin.points, self._skin.triangles[self._skin.body == body])
        mesh.point_data["number"] = np.arange(len(self._skin.points))
        # Angle (degrees) between facets above which their common edge is drawn; a cylinder of ten
        # facets has no such edges.
        sharp = 40.0
        return mesh.clean().extract_feature_edges(
            sharp, boundary_edges=False, manifold_edges=False, non_manifold_edges=False
        )


def _axis(skin: Surface) -> pv.PolyData:
    """Return the axis of revolution beside the bodies as a dash-dotted line."""
    low, high = skin.points[:, 1].min(), skin.points[:, 1].max()
    # Number of dashes of an axis of revolution, and its extension beyond the bodies relative to
    # their height.
    dashes, axis_beyond = 24, 0.05
    margin = axis_beyond * (high - low)
    begin = np.linspace(low - margin, high + margin, dashes, endpoint=False)
    dash = begin[1] - begin[0]
    ends = np.column_stack([begin, begin + 0.6 * dash, begin + 0.75 * dash, begin + 0.85 * dash])
    points = np.zeros((ends.size, 3))
    points[:, 1] = ends.ravel()
    points[:, 2] = skin.points[0, 2]
    return _mesh(points, np.arange(len(points)).reshape(-1, 2))


def _mesh(points: Floats, cells: Longs) -> pv.PolyData:
    """Return a mesh of triangles or lines."""
    size = cells.shape[1]
    numbers = np.column_stack([np.full(len(cells), size), cells]).ravel()
    return pv.PolyData(points, faces=numbers) if size == 3 else pv.PolyData(points, lines=numbers)
