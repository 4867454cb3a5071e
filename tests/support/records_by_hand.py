"""Records with a few values of them, for tests of kernels by themselves, and with other values."""


def record_of(declared, **values):
    """A record with these values; its other arrays are empty, its other numbers zero."""
    return changed(declared.absent(), **values)


def changed(record, **values):
    """A record with other values of some fields."""
    return type(record)(**{name: getattr(record, name) for name in record.names} | values)
