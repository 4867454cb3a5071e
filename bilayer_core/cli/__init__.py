"""The command line ``bilayer``. Each verb imports what it needs when it runs, so that help answers at once."""

from __future__ import annotations

from bilayer_core.cli.signals import Signals

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Default: those of the process, which is expected to end with this function.
    """
    signals = Signals(of_process=arguments is None)
    try:
        signals.heed()
        from bilayer_core.cli.program import run_program  # only now: a signal may come while it is imported
        from bilayer_core.cli.streams import guard_streams

        if arguments is None:
            guard_streams()
        return signals.ended(run_program(arguments, signals))
    except BaseException as error:
        if (interruption := signals.behind(error)) is None:
            raise
        return signals.interrupted(interruption)
    finally:
        signals.close()
