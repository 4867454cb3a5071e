"""Files on disks that take nothing for a while, or are full."""

import threading


class Valve:
    """Files whose bytes go to the disk only while the valve is open; meanwhile a write waits, as in the system."""

    def __init__(self):
        self._open = threading.Event()
        self._open.set()
        self.stalled = threading.Event()

    def shut(self):
        """Let nothing through any more."""
        self._open.clear()

    def open(self):
        """Let all through again."""
        self._open.set()

    def file(self, path, force):
        """In place of `log.file.lock.open_alone`."""
        return _Behind(self, path.open("xb"))

    def wait(self):
        """Return when it is open."""
        if not self._open.is_set():
            self.stalled.set()
        self._open.wait()


class _Behind:
    def __init__(self, valve, file):
        self._valve, self._file = valve, file

    def write(self, data):
        self._valve.wait()
        return self._file.write(data)

    def __getattr__(self, name):
        return getattr(self._file, name)


class Full:
    """A file that takes some bytes, and then says that the disk is full."""

    def __init__(self, file, room):
        self._file, self._room = file, room

    def write(self, data):
        self._room -= len(data)
        if self._room < 0:
            raise OSError(28, "No space left on device")
        return self._file.write(data)

    def __getattr__(self, name):
        return getattr(self._file, name)
