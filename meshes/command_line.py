"""The command line that the mesh generators share: -o, --size, --order, and what one adds."""

import argparse
import inspect
from collections.abc import Callable
from pathlib import Path


def mesh_parser(write: Callable[..., None], description: str) -> argparse.ArgumentParser:
    """A parser for the arguments of a generator, with the generator's own defaults.

    Args:
        write: The generator, ``write_NAME(path, ..., size=..., order=1)``; options that are added
            to the parser get the default of the argument of the same name.
        description: What it meshes, for the help text.
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
    """Write the mesh that the command line asks for.

    Args:
        parser: Made by :func:`mesh_parser` for the same generator.
        write: The generator.
    """
    write(**vars(parser.parse_args()))
