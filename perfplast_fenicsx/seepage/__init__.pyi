from .declared import Head as Head
from .declared import Seepage as Seepage
from .flow import SteadyFlow as SteadyFlow
from .flow import steady_flow as steady_flow
