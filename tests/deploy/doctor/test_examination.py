"""What is said of this computer, and how to mend it."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from support.fleets import HARDWARE_PAIR, PAIR

from rcopterx.deploy.certificates.fleet_certificates import make_certificates
from rcopterx.deploy.doctor.examination import CAP_SYS_NICE, certificates, devices, links, real_time
from rcopterx.fleet.reading import parse_fleet

NOW = datetime(2026, 11, 22, 12, tzinfo=UTC)


@pytest.mark.parametrize(
    ("priority", "limit", "capabilities", "good"),
    [
        (0, 0, 0, True), (28, 0, 0, False), (28, 27, 0, False), (28, 28, 0, True), (28, 40, 0, True),
        (28, -1, 0, True), (28, 0, 1 << CAP_SYS_NICE, True), (28, 0, ~(1 << CAP_SYS_NICE), False),
    ],
)  # fmt: skip
def test_real_time_priorities_need_a_limit_or_a_capability(
    priority: int, limit: int, capabilities: int, good: bool
) -> None:
    result = real_time(priority, limit, capabilities, granted=True)
    assert result.good is good
    assert good or "sudo tee /etc/security/limits.d/rcopterx.conf" in result.text


def test_links_whose_commands_may_wait_are_a_finding() -> None:
    assert links("bbr").good
    assert not links("cubic").good
    assert "sudo modprobe tcp_bbr" in links("cubic").text


def test_a_fleet_that_only_this_computer_reaches_needs_no_certificates() -> None:
    assert [result.good for result in certificates(parse_fleet(PAIR), "main", NOW)] == [True]


def test_a_fleet_that_any_program_may_steer_is_a_finding() -> None:
    fleet = parse_fleet(f"{PAIR}[security]\ninsecure = true")
    assert [result.good for result in certificates(fleet, "main", NOW)] == [False]


def test_every_certificate_that_is_here_is_looked_at(tmp_path: Path) -> None:
    fleet = parse_fleet(f'{PAIR}[security]\ncertificates = "{tmp_path}"')
    (missing,) = certificates(fleet, "main", NOW)
    assert not missing.good
    assert "No such file" in missing.text
    make_certificates(fleet, NOW, 20)
    names = ["host.main", "agent.h1", "agent.h2", "program.h1", "program.h2", "operator.lab", "watcher.lab"]
    found = list(certificates(fleet, "main", NOW))
    assert [(result.good, result.text) for result in found] == [
        (True, f"certificate {name} is valid") for name in names
    ]
    later = list(certificates(fleet, "main", NOW + timedelta(days=10)))
    assert all("expires in 10 days" in result.text and not result.good for result in later)
    (tmp_path / "agent.h2.key").unlink()
    assert len(list(certificates(fleet, "main", NOW))) == len(names) - 1


def test_limits_that_permit_what_the_kernel_refuses_are_a_finding() -> None:
    result = real_time(20, 99, 0, granted=False)
    assert not result.good
    assert "control group" in result.text


def test_missing_devices_are_findings(tmp_path: Path) -> None:
    fleet = parse_fleet(HARDWARE_PAIR)
    (result,) = devices(fleet, "main", tmp_path)
    assert not result.good
    assert "vehicles.h1.transmitter.port: there is no device" in result.text
    assert "vehicles.h2.transmitter.port: there is no device" in result.text
    (tmp_path / "radio-h1").touch()
    (result,) = devices(fleet, "main", tmp_path)
    assert not result.good
    (tmp_path / "radio-h2").touch()
    (result,) = devices(fleet, "main", tmp_path)
    assert result.good
