from .exported_files import export as export
from .result_rows import bound_rows as bound_rows
from .result_rows import level_rows as level_rows
from .result_rows import resultant_rows as resultant_rows
from .run_results import RunResults as RunResults
