"""Check files: ``python3 -m perfplast_fenicsx.proof FILE ...``; status 1 where one fails."""

import sys
from collections.abc import Sequence

from perfplast_fenicsx.proof.checker import check
from perfplast_fenicsx.proof.plain_arrays import ProofError


def main(paths: Sequence[str]) -> int:
    """Check files and say what they prove, and what is taken as written."""
    status = 0
    for path in paths:
        try:
            for checked in check(path).values():
                print(checked, *checked.words, sep="\n  ")
                status = status or int(bool(checked.faults))
        except ProofError as error:
            print(error, file=sys.stderr)
            return 2
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
