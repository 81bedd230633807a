from .checker import Checked as Checked
from .checker import check as check
from .plain_arrays import ProofError as ProofError
