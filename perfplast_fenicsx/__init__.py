"""Analyse elastic–plastic bodies in contact, and compute the loads at which they collapse.

Names are imported on first use, so code that needs no mesh does not start MPI.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
