"""Check proof files: ``python3 -m perfplast_fenicsx.proof FILE ...``.

The exit status is 1 if a bound is not proven, and 2 if a file is not a proof.

``--pair stands.h5 falls.h5`` checks the two files of a factor of safety, and checks that both
describe the same bodies. ``--sha256 FILE ...`` only prints the SHA-256 of the numbers in each file,
which reports show too.
"""

import sys
from collections.abc import Sequence

from perfplast_fenicsx.proof.checker import check, check_pair, numbers_digest
from perfplast_fenicsx.proof.plain_arrays import ProofError

PAIR = "--pair"
"""Option before the two files of a factor of safety."""

DIGEST = "--sha256"
"""Option to print the hash of the numbers in each file, without checking the files."""


def main(arguments: Sequence[str]) -> int:
    """Check files, print proven bounds and the data taken as written; return the exit status."""
    status = 0
    paths = [path for path in arguments if path not in (PAIR, DIGEST)]
    found = []
    try:
        if DIGEST in arguments:
            print(*(f"{numbers_digest(path)}  {path}" for path in paths), sep="\n")
            return 0
        for path in paths:
            found.append(check(path))
            for checked in found[-1].values():
                print(checked, *checked.words, sep="\n  ")
                status = status or int(bool(checked.faults))
        if PAIR in arguments:
            if len(paths) != 2:
                raise ProofError(f"{PAIR} needs the two files of a factor of safety.")
            pair = check_pair(paths[0], paths[1], found)
            print(pair)
            status = status or int(bool(pair.faults))
    except ProofError as error:
        print(error, file=sys.stderr)
        return 2
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
