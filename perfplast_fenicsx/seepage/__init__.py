"""Steady flow of water through ground, and the pressures that it has in the pores."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
