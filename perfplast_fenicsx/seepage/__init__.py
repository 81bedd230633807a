"""Compute the steady flow of water through ground, and the pore pressures of this flow."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
