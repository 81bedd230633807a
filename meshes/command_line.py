"""Define the command line of the mesh generators: -o, --size, --order, and further options."""

import argparse
import inspect
from collections.abc import Callable
from pathlib import Path


def mesh_parser(write: Callable[..., None], description: str) -> argparse.ArgumentParser:
    """Return a parser for the arguments of a generator, with the generator's own defaults.

    Args:
        write: The generator, ``write_NAME(path, ..., size=..., order=1)``. An option that is added
            to the parser gets the default of the argument with the same name.
        description: Description of the mesh, for the help text.
    """
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.ArgumentDefaultsHelpFormatter
    )
    defaults = {name: p.default for name, p in inspect.signature(write).parameters.items()}
    defaults["path"] = Path(write.__name__.removeprefix("write_") + ".msh")
    parser.set_defaults(**defaults)
    parser.add_argument("-o", "--output", dest="path", type=Path, help="the file to write")
    parser.add_argument("--size", type=float, help="edge length of the elements")
    parser.add_argument("--order", type=int, choices=(1, 2), help="degree of the geometry")
    return parser


def write_from(parser: argparse.ArgumentParser, write: Callable[..., None]) -> None:
    """Write the mesh that the command line describes.

    Args:
        parser: Parser of :func:`mesh_parser` for the same generator.
        write: The generator.
    """
    write(**vars(parser.parse_args()))
