"""Records of compiled steps with a few values of them, for tests of kernels by themselves."""


def record_of(declared, **values):
    """A record with these values; its other arrays are empty, its other numbers zero."""
    absent = declared.absent()
    return declared(**{name: getattr(absent, name) for name in declared.names} | values)
