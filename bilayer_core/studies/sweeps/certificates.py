"""Certificates for a Dask scheduler whose address begins with ``tls://``."""

from __future__ import annotations

import ssl
from pathlib import Path
from typing import TYPE_CHECKING

from bilayer_core.errors import InputError
from bilayer_core.extras import require

if TYPE_CHECKING:
    from distributed import Security

ENCRYPTED = "tls://"
OPTIONS = {
    "ca_file": ("--tls-ca-file", "distributed.comm.tls.ca-file"),
    "cert": ("--tls-cert", "distributed.comm.tls.client.cert"),
    "key": ("--tls-key", "distributed.comm.tls.client.key"),
}
"""Option and key of Dask's configuration for each file, by Dask's name for it."""


def is_encrypted(address: str) -> bool:
    """Return whether only who has a certificate can use the scheduler at an address."""
    return address.startswith(ENCRYPTED)


def security_of(ca_file: str | None, cert: str | None, key: str | None) -> Security:
    """Return the certificates of a client; what is not given comes from Dask's configuration.

    Parameters
    ----------
    ca_file, cert, key : str or None
        PEM files.

    Raises
    ------
    InputError
        If Dask is not installed.
    """
    require("--scheduler", "dask", "distributed")
    from distributed import Security

    given = {"tls_ca_file": ca_file, "tls_client_cert": cert, "tls_client_key": key}
    return Security(**{name: value for name, value in given.items() if value is not None})


def check_certificates(address: str, security: Security) -> None:
    """Raise InputError unless a client can use an address with these certificates."""
    if not is_encrypted(address):
        if security.require_encryption:
            raise InputError(f"--scheduler: {address}: certificates need an address that begins with {ENCRYPTED}")
        return
    files = security.get_tls_config_for_role("client")
    for name in ("ca_file", "cert"):
        if not files[name]:
            raise InputError(f"--scheduler: {address}: needs certificates; {_where(name)} is missing")
    named = {name: files[name] for name in OPTIONS if files[name]}
    if any("\n" in text for text in named.values()):
        return  # a program gave certificates, not names of files
    for name, path in named.items():
        _check_readable(name, path)
    _check_pem(named)


def _check_readable(name: str, path: str) -> None:
    try:
        Path(path).read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{_where(name)}: {path}: cannot be read: {reason}") from None


def _check_pem(files: dict[str, str]) -> None:
    """Raise InputError unless OpenSSL takes the files."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    cert, key = files["cert"], files.get("key", files["cert"])
    try:
        context.load_verify_locations(files["ca_file"])
    except ssl.SSLError:
        raise InputError(f"{_where('ca_file')}: {files['ca_file']}: has no certificate in PEM format") from None
    try:
        context.load_cert_chain(cert, key, password=_refuse_encrypted)
    except PermissionError:
        raise InputError(f"{_where('key')}: {key}: is encrypted; Dask needs a key without a pass phrase") from None
    except ssl.SSLError as error:
        if error.reason == "KEY_VALUES_MISMATCH":
            raise InputError(f"{_where('key')}: {key}: is not the key of the certificate {cert}") from None
        raise InputError(f"{_where('cert')}: {cert}: is no certificate in PEM format, or {key} no key of one") from None


def _refuse_encrypted() -> bytes:
    """Answer OpenSSL's question for a pass phrase, which it would put to the terminal."""
    raise PermissionError


def _where(name: str) -> str:
    option, key = OPTIONS[name]
    return f"{option} (or {key} in Dask's configuration)"
