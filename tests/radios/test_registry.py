import sys

import pytest

from rcopterx.radios.multi import MultiSettings
from rcopterx.radios.protocol import ProtocolError, SerialLine
from rcopterx.radios.registry import (
    PROTOCOL_NAMES,
    create_protocol,
    default_line,
    settings_class,
)


@pytest.mark.parametrize("name", PROTOCOL_NAMES)
def test_every_radio_is_created_with_its_own_line(name: str) -> None:
    protocol = create_protocol(name)
    assert protocol.name == name
    assert protocol.line == default_line(name)
    assert protocol.keepalive_s <= 0.04


def test_settings_and_line_reach_the_protocol() -> None:
    line = SerialLine(100_000, "N", 2)
    protocol = create_protocol("multi", MultiSettings(rx_num=3, channels=7), line)
    assert protocol.line is line
    assert protocol.encode([1100])[2:4] == bytes((3, 7))


def test_a_protocol_without_its_library_names_the_extra_and_its_settings_need_none(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for module in [name for name in sys.modules if "mavlink" in name]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "pymavlink", None)
    assert settings_class("mavlink")(system=3).system == 3
    with pytest.raises(ProtocolError, match=r"pip install 'rcopterx\[mavlink\]'"):
        create_protocol("mavlink")


def test_an_unknown_radio_is_refused_with_those_that_are_known() -> None:
    with pytest.raises(ProtocolError, match="protocol: 'sbus' is unknown, choose one of multi"):
        create_protocol("sbus")
