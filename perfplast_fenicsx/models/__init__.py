"""Read models of other programs: their meshes, sets, materials, loads and contact."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
