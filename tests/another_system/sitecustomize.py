"""Windows as the core sees it: its modules import a system without the names that Windows lacks.

Python imports this file at its start where this folder is on the path, in processes that the core starts, too. Other
libraries see the system as it is: they bring what they need on each system themselves.
"""

import builtins
import os
import signal
import subprocess
import types

MISSING_MODULES = {"fcntl", "grp", "pty", "pwd", "resource", "syslog", "termios", "tty"}
MISSING_IN_OS = set(
    """
    WNOHANG chown chroot confstr fchown fork forkpty getegid geteuid getgid getgroups getloadavg getpgid getpgrp
    getpriority getresuid getsid getuid initgroups killpg lchown lockf mkfifo mknod nice openpty pathconf pipe2
    posix_fallocate posix_spawn posix_spawnp pread pwrite sched_getaffinity sched_setaffinity sched_yield sendfile
    setegid seteuid setgid setpgid setpriority setsid setuid statvfs sync sysconf tcgetpgrp ttyname uname wait wait3
    wait4 waitid O_CLOEXEC O_DIRECTORY O_NOCTTY O_NOFOLLOW O_NONBLOCK O_SYNC
    """.split()
)
SIGNALS = set("SIGABRT SIGFPE SIGILL SIGINT SIGSEGV SIGTERM SIG_DFL SIG_IGN".split())
FUNCTIONS_OF_SIGNALS = set("default_int_handler getsignal raise_signal set_wakeup_fd signal strsignal".split())


def view(module, names):
    """A module with these names alone."""
    seen = types.ModuleType(module.__name__)
    vars(seen).update({name: vars(module)[name] for name in names})
    return seen


SEEN = {
    "os": view(os, vars(os).keys() - MISSING_IN_OS),
    "signal": view(signal, SIGNALS | FUNCTIONS_OF_SIGNALS | {"Signals"}),
}
import_module, start = builtins.__import__, subprocess.Popen.__init__


def import_as_on_windows(name, globals=None, locals=None, fromlist=(), level=0):
    if level == 0 and (globals or {}).get("__name__", "").partition(".")[0] == "bilayer_core":
        if name in MISSING_MODULES:
            raise ModuleNotFoundError(f"No module named '{name}'", name=name)
        if name in SEEN:
            return SEEN[name]
    return import_module(name, globals, locals, fromlist, level)


def start_as_on_windows(self, *arguments, preexec_fn=None, **named):
    if preexec_fn is not None:
        raise ValueError("preexec_fn is not supported on Windows platforms")
    start(self, *arguments, **named)


builtins.__import__, subprocess.Popen.__init__ = import_as_on_windows, start_as_on_windows
