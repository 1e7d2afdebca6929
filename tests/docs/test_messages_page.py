"""Promises of the message reference: complete, up to date, and its example is a valid message."""

import re
from functools import cache
from pathlib import Path

import msgspec
import pytest
from support.messages import MESSAGE_TYPES

from messages_page import EXAMPLE, reference
from rcopterx import bus
from rcopterx.bus.channels import CHANNELS
from rcopterx.bus.codec import decode
from rcopterx.bus.message import Message
from rcopterx.bus.messages import Command
from rcopterx.bus.requests import VERBS

PAGE = Path(bus.__file__).resolve().parents[1] / "docs" / "messages.md"


@cache
def printed() -> str:
    """The whole reference; every test reads it and none changes it."""
    return reference()


def section(text: str, title: str) -> str:
    return text.split(f"\n### {title}\n", 1)[1].split("\n##", 1)[0]


def test_the_page_is_what_the_tables_say_now() -> None:
    assert PAGE.read_text(encoding="utf-8") == printed(), (
        "run: python docs/generators/messages_page.py > docs/messages.md"
    )


@pytest.mark.parametrize("message_type", MESSAGE_TYPES, ids=lambda kind: kind.__name__)
def test_every_field_of_every_message_is_listed(message_type: type[Message]) -> None:
    listed = section(printed(), message_type.__name__)
    shared = {"schema_version", "source"} if message_type.__name__ != "Kill" else {"schema_version"}
    for field in msgspec.structs.fields(message_type):
        if field.name not in shared:
            assert f"| `{field.name}` |" in listed


def test_every_channel_and_verb_is_listed() -> None:
    text = printed()
    for channel in CHANNELS:
        assert f"| {channel.unit} / {channel.topic} |" in text
    for verb in VERBS:
        assert f"| {verb} |" in text


def test_units_types_and_meanings_come_from_the_fields() -> None:
    text = printed()
    assert "| `period_s` | float, 0.0005 to 1 | s |" in section(text, "Pose")
    assert "| `velocity_m_s` | 3 times float or nil | m/s | `nil` |" in section(text, "AgentStatus")
    assert "| `solve_ms_p99` | float, from 0 | ms |" in section(text, "Diagnostics")
    assert "Strictly increasing within a lease" in section(text, "Command")


def test_every_link_of_the_page_leads_to_a_heading() -> None:
    text = printed()
    headings = {line.removeprefix("### ").lower() for line in text.splitlines() if line.startswith("### ")}
    assert set(re.findall(r"\]\(#(\w+)\)", text)) <= headings


def test_the_printed_example_is_a_valid_command() -> None:
    block = printed().split("bytes of MessagePack:\n\n```\n")[1].split("```")[0]
    command = decode(bytes.fromhex(block), Command)
    assert command.lease == EXAMPLE["lease"]
    assert command.input == tuple(EXAMPLE["input"])
    assert command.next_inputs.to_numpy().tolist() == [[0.0, 0.0, 0.55, 0.0]]
