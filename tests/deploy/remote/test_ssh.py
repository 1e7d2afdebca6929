"""Promises of steps over ssh: a target is a target, whatever it is named."""

import os
import shutil
from pathlib import Path

import pytest

from rcopterx.deploy.remote.installation import RemoteError, on


def test_a_target_that_begins_with_a_dash_is_no_option_of_ssh(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "ssh"
    program.write_text('#!/bin/sh\nprintf "%s\\n" "$@"\n')
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    arguments = on("-oProxyCommand=touch hacked")("true", b"").stdout.decode().splitlines()
    assert arguments[-3:] == ["--", "-oProxyCommand=touch hacked", "true"]


@pytest.mark.skipif(shutil.which("ssh") is None, reason="apt-get install openssh-client")
def test_ssh_itself_runs_no_command_of_a_target(tmp_path: Path) -> None:
    with pytest.raises(RemoteError):
        on(f"-oProxyCommand=touch {tmp_path}/hacked")("true", b"")
    assert list(tmp_path.iterdir()) == []
