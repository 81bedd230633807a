from .checker import Checked as Checked
from .checker import ProofError as ProofError
from .checker import check as check
