from .boundary_surface import Surface as Surface
from .boundary_surface import gather_surface as gather_surface
from .plot_command import animate as animate
from .plot_command import plot as plot
from .result_reader import ResultReader as ResultReader
from .run_figures import draw_fields as draw_fields
from .run_figures import draw_path as draw_path
