from .parser import make_parser as make_parser
from .terminal import Terminal as Terminal
