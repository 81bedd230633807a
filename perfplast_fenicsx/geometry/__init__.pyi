from .kept_mesh import mesh_geometry as mesh_geometry
from .meshing_options import MeshingOptions as MeshingOptions
from .survey import Survey as Survey
