"""Add the mirror image of a meshed model, with exactly mirrored nodes."""

from collections.abc import Mapping

import gmsh

from meshes.naming import name


def add_mirror_image(axis: int, names: Mapping[str, str]) -> None:
    """Add the image in the plane x_axis = 0 of the whole mesh of gmsh's current model.

    The images are separate bodies that share no node with the originals, even where they touch;
    :func:`~perfplast_fenicsx.mesh.split_bodies.write_split` writes all bodies.

    Args:
        axis: 0, 1 or 2.
        names: Name of the image of each physical volume and surface; it may equal the original
            name.
    """
    model = gmsh.model
    dim = model.getDimension()
    tags, coordinates, _ = model.mesh.getNodes()
    points = coordinates.reshape(-1, 3)
    points[:, axis] = 0.0 - points[:, axis]  # 0.0 instead of the -0.0 of a sign change
    shift = tags.max()

    faces = {tag: model.addDiscreteEntity(dim - 1) for _, tag in model.getEntities(dim - 1)}
    bodies = {}
    for _, tag in model.getEntities(dim):
        _, sides = model.getAdjacencies(dim, tag)
        bodies[tag] = model.addDiscreteEntity(dim, boundary=[faces[side] for side in sides])
    model.mesh.addNodes(dim, next(iter(bodies.values())), tags + shift, points.ravel())

    for entity_dim, images in ((dim, bodies), (dim - 1, faces)):
        for tag, image in images.items():
            kinds, _, nodes = model.mesh.getElements(entity_dim, tag)
            for kind, array in zip(kinds, nodes, strict=True):
                model.mesh.addElementsByType(image, kind, [], array + shift)
        model.mesh.reverse([(entity_dim, image) for image in images.values()])
        # Gmsh has no two groups of one name: a group whose image keeps the name becomes larger.
        groups: dict[str, list[int]] = {}
        for pair in model.getPhysicalGroups(entity_dim):
            label, members = model.getPhysicalName(*pair), model.getEntitiesForPhysicalGroup(*pair)
            groups.setdefault(label, []).extend(members)
            groups.setdefault(names[label], []).extend(images[tag] for tag in members)
            model.removePhysicalGroups([pair])
            model.removePhysicalName(label)
        name(entity_dim, groups)
