"""Issues the certificates of a fleet by an authority of its own."""

import ipaddress
import os
import stat
from collections.abc import Collection
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Final

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from rcopterx.deploy.certificates.files import AUTHORITY, certificate_path, key_path
from rcopterx.places import replace_file

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


AUTHORITY_DAYS: Final = 3650
BACKDATED: Final = timedelta(hours=1)  # validity before the issue, because clocks of hosts differ
RENEW_DAYS: Final = 30  # certificates that expire earlier are issued again


@dataclass(frozen=True)
class Authority:
    """Certificate and key that sign certificates."""

    certificate: x509.Certificate
    key: ec.EllipticCurvePrivateKey


def new_authority(fleet: str, directory: Path, now: datetime) -> Authority:
    """Make an authority and write it; certificates of an earlier one become invalid."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = _name(f"rcopterx {fleet}")
    certificate = (
        _builder(name, name, key, now, AUTHORITY_DAYS)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(_usage(signs_certificates=True), critical=True)
        .sign(key, hashes.SHA256())
    )
    _keep(directory, AUTHORITY, certificate, key)
    return Authority(certificate, key)


def read_authority(directory: Path) -> Authority:
    """Read the authority in a directory; raises `OSError`, or `ValueError` if a file is damaged."""
    certificate = read_certificate(certificate_path(directory, AUTHORITY))
    key = serialization.load_pem_private_key(key_path(directory, AUTHORITY).read_bytes(), password=None)
    if not isinstance(key, ec.EllipticCurvePrivateKey):
        raise ValueError(f"{key_path(directory, AUTHORITY)}: not a key of this program")
    return Authority(certificate, key)


def issue(
    authority: Authority, directory: Path, name: str, addresses: Collection[str], now: datetime, days: float
) -> None:
    """Issue a certificate with a new key, and write both into a directory; only their owner can read the key.

    `addresses` are empty for owners that only connect to others; `now` has a zone; tests use negative `days`.
    """
    key = ec.generate_private_key(ec.SECP256R1())
    names = [_address(address) for address in addresses]
    server = [ExtendedKeyUsageOID.SERVER_AUTH] if names else []
    builder = (
        _builder(_name(name), authority.certificate.subject, key, now, days)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(_usage(signs_certificates=False), critical=True)
        .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.CLIENT_AUTH, *server]), critical=False)
    )
    if names:
        builder = builder.add_extension(x509.SubjectAlternativeName(names), critical=False)
    _keep(directory, name, builder.sign(authority.key, hashes.SHA256()), key)


def due(directory: Path, name: str, addresses: Collection[str], now: datetime) -> str | None:
    """Return why a certificate has to be issued; None if the present one is good."""
    path = certificate_path(directory, name)
    if not path.exists() or not key_path(directory, name).exists():
        return "new"
    if (why := problem(directory, name, now)) is not None:
        return why
    present = read_certificate(path)
    if present.not_valid_after_utc - now < timedelta(days=RENEW_DAYS):
        return "expires soon"
    names = [item.value for item in present.extensions if isinstance(item.value, x509.SubjectAlternativeName)]
    same = {name for own in names for name in own} == {_address(address) for address in addresses}
    return None if same else "other address"


def _address(address: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(address))
    except ValueError:
        return x509.DNSName(address)


def _name(common_name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common_name)])


def _builder(
    subject: x509.Name, issuer: x509.Name, key: ec.EllipticCurvePrivateKey, now: datetime, days: float
) -> x509.CertificateBuilder:
    end = now + timedelta(days=days)
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(min(now, end) - BACKDATED)
        .not_valid_after(end)
    )


def _usage(*, signs_certificates: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=True,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        key_cert_sign=signs_certificates,
        crl_sign=signs_certificates,
        encipher_only=False,
        decipher_only=False,
    )


def _keep(directory: Path, name: str, certificate: x509.Certificate, key: ec.EllipticCurvePrivateKey) -> None:
    """Write key and certificate; each file is replaced as a whole."""
    directory.mkdir(parents=True, exist_ok=True, mode=0o700)
    pem = serialization.Encoding.PEM
    secret = key.private_bytes(pem, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    replace_file(key_path(directory, name), secret, 0o600)
    replace_file(certificate_path(directory, name), certificate.public_bytes(pem), 0o644)
