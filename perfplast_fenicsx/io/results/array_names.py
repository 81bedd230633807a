"""Names of the mesh's arrays in ``fields.h5``."""

TOPOLOGY, GEOMETRY, BODY = "Mesh/mesh/topology", "Mesh/mesh/geometry", "MeshTags/body/Values"
SURFACES, SURFACE_TAGS = "MeshTags/surfaces/topology", "MeshTags/surfaces/Values"
