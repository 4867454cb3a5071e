"""The command line ``bilayer``. Each verb imports what it needs when it runs, so that help answers at once."""

from bilayer_core.cli.program import main

__all__ = ["main"]
