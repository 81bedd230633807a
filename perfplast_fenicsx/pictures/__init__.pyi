from .boundary_surface import Surface as Surface
from .drawing_process import animate as animate
from .drawing_process import draw as draw
from .drawing_process import plot as plot
from .envelope_picture import save_envelope as save_envelope
from .envelope_picture import save_shakedown as save_shakedown
from .result_reader import ResultReader as ResultReader
