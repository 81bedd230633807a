from .contact import Contact as Contact
from .obstacles import OBSTACLES as OBSTACLES
from .obstacles import Cylinder as Cylinder
from .obstacles import Obstacle as Obstacle
from .obstacles import Plane as Plane
from .obstacles import Sphere as Sphere
