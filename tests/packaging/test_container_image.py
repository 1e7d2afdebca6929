"""Promises of the Dockerfile: an image can be built from it without a daemon, and flies the demonstration."""

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from packaging_support import ROOT

BASE = "docker.io/library/python:3.11-slim"
MACHINE_CERTIFICATES = Path("/etc/ssl/certs/ca-certificates.crt")
pytestmark = [
    pytest.mark.campaign,
    pytest.mark.timeout(1800),
    pytest.mark.skipif(
        shutil.which("buildah") is None, reason="no buildah on this computer: apt-get install buildah"
    ),
]


class Buildah:
    """Buildah with a store of its own, and without the privileges that containers usually need."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        store = ("--root", str(directory / "images"), "--runroot", str(directory / "running"))
        self._command = ("buildah", *store, "--storage-driver", "vfs")

    def __call__(self, *words: str | Path) -> str:
        """What it prints; whatever it cannot do fails the test."""
        done = self.attempt(*words)
        assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]
        return done.stdout.strip()

    def attempt(self, *words: str | Path) -> subprocess.CompletedProcess[str]:
        command = [*self._command, *map(str, words)]
        return subprocess.run(command, capture_output=True, text=True, timeout=1500)


@pytest.fixture(scope="module")
def buildah() -> Iterator[Buildah]:
    """A store that can build; it has the image that the Dockerfile begins with."""
    with TemporaryDirectory(prefix="rcopterx-images-") as name:
        buildah = Buildah(Path(name))
        if buildah.attempt("pull", BASE).returncode != 0:
            make_base(buildah)
        yield buildah
        buildah("rm", "--all")


def make_base(buildah: Buildah) -> None:
    """Where the image cannot be had from its registry, stand in for it: Debian with its own Python 3.11."""
    if shutil.which("debootstrap") is None:
        pytest.skip(f"{BASE} cannot be pulled, and there is no debootstrap: apt-get install debootstrap")
    system, archive = buildah.directory / "system", buildah.directory / "system.tar"
    packages = "--include=python3,python3-pip,python3-venv,ca-certificates"
    made = subprocess.run(
        ["debootstrap", "--variant=minbase", packages, "bookworm", system], capture_output=True, text=True
    )
    if made.returncode != 0:
        pytest.skip(f"{BASE} cannot be pulled, and debootstrap fails: {made.stdout[-300:]}")
    # The image has `python`, and a pip that installs beside the system's packages.
    (system / "usr/bin/python").symlink_to("python3")
    (system / "usr/lib/python3.11/EXTERNALLY-MANAGED").unlink()
    if MACHINE_CERTIFICATES.exists():
        shutil.copy(MACHINE_CERTIFICATES, system / "etc/ssl/certs")
    subprocess.run(["tar", "--directory", system, "--create", "--file", archive, "."], check=True)
    container = buildah("from", "scratch")
    buildah("add", container, archive, "/")
    certificates = f"PIP_CERT={MACHINE_CERTIFICATES}"
    path = "PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"
    buildah("config", "--env", certificates, "--env", path, container)
    buildah("commit", "--quiet", container, BASE)
    shutil.rmtree(system)
    archive.unlink()


@pytest.fixture(scope="module")
def container(buildah: Buildah) -> str:
    """A container of the image that the Dockerfile makes."""
    file = ROOT / "packaging" / "Dockerfile"
    files = ("--file", file, "--ignorefile", f"{file}.dockerignore")
    buildah("bud", "--isolation", "chroot", "--pull-never", "--tag", "rcopterx", *files, ROOT)
    return buildah("from", "--pull-never", "rcopterx")


def test_the_image_flies_its_demonstration_without_being_root(buildah: Buildah, container: str) -> None:
    run = ("run", "--isolation", "chroot", container, "--")
    assert buildah(*run, "id", "--user", "--name") == "lab"
    assert "dialout" in buildah(*run, "id", "--groups", "--name").split()
    assert buildah(*run, "pwd") == "/home/lab"
    flown = buildah(*run, "rcopterx", "demo", "--no-browser", "--seconds", "15")
    assert "flown for 15 s" in flown


def test_the_image_starts_the_demonstration(buildah: Buildah, container: str) -> None:
    settings = buildah("inspect", "--format", "{{.OCIv1.Config.Entrypoint}} {{.OCIv1.Config.Cmd}}", container)
    assert settings == "[rcopterx] [demo --no-browser]"
