"""Elastic–plastic bodies in contact, and the loads at which they collapse.

Names are imported when they are first used, so that what needs no mesh starts no MPI.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
