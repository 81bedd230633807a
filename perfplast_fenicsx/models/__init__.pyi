from .foreign_model import ForeignModel as ForeignModel
from .inp_file import read_inp as read_inp
from .model_case import case_of as case_of
from .msh_file import write_msh as write_msh
