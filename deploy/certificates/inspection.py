"""Checks of the certificates on this computer."""

import os
import stat
from datetime import datetime, timedelta
from pathlib import Path
from typing import Final

from cryptography import x509
from cryptography.hazmat.primitives import serialization

from rcopterx.deploy.certificates.files import AUTHORITY, certificate_path, key_path

WARN_DAYS: Final = 14


def read_certificate(path: Path) -> x509.Certificate:
    """Read a certificate; raises `OSError`, or `ValueError` if the file is damaged."""
    return x509.load_pem_x509_certificate(path.read_bytes())


def problem(directory: Path, name: str, now: datetime) -> str | None:
    """Return why a certificate cannot be used at the time `now`; None if it can."""
    path = certificate_path(directory, name)
    try:
        authority = read_certificate(certificate_path(directory, AUTHORITY))
        own = read_certificate(path)
        key = serialization.load_pem_private_key(key_path(directory, name).read_bytes(), password=None)
    except OSError as error:
        return f"{error.filename}: {error.strerror}"
    except (ValueError, TypeError) as error:
        return f"{path}: damaged: {error}"
    try:
        own.verify_directly_issued_by(authority)
    except Exception:  # noqa: BLE001 - the library raises several kinds
        return f"{path}: not issued by the authority beside it"
    if own.public_key() != key.public_key():
        return f"{key_path(directory, name)}: not the key of the certificate beside it"
    for certificate, file in ((own, path), (authority, certificate_path(directory, AUTHORITY))):
        if not certificate.not_valid_before_utc <= now < certificate.not_valid_after_utc:
            return (
                f"{file}: valid from {certificate.not_valid_before_utc:%Y-%m-%d %H:%M} "
                f"to {certificate.not_valid_after_utc:%Y-%m-%d %H:%M} UTC, now it is {now:%Y-%m-%d %H:%M}"
            )
    return _exposed(key_path(directory, name))


def expiry_warning(directory: Path, name: str, now: datetime) -> str | None:
    """Return a warning if a usable certificate expires soon."""
    left = read_certificate(certificate_path(directory, name)).not_valid_after_utc - now
    if left > timedelta(days=WARN_DAYS):
        return None
    return f"{certificate_path(directory, name)}: expires in {left.days} days"


def _exposed(path: Path) -> str | None:
    status = path.stat()
    if status.st_uid not in (os.geteuid(), 0):
        return f"{path}: belongs to another user"
    if stat.S_IMODE(status.st_mode) & 0o077:
        return f"{path}: others can read it; chmod 600 {path}"
    return None
