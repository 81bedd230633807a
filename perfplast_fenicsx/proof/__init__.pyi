from .checker import check as check
from .plain_arrays import ProofError as ProofError
from .verdict import Checked as Checked
