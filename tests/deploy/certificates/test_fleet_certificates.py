"""Which certificates are made, kept and replaced, and what is said of those that cannot be used."""

import shutil
import stat
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from support.fleets import PAIR

from rcopterx.deploy.certificates.files import CHOICE, own_credentials, own_name
from rcopterx.deploy.certificates.fleet_certificates import LOCAL_NAMES, make_certificates
from rcopterx.deploy.certificates.issuing import (
    AUTHORITY_DAYS,
    expiry_warning,
    issue,
    problem,
    read_authority,
)
from rcopterx.deploy.hosts.resources import check_certificate
from rcopterx.fleet.reading import parse_fleet
from rcopterx.fleet.schema import FleetError, FleetFile

NOW = datetime(2026, 11, 22, 12, tzinfo=UTC)
NAMES = [
    *("host.main", "host.second", "agent.h1", "agent.h2"),
    *("program.h1", "program.h2", "operator.ann", "watcher.lab"),
]


def fleet_in(directory: Path, second: str = "192.0.2.2") -> FleetFile:
    return parse_fleet(
        f'{PAIR}[hosts.main]\naddress = "192.0.2.1"\n[hosts.second]\naddress = "{second}"\n'
        f'[security]\ncertificates = "{directory}"\noperators = ["ann"]'
    )


def made(directory: Path, now: datetime = NOW) -> FleetFile:
    fleet = fleet_in(directory)
    make_certificates(fleet, now, 365)
    return fleet


def test_every_name_of_the_fleet_file_gets_a_certificate(tmp_path: Path) -> None:
    directory = tmp_path / "new" / "certificates"
    made(directory)
    assert {path.stem for path in directory.glob("*.pem")} == {*NAMES, "authority"}
    assert [problem(directory, name, NOW) for name in NAMES] == [None] * len(NAMES)


def test_keys_are_readable_for_their_owner_only(tmp_path: Path) -> None:
    made(tmp_path / "c")
    for path in (tmp_path / "c").glob("*.key"):
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert stat.S_IMODE((tmp_path / "c").stat().st_mode) == 0o700


def test_what_is_there_and_valid_is_kept(tmp_path: Path) -> None:
    fleet = made(tmp_path)
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    assert make_certificates(fleet, NOW, 365) == [f"{tmp_path}: all certificates are there and valid"]
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_only_what_is_missing_moved_or_expires_soon_is_issued_again(tmp_path: Path) -> None:
    made(tmp_path)
    (tmp_path / "agent.h1.key").unlink()
    moved = fleet_in(tmp_path, second="192.0.2.3")
    assert make_certificates(moved, NOW, 40) == [
        "host.second: issued (other address), valid for 40 days",
        "agent.h1: issued (new), valid for 40 days",
    ]
    assert [line.split(":")[0] for line in make_certificates(moved, NOW + timedelta(days=11), 365)] == [
        "host.second", "agent.h1",
    ]  # fmt: skip


def test_what_a_host_refuses_is_issued_again(tmp_path: Path) -> None:
    fleet = made(tmp_path)
    (tmp_path / "host.main.key").write_text("nonsense")
    shutil.copy(tmp_path / "agent.h2.key", tmp_path / "agent.h1.key")
    (tmp_path / "operator.ann.key").chmod(0o644)
    authority = read_authority(tmp_path)
    issue(authority, tmp_path, "host.second", ["192.0.2.2", *LOCAL_NAMES], NOW + timedelta(days=2), 365)
    lines = make_certificates(fleet, NOW, 365)
    assert [line.split(":")[0] for line in lines] == ["host.main", "host.second", "agent.h1", "operator.ann"]
    assert [problem(tmp_path, name, NOW) for name in NAMES] == [None] * len(NAMES)


@pytest.mark.parametrize("damage", ["expired", "another key"])
def test_an_authority_that_cannot_be_used_is_refused_with_the_option_that_replaces_it(
    tmp_path: Path, damage: str
) -> None:
    fleet = made(tmp_path)
    now = NOW
    if damage == "expired":
        now += timedelta(days=AUTHORITY_DAYS)
    else:
        shutil.copy(tmp_path / "host.main.key", tmp_path / "authority.key")
    with pytest.raises(FleetError, match=r"authority\.(pem|key): .* --new-authority"):
        make_certificates(fleet, now, 365)
    make_certificates(fleet, now, 365, new_authority=True)
    assert [problem(tmp_path, name, now) for name in NAMES] == [None] * len(NAMES)


def test_renewing_changes_every_key_and_a_new_authority_makes_the_old_ones_worthless(tmp_path: Path) -> None:
    fleet = made(tmp_path)
    old = tmp_path / "old"
    shutil.copytree(tmp_path, old)
    make_certificates(fleet, NOW, 365, renew=True)
    for name in NAMES:
        assert (tmp_path / f"{name}.key").read_bytes() != (old / f"{name}.key").read_bytes()
        assert problem(tmp_path, name, NOW) is None
    make_certificates(fleet, NOW, 365, renew=True, new_authority=True)
    for suffix in ("pem", "key"):
        shutil.copy(old / f"host.main.{suffix}", tmp_path)
    assert (
        problem(tmp_path, "host.main", NOW)
        == f"{tmp_path}/host.main.pem: not issued by the authority beside it"
    )


def test_certificates_from_elsewhere_are_not_overwritten(tmp_path: Path) -> None:
    fleet = made(tmp_path)
    (tmp_path / "authority.key").unlink()
    with pytest.raises(FleetError, match="made on another computer"):
        make_certificates(fleet, NOW, 365)


def test_a_fleet_file_without_a_directory_is_refused_with_what_to_add() -> None:
    with pytest.raises(
        FleetError, match=r'^security\.certificates: .* certificates = "~/\.config/rcopterx/lab"'
    ):
        make_certificates(parse_fleet(PAIR), NOW, 365)


@pytest.mark.parametrize(
    ("later", "message"),
    [
        (timedelta(days=366), "valid from 2026-11-22 11:00 to 2027-11-22 12:00 UTC"),
        (timedelta(days=-1), "valid from"),
    ],
)
def test_a_certificate_out_of_its_time_is_reported(tmp_path: Path, later: timedelta, message: str) -> None:
    made(tmp_path)
    assert message in str(problem(tmp_path, "host.main", NOW + later))


def test_a_certificate_that_soon_expires_is_warned_of(tmp_path: Path) -> None:
    made(tmp_path)
    assert expiry_warning(tmp_path, "host.main", NOW) is None
    warning = expiry_warning(tmp_path, "host.main", NOW + timedelta(days=360))
    assert warning == f"{tmp_path}/host.main.pem: expires in 5 days"


def test_damaged_missing_and_exposed_files_are_reported(tmp_path: Path) -> None:
    made(tmp_path)
    (tmp_path / "host.main.key").chmod(0o644)
    assert "others can read it; chmod 600" in str(problem(tmp_path, "host.main", NOW))
    shutil.copy(tmp_path / "host.second.key", tmp_path / "host.main.key")
    assert "not the key of the certificate" in str(problem(tmp_path, "host.main", NOW))
    (tmp_path / "host.main.pem").write_text("nonsense")
    assert "damaged" in str(problem(tmp_path, "host.main", NOW))
    (tmp_path / "host.main.pem").unlink()
    assert "No such file" in str(problem(tmp_path, "host.main", NOW))


def test_a_host_without_its_certificate_starts_nothing(tmp_path: Path) -> None:
    fleet = fleet_in(tmp_path)
    with pytest.raises(FleetError, match=r"^security\.certificates: .*rcopterx certs makes certificates"):
        check_certificate(fleet, "main")
    make_certificates(fleet, datetime.now(UTC), 365)
    check_certificate(fleet, "main")


def test_a_computer_shows_the_certificate_whose_key_it_has(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(CHOICE, raising=False)
    fleet = made(tmp_path)
    assert own_name(fleet, "second") == "host.second"
    (tmp_path / "host.second.key").unlink()
    assert own_name(fleet, "second") == "operator.ann"
    monkeypatch.setenv(CHOICE, "watcher.lab")
    shown = own_credentials(fleet, "second")
    assert shown is not None
    assert shown.private_key == f"{tmp_path}/watcher.lab.key"
    monkeypatch.setenv(CHOICE, "operator.bob")
    with pytest.raises(FleetError, match=r"operator\.bob\.key cannot be read"):
        own_name(fleet, "second")
    monkeypatch.delenv(CHOICE)
    for path in tmp_path.glob("*.key"):
        path.unlink()
    assert own_credentials(fleet, "second") is None
